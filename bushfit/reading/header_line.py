"""Search for the header of a table, and for the delimiter of its columns.

The header is the line that names the columns of a test and is followed by rows with as many numbers.

Notes:
    csv.Sniffer, clevercsv, DuckDB and polars, without further information, read fewer than half of the dialects in
    tests/files/exports. If encoding and decimal mark are known, clevercsv separates the columns of nearly all.
"""

import re
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product

from bushfit.caveat import Caveat
from bushfit.reading.headers import WORDS, Vocabulary, plain
from bushfit.reading.layout import DELIMITERS, Layout, are_units_of, describe_table, lines_below, listed_names
from bushfit.reading.lines import MOST_COLUMNS, Content, Line, is_comment, is_row, is_units_row, split
from bushfit.reading.numerals import is_like_number
from bushfit.reading.roles import is_test, is_unit_alone

#: Largest number of columns whose units are looked up to find the header; chosen: a test has fewer.
_MOST_HEADINGS = 50
#: Largest number of characters of a header line; chosen: ten for each column.
_LONGEST_HEADER = 10_000
#: Blanks between a name and the bracket of its unit, which do not separate columns.
_BLANK_BEFORE_BRACKET = re.compile(r" {1,8}(?=[\[(])")
#: Wide gap, which is shortened to two blanks; and gap between columns whose headers contain single blanks.
_WIDE_GAP, _COLUMN_GAP = re.compile(" {3,}"), re.compile(r" *\t *|\s{2,}")
#: Names of the types of columns, in rows that programs write above or below the names; and what separates them.
_TYPES, _SEPARATORS = frozenset(map(plain, ("", *WORDS["rows_of"]["types"]))), re.compile(r"[\s;,|]+")
#: Letter, which each name of a column has.
_LETTER = re.compile(r"[^\W\d_]")


def find_layout(
    lines: Sequence[Line], vocabulary: Vocabulary, delimiter: str | None = None, header_line: int | None = None
) -> Layout:
    """Find the header of a table: the line that names most columns of a test and is followed by rows of equal length.

    A comment is used as the header only if no other line names two columns. If no line names two columns, the header is
    the line above the first rows of numbers, or else the first line.

    Args:
        lines: non-empty lines at the start of the file.
        vocabulary: known column names, by which a header has a role such as "force".
        delimiter: character between cells; "" for a sheet; None to detect it.
        header_line: line number of the header, if the user states it.

    Returns:
        Layout of the table; its headers are empty if there are no lines.
    """
    lines = [line for line in lines if not _TYPES.issuperset(map(plain, _SEPARATORS.split(line.text)))]
    if not lines:
        return Layout(delimiter or ",", (), 1, (), None)
    end, delimiters = _first_rows(lines, tuple(DELIMITERS.values()) if delimiter is None else (delimiter,))
    before = range(end) if header_line is None else [n for n, line in enumerate(lines) if line.number == header_line]
    candidates = list(_candidates(lines, before, delimiters, vocabulary))
    if header_line is None and not any(is_test(vocabulary.roles(cells)) for *_, cells in candidates):
        below = _candidates(lines, range(end, len(lines)), delimiters, vocabulary)
        tests = (one for one in below if one[0][1] and is_test(vocabulary.roles(one[3])))
        for _, index, delimiter, headers in tests:
            layout = describe_table(lines, vocabulary, index, delimiter, headers)
            sentence = f"lines {lines[0].number} to {lines[index].number - 1} contain another table, which is left out"
            note = Caveat("other_table", sentence)
            return replace(layout, notes=(*layout.notes, note))
    best = max(candidates, key=lambda candidate: candidate[0], default=None)
    if best is None:
        rows = [split(line.content, mark) for line in lines[end : end + 1] for mark in delimiters]
        if header_line is None and (listed := listed_names(lines[:end], rows, vocabulary)):
            layout = describe_table(lines, vocabulary, listed[0], delimiters[listed[1]], listed[2])
            return replace(layout, described_line=lines[end - 1].number)
        return describe_table(lines, vocabulary, *_likeliest(lines, before, end, delimiters))
    # the same header above a block of one or two rows is the first
    _, last, delimiter, headers = best
    roles = vocabulary.roles(headers)
    for _, index, mark, cells in candidates:
        is_same = mark == delimiter and len(cells) == len(headers) and vocabulary.roles(cells) == roles
        if is_same and any(is_row(split(line.content, delimiter)) for line in lines[index + 1 : last]):
            return describe_table(lines, vocabulary, index, delimiter, cells)
    return describe_table(lines, vocabulary, last, delimiter, headers)


