"""Columns that assign rows to tests: direction, part and run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bushfit.caveat import Caveat
from bushfit.reading.headers import ERRORS, SWEEP_COLUMNS, WORDS, Vocabulary, plain
from bushfit.reading.measurement import Floats
from bushfit.reading.names import named_direction
from bushfit.reading.runs import group_rows
from bushfit.reading.source import RowSource, Text

if TYPE_CHECKING:
    import pandas as pd

    from bushfit.reading.table import Table

#: Smallest mean number of rows per distinct text in a column that assigns rows to tests; chosen: a row counter has one.
_FEWEST_ROWS = 3
#: Names of runs of loops; in a sweep they may be anything.
_RUNS_OF_LOOPS = frozenset(map(plain, ("block", *WORDS["rows"]["run"])))
#: Names of columns that mark rows as valid or not.
_FLAGS = frozenset(map(plain, WORDS["rows"]["flag"]))
#: Known names of columns that assign rows to tests: of directions, specimen numbers, part numbers and runs.
_PARTS = {key: WORDS["above"][key] for key in ("specimen_number", "part_number")}
_RUNS = [*SWEEP_COLUMNS["repeat"], "block", *WORDS["rows"]["run"]]
_LABELS = Vocabulary({"direction": WORDS["rows"]["direction"], **_PARTS, "run": _RUNS})


class Rows(NamedTuple):
    """Criteria that select the rows of one test in a file that may contain several tests.

    Args:
        direction: text that rows must have in the column of directions, if the file has one; None for any.
        specimen_number: text that rows must have in the column of specimen numbers, if the file has one; None for any.
        texts: texts that rows must have in other columns, by header.
        shared: True if the campaign lists the file more than once, so that a column has to select the rows.
    """

    direction: str | None = None
    specimen_number: str | None = None
    texts: Mapping[str, str] = {}
    shared: bool = False


class ColumnTexts(NamedTuple):
    """Texts of a column, compressed: its distinct texts, and the index among them of the text of each row, (n,)."""

    distinct: Sequence[str]
    codes: NDArray[np.intp]

    def per_row(self) -> list[str]:
        """Return the text of the column in each row, (n,)."""
        return [self.distinct[code] for code in self.codes.tolist()]


def same_text(text: str, reference: str) -> bool:
    """Return True if two texts are equal except for case and a leading or final number sign, as in 17 and #17."""
    return text.strip(" #").casefold() == reference.strip(" #").casefold()


def column_texts(table: Table, *indices: int) -> Iterator[ColumnTexts]:
    """Find the texts of columns; an empty or merged cell has the text of the cell above, if there is one.

    Yields:
        Texts of the column with each index.
    """
    import pandas as pd

    chunks = [_cells_of_chunk(table, chunk, indices) for chunk in table.chunks()] if indices else []
    for index in indices:
        cells = pd.concat([frame[index] for frame in chunks], ignore_index=True)
        texts = cells.map(lambda cell: _text(cell).strip(" #")).astype(object)
        is_of_remarks = texts[:1].eq("").any()  # a column of merged cells does not begin empty
        codes, distinct = pd.factorize(texts if is_of_remarks else texts.mask(texts == "").ffill())
        yield ColumnTexts(list(distinct), codes)


def _cells_of_chunk(table: Table, chunk: RowSource, indices: Sequence[int]) -> pd.DataFrame:
    """Read columns of a chunk of rows as texts or numbers; the columns of the result are named by their indices."""
    import pandas as pd

    if isinstance(chunk, Text) and table.layout.delimiter != " " and not table.marks and b'"' not in chunk.data:
        is_clean, types = table.parse(chunk, table.needed) is not None, dict.fromkeys(indices, "category")
        frame = chunk.frame(table.layout, types, len(table.headers), ".") if is_clean else None
        if isinstance(frame, pd.DataFrame):
            return frame
    rows = [row for _, row in table.rows(chunk)]
    return pd.DataFrame({index: pd.Series([row[index] for row in rows], dtype=object) for index in indices})


def _text(cell: str | float) -> str:
    """Text of a cell; a number has up to twelve digits."""
    return cell if isinstance(cell, str) else f"{cell:.12g}"


def _may_distinguish_tests(table: Table, index: int) -> bool:
    """Return True if a column contains no measured quantity and few distinct texts, which may distinguish tests."""
    if not table.headers[index] or index in {column.index for column in table.roles.values()}:
        return False
    first = [_text(row[index]) for row in table.first_rows]
    return any(first) and _FEWEST_ROWS * len({text for text in first if text}) <= len(first)


