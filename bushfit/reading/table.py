"""Table of a test: rows as in the file, roles of the columns, numbers in SI, and errors that state a location."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bushfit import units
from bushfit.caveat import Caveat
from bushfit.errors import MeasurementError, error_location
from bushfit.geometry import TRANSLATION, Motion
from bushfit.reading.block_labels import find_lines_above, find_remarks
from bushfit.reading.headers import Column, Vocabulary
from bushfit.reading.instruments import word_for_part
from bushfit.reading.labelled import find_labels
from bushfit.reading.layout import Layout
from bushfit.reading.lines import is_comment, is_row, is_summary_row
from bushfit.reading.measurement import Floats
from bushfit.reading.names import Labels, labels_and_text_above
from bushfit.reading.numerals import Numerals, find_first_decimal, find_numerals, is_like_number
from bushfit.reading.parts import OpenedFile
from bushfit.reading.rejected import (
    FaultyRow,
    bad_row,
    begins_other_table,
    find_other_tables,
    lost_formulas,
    mark_missing,
    note_left_out,
    refuse_other_columns,
    row_fault,
)
from bushfit.reading.roles import names_for_motion
from bushfit.reading.source import LARGEST_VALUE, Channels, RowSource, Text, cells_of
from bushfit.reading.times import parse_clock

#: Number of first rows that are examined; chosen: a long record need not be read completely.
_FIRST = 1000
#: Largest number of rows of texts between the units and the first numbers.
_MOST_TEXT_ROWS = 8
#: Number of first rows that show whether a file is a table of numbers.
_FEW_ROWS = 4
#: Rows that are converted at a time if pandas cannot read them; chosen: their texts take a few MiB.
_CHUNK_ROWS = 1 << 16

#: Line number and cells of a row of a table.
Row = tuple[int, Sequence[str | float]]


@dataclass(frozen=True, eq=False)
class Table:
    """Table of a test in its file, whose columns have roles, such as "force".

    Args:
        opened: test file, with its format as the user states it.
        source: part of the file that contains the table.
        layout: location of the table, with its headers, units row and delimiter.
        names: usual column names by role, before adaptation to the motion.
        motion: kind of motion: translation, rotation or strain.
        roles: recognised columns, by role such as "force".
        notes: warnings on columns that were recognised only by their unit.
        selected: positions of the rows of the test in `all_rows`, from 0; None for all rows.
        needed: indices of columns that must contain a number; a row without one is not a row of data.
        clocks: indices of columns that contain times as texts, such as 20:07:10.
        marks: cells that mark a missing value, such as -9999, by index of their column; all copies of a table share it.
    """

    opened: OpenedFile
    source: RowSource
    layout: Layout
    names: Mapping[str, Sequence[str]] = field(default_factory=dict)
    motion: Motion = TRANSLATION
    roles: Mapping[str, Column] = field(default_factory=dict, kw_only=True)
    notes: tuple[Caveat, ...] = field(default=(), kw_only=True)
    selected: frozenset[int] | None = field(default=None, kw_only=True)
    needed: frozenset[int] = field(default=frozenset(), kw_only=True)
    clocks: frozenset[int] = field(default=frozenset(), kw_only=True)
    marks: dict[int, set[str | float]] = field(default_factory=dict, kw_only=True)

    #: Notation of the numbers in the columns whose quantity is known.
    numerals = cached_property(find_numerals)
    #: Decimal mark of the first thousand numbers; None if they leave it open.
    first_decimal = cached_property(find_first_decimal)
    #: Columns that state direction, specimen_number and run of each row: index and texts, (n,), by these keys.
    row_labels = cached_property(find_labels)
    #: Non-empty lines above the table, and notes below it.
    lines_above = cached_property(find_lines_above)
    #: Warnings on lines above the table, marked rows and hidden rows that may change what the test means.
    remarks = cached_property(find_remarks)
    #: Headers of other tests below the table: line number and names of the columns.
    other_tables = cached_property(find_other_tables)

    @cached_property
    def labels_above(self) -> Labels:
        """Labels in the lines above the table, such as a temperature."""
        return labels_and_text_above(self.lines_above)

    @property
    def file(self) -> Path:
        """Path of the test file."""
        return self.opened.file

    @property
    def headers(self) -> tuple[str, ...]:
        """Texts of the header cells of the table."""
        return self.layout.headers

    def chunks(self) -> Iterator[RowSource]:
        """Yield the rows of the table in chunks of a few MiB, to limit memory; a single chunk for selected rows."""
        if isinstance(self.source, Text) and self.selected is None:
            return self.source.chunks(self.layout.lines_before_data)
        return iter([self.source])

    def rows(self, chunk: RowSource | None = None, left_out: list[FaultyRow] | None = None) -> Iterator[Row]:
        """Yield the line number and the cells of each row of data; other rows, such as remarks and means, are left out.

        Args:
            chunk: successive rows of the source to read; default all rows of the source.
            left_out: list to which the other rows are added.

        Raises:
            MeasurementError: a line or a quoted cell is far too long.
        """
        for position, (line, cells, fault) in enumerate(self.all_rows(chunk)):
            if fault is not None and left_out is not None:
                left_out.append((line, cells, fault))
            if fault is None and (self.selected is None or position in self.selected):
                yield line, cells

    @cached_property
    def first_row(self) -> Sequence[str | float]:
        """Cells of the first row of data in the table, with numbers if there is one; empty cells without rows."""
        rows = (cells for _, cells in islice(self.rows(), _MOST_TEXT_ROWS) if is_row(list(map(str, cells))))
        return next(rows, None) or next((cells for _, cells in self.rows()), [""] * len(self.headers))

    @cached_property
    def first_rows(self) -> list[Sequence[str | float]]:
        """Cells of each of the first thousand rows of data; one row of empty cells if there are none."""
        return [cells for _, cells in islice(self.rows(), _FIRST)] or [[""] * len(self.headers)]

    def all_rows(self, chunk: RowSource | None = None) -> Iterator[tuple[int, Sequence[str | float], str | None]]:
        """Yield line number, cells and fault of each non-empty row below the header, whether it is data or not.

        Args:
            chunk: successive rows of the source to read; default all rows of the source.

        Yields:
            Line number, cells, and the reason why the row is not data (see `row_fault`); None for a row of data.
        """
        level, is_other_table = dict[int, str | float](), False
        vocabulary = Vocabulary(names_for_motion(self.names, self.motion))
        with error_location(self.file):
            for line in (chunk or self.source).lines(self.layout.lines_before_data):
                if self.layout.numbered or not is_comment(line.content, self.layout.delimiter):
                    cells = cells_of(line, self.layout.delimiter)
                    if any(cell != "" for cell in cells):
                        cells = [*cells, *[""] * (len(self.headers) - len(cells))]
                        if levels := self.layout.levels:
                            level |= {index: cells[index] for index in levels if is_like_number(str(cells[index]))}
                            if all(index in levels for index, cell in enumerate(cells) if cell != ""):
                                continue
                            cells = [level.get(n, "") if cell == "" else cell for n, cell in enumerate(cells)]
                        if any(str(cell)[-1:] in ("]", ")") for cell in cells):
                            texts = list(map(str, cells))
                            is_same = self.layout.is_header(texts, vocabulary) or self.layout.is_repeated(texts)
                            is_other_table = not is_same and (is_other_table or begins_other_table(texts))
                        yield line.number, cells, "other" if is_other_table else row_fault(self, cells)

    def parse(self, chunk: RowSource, indices: frozenset[int]) -> Mapping[int, Floats] | None:
        """Read columns of a chunk of rows at once, in units of the file.

        Args:
            chunk: successive rows of the source to read.
            indices: indices of the columns.

        Returns:
            Numbers by column index, (n,) each; None if the chunk has to be read row by row, because it has rows without
            data or numbers in another notation.

        Notes:
            All columns that begin with a number are parsed as numbers, so that a summary row such as "Mean" fails as
            intended. Texts in front of these columns are searched for such words.
        """
        if self.selected is not None or not indices.isdisjoint((*self.clocks, *self.marks)):
            return None
        if isinstance(chunk, Channels) and chunk.numeric >= indices:
            return {index: chunk.arrays[index] for index in indices}
        first = list(map(str, self.first_row))
        if not isinstance(chunk, Text) or not indices or len(first) != len(self.headers):
            return None
        if self.first_decimal is None:
            return None
        notation = Numerals(self.first_decimal)
        numeric = [index for index, cell in enumerate(first) if notation.allows(cell)]
        if not indices <= {*numeric}:
            return None  # pandas takes TRUE for 1
        frame = chunk.frame(self.layout, dict.fromkeys(numeric, float), len(first), notation.decimal)
        words = chunk.first_words(self.layout.delimiter) if numeric[0] else ()
        if frame is None or any(is_summary_row([word]) for word in words):
            return None
        return {index: frame[index].to_numpy() for index in indices}

    def holds_numbers(self, index: int) -> bool:
        """Return True if the column with this index has a number in the first row of data."""
        cell = self.first_row[index]
        return not isinstance(cell, str) or is_like_number(cell)

    def error(
        self,
        problem: str,
        *,
        line: int | None = None,
        column: Column | None = None,
        kind: type[MeasurementError] = MeasurementError,
        **details: Any,
    ) -> MeasurementError:
        """Return an error that names the file and the location in it.

        Args:
            problem: description of the problem in one clause.
            line: line number; None if the problem is not on one line.
            column: column of the cell; None if the problem is not in one column.
            kind: class of the error.
            details: texts for `found`, `expected` and `hint` of the error.
        """
        return kind(problem, file=self.file, place=self.place(line, column), **details)

    def header_error(self, problem: str, found: str | None = None, **details: Any) -> MeasurementError:
        """Return an error that names the header line.

        Args:
            problem: description of the problem in one clause.
            found: text found; None for the header cells, or their number if the file is not a table of numbers.
            **details: texts for `expected` and `hint` of the error.
        """
        if found is None and self.is_table:
            found = ", ".join(self.headers)
        found = found or f"{len(self.headers)} cell{'s' * (len(self.headers) != 1)}, without the name of a column"
        return self.error(problem, line=self.layout.header_line, found=found, **details)

    @property
    def is_table(self) -> bool:
        """True if the file is a table of numbers; errors do not quote the text of any other file."""
        return len(self.roles) > 1 or any(is_row(list(map(str, cells))) for _, cells in islice(self.rows(), _FEW_ROWS))

    def place(self, line: int | None, column: Column | None) -> str | None:
        """Return the location in the file for an error, such as "line 3, column "Time [s]""; None if nothing is known.

        Args:
            line: line number; None if the problem is not on one line.
            column: column of the cell; None if the problem is not in one column.
        """
        source = self.source
        parts = [
            f'{word_for_part(self.file)} "{source.sheet}"' if source.sheet else None,
            f"{'row' if source.sheet or isinstance(source, Channels) else 'line'} {line}" if line else None,
            f'column "{column.header}"' if column else None,
        ]
        return ", ".join(part for part in parts if part) or None

    def agrees(self, role: str, expected: str) -> bool:
        """True if a column has a role such as "force", and a unit with the dimension of the unit `expected`."""
        column = self.roles.get(role)
        return column is not None and units.is_compatible(column.unit or "1", expected)

    def read(self, wanted: Mapping[str, Column], *, fewest_rows: int) -> tuple[dict[str, Floats], tuple[Caveat, ...]]:
        """Read columns, and list the rows that are left out.

        Args:
            wanted: columns by role such as "force", with their factors to SI.
            fewest_rows: smallest number of rows that is accepted.

        Returns:
            Values in SI by role, (n,) each, and warnings on rows left out and on columns recognised by their unit.

        Raises:
            MeasurementError: ambiguous numbers, too few rows, or so many rows without data that the meaning of the
                table is in doubt.
        """
        table, left_out, requested = self.needing(wanted), list[FaultyRow](), wanted
        terms = {
            f"{role}|{index}": replace(column, index=index, scale=sign * column.scale)
            for role, column in wanted.items()
            for index, sign in column.terms
        }
        wanted = {**wanted, **terms}
        parts = [part for chunk in table.chunks() for part in table._read_chunk(chunk, wanted, left_out)]
        if left_out:
            refuse_other_columns(table, left_out, Vocabulary(names_for_motion(self.names, self.motion)))
        values = {role: np.concatenate([np.empty(0), *(part.pop(role) for part in parts)]) for role in wanted}
        if mark_missing(table, wanted, values):
            return self.read(requested, fewest_rows=fewest_rows)
        count = len(next(iter(values.values())))
        notes = (*self.notes, *self.remarks, *note_left_out(table, left_out, count))
        if count < fewest_rows:
            faulty = ((line, cells) for line, cells, fault in left_out if fault in ("doubtful", "missing"))
            if row := next(faulty, None):
                raise bad_row(table, *row)
            few = self.error("too few rows", found=f"{count}", expected=f"at least {fewest_rows}")
            raise lost_formulas(self) or few
        for role, column in wanted.items():
            if column.logarithm:
                with np.errstate(over="ignore"):
                    values[role] = column.scale * column.logarithm ** (values[role] / column.scale)
        for role in terms:
            values[role.partition("|")[0]] += values.pop(role)
        return values, notes

    def needing(self, wanted: Mapping[str, Column]) -> "Table":
        """Copy of the table in which only rows with a number in each wanted column are data."""
        return replace(self, needed=self.needed.union(*(column.indices for column in wanted.values())))

    def refuse(
        self, bad: NDArray[np.bool_], column: Column, problem: str, expected: str, hint: str | None = None
    ) -> None:
        """Raise an error that names line and cell of the first bad row, if there is one.

        Args:
            bad: mask of the bad rows, (n,).
            column: column with the bad cell.
            problem: description of the problem in one clause.
            expected: expected content of the cell.
            hint: next step to suggest.

        Raises:
            MeasurementError: there is a bad row.
        """
        if bad.any():
            line, cells = next(islice(self.rows(), int(np.argmax(bad)), None))
            found = f'"{cells[column.index]}"'
            raise self.error(problem, line=line, column=column, found=found, expected=expected, hint=hint)

    def _read_chunk(
        self, chunk: RowSource, wanted: Mapping[str, Column], left_out: list[FaultyRow]
    ) -> Iterator[dict[str, Floats]]:
        """Read a chunk of rows as arrays of numbers [SI] by role: at once if all its rows are data, else row by row.

        Args:
            chunk: successive rows of the source to read.
            wanted: columns by role such as "force", with their factors to SI.
            left_out: list to which rows without data are added.

        Raises:
            MeasurementError: a cell without a finite number, or with one above LARGEST_VALUE.
        """
        if (arrays := self.parse(chunk, frozenset(column.index for column in wanted.values()))) is not None:
            values = {role: column.scale * arrays[column.index] for role, column in wanted.items()}
            extremes = [(x.min(initial=0.0), x.max(initial=0.0)) for x in values.values()]
            if all(low >= -LARGEST_VALUE and high <= LARGEST_VALUE for low, high in extremes):  # not if NaN
                yield values
                return
        rows = self.rows(chunk, left_out)
        while rows_read := list(islice(rows, _CHUNK_ROWS)):
            yield {role: np.array([self._number(column, *row) for row in rows_read]) for role, column in wanted.items()}

    def _number(self, column: Column, line: int, cells: Sequence[str | float]) -> float:
        """Number in the cell of a column, in SI.

        Raises:
            MeasurementError: the cell has no finite number, or one above LARGEST_VALUE.
        """
        cell, value_of = cells[column.index], parse_clock if column.index in self.clocks else self.numerals.value
        value = value_of(cell) if isinstance(cell, str) else cell
        if value is None or not abs(value * column.scale) <= LARGEST_VALUE:
            raise bad_row(self, line, cells, column=column)
        return value * column.scale
