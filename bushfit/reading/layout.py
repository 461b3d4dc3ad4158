"""Location of a table in its file: delimiter, header and units row.

The header is the line that names the columns of a test and is followed by rows with as many numbers.

Notes:
    csv.Sniffer, clevercsv, DuckDB and polars, without further information, read fewer than half of the dialects in
    tests/files/exports. If encoding and decimal mark are known, clevercsv separates the columns of nearly all.
"""

import re
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product, takewhile
from typing import Annotated, Literal

from pydantic import BeforeValidator

from bushfit.caveat import Caveat
from bushfit.reading.channel_lists import listed_names, scales_above
from bushfit.reading.headers import WORDS, Vocabulary, plain, plain_name, split_unit
from bushfit.reading.lines import MOST_COLUMNS, Content, Line, cells_below, is_comment, is_row, is_units_row, split
from bushfit.reading.numerals import is_like_number, plainest_value
from bushfit.reading.roles import UNIT_NAMES, X_UNIT_NAMES, is_test, is_unit_alone, stated_once
from bushfit.reading.times import parse_clock

#: Characters that separate columns, by their names in a campaign, in the order in which they are tried.
DELIMITERS = {"semicolon": ";", "tab": "\t", "pipe": "|", "comma": ",", "caret": "^", "blanks": " "}
#: Signs in numbers by the words for them.
SIGNS = {"point": ".", "comma": ",", "blank": " ", "apostrophe": "'"}
#: Validators that replace the word for a sign in numbers by the sign, and the sign of a delimiter by its word.
_SIGN = BeforeValidator(lambda raw: SIGNS.get(raw, raw) if isinstance(raw, str) else raw)
_WORD = BeforeValidator(lambda raw: next((word for word, sign in DELIMITERS.items() if sign == raw), raw))
#: Non-empty lines at the start of a file that are searched for the header; chosen: far more than preambles have.
MOST_HEAD_LINES = 500
#: Largest number of columns whose units are looked up to find the header; chosen: a test has fewer.
_MOST_HEADINGS = 50
#: Largest number of characters of a header line; chosen: ten for each column.
_LONGEST_HEADER = 10_000
#: Non-empty lines below a header that are searched for its units row and first numbers; chosen: room for comments.
_LINES_BELOW_HEADER = 8
#: Names of the rate and the step of the rows, and of their start.
STEPS = frozenset(map(plain, (*WORDS["above"]["sampling_rate"], *WORDS["above"]["sampling_interval"], "start")))
#: Names in the first cells of rows that describe the columns, such as "Unit" and "dx".
_DESCRIPTIONS = UNIT_NAMES | frozenset(map(plain, WORDS["rows_of"]["descriptions"]))
#: Letter, which each name of a column has; and a number with a number sign: "#1".
_LETTER, _NUMBERED = re.compile(r"[^\W\d_]"), re.compile(r"#\s?\d+\b")
#: Names of the types of columns, in rows that programs write above or below the names; and what separates them.
_TYPES, _SEPARATORS = frozenset(map(plain, ("", *WORDS["rows_of"]["types"]))), re.compile(r"[\s;,|]+")
#: Blanks between a name and the bracket of its unit, which do not separate columns.
_BLANK_BEFORE_BRACKET = re.compile(r" {1,8}(?=[\[(])")
#: Wide gap, which is shortened to two blanks; and gap between columns whose headers contain single blanks.
_WIDE_GAP, _COLUMN_GAP = re.compile(" {3,}"), re.compile(r" *\t *|\s{2,}")


@dataclass(frozen=True, kw_only=True)
class FileFormat:
    """Format of a test file as the user states it; None for a property that is to be detected.

    Args:
        encoding: Python's name of the text encoding, such as "cp1252".
        delimiter: name of the character between cells; a campaign may state the character itself.
        decimal: decimal mark of the numbers; a campaign may state the words "point" and "comma".
        thousands: thousands separator of the numbers.
        header_line: number of the line, or row of a workbook, with the column names, from 1.
        sheet: name of the sheet of a workbook, or of the group of channels of a recording.
    """

    encoding: str | None = None
    delimiter: Annotated[Literal["comma", "semicolon", "tab", "pipe", "caret", "blanks"] | None, _WORD] = None
    decimal: Annotated[Literal[".", ","] | None, _SIGN] = None
    thousands: Annotated[Literal[".", ",", " ", "'", "none"] | None, _SIGN] = None
    header_line: int | None = None
    sheet: str | None = None


