"""Cells of a table: rows of data, rows that are left out, notation of numbers, and errors with a place."""

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bushfit.errors import MeasurementError
from bushfit.reading.headers import WORDS, Column
from bushfit.reading.instruments import word_for_part
from bushfit.reading.layout import Layout, is_comment, is_row, is_summary_row
from bushfit.reading.measurement import Floats
from bushfit.reading.numerals import ALL_NUMERALS, Numerals, Place, consistent_notations, is_like_number
from bushfit.reading.parts import OpenedFile
from bushfit.reading.source import Channels, RowSource, Sheet, Text, cells_of
from bushfit.reading.times import clock

#: Largest ratio of left-out rows that look like data to rows of data; chosen: with more, the meaning is in doubt.
_MOST_LEFT_OUT = 0.1
#: Number of first rows that are examined; chosen: a long record need not be read completely.
_FIRST = 1000
#: Largest number of rows of texts between the units and the first numbers.
_MOST_TEXT_ROWS = 8
#: Largest number of lines that a note lists.
_MOST_LISTED = 4
#: Rows with an unknown word instead of a number that are always left out; chosen: a mean, a deviation, a range.
_MOST_WORDS = 3
#: Placeholders for a missing value.
_MISSING = frozenset(WORDS["rows_of"]["missing"])

#: Line number and cells of a row of a table.
Row = tuple[int, Sequence[str | float]]
#: Line number and cells of a row that is not data, and the reason, see `Cells.fault`.
FaultyRow = tuple[int, Sequence[str | float], str]


