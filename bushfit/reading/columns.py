"""The recognised columns of a table: how they write their numbers, and their values in SI."""

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bushfit.errors import MeasurementError
from bushfit.reading.headers import Column
from bushfit.reading.layout import FileFormat, Layout, fits
from bushfit.reading.measurement import Floats
from bushfit.reading.numerals import ALL_NUMERALS, Numerals, Place, is_like_number, weigh
from bushfit.reading.source import LARGEST_VALUE, LEAST_VALUE, RowSource, rows

#: Rows that are taken apart at a time where a library cannot; chosen: their texts fill some MiB.
_CHUNK_ROWS = 1 << 16
#: Cells in which the decimal mark has to show for a library to read a file; chosen: those of its first rows.
_FIRST_CELLS = 1000

#: Characters of what was found that an error quotes; chosen: two lines of a terminal.
_LONGEST_FOUND = 200


@dataclass(frozen=True, eq=False)
class Columns:
    """A table as its file has it, a header and rows of cells, and its columns.

    Args:
        file, source: where it lies, and its rows.
        layout: its header, units row and delimiter.
        stated: what the user states of the file's format.
        roles: the recognised columns, by what they hold.
    """

    file: Path
    source: RowSource
    layout: Layout
    stated: FileFormat
    roles: Mapping[str, Column]

    @property
    def headers(self) -> tuple[str, ...]:
        """The cells of the header."""
        return self.layout.headers

    def rows(self) -> Iterator[tuple[int, Sequence[str | float]]]:
        """Line and cells of each row of data.

        Raises:
            MeasurementError: a line or a quoted cell that is far too long.
        """
        try:
            for line, cells in rows(self.source, self.layout):
                if any(cell != "" for cell in cells):
                    yield line, cells
        except csv.Error as error:
            raise self.error("the table cannot be read", found=str(error)) from error

    def texts(self, index: int, most: int | None = None) -> list[str]:
        """The text of each row in a column, or of the first ones, (n,); an empty cell, as merged ones are, goes on.

        A sign # before a number does not count.
        """
        found, last = [], ""
        for _, cells in islice(self.rows(), most):
            cell = cells[index] if index < len(cells) else ""
            last = (cell.strip(" #") if isinstance(cell, str) else f"{cell:.12g}") or last
            found.append(last)
        return found

    def holds_numbers(self, index: int) -> bool:
        """Whether a column begins with a number."""
        cells = next(self.rows(), (0, ()))[1]
        return index < len(cells) and is_like_number(str(cells[index]))

    def error(
        self,
        problem: str,
        *,
        line: int | None = None,
        column: Column | None = None,
        found: str | None = None,
        kind: type[MeasurementError] = MeasurementError,
        **said: str | None,
    ) -> MeasurementError:
        """An error in this table, at a line (from 1) and column where they are known, with what else is `said`."""
        found = found if found is None or len(found) <= _LONGEST_FOUND else found[:_LONGEST_FOUND] + "..."
        return kind(problem, file=self.file, place=self.place(line, column), found=found, **said)

    def header_error(self, problem: str, *, found: str | None = None, **said: Any) -> MeasurementError:
        """An error in the header, of which all cells were found unless `found` says what."""
        found = ", ".join(self.headers) if found is None else found
        return self.error(problem, line=self.layout.header_line, found=found, **said)

    def place(self, line: int | None, column: Column | None) -> str | None:
        """A place in the file in words: its sheet, line and column, as far as there are such."""
        sheet = self.source.sheet
        parts = [
            f'sheet "{sheet}"' if sheet else None,
            f"{'row' if sheet else 'line'} {line}" if line else None,
            f'column "{column.header}"' if column else None,
        ]
        return ", ".join(part for part in parts if part) or None

    @cached_property
    def numerals(self) -> Numerals:
        """How the columns write their numbers: in one way, which all of them together tell.

        Raises:
            MeasurementError: numbers that can be read in two ways, or that are written in two ways.
        """
        layout, source = self.layout, self.source
        ways = self._open_ways()
        if layout.delimiter == "," and not source.may_have_comma(layout):
            ways = tuple(way for way in ways if "," not in (way.decimal, way.thousands)) or ways
        evidence = weigh(self._texts(), ways)
        columns = {column.index: column for column in self.roles.values()}
        if evidence.contrary is None and source.may_group(layout, evidence.ways[0].decimal):
            evidence = weigh(self._texts(), ways, all_cells=True)
        if evidence.contrary:
            (line, index), text = evidence.contrary
            raise self.error(
                "this number is written in another way than those before it",
                line=line,
                column=columns[index],
                found=f'"{text}"',
                expected=f"numbers with a decimal {'comma' if evidence.ways[0].decimal == ',' else 'point'}",
                hint='write all numbers in one way, or state decimal = "..." and thousands = "..." in the campaign',
            )
        if evidence.unclear:
            (line, index), text = evidence.unclear
            readings = dict.fromkeys(way.value(text) or 0.0 for way in evidence.ways)
            raise self.error(
                "this number can be read in two ways",
                line=line,
                column=columns[index],
                found=f'"{text}", and no number in the file that settles it',
                expected=" or ".join(f"{reading:.15g}" for reading in readings),
                hint='state decimal = "." or decimal = "," in the campaign',
            )
        return evidence.ways[0]

    def read(self, wanted: Mapping[str, Column], *, fewest_rows: int) -> dict[str, Floats]:
        """The numbers of the wanted columns in SI, each (n,): by a library where the rows are tidy, else row by row.

        Raises:
            MeasurementError: a row of another length, a cell that is no finite number, numbers that can be read in two
                ways, or too few rows.
        """
        values = self._by_library(wanted) or self._row_by_row(wanted)
        found = len(next(iter(values.values())))
        if found < fewest_rows:
            raise self._empty("too few rows", found=f"{found}", expected=f"at least {fewest_rows}")
        return values

    def _empty(self, problem: str, **said: Any) -> MeasurementError:
        """The error for what should be filled, which may be formulas."""
        if self.source.lacks_values():
            problem = "the workbook has formulas whose values were not saved"
            said["hint"] = "open it in a spreadsheet program and save it again"
        return self.error(problem, **said)

    def check_positive(self, roles: Sequence[str], wanted: Mapping[str, Column], values: Mapping[str, Floats]) -> None:
        """Refuse a value that is not positive in one of some columns, as far as there are such among `values`.

        Raises:
            MeasurementError: there is such a value.
        """
        for role in roles:
            if role in values:
                problem = f"the {role.replace('_', ' ')} is not positive"
                self.refuse(values[role] <= 0.0, wanted[role], problem, "a number above zero")
                least = f"{LEAST_VALUE / abs(wanted[role].scale):.3g} or more"
                self.refuse(values[role] < LEAST_VALUE, wanted[role], "no rig records so little", least)

    def refuse(
        self, bad: NDArray[np.bool_], column: Column, problem: str, expected: str, hint: str | None = None
    ) -> None:
        """Refuse a table with rows that are marked in `bad`, (n,); the error names line and cell of the first.

        Raises:
            MeasurementError: a row is marked.
        """
        if bad.any():
            line, cells = next(islice(self.rows(), int(np.argmax(bad)), None))
            raise self.error(
                problem, line=line, column=column, found=f'"{cells[column.index]}"', expected=expected, hint=hint
            )

    def _open_ways(self) -> tuple[Numerals, ...]:
        """The ways to write numbers that the user leaves open."""
        decimal, thousands = self.stated.decimal, self.stated.thousands
        fitting = (way for way in ALL_NUMERALS if decimal in (None, way.decimal))
        ways = tuple(way for way in fitting if thousands in (None, way.thousands or "none"))
        if not ways:
            raise self.error("decimal mark and thousands separator are the same", found=decimal, expected="two signs")
        return ways

    def _texts(self) -> Iterator[tuple[Place, str]]:
        """Place and text of the columns' cells; those that a workbook holds as numbers are left out."""
        indices = [column.index for column in self.roles.values()]
        for line, cells in self.rows():
            for index in indices:
                if index < len(cells) and isinstance(cell := cells[index], str):
                    yield (line, index), cell

    def _by_library(self, wanted: Mapping[str, Column]) -> dict[str, Floats] | None:
        """The wanted columns as a library reads them; None where they have to be read row by row.

        The library takes no thousands separators. So what it reads as numbers needs no more evidence than that of the
        first cells, as long as these settle the decimal mark.
        """
        decimals = {way.decimal for way in weigh(islice(self._texts(), _FIRST_CELLS), self._open_ways()).ways}
        first = next(self.rows(), (0, ()))[1]
        if len(decimals) > 1 or not fits(first, len(self.headers)):
            return None
        numerals = Numerals(decimals.pop())
        cells = [first[column.index] for column in wanted.values()]
        if not all(isinstance(cell, str) and numerals.allows(cell) for cell in cells):
            return None  # a library may take a column of TRUE for numbers
        scales = {column.index: column.scale for column in wanted.values()}
        values = self.source.columns(self.layout, len(first), scales, numerals)
        return None if values is None else {role: values[column.index] for role, column in wanted.items()}

    def _row_by_row(self, wanted: Mapping[str, Column]) -> dict[str, Floats]:
        """The wanted columns of rows that a library does not read, or the error of the first bad row."""
        width = len(self.headers)
        parts: dict[str, list[Floats]] = {role: [np.empty(0)] for role in wanted}
        remaining = self.rows()
        while chunk := list(islice(remaining, _CHUNK_ROWS)):
            for line, cells in chunk:
                if not fits(cells, width):
                    wider = len(cells) > width
                    raise self.error(
                        "the row does not match the header",
                        line=line,
                        found=f"{len(cells)} cell" + "s" * (len(cells) != 1),
                        expected=f"{width} cells",
                        hint="part the columns by semicolons where numbers have a decimal comma" if wider else None,
                    )
            for role, column in wanted.items():
                numbers = [self._number(cells[column.index], column) for _, cells in chunk]
                if None in numbers:
                    line, cells = chunk[numbers.index(None)]
                    cell = cells[column.index]
                    raise (self._empty if cell == "" else self.error)(
                        "the cell is empty" if cell == "" else "this is no finite number, or one beyond every rig",
                        line=line,
                        column=column,
                        found=f'"{cell}"',
                        expected=f"a number such as 12{self.numerals.decimal}5",
                    )
                parts[role].append(np.array(numbers, dtype=float))
        return {role: np.concatenate(chunks) for role, chunks in parts.items()}

    def _number(self, cell: str | float, column: Column) -> float | None:
        """The number in a cell in SI; None where it holds none, or one beyond LARGEST_VALUE, as no rig records."""
        number = self.numerals.value(cell) if isinstance(cell, str) else cell
        return None if number is None or not abs(number * column.scale) <= LARGEST_VALUE else number * column.scale
