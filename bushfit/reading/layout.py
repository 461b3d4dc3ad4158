"""Where a table begins in its file, and what parts its columns.

The header is the line that names the columns a test must have, with rows of as many numbers below it.

Notes:
    tests/benchmarks/test_dialects_elsewhere.py compares this rule with csv.Sniffer, clevercsv, DuckDB and polars. Each
    left to itself, none of them reads half of the dialects; told the encoding and the decimal mark, clevercsv parts the
    columns of nearly all.
"""

import csv
import re
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

from bushfit import units
from bushfit.reading.headers import Vocabulary, split_convention
from bushfit.reading.numerals import is_like_number

#: Delimiters by their names in a campaign, in the order in which they are tried.
DELIMITERS = {"semicolon": ";", "tab": "\t", "pipe": "|", "comma": ",", "blanks": " "}
#: Filled lines at the start of a file within which its header lies; chosen: far more than preambles have.
MOST_HEAD_LINES = 500
#: Columns of a table; chosen: far more than a test has.
_MOST_COLUMNS = 1000
#: Characters of a line; chosen: a longer one is no row of a table.
_LONGEST_LINE = 1 << 20
#: Characters of a header's line; chosen: ten for each of the most columns.
_LONGEST_HEADER = 10_000
#: Filled lines below a header that may hold its units row and first numbers; chosen: room for comments there.
_LINES_BELOW_HEADER = 8
#: Signs with which a comment begins.
_COMMENT_SIGNS = ("#", "%", "//")
#: A number that a # marks as such: "#1".
_NUMBERED = re.compile(r"#\s?\d+\b")
#: Blanks between a name and the bracket of its unit, which part no columns.
_BLANK_BEFORE_BRACKET = re.compile(r"\s+(?=[\[(])")
#: What parts columns of which the headers have single blanks.
_COLUMN_GAP = re.compile(r"\t|\s{2,}")

#: A line of a text, or the cells of a workbook's row: texts and numbers.
Content = str | Sequence[str | float]


class Line(NamedTuple):
    """A line of a file that holds something: its number from 1, and what it holds."""

    number: int
    content: Content


@dataclass(frozen=True, kw_only=True)
class FileFormat:
    """What a user states of a file's format; None where the file itself settles it.

    Args:
        encoding: by Python's name, such as "cp1252".
        delimiter: what parts the cells.
        decimal: mark in the numbers.
        thousands: mark in the numbers.
        header_line: line of the column names, from 1; of a workbook its row.
        sheet: of a workbook.
    """

    encoding: str | None = None
    delimiter: Literal["comma", "semicolon", "tab", "pipe", "blanks"] | None = None
    decimal: Literal[".", ","] | None = None
    thousands: Literal[".", ",", " ", "'", "none"] | None = None
    header_line: int | None = None
    sheet: str | None = None


@dataclass(frozen=True)
class Layout:
    """Where a table lies in its file; lines count from 1.

    Args:
        delimiter: what parts the cells; " " for runs of blanks; "" where cells come apart by themselves.
        headers, header_line: cells and line of the header.
        units, units_line: cells of the units row, "" where a column has none, and its line; None where there is none.
        written: cells of the header of a wide table that name a quantity, of which `headers` are those of the long one.
        numbered: whether all rows begin with a number behind a # ("#1"), which then begins no comment.
    """

    delimiter: str
    headers: tuple[str, ...]
    header_line: int
    units: tuple[str, ...]
    units_line: int | None
    written: tuple[str, ...] = ()
    numbered: bool = False

    @property
    def lines_before_data(self) -> int:
        """Lines down to the header and its units row."""
        return self.units_line or self.header_line


def split(content: Content, delimiter: str) -> list[str]:
    """The cells of a line, without blanks around them.

    Raises:
        csv.Error: a line or a quoted cell that is far too long.
    """
    if not isinstance(content, str):
        return [cell if isinstance(cell, str) else repr(cell) for cell in content]
    if len(content) > _LONGEST_LINE:
        raise csv.Error(f"a line of {len(content)} characters")
    if delimiter == " ":
        return content.split()
    if '"' in content:
        return [cell.strip() for cell in next(csv.reader([content], delimiter=delimiter, skipinitialspace=True), ())]
    return [cell.strip() for cell in content.split(delimiter)]


def is_comment(content: Content, delimiter: str) -> bool:
    """Whether a line is a comment; a semicolon begins one where it does not part columns."""
    text = content if isinstance(content, str) else next((str(cell) for cell in content if cell != ""), "")
    return text.lstrip().startswith(_COMMENT_SIGNS if delimiter == ";" else (*_COMMENT_SIGNS, ";"))


def fits(cells: Sequence[str | float], width: int) -> bool:
    """Whether a row has as many cells as the header; empty ones may follow."""
    return len(cells) == width or (len(cells) > width and all(cell == "" for cell in cells[width:]))


def find_layout(
    lines: Sequence[Line], vocabulary: Vocabulary, *, delimiter: str | None = None, header_line: int | None = None
) -> Layout:
    """Find the header of a table: the line that names most columns of a test and has rows of as many cells below it.

    A comment is taken for the header only where no other line names two columns. Where no line at all does, the line
    above the first rows of numbers is taken, or else the first line, so that an error can show it.

    `delimiter` ("" for a workbook) and the number `header_line` are those that are stated.
    """
    if not lines:
        return Layout(delimiter or ",", (), 1, (), None)
    end, delimiters = _first_rows(lines, tuple(DELIMITERS.values()) if delimiter is None else (delimiter,))
    before = [index for index in range(end) if header_line in (None, lines[index].number)]
    if header_line is not None and not before:
        before = [index for index, line in enumerate(lines) if line.number == header_line]
    for commented in (False, True):
        candidates = _candidates(lines, before, delimiters, vocabulary, commented)
        if found := max(candidates, key=lambda entry: entry[0], default=None):
            return _layout(lines, *found[1:])
    return _layout(lines, *_likeliest(lines, before, end, delimiters))