@dataclass(frozen=True)
class Layout:
    """Location, delimiter, header and units of a table in its file; lines count from 1.

    Args:
        delimiter: character between cells; " " for runs of blanks; "" for a sheet, whose cells are separate already.
        headers: texts of the header cells; column numbers from 1 if the table has no header.
        header_line: number of the header line, or of the first row if the table has no header.
        units: units of the columns from the units row; "" for a column without one.
        units_line: number of the units row; None if there is none.
        written: original header cells of a wide table that name a quantity; `headers` belong to the long table.
        numbered: True if all rows begin with a number after a # ("#1"), so that # does not mark a comment.
        headerless: True if the table has no header.
        notes: warnings on columns that are left out or filled.
        levels: indices of columns, such as the amplitude, that are empty if they have the value of the row above.
        described_line: number of the last row below the header that describes the columns; 0 without such rows.
    """

    delimiter: str
    headers: tuple[str, ...]
    header_line: int
    units: tuple[str, ...]
    units_line: int | None
    written: tuple[str, ...] = ()
    numbered: bool = False
    headerless: bool = False
    notes: tuple[Caveat, ...] = ()
    levels: frozenset[int] = frozenset()
    described_line: int = 0

    @property
    def lines_before_data(self) -> int:
        """Number of the last line before the first row of data: its units row, or else its header."""
        return max(self.header_line - self.headerless, self.units_line or 0, self.described_line)

    def is_repeated(self, cells: Sequence[str]) -> bool:
        """True if a row repeats the header or the row of units, even if blanks in names split it differently."""
        text = plain("".join(cells))
        return text != "" and any(text == plain("".join(row)) for row in (self.headers, self.units))

    def is_header(self, cells: Sequence[str], vocabulary: Vocabulary) -> bool:
        """True if at least two cells of a row name columns of the table, with the same or other names and units."""
        names = {plain(split_unit(header)[0]) for header in self.headers} - {""}
        matching = names & {plain(split_unit(cell)[0]) for cell in cells}
        return max(len(matching), len(vocabulary.roles(cells) & vocabulary.roles(self.headers))) > 1


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
            layout = _layout(lines, vocabulary, index, delimiter, headers)
            sentence = f"lines {lines[0].number} to {lines[index].number - 1} contain another table, which is left out"
            note = Caveat("other_table", sentence)
            return replace(layout, notes=(*layout.notes, note))
    best = max(candidates, key=lambda candidate: candidate[0], default=None)
    if best is None:
        rows = [split(line.content, mark) for line in lines[end : end + 1] for mark in delimiters]
        if header_line is None and (listed := listed_names(lines[:end], rows, vocabulary)):
            layout = _layout(lines, vocabulary, listed[0], delimiters[listed[1]], listed[2])
            return replace(layout, described_line=lines[end - 1].number)
        return _layout(lines, vocabulary, *_likeliest(lines, before, end, delimiters))
    # the same header above a block of one or two rows is the first
    _, last, delimiter, headers = best
    roles = vocabulary.roles(headers)
    for _, index, mark, cells in candidates:
        is_same = mark == delimiter and len(cells) == len(headers) and vocabulary.roles(cells) == roles
        if is_same and any(is_row(split(line.content, delimiter)) for line in lines[index + 1 : last]):
            return _layout(lines, vocabulary, index, delimiter, cells)
    return _layout(lines, vocabulary, last, delimiter, headers)


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
                below = (split(line.content, delimiter) for line in _below(lines, index, delimiter))
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


