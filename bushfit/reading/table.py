"""A table with named columns and units: its layout understood, its numbers in SI, its errors with their line."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import cached_property
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bushfit import units
from bushfit.errors import MeasurementError, NoColumnError, UnitError
from bushfit.reading.files import sha256, view_bytes
from bushfit.reading.headers import Column, Vocabulary, split_convention
from bushfit.reading.layout import DELIMITERS, FileFormat, Layout, find_layout, fits
from bushfit.reading.measurement import Floats
from bushfit.reading.numerals import ALL, Numerals, is_like_number, weigh
from bushfit.reading.source import LARGEST, Source, Text, rows
from bushfit.reading.workbook import is_workbook, open_sheet

_LONGEST_FOUND = 200
#: Rows that are taken apart at a time, where a library cannot.
_CHUNK = 1 << 16
#: Cells that may settle the decimal mark.
_FIRST_CELLS = 1000
_EXPECTED_HEADER = 'a header row such as "time [s],displacement [mm],force [N]"'


@dataclass(frozen=True, eq=False)
class Table:
    """An opened table.

    Args:
        file: where it comes from.
        source: the file's rows.
        layout: header, units row and delimiter.
        stated: what the user says of the file's format.
        roles: the columns that were recognised.
        checksum: SHA-256 of the file, perhaps still under way.
    """

    file: Path
    source: Source
    layout: Layout
    roles: Mapping[str, Column]
    checksum: Future[str]
    stated: FileFormat

    @classmethod
    def open(
        cls,
        file: Path,
        names: Mapping[str, Sequence[str]],
        columns: Mapping[str, str] | None = None,
        stated_units: Mapping[str, str] | None = None,
        stated: FileFormat | None = None,
    ) -> Table:
        """Read a file and understand its header.

        Args:
            file: a text in any dialect. Lines of other content may lead it; a row of units may follow the header.
            names: for each role the headers it goes by.
            columns: header of a role that goes by another name.
            stated_units: units that the file does not carry.
            stated: what the file does not tell of its format.

        Raises:
            MeasurementError: no such file, no text, no header, or a header that does not settle which column is which.
            UnitError: two different units for one column.
        """
        stated = stated or FileFormat()
        data = view_bytes(file, MeasurementError)
        checksum = sha256(data)
        vocabulary = Vocabulary(names, columns or {})

        def lay_out(source: Source) -> Layout:
            delimiter = "" if source.sheet else DELIMITERS[stated.delimiter] if stated.delimiter else None
            return find_layout(source.head(), vocabulary, delimiter=delimiter, header_line=stated.header_line)

        try:
            source: Source
            if is_workbook(data):
                source = open_sheet(
                    data[:], file, stated.sheet, lambda sheet: len(vocabulary.roles(lay_out(sheet).headers)) > 1
                )
            elif stated.sheet:
                raise MeasurementError(
                    "this is no workbook", file=file, found=f'sheet = "{stated.sheet}"', expected="xlsx"
                )
            else:
                source = Text.open(data, file, stated.encoding)
            layout = lay_out(source)
        except csv.Error as error:
            raise MeasurementError("the table cannot be read", file=file, found=str(error)) from error
        if stated.header_line not in (None, layout.header_line):
            found = f"header_line = {stated.header_line}"
            raise MeasurementError("there is no header on this line", file=file, found=found, hint="lines count from 1")
        table = cls(file, source, layout, {}, checksum, stated)
        table._check_header()
        return replace(table, roles=table._recognise(vocabulary, columns or {}, stated_units or {}))

    @property
    def headers(self) -> tuple[str, ...]:
        """The header's cells."""
        return self.layout.headers

    @property
    def sha256(self) -> str:
        """Checksum of the file."""
        return self.checksum.result()

    def column(self, role: str, expected: str) -> Column:
        """The column of a role, with its unit resolved against the SI unit `expected`; a ratio needs no unit.

        Raises:
            MeasurementError: no such column.
            UnitError: no unit, an unknown one, or one of another dimension.
        """
        if role not in self.roles:
            raise self.missing(role, expected)
        column = self.roles[role]
        if column.unit is None and expected != "1":
            example = units.example(expected)
            raise UnitError(
                f"the {_label(role)} has no unit",
                file=self.file,
                place=self._place(self.layout.header_line, column),
                found=f'"{column.header}"',
                expected=units.describe(expected),
                hint=f'write "{column.header} [{example}]" in the header, '
                f'or units = {{ {role} = "{example}" }} in the campaign',
            )
        try:
            return replace(column, scale=units.factor(column.unit or "1", expected))
        except UnitError as error:
            error.file, error.place = self.file, self._place(self.layout.header_line, column)
            raise

    def read(self, wanted: Mapping[str, Column], *, fewest_rows: int) -> dict[str, Floats]:
        """The numbers of the wanted columns in SI, each (n,).

        Raises:
            MeasurementError: a row of another length, a cell that is no finite number, numbers that can be read in two
                ways, or too few rows.
        """
        values = self._tidy(wanted)
        if values is None:
            values = self._row_by_row(wanted)
        found = len(next(iter(values.values())))
        if found < fewest_rows:
            raise self.error("too few rows", found=f"{found}", expected=f"at least {fewest_rows}")
        return values

    def refuse(
        self, bad: NDArray[np.bool_], column: Column, problem: str, expected: str, hint: str | None = None
    ) -> None:
        """Raise for the first row that is marked in `bad`, (n,), naming its line and cell.

        Raises:
            MeasurementError: a row is marked.
        """
        if bad.any():
            line, cells = next(islice(self._rows(), int(np.argmax(bad)), None))
            found = f'"{cells[column.index]}"'
            raise self.error(problem, line=line, column=column, found=found, expected=expected, hint=hint)

    def agrees(self, role: str, expected: str) -> bool:
        """Whether the column of a role is there and states a unit of the dimension of `expected`."""
        column = self.roles.get(role)
        return column is not None and column.unit is not None and units.agrees(column.unit, expected)

    def missing(self, role: str, expected: str, hint: str | None = None) -> MeasurementError:
        """The error for a role without a column, whose SI unit would be `expected`."""
        return self.error(
            f"there is no column for the {_label(role)}",
            line=self.layout.header_line,
            found=", ".join(self.headers),
            expected=f'a header such as "{_label(role)} [{units.example(expected)}]"',
            hint=f'name the column in the campaign: columns = {{ {role} = "..." }}' + (f", {hint}" if hint else ""),
        )

    def error(
        self,
        problem: str,
        *,
        line: int | None = None,
        column: Column | None = None,
        found: str | None = None,
        expected: str | None = None,
        hint: str | None = None,
        kind: type[MeasurementError] = MeasurementError,
    ) -> MeasurementError:
        """An error in this table, at a line (from 1) and column where they are known."""
        found = found if found is None or len(found) <= _LONGEST_FOUND else found[:_LONGEST_FOUND] + "..."
        place = self._place(line, column)
        return kind(problem, file=self.file, place=place, found=found, expected=expected, hint=hint)

    def _place(self, line: int | None, column: Column | None) -> str | None:
        sheet = self.source.sheet
        row = "row" if sheet else "line"
        parts = [
            f'sheet "{sheet}"' if sheet else None,
            f"{row} {line}" if line else None,
            f'column "{column.header}"' if column else None,
        ]
        return ", ".join(part for part in parts if part) or None

    def _check_header(self) -> None:
        if len(self.headers) < 2:
            raise self.error(
                "there is only one column",
                line=self.layout.header_line,
                found=self.headers[0] if self.headers else "nothing",
                expected=f"{_EXPECTED_HEADER}, separated by comma, semicolon, tab, | or blanks",
            )
        if all(is_like_number(cell) for cell in self.headers):
            raise self.error(
                "there is no header",
                line=self.layout.header_line,
                found=", ".join(self.headers),
                expected=_EXPECTED_HEADER,
            )

    def _recognise(
        self, vocabulary: Vocabulary, columns: Mapping[str, str], stated_units: Mapping[str, str]
    ) -> dict[str, Column]:
        roles: dict[str, Column] = {}
        for index, (header, unit_cell) in enumerate(zip(self.headers, self.layout.units, strict=True)):
            heading = vocabulary.heading(header)
            if heading is None:
                continue
            role = heading.role
            if role in roles:
                raise self.error(
                    f"more than one column could be the {_label(role)}",
                    line=self.layout.header_line,
                    found=f"{roles[role].header}, {header}",
                    expected="one",
                    hint=f'choose it in the campaign: columns = {{ {role} = "{header}" }}',
                )
            parts = [split_convention(unit) for unit in (heading.unit, unit_cell, stated_units.get(role)) if unit]
            conventions = {said for said in (heading.convention, *(part[1] for part in parts)) if said}
            stated = {unit for unit, _ in parts if unit}
            column = Column(role, header, index, next(iter(stated), None), 1.0, next(iter(conventions), None))
            if len(stated) > 1 or len(conventions) > 1:
                raise UnitError(
                    f"two units for the {_label(role)}",
                    file=self.file,
                    place=self._place(self.layout.header_line, column),
                    found=" and ".join(sorted(stated) if len(stated) > 1 else sorted(conventions)),
                    expected="one unit, from the header, the units row or the campaign",
                )
            roles[role] = column
        for role in columns:
            if role not in roles:
                near = get_close_matches(columns[role], self.headers, n=1, cutoff=0.4)
                header = near[0] if near else "..."
                raise self.error(
                    f'there is no column "{columns[role]}"',
                    kind=NoColumnError,
                    line=self.layout.header_line,
                    found=", ".join(self.headers),
                    expected=f"the header that was named for the {_label(role)}",
                    hint=(f'did you mean "{near[0]}"? ' if near else "name one of this file: ")
                    + f'columns = {{ {role} = "{header}" }} in the campaign',
                )
        return roles

    @cached_property
    def numerals(self) -> Numerals:
        """How the recognised columns write their numbers, by what all of them tell.

        Raises:
            MeasurementError: numbers that can be read in two ways, or that are written in two ways.
        """
        ways = self._ways()
        if self.layout.delimiter == "," and not self.source.may_have_comma(self.layout):
            ways = tuple(way for way in ways if "," not in (way.decimal, way.thousands)) or ways
        evidence = weigh(self._cells(), ways)
        if evidence.contrary is None and self.source.may_group(self.layout, evidence.ways[0].decimal):
            evidence = weigh(self._cells(), ways, all_cells=True)
        if evidence.contrary:
            (line, index), text = evidence.contrary
            mark = "comma" if evidence.ways[0].decimal == "," else "point"
            raise self.error(
                "this number is written in another way than those before it",
                line=line,
                column=self._column_at(index),
                found=f'"{text}"',
                expected=f"numbers with a decimal {mark}",
                hint='write all numbers in one way, or state decimal = "..." and thousands = "..." in the campaign',
            )
        if evidence.unclear:
            (line, index), text = evidence.unclear
            readings = dict.fromkeys(way.value(text) or 0.0 for way in evidence.ways)
            raise self.error(
                "this number can be read in two ways",
                line=line,
                column=self._column_at(index),
                found=f'"{text}", and no number in the file that settles it',
                expected=" or ".join(f"{reading:.15g}" for reading in readings),
                hint='state decimal = "." or decimal = "," in the campaign',
            )
        return evidence.ways[0]

    def _ways(self) -> tuple[Numerals, ...]:
        """The ways to write numbers that the user leaves open."""
        decimal, thousands = self.stated.decimal, self.stated.thousands
        ways = tuple(
            way for way in ALL if decimal in (None, way.decimal) and thousands in (None, way.thousands or "none")
        )
        if not ways:
            raise self.error("decimal mark and thousands separator are the same", found=decimal, expected="two signs")
        return ways

    def _cells(self) -> Iterator[tuple[tuple[int, int], str]]:
        """Place and text of the recognised columns' cells, as far as they are texts."""
        indices = [column.index for column in self.roles.values()]
        for line, cells in self._rows():
            for index in indices:
                if index < len(cells) and isinstance(cell := cells[index], str):
                    yield (line, index), cell

    def _column_at(self, index: int) -> Column:
        return next(column for column in self.roles.values() if column.index == index)

    def _rows(self) -> Iterator[tuple[int, Sequence[str | float]]]:
        """Line and cells of each row of data."""
        try:
            for line, cells in rows(self.source, self.layout):
                if any(cell != "" for cell in cells):
                    yield line, cells
        except csv.Error as error:
            raise self.error("the table cannot be read", found=str(error)) from error

    def _tidy(self, wanted: Mapping[str, Column]) -> dict[str, Floats] | None:
        """The wanted columns read by a library, or None where row by row it has to be.

        The library takes no thousands separators, so what it reads as numbers needs no more evidence than that of the
        first cells, as long as these settle the decimal mark.
        """
        decimals = {way.decimal for way in weigh(islice(self._cells(), _FIRST_CELLS), self._ways()).ways}
        first = next(self._rows(), (0, ()))[1]
        if len(decimals) > 1 or not fits(first, len(self.headers)):
            return None
        numerals = Numerals(decimals.pop())
        # a library may take a column of TRUE for numbers
        if not all(
            isinstance(cell := first[column.index], str) and numerals.allows(cell) for column in wanted.values()
        ):
            return None
        scales = {column.index: column.scale for column in wanted.values()}
        columns = self.source.columns(self.layout, len(first), scales, numerals)
        return None if columns is None else {role: columns[column.index] for role, column in wanted.items()}

    def _row_by_row(self, wanted: Mapping[str, Column]) -> dict[str, Floats]:
        parts: dict[str, list[Floats]] = {role: [np.empty(0)] for role in wanted}
        remaining = self._rows()
        while chunk := list(islice(remaining, _CHUNK)):
            for line, cells in chunk:
                if not fits(cells, len(self.headers)):
                    raise self._mismatch(line, len(cells))
            for role, column in wanted.items():
                numbers = [self._number(cells[column.index], column) for _, cells in chunk]
                if None in numbers:
                    line, cells = chunk[numbers.index(None)]
                    raise self._no_number(line, column, cells[column.index])
                parts[role].append(np.array(numbers, dtype=float))
        return {role: np.concatenate(chunks) for role, chunks in parts.items()}

    def _number(self, cell: str | float, column: Column) -> float | None:
        """The number in a cell in SI; None where it holds none, or one beyond all measure."""
        number = self.numerals.value(cell) if isinstance(cell, str) else cell
        return number * column.scale if number is not None and abs(number * column.scale) <= LARGEST else None

    def _mismatch(self, line: int, found: int) -> MeasurementError:
        width = len(self.headers)
        return self.error(
            "the row does not match the header",
            line=line,
            found=f"{found} cell" + "s" * (found != 1),
            expected=f"{width} cells",
            hint="part the columns by semicolons where numbers have a decimal comma" if found > width else None,
        )

    def _no_number(self, line: int, column: Column, cell: str | float) -> MeasurementError:
        return self.error(
            "the cell is empty" if cell == "" else "this is no finite number",
            line=line,
            column=column,
            found=f'"{cell}"',
            expected=f"a number such as 12{self.numerals.decimal}5",
        )


def _label(role: str) -> str:
    return role.replace("_", " ")