def find_labels(table: Table) -> Mapping[str, tuple[int, Sequence[str]]]:
    """Find the columns that state the direction, the part (specimen_number) and the run of each row.

    Returns:
        Index and texts, (n,), of each column by the keys "direction", "specimen_number" and "run"; a key without a
        column is missing.
    """
    labels: dict[str, tuple[int, Sequence[str]]] = {}
    for index, header in enumerate(table.headers):
        heading = _LABELS.heading(header) if header else None
        role = heading.role if heading else ""
        is_of_loop = role == "run" and plain(header) in _RUNS_OF_LOOPS
        if role in ("", *labels) or (is_of_loop and "displacement" not in table.roles):
            continue
        if _may_distinguish_tests(table, index):
            (texts,) = column_texts(table, index)
            if role == "direction":
                directions = [named_direction([text], short=True) for text in texts.distinct]
                if not any(directions):
                    continue
                named = [str(direction or text) for direction, text in zip(directions, texts.distinct, strict=True)]
                texts = ColumnTexts(named, texts.codes)
            labels[role] = (index, texts.per_row())
    if "part_number" in labels:
        labels.setdefault("specimen_number", labels.pop("part_number"))
    return labels


def select_rows(table: Table, labels: Mapping[str, tuple[int, Sequence[str]]], wanted: Rows) -> frozenset[int] | None:
    """Select the rows of one test in a file that may contain several tests.

    Args:
        table: table with all rows.
        labels: index and texts, (n,), of the columns "direction", "specimen_number" and "run" that the file has.
        wanted: texts that the rows must have in these and other columns.

    Returns:
        Positions of the rows among all non-empty rows below the header, from 0; None if all rows are selected.

    Raises:
        MeasurementError: there is no such row or column, the rows belong to several parts, or no column distinguishes
            the tests of a shared file.
    """
    wanted_texts = {"direction": wanted.direction, "specimen_number": wanted.specimen_number}
    chosen = [(*labels[key], text) for key, text in wanted_texts.items() if text and key in labels]
    for header, text in wanted.texts.items():
        if header not in table.headers:
            raise table.header_error(f'there is no column "{header}"', expected="headers, as keys of rows")
        index = table.headers.index(header)
        chosen.append((index, next(column_texts(table, index)).per_row(), text))
    if wanted.shared and not chosen:
        raise table.header_error(**ERRORS["listed_twice"])
    column, parts = labels.get("specimen_number", (0, ()))
    total = len(parts or (chosen[0][1] if chosen else ()))
    selected = [n for n in range(total) if all(same_text(texts[n], text) for _, texts, text in chosen)]
    several = len({parts[n] for n in selected}) > 1 if parts else False
    if several or (chosen and not selected):
        conflicts = [(column, parts, "one part")] if several else chosen
        raise table.header_error(
            "this file contains tests of several parts" if several else "no row belongs to this test",
            found="; ".join(
                f'{", ".join(dict.fromkeys(texts))} in column "{table.headers[index]}"' for index, texts, _ in conflicts
            ),
            expected=" and ".join(text for *_, text in conflicts),
            hint='state one part: specimen_number = "..."; bushfit init lists all tests of a file',
        )
    if not chosen or len(selected) == total:
        return None
    positions = [n for n, (*_, fault) in enumerate(table.all_rows()) if fault is None]
    return frozenset(positions[n] for n in selected)


def note_not_understood(
    table: Table, labels: Mapping[str, tuple[int, Sequence[str]]], rows: NDArray[np.intp] | None, *settled: Floats
) -> Iterator[Caveat]:
    """Warnings on columns that may distinguish several tests in one file but whose meaning is not known.

    Args:
        table: table with all rows.
        labels: index and texts, (n,), of the columns "direction", "specimen_number" and "run" that the file has.
        rows: indices of the rows that were read, (n,); None for all.
        settled: frequency and nominal amplitude of these rows, (n,) each; none for a loop. Numbers that are constant at
            each operating point, and texts that are constant at each frequency or amplitude, need no warning.

    Yields:
        One warning for each such column.
    """
    understood = {index for key, (index, texts) in labels.items() if key != "direction" or len({*texts}) == 1}
    unclear = [
        index
        for index, header in enumerate(table.headers)
        if index not in understood
        and header != "block"
        and (settled or plain(header) in _FLAGS or not table.holds_numbers(index))
        and _may_distinguish_tests(table, index)
    ]
    for index, texts in zip(unclear, column_texts(table, *unclear), strict=True):
        header, is_number = table.headers[index], table.holds_numbers(index)
        codes = texts.codes if rows is None else texts.codes[rows]
        present, number, counts = np.unique(codes, return_inverse=True, return_counts=True)
        depends_on = [settled] if is_number else [(quantity,) for quantity in settled]
        explained = any(all(np.ptp(number[group]) == 0 for group in group_rows(*keys)) for keys in depends_on)
        is_plain = explained or (is_number and counts.min() < _FEWEST_ROWS)
        if counts.size > 1 and (plain(header) in _FLAGS or not is_plain):
            values = sorted(texts.distinct[code] for code in present)
            listed = ", ".join(value or "empty" for value in values[:4]) + ", ..." * (len(values) > 4)
            yield Caveat(
                "column_not_understood",
                f'"{header}" (column {index + 1}) varies from row to row ({listed}) and is not understood: all rows '
                "are one test, with equal points as repeats. To select rows, write "
                f'rows = {{ "{header}" = "{"..." if plain(header) in _FLAGS else values[0]}" }} in the campaign',
            )