def _below(lines: Sequence[Line], header: int, delimiter: str) -> Iterator[Line]:
    """Yield the first few lines below the header line with the index `header`, without comments."""
    below = lines[header + 1 : header + 1 + _LINES_BELOW_HEADER]
    return (line for line in below if not is_comment(line.content, delimiter))


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
        most = len(row) if len(cells) == len(below) and _are_units_of(cells, below) else 1
        if 0 <= len(cells) - len(row) <= most and not is_units_row(cells):
            is_named = all(map(_LETTER.search, filter(None, cells)))
            ranked.append((-order, is_named, is_units_row(below), index, delimiter, cells))
    return max(ranked)[3:] if ranked else (end, *max(rows, key=lambda entry: len(entry[1])))


def _layout(
    lines: Sequence[Line], vocabulary: Vocabulary, index: int, delimiter: str, headers: Sequence[str]
) -> Layout:
    """Layout of the table below a header, with its units row if there is one, and with columns that have no header.

    Args:
        lines: non-empty lines at the start of the file.
        vocabulary: known column names, by which a header has a role such as "force".
        index: index of the header in `lines`.
        delimiter: character between cells.
        headers: header cells.
    """
    number, width = lines[index].number, len(headers)
    if all(is_like_number(cell) or parse_clock(cell) is not None for cell in headers) and width > 1:
        names = tuple(str(column) for column in range(1, width + 1))
        return Layout(delimiter, names, number, ("",) * width, None, headerless=True)
    layout = Layout(delimiter, tuple(headers), number, ("",) * width, None)
    layout = _with_units(layout, lines, index, vocabulary)
    if scales := scales_above((split(line.content, delimiter) for line in lines[:index]), layout.headers):
        listed = ", ".join(f'"{layout.headers[n]}" {text}' for n, text in scales.items())
        note = Caveat("stated_unit", f"the lines above the table scale its columns: {listed}; offsets are left out")
        layout = replace(layout, units=tuple(scales.get(n, unit) for n, unit in enumerate(layout.units)), notes=(note,))
    rows = [split(line.content, delimiter) for line in lines[index + 1 :] if line.number > layout.lines_before_data]
    layout = _with_unnamed_columns(layout, rows[:_LINES_BELOW_HEADER])
    numbered = bool(rows) and all(_NUMBERED.match(next(filter(None, cells), "")) for cells in rows)
    if levels := stated_once(layout.headers, rows, vocabulary):
        filled = ", ".join(f'"{layout.headers[column]}"' for column in sorted(levels))
        note = Caveat("cells_filled", f"{filled}: an empty cell has the value of the cell above")
        layout = replace(layout, levels=levels, notes=(note, *layout.notes))
    return replace(layout, numbered=numbered)


def _descriptions(below: Sequence[Line], delimiter: str, width: int) -> list[Line]:
    """Find the rows that describe the columns, such as their types, between a header and its units or its first row.

    Args:
        below: first lines below the header.
        delimiter: character between cells.
        width: number of columns.

    Returns:
        Rows with names such as "Unit" and "dx" in the first cell; or else rows above the units that are not data, and a
        row that counts the columns.
    """

    def cells(line: Line) -> list[str]:
        return split(line.content, delimiter)

    def is_counted(line: Line) -> bool:
        numbers = [plainest_value(cell) for cell in cells(line)]
        return width > 2 and numbers == list(range(1, width + 1))

    named = [*takewhile(lambda line: (first := cells(line)[0]) != "" and not is_like_number(first), below)]
    if any(plain(split_unit(cells(line)[0])[0]) in _DESCRIPTIONS for line in named):
        return named
    before_rows = [*takewhile(lambda line: is_counted(line) or not is_row(cells(line)), below)]
    units_row = max((n for n, line in enumerate(before_rows) if is_units_row(cells(line))), default=0)
    return before_rows[:units_row] or [*takewhile(is_counted, before_rows)]