def _candidates(
    lines: Sequence[Line], before: Sequence[int], delimiters: Sequence[str], vocabulary: Vocabulary
) -> Iterator[tuple[tuple[int, ...], int, str, list[str]]]:
    """Yield the lines that may be the header: those that name two columns or more.

    Args:
        lines: non-empty lines at the start of the file.
        before: indices of lines that may be the header.
        delimiters: possible characters between cells.
        vocabulary: known column names, by which a header has a role such as "force".

    Yields:
        Rank for the choice among headers, index in `lines`, delimiter and header cells.
    """
    for index, (order, delimiter) in product(before, enumerate(delimiters)):
        content = lines[index].content
        if (is_note := is_comment(content, delimiter)) and isinstance(content, str):
            content = content.lstrip().lstrip("#%/ " if delimiter == ";" else "#%/; ")
        for cells in header_cells(content, delimiter):
            units_alone = [is_unit_alone(cell, vocabulary) for cell in cells[:_MOST_HEADINGS]]
            named_count = len(vocabulary.roles(cells)) + sum(units_alone)
            if named_count > 1 and not any(is_like_number(cell) for cell in cells):
                below = (split(line.content, delimiter) for line in lines_below(lines, index, delimiter))
                width = next((len(row) for row in below if is_row(row)), 0)
                shorter = delimiter != " " and len(cells) < 2 * width < 2 * len(cells)  # empty cells at the end
                followed = 2 if width == len(cells) else int(shorter)
                yield (not is_note, followed, named_count, index, -order), index, delimiter, cells


def header_cells(content: Content, delimiter: str) -> Iterator[list[str]]:
    """Split a header line into cells, in all plausible ways.

    Yields:
        Cells for one way to split the line, without empty cells at the end.
    """
    if isinstance(content, str) and len(content := content.rstrip(f" \t{delimiter}")) > _LONGEST_HEADER:
        return
    content = _WIDE_GAP.sub("  ", content) if isinstance(content, str) else content
    forms = [] if delimiter == " " and "\t" in content else [split(content, delimiter)]
    if delimiter == " " and isinstance(content, str):
        joined = [split(_BLANK_BEFORE_BRACKET.sub("", content), delimiter)] if forms else []
        forms = [_COLUMN_GAP.split(content.strip()), *joined, *forms]
    for cells in forms:
        while cells and not cells[-1]:
            cells.pop()
        if 1 < len(cells) <= MOST_COLUMNS:
            yield cells


def _first_rows(lines: Sequence[Line], delimiters: Sequence[str]) -> tuple[int, Sequence[str]]:
    """Index of the first of three consecutive rows of numbers, and the delimiters that split them into numbers.

    Without three rows of numbers: the number of lines, and all delimiters.
    """
    last = deque[int](maxlen=3)
    for index in (index for index, line in enumerate(lines) if not is_comment(line.content, ";")):
        last.append(index)
        three = [lines[place].content for place in last]
        marks = [mark for mark in delimiters if mark != " " or not all("\t" in content for content in three)]
        fitting = [mark for mark in marks if all(is_row(split(content, mark)) for content in reversed(three))]
        if len(three) == 3 and fitting:
            return last[0], fitting
    return len(lines), delimiters


def _likeliest(
    lines: Sequence[Line], before: Sequence[int], end: int, delimiters: Sequence[str]
) -> tuple[int, str, list[str]]:
    """Find the likeliest header if no line names the columns of a test.

    The header is the last line above the first row of numbers that has as many cells, or one more, or else that row
    itself; without rows of numbers, the first line.

    Args:
        lines: non-empty lines at the start of the file.
        before: indices of lines that may be the header.
        end: index of the first row of numbers.
        delimiters: possible characters between cells.

    Returns:
        Index of the header in `lines`, delimiter and header cells.
    """
    if end == len(lines):
        first = next(iter(before), 0)
        cells_of = {mark: split(lines[first].content, mark) for mark in delimiters}
        delimiter = max(delimiters, key=lambda mark: len(cells_of[mark]) if mark != " " else 0)
        return first, delimiter, cells_of[delimiter]
    rows = [(mark, split(lines[end].content, mark)) for mark in delimiters]
    rows = [(mark, cells) for mark, cells in rows if len(cells) > 1 and all(map(is_like_number, cells))] or rows
    ranked = list[tuple[int, bool, bool, int, str, list[str]]]()
    for (order, (delimiter, row)), index in product(enumerate(rows), before):
        cells, below = (split(line.content, delimiter) for line in lines[index : index + 2])
        # one more than numbers, because a comment may be empty; or more, if the row of units has as many
        most = len(row) if len(cells) == len(below) and are_units_of(cells, below) else 1
        if 0 <= len(cells) - len(row) <= most and not is_units_row(cells):
            is_named = all(map(_LETTER.search, filter(None, cells)))
            ranked.append((-order, is_named, is_units_row(below), index, delimiter, cells))
    return max(ranked)[3:] if ranked else (end, *max(rows, key=lambda entry: len(entry[1])))
