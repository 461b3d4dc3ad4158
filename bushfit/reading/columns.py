"""The recognised columns of a table: how they write their numbers, and their values in SI."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from bushfit.reading.cells import Cells
from bushfit.reading.headers import Column
from bushfit.reading.layout import fits
from bushfit.reading.measurement import Floats
from bushfit.reading.numerals import ALL_NUMERALS, Numerals, Place, weigh
from bushfit.reading.source import LARGEST_VALUE

#: Rows that are taken apart at a time where a library cannot; chosen: their texts fill some MiB.
_CHUNK_ROWS = 1 << 16
#: Cells in which the decimal mark has to show for a library to read a file; chosen: those of its first rows.
_FIRST_CELLS = 1000


@dataclass(frozen=True, eq=False)
class Columns(Cells):
    """A table of which the columns are recognised; `roles` has them by what they hold."""

    roles: Mapping[str, Column]

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
            raise self.error("too few rows", found=f"{found}", expected=f"at least {fewest_rows}")
        return values

    def check_positive(self, roles: Sequence[str], wanted: Mapping[str, Column], values: Mapping[str, Floats]) -> None:
        """Refuse a value that is not positive in one of some columns, as far as there are such among `values`.

        Raises:
            MeasurementError: there is such a value.
        """
        for role in roles:
            if role in values:
                problem = f"the {role.replace('_', ' ')} is not positive"
                self.refuse(values[role] <= 0.0, wanted[role], problem, "a number above zero")

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
                    raise self.error(
                        "the cell is empty" if cell == "" else "this is no finite number",
                        line=line,
                        column=column,
                        found=f'"{cell}"',
                        expected=f"a number such as 12{self.numerals.decimal}5",
                    )
                parts[role].append(np.array(numbers, dtype=float))
        return {role: np.concatenate(chunks) for role, chunks in parts.items()}

    def _number(self, cell: str | float, column: Column) -> float | None:
        """The number in a cell in SI; None where it holds none, or one beyond LARGEST_VALUE."""
        number = self.numerals.value(cell) if isinstance(cell, str) else cell
        return None if number is None or not abs(number * column.scale) <= LARGEST_VALUE else number * column.scale
