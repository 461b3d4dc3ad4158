"""The recognised columns of a table: how they write their numbers, and their values in SI."""

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from bushfit.errors import MeasurementError
from bushfit.reading.headers import ROW_COLUMNS, Column, Vocabulary
from bushfit.reading.instruments import word_for_part
from bushfit.reading.layout import FileFormat, Layout, fits
from bushfit.reading.measurement import Floats
from bushfit.reading.names import named_direction
from bushfit.reading.numerals import ALL_NUMERALS, Numerals, Place, is_like_number, weigh
from bushfit.reading.runs import rows_alike
from bushfit.reading.source import LARGEST_VALUE, LEAST_VALUE, Channels, RowSource, Sheet, Text, rows

#: Rows that are taken apart at a time where a library cannot; chosen: their texts fill some MiB.
_CHUNK_ROWS = 1 << 16
#: Rows of each value in the mean where a column parts tests; chosen: one that counts its rows parts none.
_FEWEST_ROWS = 3
#: Rows that tell whether a column may part tests, and cells that tell the decimal mark; chosen: a long record is not
#: read whole for either.
_FIRST = 1000
#: What a column may say of the test that a row belongs to.
_LABELS = Vocabulary(ROW_COLUMNS, {})


class Rows(NamedTuple):
    """The rows of a file that make a test: of a direction and a specimen number, where columns tell them, and with
    `texts` in the columns of these headers; where tests share a file, a column has to tell them apart."""

    direction: str | None = None
    specimen_number: str | None = None
    texts: Mapping[str, str] = {}
    shared: bool = False


def same_text(text: str, other: str) -> bool:
    """Whether two texts of such columns are one, in upper or lower case: 17 and #17."""
    return text.strip(" #").casefold() == other.strip(" #").casefold()