def _with_units(layout: Layout, lines: Sequence[Line], index: int, vocabulary: Vocabulary) -> Layout:
    """Add the units of the columns from a row that is labelled "Unit", or from a row of units next to the header.

    In a file of pandas with a header of two levels, the names of the first columns are in the row of the units.

    Args:
        layout: layout without units.
        lines: non-empty lines at the start of the file.
        index: index of the header in `lines`.
        vocabulary: known column names, by which a header has a role such as "force".
    """
    headers, empty, above = layout.headers, layout.units, lines[:index]
    below = list(_below(lines, index, layout.delimiter))
    descriptions = _descriptions(below, layout.delimiter, len(headers))
    layout = replace(layout, described_line=descriptions[-1].number if descriptions else 0)
    rows = [(line.number, split(line.content, layout.delimiter)) for line in (*descriptions, *reversed(above))]
    first = rows[len(descriptions) - 1][1][0] if descriptions else ""
    if plain(headers[0]) in _DESCRIPTIONS and (heading := vocabulary.heading(first)):  # below the names of the channels
        x_units = (cells[1] for _, cells in rows if len(cells) > 1 and plain(cells[0]) in X_UNIT_NAMES)
        headers = (f"{first} [{x_unit}]" if (x_unit := next(x_units, "")) and not heading.unit else first, *headers[1:])
        layout = replace(layout, headers=headers)
    for number, cells in rows:
        if 1 < len(cells) <= len(headers) and plain(cells[0]) in UNIT_NAMES and is_units_row(cells[1:]):
            return replace(layout, units_line=number, units=("", *cells[1:], *empty)[: len(headers)])
    directly_above = split(above[-1].content, layout.delimiter) if above else []
    if len(directly_above) == len(headers) and all(is_units_row([cell]) for cell in directly_above):
        return replace(layout, units=tuple(cell.strip("[]() ") for cell in directly_above))
    for line in (*descriptions[:1], *below[len(descriptions) :][:1]):
        cells = [cell.strip("[]() ") for cell in split(line.content, layout.delimiter)]
        if layout.delimiter == " " and isinstance(line.content, str):
            wide = [cell.strip("[]() ") for cell in cells_below(str(lines[index].content), line.content)]
            cells = wide if len(wide) == len(headers) else cells
        are_named = [vocabulary.heading(cell) is not None for cell in cells]
        if _are_units_of(headers, cells):
            return replace(layout, units_line=line.number, units=(*cells, *empty)[: len(headers)])
        if any(are_named) and are_named == [*map(bool, cells)] and not vocabulary.roles(headers[: len(cells)]):
            return replace(layout, units_line=line.number, headers=(*cells, *headers[len(cells) :]))
    return layout


def _are_units_of(headers: Sequence[str], cells: Sequence[str]) -> bool:
    """True if a row has the units of the columns with some headers; the cell below a step or rate may be its number."""
    others = [cell for header, cell in zip(headers, cells, strict=False) if plain_name(header) not in STEPS]
    return len(cells) <= len(headers) and is_units_row(others)


def _with_unnamed_columns(layout: Layout, below: Sequence[Sequence[str]]) -> Layout:
    """Add headers for columns that have none, such as the names of the rows that R writes first.

    Args:
        layout: layout with headers.
        below: cells of the first rows below the units.
    """
    headers, row = layout.headers, layout.units
    rows = [cells for cells in below if is_row(cells)]
    widths = {len(cells) for cells in rows}
    has_keyword = layout.described_line or plain(headers[0]) in _DESCRIPTIONS
    if has_keyword and widths == {len(headers) - 1}:  # the names of the descriptions have their own column
        return replace(layout, headers=headers[1:], units=row[1:])
    may_be_decimal = layout.delimiter == "," and not any("." in cell for cells in below for cell in cells)
    if len(widths) != 1 or not len(headers) < (width := widths.pop()) < 2 * len(headers) or may_be_decimal:
        return layout
    counts = [cells[0] for cells in rows]
    are_numbered = len(counts) > 2 and counts in [[str(n + start) for n in range(len(counts))] for start in (0, 1)]
    unnamed = ("",) * (width - len(headers))
    if are_numbered or not all(map(is_like_number, counts)):
        return replace(layout, headers=(*unnamed, *headers), units=(*unnamed, *row))
    return replace(layout, headers=(*headers, *unnamed), units=(*row, *unnamed))