def _candidates(
    lines: Sequence[Line], before: Sequence[int], delimiters: Sequence[str], vocabulary: Vocabulary, commented: bool
) -> Iterator[tuple[tuple[int, ...], int, str, list[str]]]:
    """Rank, index, delimiter and cells of each line that names two columns or more."""
    for index in before:
        for order, delimiter in enumerate(delimiters):
            content = lines[index].content
            if is_comment(content, delimiter) != commented:
                continue
            if commented and isinstance(content, str):
                content = content.lstrip().lstrip("#%/ " if delimiter == ";" else "#%/; ")
            for cells in _header_cells(content, delimiter):
                roles = vocabulary.roles(cells)
                if len(roles) > 1 and not any(is_like_number(cell) for cell in cells):
                    below = (split(line.content, delimiter) for line in _below(lines, index, delimiter))
                    followed = next((fits(row, len(cells)) for row in below if _is_row(row)), False)
                    yield (followed, len(roles), index, -order), index, delimiter, cells


def _header_cells(content: Content, delimiter: str) -> Iterator[list[str]]:
    """The cells of a header, without empty ones at its end, for each way to take it apart."""
    if len(content) > _LONGEST_HEADER:
        return
    ways = [split(content, delimiter)]
    if delimiter == " " and isinstance(content, str):
        ways = [_COLUMN_GAP.split(content.strip()), split(_BLANK_BEFORE_BRACKET.sub("", content), delimiter)]
    for cells in ways:
        while cells and not cells[-1]:
            cells.pop()
        if 1 < len(cells) <= _MOST_COLUMNS:
            yield cells


def _below(lines: Sequence[Line], header: int, delimiter: str) -> Iterator[Line]:
    """The lines just below a header that are no comments."""
    below = lines[header + 1 : header + 1 + _LINES_BELOW_HEADER]
    return (line for line in below if not is_comment(line.content, delimiter))


def _is_row(cells: Sequence[str]) -> bool:
    """Whether two cells or more, and no fewer than half of them, hold numbers."""
    numbers = sum(is_like_number(cell) for cell in cells[:_MOST_COLUMNS])
    return numbers > 1 and 2 * numbers >= len(cells)


def _first_rows(lines: Sequence[Line], delimiters: Sequence[str]) -> tuple[int, Sequence[str]]:
    """Index of the first of three rows of numbers in a row, and what parts them; else the number of lines, and all."""
    last = deque[int](maxlen=3)
    for index in (index for index, line in enumerate(lines) if not is_comment(line.content, ";")):
        last.append(index)
        three = [lines[place].content for place in last]
        parting = [mark for mark in delimiters if all(_is_row(split(content, mark)) for content in reversed(three))]
        if len(three) == 3 and parting:
            return last[0], parting
    return len(lines), delimiters


def _likeliest(
    lines: Sequence[Line], before: Sequence[int], end: int, delimiters: Sequence[str]
) -> tuple[int, str, list[str]]:
    """Index, delimiter and cells of the line that is likeliest meant as the header, where none names the columns.

    That is the last above the first row of numbers with as many cells, or else that row; without rows, the first line.
    """
    if end == len(lines):
        first = next(iter(before), 0)
        content = lines[first].content
        delimiter = max(delimiters, key=lambda mark: len(split(content, mark)) if mark != " " else 0)
        return first, delimiter, split(content, delimiter)
    rows = [(mark, split(lines[end].content, mark)) for mark in delimiters]
    rows = [(mark, cells) for mark, cells in rows if len(cells) > 1 and all(map(is_like_number, cells))] or rows
    for delimiter, row in rows:
        for index in reversed(before):
            cells = split(lines[index].content, delimiter)
            if fits(row, len(cells)) and not _is_units_row([cell.strip("[]() ") for cell in cells]):
                return index, delimiter, cells
    delimiter, row = max(rows, key=lambda entry: len(entry[1]))
    return end, delimiter, row


def _layout(lines: Sequence[Line], index: int, delimiter: str, headers: Sequence[str]) -> Layout:
    """The layout of a header, with the units row that may follow it; this may lack empty cells at its end."""
    units_line, row = None, ("",) * len(headers)
    if line := next(_below(lines, index, delimiter), None):
        cells = [cell.strip("[]() ") for cell in split(line.content, delimiter)]
        if (len(cells) < len(headers) or fits(cells, len(headers))) and _is_units_row(cells):
            units_line, row = line.number, tuple([*cells, *row][: len(headers)])
    below = [line.content for line in lines[index + 1 :] if line.number != units_line]
    numbered = bool(below) and all(
        _NUMBERED.match(next(filter(None, split(content, delimiter)), "")) for content in below
    )
    return Layout(delimiter, tuple(headers), lines[index].number, row, units_line, numbered=numbered)


def _is_units_row(cells: Sequence[str]) -> bool:
    """Whether no cell is a number and half of the filled cells or more are units; a ratio may have the unit "1"."""
    filled = [split_convention(cell)[0] for cell in cells if cell]
    has_numbers = any(is_like_number(cell) and cell != "1" for cell in filled)
    return not has_numbers and 0 < len(filled) <= 2 * sum(units.is_unit(cell) for cell in filled)