@dataclass(frozen=True, eq=False)
class Columns:
    """A table as its file has it, a header and rows of cells, and its columns.

    Args:
        file, source: where it lies, and its rows.
        layout: its header, units row and delimiter.
        stated: what the user states of the file's format.
        roles: the recognised columns, by what they hold.
        left_out: lines of rows that belong to other tests.
    """

    file: Path
    source: RowSource
    layout: Layout
    stated: FileFormat
    roles: Mapping[str, Column]
    left_out: frozenset[int] = field(default=frozenset(), kw_only=True)

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
                if line not in self.left_out and any(cell != "" for cell in cells):
                    yield line, cells
        except csv.Error as error:
            raise self.error("the table cannot be read", found=str(error)) from error

    @cached_property
    def row_labels(self) -> Mapping[str, tuple[int, Sequence[str]]]:
        """Index and texts, (n,), of columns that tell direction, specimen_number and run; directions by their names."""
        found: dict[str, tuple[int, Sequence[str]]] = {}
        for index, header in enumerate(self.headers):
            heading = _LABELS.heading(header)
            if heading and heading.role not in found and (texts := self._texts_that_part_tests(index)):
                if heading.role == "direction":
                    known = {text: named_direction([text], short=True) for text in set(texts)}
                    texts = [str(known[text] or text) for text in texts] if any(known.values()) else []
                found |= {heading.role: (index, texts)} if texts else {}
        return found

    def taking(self, wanted: Rows) -> Self:
        """The table of the rows of one test alone.

        Raises:
            MeasurementError: no such row or column, rows of several parts, or tests that no column tells apart.
        """
        stated = {"direction": wanted.direction, "specimen_number": wanted.specimen_number}
        chosen = [(*self.row_labels[key], text) for key, text in stated.items() if text and key in self.row_labels]
        for header, text in wanted.texts.items():
            if header not in self.headers:
                raise self.header_error(f'there is no column "{header}"', expected="headers, as keys of rows")
            chosen.append((self.headers.index(header), self.texts(self.headers.index(header)), text))
        if wanted.shared and not chosen:
            expected = "each file once, or a column that tells its tests apart"
            raise self.header_error("a file is listed twice", expected=expected)
        column, parts = self.row_labels.get("specimen_number", (0, ()))
        rows = [line for line, _ in self.rows()] if chosen or parts else []
        kept = [n for n in range(len(rows)) if all(same_text(texts[n], text) for _, texts, text in chosen)]
        several = len({parts[n] for n in kept}) > 1 if parts else False
        if several or (chosen and not kept):
            found = [(column, parts, "one part")] if several else chosen
            raise self.header_error(
                "this file holds tests of several parts" if several else "no row is of this test",
                found="; ".join(
                    f'{", ".join([*dict.fromkeys(own)])} in column "{self.headers[i]}"' for i, own, _ in found
                ),
                expected=" and ".join(text for *_, text in found),
                hint='state one that was found, as specimen_number = "..."; bushfit init writes all tests of a file',
            )
        return replace(self, left_out=frozenset(rows).difference(rows[n] for n in kept))

    def not_understood(self, rows: NDArray[np.intp] | None = None, *settled: Floats) -> Iterator[str]:
        """A sentence for each column that may part tests, and of which nothing says what it means.

        Of a sweep, `settled` are frequency and level of its `rows`, (n,): a number that goes with them is measured, and
        a text that goes with one of them names it. Of a loop, numbers are channels.
        """
        known = {column.index for column in self.roles.values()}
        known |= {index for key, (index, texts) in self.row_labels.items() if key != "direction" or len({*texts}) == 1}
        for index in (index for index in range(len(self.headers)) if index not in known):
            is_number, header = self.holds_numbers(index), self.headers[index]
            if (is_number and not settled) or not (texts := self._texts_that_part_tests(index)):
                continue
            own = np.array(texts)[slice(None) if rows is None else rows]
            values, place, counts = np.unique(own, return_inverse=True, return_counts=True)
            goes_with = [settled] if is_number else [(one,) for one in settled]
            explained = any(all(np.ptp(place[alike]) == 0 for alike in rows_alike(*keys)) for keys in goes_with)
            if values.size > 1 and not explained and not (is_number and counts.min() < _FEWEST_ROWS):
                listed = ", ".join(values[:4]) + ", ..." * (values.size > 4)
                yield (
                    f'"{header}" (column {index + 1}) varies from row to row ({listed}) and is not understood: all '
                    f'rows count as one test; rows = {{ "{header}" = "{values[0]}" }} in the campaign takes those alone'
                )

    def holds_numbers(self, index: int) -> bool:
        """Whether a column begins with a number."""
        cells = next(self.rows(), (0, ()))[1]
        return index < len(cells) and is_like_number(str(cells[index]))

    def texts(self, index: int, most: int | None = None) -> list[str]:
        """The text of each row in a column, or of the first ones, (n,); an empty cell, as merged ones are, goes on."""
        found, last = [], ""
        for _, cells in islice(self.rows(), most):
            cell = cells[index] if index < len(cells) else ""
            last = (cell.strip(" #") if isinstance(cell, str) else f"{cell:.12g}") or last
            found.append(last)
        return found

    def _texts_that_part_tests(self, index: int) -> list[str]:
        """The texts of a column without a role that may part tests; else none."""
        if self.layout.written or index in {column.index for column in self.roles.values()}:
            return []
        first = self.texts(index, _FIRST)
        return self.texts(index) if _FEWEST_ROWS * len(set(first)) <= len(first) else []

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
        return kind(problem, file=self.file, place=self.place(line, column), found=found, **said)

    def header_error(self, problem: str, *, found: str | None = None, **said: Any) -> MeasurementError:
        """An error in the header, of which all cells were found unless `found` says what."""
        found = ", ".join(self.headers) if found is None else found
        return self.error(problem, line=self.layout.header_line, found=found, **said)

    def place(self, line: int | None, column: Column | None) -> str | None:
        """A place in the file in words: its sheet, line and column, as far as there are such."""
        source = self.source
        parts = [
            f'{word_for_part(self.file)} "{source.sheet}"' if source.sheet else None,
            f"{'row' if source.sheet or isinstance(source, Channels) else 'line'} {line}" if line else None,
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
        if layout.delimiter == "," and isinstance(source, Text) and not source.may_have_comma(layout):
            ways = tuple(way for way in ways if "," not in (way.decimal, way.thousands)) or ways
        evidence = weigh(self._texts(), ways)
        columns = {column.index: column for column in self.roles.values()}
        may_group = isinstance(source, Sheet) or source.may_group(layout, evidence.ways[0].decimal)
        if evidence.contrary is None and may_group:
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
        if isinstance(self.source, Sheet) and self.source.lacks_values():
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
        indices = {column.index for column in self.roles.values()} - self.source.numeric
        for line, cells in self.rows() if indices else ():
            for index in indices:
                if index < len(cells) and isinstance(cell := cells[index], str):
                    yield (line, index), cell

    def _by_library(self, wanted: Mapping[str, Column]) -> dict[str, Floats] | None:
        """The wanted columns as a library reads them; None where they have to be read row by row.

        The library takes no thousands separators. So what it reads as numbers needs no more evidence than that of the
        first cells, as long as these settle the decimal mark.
        """
        scales = {column.index: column.scale for column in wanted.values()}
        if self.left_out or (isinstance(self.source, Sheet) and not isinstance(self.source, Channels)):
            return None
        if isinstance(self.source, Channels):
            known = self.source.values(scales)
            return None if known is None else {role: known[column.index] for role, column in wanted.items()}
        decimals = {way.decimal for way in weigh(islice(self._texts(), _FIRST), self._open_ways()).ways}
        first = next(self.rows(), (0, ()))[1]
        if len(decimals) > 1 or not fits(first, len(self.headers)):
            return None
        numerals = Numerals(decimals.pop())
        cells = [first[column.index] for column in wanted.values()]
        if not all(isinstance(cell, str) and numerals.allows(cell) for cell in cells):
            return None  # a library may take a column of TRUE for numbers
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