@dataclass(frozen=True, eq=False)
class Cells:
    """Header and rows of a table as in its file, before conversion to numbers.

    Args:
        opened: test file, with its format as the user states it.
        source: part of the file that contains the table.
        layout: location of the table, with its headers, units row and delimiter.
        roles: recognised columns, by role such as "force".
        selected: positions of the rows of the test among those of `all_rows`, from 0; None for all.
        needed: indices of columns that must contain a number; a row without one is not a row of data.
        clocks: indices of columns that contain times as texts, such as 20:07:10.
        marks: cell that marks a missing value, such as -9999, by index of its column; all copies of a table share it.
    """

    opened: OpenedFile
    source: RowSource
    layout: Layout
    roles: Mapping[str, Column] = field(default_factory=dict, kw_only=True)
    selected: frozenset[int] | None = field(default=None, kw_only=True)
    needed: frozenset[int] = field(default=frozenset(), kw_only=True)
    clocks: frozenset[int] = field(default=frozenset(), kw_only=True)
    marks: dict[int, str | float] = field(default_factory=dict, kw_only=True)

    @property
    def file(self) -> Path:
        """Path of the test file."""
        return self.opened.file

    @property
    def headers(self) -> tuple[str, ...]:
        """Texts of the header cells of the table."""
        return self.layout.headers

    def blocks(self) -> Iterator[RowSource]:
        """Yield the rows of the table in blocks to be read one by one; a single block for selected rows."""
        if isinstance(self.source, Text) and self.selected is None:
            return self.source.blocks(self.layout.lines_before_data)
        return iter([self.source])

    def rows(self, block: RowSource | None = None, left_out: list[FaultyRow] | None = None) -> Iterator[Row]:
        """Yield the line number and the cells of each row of data; other rows, such as remarks and means, are left out.

        Args:
            block: block of the source; default the whole source.
            left_out: list to which the other rows are added.

        Raises:
            MeasurementError: a line or a quoted cell is far too long.
        """
        for position, (line, cells, fault) in enumerate(self.all_rows(block)):
            if fault is not None and left_out is not None:
                left_out.append((line, cells, fault))
            if fault is None and (self.selected is None or position in self.selected):
                yield line, cells

    @cached_property
    def first_row(self) -> Sequence[str | float]:
        """Cells of the first row of data in the table, with numbers if there is one; empty cells without rows."""
        rows = [cells for _, cells in islice(self.rows(), _MOST_TEXT_ROWS)] or [[""] * len(self.headers)]
        return next((row for row in rows if is_row(list(map(str, row)))), rows[0])

    @cached_property
    def first_rows(self) -> list[Sequence[str | float]]:
        """Cells of each of the first thousand rows of data; one row of empty cells if there are none."""
        return [cells for _, cells in islice(self.rows(), _FIRST)] or [[""] * len(self.headers)]

    def all_rows(self, block: RowSource | None = None) -> Iterator[tuple[int, Sequence[str | float], str | None]]:
        """Yield line number, cells and fault of each non-empty row below the header, whether it is data or not.

        Args:
            block: block of the source; default the whole source.

        Yields:
            Line number, cells, and the reason why the row is not data (see `fault`); None for a row of data.
        """
        try:
            for line in (block or self.source).lines(self.layout.lines_before_data):
                if self.layout.numbered or not is_comment(line.content, self.layout.delimiter):
                    cells = cells_of(line, self.layout.delimiter)
                    if any(cell != "" for cell in cells):
                        cells = [*cells, *[""] * (len(self.headers) - len(cells))]
                        yield line.number, cells, self.fault(cells)
        except csv.Error as error:
            raise self.error("the table cannot be read", found=str(error)) from error

    def fault(self, cells: Sequence[str | float]) -> str | None:
        """Find the reason why a row is not data.

        Returns:
            "other" for what is clearly not data, such as a remark or a mean; "missing" for a placeholder such as NaN
            instead of a number; "word" for another word instead of a number; "doubtful" for a row that looks like data
            but cannot be read; None for a row of data.
        """
        texts = [str(cell) for cell in cells]
        if is_summary_row(texts):
            return "other"
        if any(texts[len(self.headers) :]):
            return "doubtful" if is_row(texts) else "other"
        if self.layout.delimiter == " " and not texts[-1] and is_row(texts):
            return "doubtful"  # a cell is missing, and all behind it are displaced
        for index in self.needed:
            if self.marks and cells[index] == self.marks.get(index):
                return "missing"
            if isinstance(cells[index], str) and not is_like_number(texts[index]):
                if index in self.clocks and clock(texts[index]) is not None:
                    continue
                if index in self.clocks or not any(map(is_like_number, texts)):
                    return "other"
                if not any(is_like_number(texts[number]) for number in self.needed):
                    return "other"
                word = texts[index].lower().strip("#*!?-./ ")
                is_word = texts[index] and not any(sign.isdigit() for sign in word)
                return "doubtful" if not is_word else "missing" if word in _MISSING else "word"
        return None

    @cached_property
    def first_decimal(self) -> str | None:
        """Decimal mark of the first thousand numbers; None if they leave it open."""
        ways = consistent_notations(islice(self.number_texts(), _FIRST), self.possible_numerals()).ways
        return ways[0].decimal if len({way.decimal for way in ways}) == 1 else None

    def parse(self, block: RowSource, indices: frozenset[int]) -> Mapping[int, Floats] | None:
        """Read columns of a block at once, in units of the file.

        Args:
            block: block of the source.
            indices: indices of the columns.

        Returns:
            Numbers by column index, (n,) each; None if the block has to be read row by row, because it has rows without
            data or numbers in another notation.

        Notes:
            All columns that begin with a number are parsed as numbers: a summary row such as "Mean" then fails, as it
            must. Texts in front of these columns are searched for such words.
        """
        if self.selected is not None or not indices.isdisjoint((*self.clocks, *self.marks)):
            return None
        if isinstance(block, Channels) and block.numeric >= indices:
            return {index: block.arrays[index] for index in indices}
        first = list(map(str, self.first_row))
        if not isinstance(block, Text) or not indices or len(first) != len(self.headers) or self.first_decimal is None:
            return None
        notation = Numerals(self.first_decimal)
        numeric = [index for index, cell in enumerate(first) if notation.allows(cell)]
        if not indices <= {*numeric}:
            return None  # pandas takes TRUE for 1
        frame = block.frame(self.layout, dict.fromkeys(numeric, float), len(first), notation.decimal)
        words = block.first_words(self.layout.delimiter) if numeric[0] else ()
        if frame is None or any(is_summary_row([word]) for word in words):
            return None
        return {index: frame[index].to_numpy() for index in indices}

    def texts(self, block: RowSource, indices: Sequence[int]) -> Iterator[tuple[NDArray[Any], NDArray[Any]]]:
        """Find the distinct cells of columns, texts or numbers, in a block of rows.

        Yields:
            For each column, the index among its distinct cells of each of the n rows of data, (n,), and these cells.
        """
        import pandas as pd

        if isinstance(block, Text) and self.layout.delimiter != " " and not self.marks and b'"' not in block.data:
            is_clean, types = self.parse(block, self.needed) is not None, dict.fromkeys(indices, "category")
            frame = block.frame(self.layout, types, len(self.headers), ".") if is_clean else None
            if frame is not None:
                yield from (frame[index].factorize() for index in indices)
                return
        rows = [row for _, row in self.rows(block)]
        yield from (pd.factorize(np.array([row[index] for row in rows], dtype=object)) for index in indices)

    def note_left_out(self, rows: Sequence[FaultyRow], count: int) -> Iterator[str]:
        """Describe rows that are left out because they are not data, except headers and units that are repeated.

        Args:
            rows: the rows that are left out.
            count: number of rows of data.

        Yields:
            One sentence if there are such rows.

        Raises:
            MeasurementError: so many of these rows look like data that the meaning of the table is in doubt.
        """
        left_out = [row for row in rows if not self.layout.is_repeated([str(cell) for cell in row[1]])]
        in_doubt = [row for row in left_out if row[2] in ("doubtful", "word")]
        is_much = len(in_doubt) > _MOST_WORDS or sum(fault == "doubtful" for *_, fault in in_doubt) > 1
        if is_much and len(in_doubt) > _MOST_LEFT_OUT * count:
            raise self.bad_row(*in_doubt[0][:2], len(in_doubt))
        if left_out:
            listed = [
                f"{'row' if isinstance(self.source, Sheet) else 'line'} {line} "
                f"({', '.join(str(cell) for cell in cells if cell != '')[:40]})"
                for line, cells, _ in left_out[:_MOST_LISTED]
            ]
            more = ", ..." if len(left_out) > _MOST_LISTED else ""
            yield f"{len(left_out)} row{'s' * (len(left_out) > 1)} left out, without data: {', '.join(listed)}{more}"

    def bad_row(
        self, line: int, cells: Sequence[str | float], count: int = 1, column: Column | None = None
    ) -> MeasurementError:
        """Return the error for a row that does not match the header, or has a cell that is not a number.

        Args:
            line: line number of the row.
            cells: cells of the row.
            count: number of such rows in the table.
            column: column of the bad cell; by default, the first needed column without a number.
        """
        also = f", and {count - 1} more such rows" if count > 1 else ""
        needed = [column for column in self.roles.values() if column.index in self.needed]
        bad = (one for one in needed if isinstance(cells[one.index], str) and not is_like_number(str(cells[one.index])))
        column = column or next(bad, None)
        if column is None or len(cells) > len(self.headers) or (self.layout.delimiter == " " and cells[-1] == ""):
            commas = self.layout.delimiter == "," and not any("." in str(cell) for cell in cells)
            filled = next((n for n in range(len(cells), 0, -1) if cells[n - 1] != ""), 0)
            return self.error(
                "the row does not match the header",
                line=line,
                found=f"{filled} cell{'s' * (filled != 1)}{also}",
                expected=f"{len(self.headers)} cells",
                hint="separate the columns by semicolons if numbers have a decimal comma" if commas else None,
            )
        cell = cells[column.index]
        if cell == "" and isinstance(self.source, Sheet) and self.source.lacks_values():
            hint = "open it in a spreadsheet program and save it again"
            return self.error("the workbook has formulas whose values were not saved", hint=hint)
        return self.error(
            "the cell is empty" if cell == "" else "this is not a finite number, or beyond the range of every rig",
            line=line,
            column=column,
            found=f'"{cell}"{also}',
            expected=f"a number such as 12{self.numerals.decimal}5",
        )

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
        """Return an error for the header line; if the file is a table, `found` is by default the header cells."""
        if found is None and self.is_table:
            found = ", ".join(self.headers)
        found = found or f"{len(self.headers)} cell{'s' * (len(self.headers) != 1)}, without the name of a column"
        return self.error(problem, line=self.layout.header_line, found=found, **details)

    @property
    def is_table(self) -> bool:
        """True if the file is a table of numbers; errors do not quote the text of any other file."""
        return len(self.roles) > 1 or any(
            is_row(list(map(str, cells))) for _, cells in islice(self.rows(), _MOST_LISTED)
        )

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

    @cached_property
    def numerals(self) -> Numerals:
        """Notation of the numbers in the columns whose quantity is known.

        Raises:
            MeasurementError: the numbers have two notations, or can be read in two ways.
        """
        notations = self.possible_numerals()
        if isinstance(self.source, Text):
            absent = [sign for sign in ",. '" if not self.source.may_contain(sign, self.layout)]
            decimal = "," if self.layout.delimiter == "," and "," in absent else ""  # is not the decimal mark
            possible = (way for way in notations if way.thousands not in absent and way.decimal != decimal)
            notations = tuple(possible) or notations
        evidence = consistent_notations(self.number_texts(), notations)
        if not evidence.is_contrary and any(way.thousands for way in evidence.ways):
            evidence = consistent_notations(self.number_texts(), notations, all_cells=True)
        usual = evidence.ways[0]
        if evidence.question is None:
            return usual
        (line, index), text = evidence.question
        if evidence.is_contrary:
            problem, found = "this number has another format than the others", f'"{text}"'
            expected = f"numbers with a decimal {'comma' if usual.decimal == ',' else 'point'}"
            hint = "correct this cell; or, if all numbers of the file are written so, state "
            hint += 'decimal = "..." and thousands = "..." in the campaign'
        else:
            problem = "this number can be read in two ways"
            found = f'"{text}", and no number in the file that settles it'
            expected = " or ".join(dict.fromkeys(f"{way.value(text) or 0.0:.15g}" for way in evidence.ways))
            hint = 'state decimal = "." or decimal = "," in the campaign'
        column = next(column for column in self.roles.values() if column.index == index)
        raise self.error(problem, line=line, column=column, found=found, expected=expected, hint=hint)

    def possible_numerals(self) -> tuple[Numerals, ...]:
        """Return the notations of numbers that agree with the decimal mark and thousands separator the user states."""
        decimal, thousands = self.opened.stated.decimal, self.opened.stated.thousands
        fitting = (way for way in ALL_NUMERALS if decimal in (None, way.decimal))
        notations = tuple(way for way in fitting if thousands in (None, way.thousands or "none"))
        if not notations:
            raise self.error("decimal mark and thousands separator are the same", found=decimal, expected="two signs")
        return notations

    def number_texts(self) -> Iterator[tuple[Place, str]]:
        """Yield location and text of each cell in columns of known quantity, unless the file stores it as a number."""
        indices = {column.index for column in self.roles.values()} - self.source.numeric - self.clocks
        for line, cells in self.rows() if indices else ():
            for index in indices:
                if isinstance(cell := cells[index], str):
                    yield (line, index), cell
