"""Lines of a table: their cells, and whether a line is a comment, a row of numbers, of units, or a summary."""

import csv
import re
from collections.abc import Iterator, Sequence
from itertools import accumulate
from typing import NamedTuple

from bushfit import units
from bushfit.reading.headers import WORDS, plain, split_convention
from bushfit.reading.numerals import EXPONENT, is_like_number

#: First words of rows that summarise others.
_SUMMARIES = frozenset(map(plain, WORDS["rows_of"]["summary"]))
#: Largest number of columns of a table; chosen: far more than a test has.
MOST_COLUMNS = 1000
#: Largest number of characters of a line; chosen: a longer line is not a row of a table.
LONGEST_LINE = 1 << 20
_DIGIT = re.compile(r"\d")
_COMMENT_SIGNS = ("#", "%", "//")
#: Blanks between columns of cells with units, such as "5 Hz 0.1 mm": not behind a number without its unit.
_BETWEEN_QUANTITIES = re.compile(r"(?<=[^\d\s])\s+|\s+(?=[+-]?\.?\d)")
#: Number with a unit: "594.4 N/mm", "±0,5mm", "5.7°". Possessive: an exponent belongs to the number, never to the unit.
WITH_UNIT = re.compile(
    rf"(?:±|\+/?-)?\s*(?P<number>[+-]?[\d.,]++(?:\s*+{EXPONENT})?+)\s*+(?P<unit>(?:[^\W\d]|[°%‰])[^;]{{0,20}})"
)

#: Cell of a line whose columns are separated by wide gaps.
_CELL = re.compile(r"\S+(?: \S+)*")
#: End of a row in a matrix of MATLAB.
_END_OF_MATRIX_ROW = re.compile(r"\s*;\s*(?:\.{3})?$")

#: A line of a text, or the cells of a row of a workbook: texts and numbers.
Content = str | Sequence[str | float]


class Line(NamedTuple):
    """Non-empty line of a text or row of a sheet: its number from 1, and its content."""

    number: int
    content: Content

    @property
    def text(self) -> str:
        """Text of the line; of a row, its cells separated by blanks."""
        return self.content.strip() if isinstance(self.content, str) else " ".join(map(str, self.content)).strip()


def split(content: Content, delimiter: str) -> list[str]:
    """Return the texts of the cells of a line, stripped of blanks and without empty cells at the end."""
    if not isinstance(content, str):
        return [cell if isinstance(cell, str) else repr(cell) for cell in content]
    if delimiter == "|" and content.lstrip().startswith("||"):
        content = "|" + content.strip().strip("|").replace("||", "|")  # a header as Jira writes it
    text = content.rstrip(f" {delimiter}")
    if delimiter == " ":
        text = _END_OF_MATRIX_ROW.sub("", text)
        cells, quantities = text.split(), _BETWEEN_QUANTITIES.split(text.strip())
        if len(quantities) < len(cells) and len(quantities) > 1:
            found = [match["unit"] for match in map(WITH_UNIT.fullmatch, quantities) if match]
            return quantities if len(found) > 1 and all(map(units.is_unit, found)) else cells
        return cells
    if '"' in text and len(text) < csv.field_size_limit():
        return [cell.strip() for cell in next(csv.reader([text], delimiter=delimiter, skipinitialspace=True), ())]
    return [cell.strip() for cell in text.split(delimiter, MOST_COLUMNS)]


def is_comment(content: Content, delimiter: str) -> bool:
    """Return True if a line begins with a comment sign: #, %, //, or a semicolon that is not the delimiter.

    A # in a cell of its own is the name or unit of a column that counts.
    """
    text = content if isinstance(content, str) else next((str(cell) for cell in content if cell != ""), "")
    begins = text.lstrip().startswith(_COMMENT_SIGNS if delimiter == ";" else (*_COMMENT_SIGNS, ";"))
    return begins and (delimiter == " " or split(content, delimiter)[0] != "#")


def is_row(cells: Sequence[str]) -> bool:
    """True if half of the non-empty cells, and at least two, are numbers, and the first cell is not a "name:"."""
    filled = [cell for cell in cells[:MOST_COLUMNS] if cell]
    numbers = sum(map(is_like_number, filled))
    return numbers > 1 and 2 * numbers >= len(filled) and not filled[0].endswith(":")


def is_units_row(cells: Sequence[str]) -> bool:
    """Return True if at least half of the non-empty cells are units and no cell is a number other than the unit 1."""
    filled = [split_convention(cell.strip("[]() "))[0] for cell in cells if cell.strip("[]() ")]
    has_numbers = any(is_like_number(cell) and cell != "1" for cell in filled)
    return not has_numbers and 0 < len(filled) <= 2 * sum(units.is_unit(cell) for cell in filled)


def is_summary_row(cells: Sequence[str]) -> bool:
    """Return True if the first text of a row is a word such as "Mean" or "Std", so that it summarises other rows."""
    first = next(filter(None, cells), "")
    return _DIGIT.search(first) is None and plain(first) in _SUMMARIES


def cells_below(header: str, row: str) -> list[str]:
    """Return the unit below each header ("" without one) in two lines, whose columns are aligned by blanks."""
    spans, cells = ([(*cell.span(), cell[0]) for cell in _CELL.finditer(line.expandtabs())] for line in (header, row))
    by_column = {
        max(range(len(spans)), key=lambda n: min(end, spans[n][1]) - max(start, spans[n][0])): text
        for start, end, text in cells
    }
    aligned = [by_column.get(n, "") for n in range(len(spans))]
    return aligned if len(by_column) == len(cells) < len(spans) else [text for *_, text in cells]


def fill_merged(cells: Sequence[str]) -> list[str]:
    """Fill each empty cell in a row of headers with the text of the nearest filled cell on its left."""
    merged: Iterator[str] = accumulate(cells, lambda before, cell: cell or before)
    return list(merged)
