"""The table of a batch: a row a bushing, in the manifest's order, a unit that people use in every header."""

from collections.abc import Sequence
from itertools import product

from bushfit.batch.document import Record
from bushfit.batch.ledger import ROWS
from bushfit.batch.limits import Judgement
from bushfit.batch.manifest import Row
from bushfit.batch.quantities import OF_FIT, Quantity, figures
from bushfit.report.tables import BETWEEN

#: Columns of every batch, before its numbers.
_FIRST = ("name", "campaign", "folder", "status", "error")
#: Columns where rows are diagnosed.
_FOUND = ("verdict", "named effects", "cannot be told from")
#: Columns where there are limits.
_JUDGED = ("limits", "out of limits", "on the edge")
#: End of the header of each of a quantity's figures, and their place among these.
_PARTS = {"": 0, ", low": 1, ", high": 2, ", std error": 3}
#: Columns of every batch, after its numbers.
_LAST = ("on a bound", "warnings")


class Table:
    """The headers and the rows.

    A parameter has the unit for its usual size, whatever it is in this batch: the headers of two batches agree.
    """

    def __init__(
        self, parameters: Sequence[Quantity], points: Sequence[Quantity], *, verdicts: bool, limits: bool
    ) -> None:
        self._verdicts, self._limits = verdicts, limits
        header = [*_FIRST, *(_JUDGED if limits else ()), *(_FOUND if verdicts else ())]
        self._numbers = [
            *product((quantity.tabled for quantity in parameters), ("", ", std error", ", low", ", high")),
            *product(OF_FIT.values(), ("",)),
            *product(points, ("", ", low", ", high")),
        ]
        header += [quantity.header + part for quantity, part in self._numbers]
        self.headers = [*header, *_LAST]

    def row(self, row: Row, record: Record, judged: Judgement | None) -> list[str | float | None]:
        """One line."""
        found = dict(figures(record))
        folder = f"{ROWS}/{row.folder}" if record["status"] == "done" else ""
        error = " ".join(record.get("error", "").split())
        cells: list[str | float | None] = [row.name, row.listed, folder, record["status"], error]
        if self._limits:
            words = ["; ".join(said.values()) for said in (judged.missed, judged.edge)] if judged else ["", ""]
            cells += [str(judged.verdict) if judged else "", *words]
        if self._verdicts:
            names = record.get("effects", []), record.get("alternatives", [])
            cells += [record.get("verdict", ""), *map(", ".join, names)]
        for quantity, part in self._numbers:
            value = found.get(quantity.name, (None,) * 4)[_PARTS[part]]
            cells.append(None if value is None else value * quantity.factor)
        bounds = ", ".join(f"{name} ({end})" for name, end in record.get("at_bound", {}).items())
        return [*cells, bounds, BETWEEN.join(record.get("warnings", ()))]
