"""Layout of a table in its file: delimiter, header, units row and columns without a header."""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile
from typing import Annotated, Literal

from pydantic import BeforeValidator

from bushfit.caveat import Caveat
from bushfit.reading.headers import WORDS, Vocabulary, plain, plain_name, split_unit
from bushfit.reading.lines import Line, cells_below, is_comment, is_row, is_units_row, split
from bushfit.reading.numerals import is_like_number, plainest_value
from bushfit.reading.roles import UNIT_NAMES, X_UNIT_NAMES, stated_once
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
#: Non-empty lines below a header that are searched for its units row and first numbers; chosen: room for comments.
_LINES_BELOW_HEADER = 8
#: Names of the rate and the step of the rows, and of their start.
STEPS = frozenset(map(plain, (*WORDS["above"]["sampling_rate"], *WORDS["above"]["sampling_interval"], "start")))
#: Names in the first cells of rows that describe the columns, such as "Unit" and "dx".
_DESCRIPTIONS = UNIT_NAMES | frozenset(map(plain, WORDS["rows_of"]["descriptions"]))
#: Number with a number sign: "#1".
_NUMBERED = re.compile(r"#\s?\d+\b")
#: Name of a column in a list of names above a table: "Sig1 Time (s)", "Column 2: Weg [mm]", "# 3 Force [N]".
_LISTED_NAME = re.compile(
    r"[@#%*\s]*(?:(?:(?:sig|signal|col|column|ch|chan|channel|spalte|kanal)[\s.]*)?(?P<number>\d{1,3})\s*[:=.)\t ]\s*)?"
    r"(?P<name>[^\W\d].*?)\s*",
    re.IGNORECASE,
)
#: Names of a column with the size of one count of a channel.
SCALES = frozenset(map(plain, WORDS["rows_of"]["scales"]))


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


def describe_table(
    lines: Sequence[Line], vocabulary: Vocabulary, index: int, delimiter: str, headers: Sequence[str]
) -> Layout:
    """Describe the table below a header.

    Args:
        lines: non-empty lines at the start of the file.
        vocabulary: known column names, by which a header has a role such as "force".
        index: index of the header in `lines`.
        delimiter: character between cells.
        headers: header cells.

    Returns:
        Layout of the table, with its units row if there is one, and with columns that have no header.
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
    below = list(lines_below(lines, index, layout.delimiter))
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
        if are_units_of(headers, cells):
            return replace(layout, units_line=line.number, units=(*cells, *empty)[: len(headers)])
        if any(are_named) and are_named == [*map(bool, cells)] and not vocabulary.roles(headers[: len(cells)]):
            return replace(layout, units_line=line.number, headers=(*cells, *headers[len(cells) :]))
    return layout


def are_units_of(headers: Sequence[str], cells: Sequence[str]) -> bool:
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


def lines_below(lines: Sequence[Line], header: int, delimiter: str) -> Iterator[Line]:
    """Yield the first few lines below a header, without comments.

    Args:
        lines: non-empty lines at the start of the file.
        header: index of the header in `lines`.
        delimiter: character between cells.
    """
    below = lines[header + 1 : header + 1 + _LINES_BELOW_HEADER]
    return (line for line in below if not is_comment(line.content, delimiter))


def listed_names(
    lines: Sequence[Line], rows: Sequence[Sequence[str]], vocabulary: Vocabulary
) -> tuple[int, int, list[str]] | None:
    """Find the names of columns that the lines above a table list, one on each line, such as "Channel 1: Time [s]".

    Args:
        lines: lines above the table.
        rows: cells of its first row, for each possible delimiter.
        vocabulary: known column names, by which a header has a role such as "force".

    Returns:
        Index of the last line of the list, index of the delimiter that gives as many cells as there are names, and the
        names; None without such a list.
    """
    matches = [_LISTED_NAME.fullmatch(line.text) for line in lines]
    listed = [match for match in matches if match and match["number"]]
    if not listed:
        listed = [match for match in matches if match and vocabulary.heading(match["name"])]
    counts = [int(match["number"]) for match in listed if match["number"]]
    names = [re.sub(r"\s{2,}|\t", " ", match["name"]) for match in listed]
    if len(vocabulary.roles(names)) < 2 or counts not in ([], *(list(range(n, n + len(names))) for n in (0, 1))):
        return None
    last = matches.index(listed[-1])
    return next(((last, index, names) for index, row in enumerate(rows) if len(row) == len(names)), None)


def scales_above(lines: Iterable[Sequence[str]], headers: Sequence[str]) -> dict[int, str]:
    """Find the scales of recorded counts in a table of channels above the data: "Name,Units,Scale" and a row for each.

    Returns:
        Scale with its unit, such as "x 0.00125 mm", by index of the header that names the channel.
    """
    scale = unit = None
    scales = dict[int, str]()
    for cells in lines:
        names = list(map(plain, cells))
        if SCALES.intersection(names) and UNIT_NAMES.intersection(names):
            scale, unit = (next(n for n, name in enumerate(names) if name in words) for words in (SCALES, UNIT_NAMES))
        elif scale is not None and unit is not None and len(cells) > max(scale, unit) and is_like_number(cells[scale]):
            matching = [n for n, header in enumerate(headers) if header in cells]
            scales |= dict.fromkeys(matching, f"x {cells[scale]} {cells[unit]}")
    return scales
