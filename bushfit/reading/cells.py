"""Cells of a table: rows of data, rows that are left out, notation of numbers, and errors with a place."""

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any, Self

from bushfit.errors import MeasurementError
from bushfit.reading.headers import WORDS, Column, plain
from bushfit.reading.instruments import word_for_part
from bushfit.reading.layout import FileFormat, Layout, Line, is_comment, is_row, is_units_row
from bushfit.reading.numerals import ALL_NUMERALS, Numerals, Place, is_like_number, weigh
from bushfit.reading.source import Channels, RowSource, Sheet, Text, cells_of, holds_number, rows
from bushfit.reading.times import clock

#: Bytes of a text whose columns are read with pandas; chosen: shorter ones take a moment.
_LARGE = 1 << 20
#: Rows that are left out and look like data, per row of data, at most; chosen: more make the meaning doubtful.
_MOST_LEFT_OUT = 0.1
#: Lines that a note lists.
_MOST_LISTED = 4
_SUMMARIES = frozenset(map(plain, WORDS["rows_of"]["summary"]))
#: Texts for a missing value.
_MISSING = frozenset(
    ("", "nan", "#n/a", "#na", "n/a", "na", "-", "--", "---", "null", "none", "#value!", "#div/0!", "#num!")
)


@dataclass(frozen=True, eq=False)
class Cells:
    """Header and rows of a table as in its file.

    Args:
        file: path.
        source: its lines.
        layout: header, units row and delimiter.
        stated: format as the user states it.
        roles: recognised columns by role.
        selected: positions of the rows that make the test, among all lines below the header; None for all.
        needed: indices of columns that hold a number in every row of data.
        clocks: indices of columns that hold times as texts.
    """

    file: Path
    source: RowSource
    layout: Layout
    stated: FileFormat
    roles: Mapping[str, Column]
    selected: frozenset[int] | None = field(default=None, kw_only=True)
    needed: frozenset[int] = field(default=frozenset(), kw_only=True)
    clocks: frozenset[int] = field(default=frozenset(), kw_only=True)

    @property
    def headers(self) -> tuple[str, ...]:
        """Cells of the header."""
        return self.layout.headers

    def rows(self) -> Iterator[tuple[int, Sequence[str | float]]]:
        """Line number and cells of each row of data; rows without data are left out.

        Raises:
            MeasurementError: a line or a quoted cell is far too long.
        """
        for position, (line, cells, fault) in enumerate(self._all_rows()):
            if fault is None and (self.selected is None or position in self.selected):
                yield line, cells

    def _all_rows(self) -> Iterator[tuple[int, Sequence[str | float], str | None]]:
        """Line number, cells, and fault of each row; a row of data has no fault."""
        width = len(self.headers)
        try:
            for line, cells in rows(self.source, self.layout):
                if any(cell != "" for cell in cells):
                    padded = cells if len(cells) >= width else [*cells, *[""] * (width - len(cells))]
                    yield line, padded, self._fault(cells, padded)
        except csv.Error as error:
            raise self.error("the table cannot be read", found=str(error)) from error

    def _fault(self, cells: Sequence[str | float], padded: Sequence[str | float]) -> str | None:
        """Reason why a row is no data; None if it is data."""
        first = next((cell for cell in cells if cell != ""), "")
        if isinstance(first, str) and plain(first) in _SUMMARIES and plain(first):
            return "summary"
        if len(cells) > len(self.headers) and any(cell != "" for cell in cells[len(self.headers) :]):
            return "width" if is_row([str(cell) for cell in cells]) else "text"
        if len(cells) < len(self.headers) and self.layout.delimiter == " " and is_row([str(cell) for cell in cells]):
            return "width"
        for index in self.needed:
            cell = padded[index]
            if index in self.clocks:
                if clock(str(cell)) is None:
                    return "text"
            elif isinstance(cell, str) and not is_like_number(cell):
                texts = [str(padded[number]).lower() for number in self.needed]
                if all(text in _MISSING for text in texts) or not any(is_like_number(str(text)) for text in cells):
                    return "text"
                return "missing" if cell.lower() in _MISSING and cell else "cell"
        return None

    def left_out(self, rows: Sequence[tuple[int, Sequence[str | float], str]] | None = None) -> Iterator[str]:
        """Sentence on the rows that are left out because they hold no data of the test.

        Args:
            rows: line number, cells and fault of each such row; default all in the table.

        Yields:
            One sentence if there are such rows.

        Raises:
            MeasurementError: so many of these rows look like data that their meaning is in doubt.
        """
        found = [(line, cells, fault) for line, cells, fault in self._all_rows() if fault] if rows is None else rows
        faults: dict[int, tuple[str, Sequence[str | float]]] = {}
        header = [plain(cell) for cell in self.headers]
        for line, cells, fault in found:
            texts = [str(cell) for cell in cells]
            if [plain(text) for text in texts[: len(header)]] != header and not is_units_row(texts):
                faults[line] = fault, cells
        doubtful = [line for line, (fault, _) in faults.items() if fault in ("cell", "width")]
        if len(doubtful) > 1 and len(doubtful) > _MOST_LEFT_OUT * sum(1 for _ in self.rows()):
            raise self.bad_row(doubtful[0], faults[doubtful[0]][1], len(doubtful))
        if faults:
            listed = [
                f"{'row' if isinstance(self.source, Sheet) else 'line'} {line} "
                f"({', '.join(str(cell) for cell in cells if cell != '')[:40]})"
                for line, (_, cells) in islice(faults.items(), _MOST_LISTED)
            ]
            more = ", ..." if len(faults) > _MOST_LISTED else ""
            yield f"{len(faults)} row{'s' * (len(faults) > 1)} left out, without data: {', '.join(listed)}{more}"

    def without_faults(self) -> tuple[Self, list[tuple[int, Sequence[str | float], str]]]:
        """Remove lines without data from a text; only lines with letters, dashes or empty cells are examined.

        Returns:
            The table, and line number, cells and fault of each removed line.
        """
        source, layout = self.source, self.layout
        lines = source.suspicious(layout, _MOST_LEFT_OUT) if isinstance(source, Text) and not layout.numbered else None
        if not lines or not isinstance(source, Text):
            return self, []
        faults: list[tuple[int, Sequence[str | float], str]] = []
        chunks, chunk_start = list[bytes](), 0
        for number, start, end in lines:
            line = Line(number, source.data[start:end].decode("utf-8", "replace").rstrip())
            cells = [] if is_comment(line.content, layout.delimiter) else list(cells_of(line, layout))
            if any(cells) and (fault := self._fault(cells, [*cells, *[""] * (len(self.headers) - len(cells))])):
                faults.append((number, [*cells, *[""] * (len(self.headers) - len(cells))], fault))
                chunks.append(source.data[chunk_start:start])
                chunk_start = end
        data = b"".join([*chunks, source.data[chunk_start:]]) if chunks else source.data
        return replace(self, source=Text(data, source.encoding)), faults

    def bad_row(
        self, line: int, cells: Sequence[str | float], count: int = 1, column: Column | None = None
    ) -> MeasurementError:
        """Create the error for a row that does not fit the header, or has a cell that is no number.

        Args:
            line: line number.
            cells: its cells.
            count: number of such rows.
            column: with the bad cell; default the first needed one without a number.

        Returns:
            The error.
        """
        width, also = len(self.headers), f", and {count - 1} more such rows" if count > 1 else ""
        needed = (column for column in self.roles.values() if column.index in self.needed)
        column = column or next((column for column in needed if not holds_number(cells, column.index)), None)
        if column is None or len(cells) > width:
            commas = self.layout.delimiter == "," and not any("." in str(cell) for cell in cells)
            return self.error(
                "the row does not match the header",
                line=line,
                found=f"{len(cells)} cell{'s' * (len(cells) != 1)}{also}",
                expected=f"{width} cells",
                hint="separate the columns by semicolons if numbers have a decimal comma" if commas else None,
            )
        cell = cells[column.index]
        if cell == "" and isinstance(self.source, Sheet) and self.source.lacks_values():
            hint = "open it in a spreadsheet program and save it again"
            return self.error("the workbook has formulas whose values were not saved", hint=hint)
        return self.error(
            "the cell is empty" if cell == "" else "this is no finite number, or one beyond every rig",
            line=line,
            column=column,
            found=f'"{cell}"{also}',
            expected=f"a number such as 12{self.numerals.decimal}5",
        )

    def holds_numbers(self, index: int) -> bool:
        """Return True if a column begins with a number."""
        return holds_number(next(self.rows(), (0, ()))[1], index)

    def texts(self, index: int, count: int | None = None) -> list[str]:
        """Read the texts of a column.

        Args:
            index: of the column.
            count: number of rows; default all.

        Returns:
            Texts, (n,); an empty cell, such as a merged one, has the text of the cell above.
        """
        column: Iterator[str | float] = (cells[index] if index < len(cells) else "" for _, cells in self.rows())
        if count is None and index in self.large_texts:
            column = iter(self.large_texts[index])
        texts, last = [], ""
        for cell in islice(column, count):
            last = (cell.strip(" #") if isinstance(cell, str) else f"{cell:.12g}") or last
            texts.append(last)
        return texts

    @cached_property
    def large_texts(self) -> Mapping[int, Sequence[str]]:
        """Texts of all columns without a role in a large text whose rows all are data, by index; else empty."""
        if not isinstance(self.source, Text) or len(self.source.data) < _LARGE or self.selected is not None:
            return {}
        first = [str(cell) for cell in next(self.rows(), (0, ()))[1]]
        if len(first) != len(self.headers) or not self.needed or self.needed & self.clocks:
            return {}
        if self.source.columns(self.layout, first, dict.fromkeys(self.needed, 1.0), self.numerals) is None:
            return {}
        free = sorted(set(range(len(first))) - {column.index for column in self.roles.values()})
        return (self.source.texts(self.layout, free) if free else None) or {}

    def error(
        self,
        problem: str,
        *,
        line: int | None = None,
        column: Column | None = None,
        kind: type[MeasurementError] = MeasurementError,
        **details: Any,
    ) -> MeasurementError:
        """Create an error with its place.

        Args:
            problem: in one clause.
            line: line number.
            column: column of the cell.
            kind: class of the error.
            details: found, expected and hint.
        """
        return kind(problem, file=self.file, place=self.place(line, column), **details)

    def header_error(self, problem: str, found: str | None = None, **details: Any) -> MeasurementError:
        """Create an error in the header.

        Args:
            problem: in one clause.
            found: default the cells of the header, if the file is understood as a table of numbers.
            details: further arguments of `error`.
        """
        if found is None and self.is_table:
            found = ", ".join(self.headers)
        found = found or f"{len(self.headers)} cell{'s' * (len(self.headers) != 1)}, without the name of a column"
        return self.error(problem, line=self.layout.header_line, found=found, **details)

    @property
    def is_table(self) -> bool:
        """True if the file is understood as a table of numbers; the text of any other file is not shown in errors."""
        rows = ([str(cell) for cell in cells] for _, cells in islice(self.rows(), _MOST_LISTED))
        return len(self.roles) > 1 or bool(self.layout.written) or any(map(is_row, rows))

    def place(self, line: int | None, column: Column | None) -> str | None:
        """Location in the file in words, as "line 3, column "Time [s]"".

        Args:
            line: line number, if it is known.
            column: if it is known.

        Returns:
            Sheet, line and column; None if all are unknown.
        """
        source = self.source
        parts = [
            f'{word_for_part(self.file)} "{source.sheet}"' if source.sheet else None,
            f"{'row' if source.sheet or isinstance(source, Channels) else 'line'} {line}" if line else None,
            f'column "{column.header}"' if column else None,
        ]
        return ", ".join(part for part in parts if part) or None

    @cached_property
    def numerals(self) -> Numerals:
        """Notation of the numbers in all columns with a role.

        Raises:
            MeasurementError: the numbers have two notations, or can be read in two ways.
        """
        layout, source = self.layout, self.source
        notations = self.possible_numerals()
        if layout.delimiter == "," and isinstance(source, Text) and not source.may_have_comma(layout):
            notations = tuple(way for way in notations if "," not in (way.decimal, way.thousands)) or notations
        evidence = weigh(self.number_texts(), notations)
        columns = {column.index: column for column in self.roles.values()}
        may_group = isinstance(source, Sheet) or source.may_group(layout, evidence.ways[0].decimal)
        if evidence.contrary is None and may_group:
            evidence = weigh(self.number_texts(), notations, all_cells=True)
        if evidence.contrary:
            (line, index), text = evidence.contrary
            raise self.error(
                "this number has another format than the others",
                line=line,
                column=columns[index],
                found=f'"{text}"',
                expected=f"numbers with a decimal {'comma' if evidence.ways[0].decimal == ',' else 'point'}",
                hint="correct this cell; or, if all numbers of the file are written so, state "
                'decimal = "..." and thousands = "..." in the campaign',
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

    def possible_numerals(self) -> tuple[Numerals, ...]:
        """Notations of numbers that the user leaves possible."""
        decimal, thousands = self.stated.decimal, self.stated.thousands
        fitting = (way for way in ALL_NUMERALS if decimal in (None, way.decimal))
        notations = tuple(way for way in fitting if thousands in (None, way.thousands or "none"))
        if not notations:
            raise self.error("decimal mark and thousands separator are the same", found=decimal, expected="two signs")
        return notations

    def number_texts(self) -> Iterator[tuple[Place, str]]:
        """Place and text of the cells of columns with a role, without those that the file stores as numbers."""
        indices = {column.index for column in self.roles.values()} - self.source.numeric - self.clocks
        for line, cells in self.rows() if indices else ():
            for index in indices:
                if index < len(cells) and isinstance(cell := cells[index], str):
                    yield (line, index), cell
