"""batch.csv: a row a bushing, in the manifest's order, a unit in every header."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TextIO

from bushfit.batch.ledger import ROWS, Record
from bushfit.batch.limits import Judgement
from bushfit.batch.manifest import Row
from bushfit.batch.quantities import CHI_SQUARE, NRMSE, Quantity, figures
from bushfit.reading.csvfile import Rows

#: Columns of every batch, before its numbers.
_FIRST = ("name", "campaign", "folder", "status", "error")
#: Columns where rows are diagnosed.
_FOUND = ("verdict", "named effects", "cannot be told from")
#: Columns where there are limits.
_JUDGED = ("limits", "out of limits", "on the edge")
#: Columns of every batch, after its numbers.
_LAST = ("on a bound", "warnings")


class Table:
    """Writes rows as they come."""

    def __init__(
        self,
        stream: TextIO,
        parameters: Sequence[Quantity],
        points: Sequence[Quantity],
        *,
        verdicts: bool,
        limits: bool,
    ) -> None:
        self._parameters, self._points = parameters, points
        self._verdicts, self._limits = verdicts, limits
        header = [*_FIRST, *(_JUDGED if limits else ()), *(_FOUND if verdicts else ())]
        for quantity in parameters:
            header += [quantity.header, *(f"{quantity.header}, {part}" for part in ("std error", "low", "high"))]
        header += [NRMSE.header, CHI_SQUARE.header]
        for quantity in points:
            header += [quantity.header, f"{quantity.header}, low", f"{quantity.header}, high"]
        self._rows = Rows(stream, [*header, *_LAST])

    def add(self, row: Row, record: Record, judged: Judgement | None) -> None:
        """One line."""
        found = dict(figures(record))
        folder = f"{ROWS}/{row.folder}" if record["status"] == "done" else ""
        cells: list[str | float | None] = [row.name, row.listed, folder, record["status"]]
        cells.append(" ".join(record.get("error", "").split()))
        if self._limits:
            cells += (
                [str(judged.verdict), *("; ".join(words.values()) for words in (judged.missed, judged.edge))]
                if judged
                else [""] * 3
            )
        if self._verdicts:
            cells += [record.get("verdict", ""), *(", ".join(record.get(k, ())) for k in ("effects", "alternatives"))]
        for quantity in self._parameters:
            value, low, high, stderr = found.get(quantity.name, (None,) * 4)
            cells += [_number(x, quantity) for x in (value, stderr, low, high)]
        cells += [_number(found.get(quantity.name, (None,))[0], quantity) for quantity in (NRMSE, CHI_SQUARE)]
        for quantity in self._points:
            cells += [_number(x, quantity) for x in found.get(quantity.name, (None,) * 4)[:3]]
        cells.append(", ".join(f"{name} ({end})" for name, end in record.get("at_bound", {}).items()))
        cells.append("; ".join(record.get("warnings", ())))
        self._rows.add(cells)


def _number(value: float | None, quantity: Quantity) -> float | None:
    return None if value is None else value * quantity.factor
