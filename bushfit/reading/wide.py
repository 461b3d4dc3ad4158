r"""Convert wide tables of a sweep (frequencies down and amplitudes across, or the reverse) into long tables.

A wide table has one block or more, side by side or one below the other. The first column of a block contains
frequencies or amplitudes. The header of every other column states a level, which is an amplitude, a frequency, a
temperature or a preload, and the quantity, in one cell ("K* 0.1 mm [N/mm]") or in several. Of merged header cells only
the leftmost is filled:

    K* [N/mm];0.1 mm;0.2 mm            ;0.1 mm;       ;0.2 mm;              f [Hz];K*_0.1mm [N/mm];tan_d_0.1mm;...
    5        ;1520  ;1390        f [Hz];K*    ;tan d  ;K*    ;tan d         5     ;1520           ;0.101      ;...
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import NamedTuple

from bushfit import units
from bushfit.caveat import Caveat
from bushfit.errors import MeasurementError
from bushfit.reading.blocks import find_segments
from bushfit.reading.headers import COUNTED, ERRORS, AmplitudeConvention, Vocabulary, split_convention
from bushfit.reading.layout import MOST_HEAD_LINES, Layout
from bushfit.reading.lines import Line, fill_merged, is_comment, is_row, is_summary_row, is_units_row
from bushfit.reading.names import named_direction
from bushfit.reading.numerals import is_like_number, plainest_value
from bushfit.reading.rejected import list_left_out
from bushfit.reading.reshape import KeyedValue, spread
from bushfit.reading.roles import CONDITIONS
from bushfit.reading.source import RowSource, Sheet, cells_of

#: Roles of the two stepped quantities, each with the other: one varies down the rows and one across the columns.
_STEPPED = {"frequency": "amplitude", "amplitude": "frequency"}
#: Words of the longest title of a block, such as "Radial, part 2"; chosen: more are a remark.
_LONGEST_TITLE = 4
#: Largest number of header rows above a block; chosen: a title, levels, quantities, and units.
_MOST_HEADER_ROWS = 4
#: Number in a header, with its symbol ("A = 0.1") and the word after it, which may be its unit.
_LEVEL = re.compile(
    r"(?:(?P<name>[^\W\d_]+)\s*=\s*)?(?<![\w.,*'|#])±?"
    r"(?P<number>(?:(?<![^\s(])-)?\d+(?:[.,p]\d+)?(?:e[+-]?\d+)?)(?![.,]?\d)"
    r"(?:\s*[\[(]?\s*(?P<unit>°\s*[CFK]\b|[^\W\d_]+|%|°)[\])]?)?",
    re.IGNORECASE,
)
#: Role of a level by the symbol before it: "A = 0.1".
_SYMBOLS = {"f": "frequency", "a": "amplitude", "x": "amplitude", "s": "amplitude", "\u03b3": "amplitude"}
#: Largest number of columns of a wide table; chosen: two for each of a hundred levels.
_MOST_COLUMNS = 200
#: Words and marks without a meaning that join a level to a quantity in a header.
_JOINTS = re.compile(r"[\[(]\s*(?:at|bei)?\s*[\])]|(?<!\w)(?:at|bei|für|for|à|a|@|:|,|;|=|-)(?!\w)")
#: Level that may have a thousands separator: 1,250.
_GROUPED = re.compile(r"[1-9]\d{0,2}[.,]\d{3}")
#: Separator of the two roles in the top left cell of a block: "f [Hz] \ A [mm]".
_CORNER = re.compile(r"\s*[\\|]\s*|\s+/\s+")


@dataclass(frozen=True)
class _Meaning:
    """Meaning of one header cell, or of all header cells of a column, of a wide table; None for unstated parts.

    Args:
        role: quantity in the column, such as "stiffness".
        unit: unit of the quantity.
        level: text of the number of the frequency, amplitude or condition at which the quantity was measured.
        stepped: role of the level, such as "frequency".
        level_unit: unit of the level.
        convention: convention of an amplitude.
    """

    role: str | None = None
    unit: str | None = None
    level: str | None = None
    stepped: str | None = None
    level_unit: str | None = None
    convention: AmplitudeConvention | None = None

    def __or__(self, second: "_Meaning") -> "_Meaning":
        """Combine two meanings; values on the left take precedence unless they are None."""
        return replace(second, **{name: value for name, value in vars(self).items() if value is not None})


class _WideColumn(NamedTuple):
    """Column of a wide table, apart from the first column of its block, which contains frequencies or amplitudes.

    Args:
        meaning: meaning of its headers.
        first_meaning: meaning of the first column of its block.
        points: for each row, its line number, the cell of the first column, and the cell of this column.
        direction: direction in a title above its block, or above an earlier one; "" without any.
    """

    meaning: _Meaning
    first_meaning: _Meaning
    points: list[tuple[int, str | float, str | float]]
    direction: str = ""


def unpivot(source: RowSource, layout: Layout, vocabulary: Vocabulary) -> Sheet | None:
    """Convert a wide table into a long table, with a row for each frequency and amplitude.

    Args:
        source: lines or rows of the file.
        layout: layout of the file if it is read as a long table.
        vocabulary: known column names, by which a header has a role such as "force".

    Returns:
        Long table, with its layout; None if the file has no wide table.

    Raises:
        MeasurementError: a block does not state its quantity, or blocks differ in the unit of their levels.
    """
    roles = [heading.role for cell in layout.headers if (heading := vocabulary.heading(cell))]
    is_long = len(roles) > 2 and len(set(roles)) == len(roles) and not set(roles).isdisjoint(_STEPPED)
    has_merged_titles = "" in layout.headers and not set(roles).issuperset(_STEPPED)
    if (is_long and not has_merged_titles) or len(layout.headers) > _MOST_COLUMNS:
        return None
    if not (read := _read_blocks(source.head, layout.delimiter, vocabulary))[0]:
        return None
    is_longer = len(source.head) >= MOST_HEAD_LINES
    columns, texts, left_out = _read_blocks(source.lines(0), layout.delimiter, vocabulary) if is_longer else read
    summaries = [text for text in dict.fromkeys(texts) if is_summary_row([text])]
    sentences = (f'the column "{text}" is left out, because it summarizes other columns' for text in summaries)
    notes = *(Caveat("summary_column", sentence) for sentence in sentences), *list_left_out(source, left_out)
    written = tuple(text for text in texts if any(m.role or m.stepped for m in _read_corner(text, vocabulary)))
    return _long_table(columns, source, replace(layout, written=written, notes=notes), vocabulary)


def _read_blocks(
    lines: Iterable[Line], delimiter: str, vocabulary: Vocabulary
) -> tuple[list[_WideColumn], list[str], list[Line]]:
    """Read the blocks of a wide table.

    Args:
        lines: lines or rows of the file.
        delimiter: character between cells; "" for a sheet.
        vocabulary: known column names, by which a header has a role such as "force".

    Returns:
        Columns of all blocks, their header cells, and the rows of numbers that belong to no block.
    """

    def is_numbers(line: Line) -> bool | None:
        """True for a row of numbers, which begins with a number; None for any other line."""
        texts = list(map(str, line.content))
        return (is_row(texts) and is_like_number(next(filter(None, texts)))) or None

    cells = [(line.number, cells_of(line, delimiter)) for line in lines if not is_comment(line.content, delimiter)]
    width = max((len(row) for _, row in cells), default=0)
    padded = [Line(number, [*row, *[""] * (width - len(row))]) for number, row in cells]
    columns, texts, left_out, direction, start = list[_WideColumn](), list[str](), list[Line](), None, 0
    for above, rows in find_segments(padded, is_numbers, fewest_rows=2):
        start = next((n for row in rows for n, cell in enumerate(row.content) if cell != ""), start)
        left_out += [line for line in above if is_numbers(line) and line.content[start] != ""]  # levels begin later
        headers = [list(map(str, line.content)) for line in above[-_MOST_HEADER_ROWS:] if line not in left_out]
        blocks = list[_WideColumn]()
        if rows and headers:
            if len(headers) > 1 and is_units_row(headers[-1]):  # the unit of an amplitude may be that of a stiffness
                named = zip(headers[-2], headers.pop(), strict=True)
                headers[-1] = [f"{name} [{unit}]" if name and unit else name or unit for name, unit in named]
            titles = (line.text for line in above if len(line.text.split()) <= _LONGEST_TITLE)
            direction = next(filter(None, (named_direction([title]) for title in titles)), direction)
            corners = [[m.stepped for m in _read_corner(cell, vocabulary) if not m.level] for cell in headers[-1]]
            repeated = [n for n in range(start + 1, width) if any(corners[n]) and corners[n] == corners[start]]
            for side in map(slice, [start, *repeated], [*repeated, width]):
                data = [Line(row.number, row.content[side]) for row in rows]
                blocks += _read_block([row[side] for row in headers], data, vocabulary)
        columns += [column._replace(direction=str(direction or "")) for column in blocks]
        texts += [text for row in headers for text in row] if blocks else []
        left_out += [] if blocks else rows
    return columns, texts, left_out


def _read_block(headers: Sequence[list[str]], rows: Sequence[Line], vocabulary: Vocabulary) -> list[_WideColumn]:
    """Read the columns of a block with their meanings; an empty list if it is not a block of a wide table.

    Args:
        headers: cells of the header rows.
        rows: rows of numbers.
        vocabulary: known column names, by which a header has a role such as "force".
    """
    columns = [n for n in range(1, len(headers[0])) if any(row.content[n] != "" for row in rows)]
    meanings = dict.fromkeys(columns, _Meaning())
    down, across = _Meaning(), _Meaning()
    for distance, cells in enumerate(reversed(headers)):
        texts = fill_merged(cells) if distance else cells
        row = {column: _read_header(texts[column], vocabulary) for column in columns}
        levels = {meaning.stepped for meaning in row.values() if meaning.level}
        unclear = [column for column in columns if texts[column] and row[column] == _Meaning()]
        corners = _read_corner(cells[0], vocabulary)
        is_name = cells[0] != "" and not is_like_number(cells[0])
        is_value = levels == {None} and not any(corner.stepped or corner.unit for corner in corners)
        below = {meaning.stepped for meaning in meanings.values() if meaning.level}
        if (is_name and (is_value or (distance and sum(map(bool, cells)) == 2))) or (below and levels - {None, *below}):
            break  # a name and its value above the table, or an amplitude above temperatures
        if unclear and not (levels and all(is_summary_row([texts[column]]) for column in unclear)):
            break
        for corner in corners:
            axis = replace(corner, level_unit=corner.level_unit or corner.unit, unit=None)
            if corner.role is not None or corner.level:
                across |= corner if levels != {None} and not corner.level else _Meaning()
            elif corner.stepped in levels - {None} or (levels and down.stepped not in (None, corner.stepped)):
                across |= axis
            else:
                down |= axis
        columns = [column for column in columns if column not in unclear]
        meanings = {column: meanings[column] | row[column] for column in columns}
    found = (meaning.stepped for meaning in (*meanings.values(), across) if meaning.stepped)
    stepped = next(found, _STEPPED.get(down.stepped or ""))
    meanings = {n: meanings[n] | across | _Meaning(stepped=stepped) for n in columns}
    if stepped is None or len(columns) < 2 or not all(meaning.level for meaning in meanings.values()):
        return []
    all_texts = list(map(fill_merged, headers))
    named = {(meaning, *(texts[column] for texts in all_texts)) for column, meaning in meanings.items()}
    if len(named) > len(set(meanings.values())):
        return []  # such as K axial and K radial, or two samples, at the same level
    down = replace(down, stepped=_STEPPED.get(stepped, down.stepped or "frequency"))  # beside temperatures or preloads
    return [
        _WideColumn(meaning, down, [(row.number, row.content[0], row.content[n]) for row in rows])
        for n, meaning in meanings.items()
    ]


def _read_corner(text: str, vocabulary: Vocabulary) -> list[_Meaning]:
    """Meanings of the top left cell of a wide table, which names one role or two: "f / Hz", "f [Hz] \\ A [mm]"."""
    whole = _read_header(text, vocabulary)
    return [whole] if whole.stepped else [_read_header(part, vocabulary) for part in _CORNER.split(text)]


def _read_header(text: str, vocabulary: Vocabulary) -> _Meaning:
    """Meaning of a header cell of a wide table; empty if a part of the cell is not understood."""
    whole, convention = split_convention(text.replace("_", " "))
    if is_like_number(text):
        return _Meaning(level=text)
    match = _LEVEL.search(whole)
    stepped = _role_of_unit(match["unit"]) if match else None
    named = _named_quantity(text, vocabulary)
    if named and units.is_unit(named.unit or named.level_unit or "1"):
        number = _LEVEL.fullmatch(named.unit or named.level_unit or "")
        if not (number and _role_of_unit(number["unit"])):  # "tan delta 1 %" has a level, and no unit of 1 %
            return named
    is_level = match is not None and stepped is not None and match.span() == (0, len(whole))  # 1 mm is no unit
    if text and not is_level and units.is_unit(unit := whole.strip("[]() ")):
        return _Meaning(unit=unit, convention=convention)
    if match is None:
        return _Meaning()
    rest = whole[: match.start()] + " " + whole[match.end() if stepped else match.end("number") :]
    rest = _JOINTS.sub(" ", rest).strip()
    level = _Meaning(
        level=match["number"].replace("p", "."),
        stepped=stepped or _SYMBOLS.get((match["name"] or "").lower()),
        level_unit=match["unit"] if stepped else None,
        convention=convention,
    )
    if not rest:
        return level
    named = _named_quantity(rest, vocabulary)
    if named and named.role in ("repeat", *CONDITIONS):  # "Run 1" is no level, but "Preload 500 N" is
        return _Meaning() if named.role == "repeat" else replace(level, stepped=named.role, level_unit=named.unit)
    if named:
        return level | replace(named, convention=convention)
    role = None if stepped else _role_of_unit(unit := rest.strip("[]() "))
    return replace(level, level_unit=unit, stepped=role) if role else _Meaning()


def _named_quantity(text: str, vocabulary: Vocabulary) -> _Meaning | None:
    """Meaning of a header of a wide table without a level, such as "K* [N/mm]"; None if it names no known role."""
    heading = vocabulary.heading(text)
    if heading and heading.role in _STEPPED:
        return _Meaning(stepped=heading.role, level_unit=heading.unit, convention=heading.convention)
    return _Meaning(heading.role, heading.unit) if heading else None


def _role_of_unit(unit: str | None) -> str | None:
    """Role of a number by its unit, such as "frequency"; None for other units, and for the symbols K, C and F."""
    roles = {"Hz": "frequency", "m": "amplitude", "rad": "amplitude", "1": "amplitude", "K": "temperature"}
    unit = None if unit in ("K", "C", "F") else unit
    return next((role for si, role in roles.items() if unit and units.is_compatible(unit, si)), None)


def _long_table(columns: Sequence[_WideColumn], source: RowSource, layout: Layout, vocabulary: Vocabulary) -> Sheet:
    """Build a long table (a row per frequency and amplitude) from all blocks of a wide table, with its layout.

    Args:
        columns: columns of all blocks.
        source: lines or rows of the file.
        layout: layout of the file if it is read as a long table, with the header cells and notes of the wide table.
        vocabulary: known column names, by which a header has a role such as "force".

    Raises:
        MeasurementError: a block does not state its quantity, or frequencies or amplitudes have two units.
    """
    columns = sorted(columns, key=lambda column: plainest_value(column.meaning.level or ""))
    is_named = all(column.meaning.role for column in columns)
    axes = [
        dict.fromkeys((meaning.stepped, meaning.level_unit, meaning.convention) for meaning in meanings)
        for meanings in zip(*((column.first_meaning, column.meaning) for column in columns), strict=True)
    ]
    if not is_named or any(len(axis) > 1 for axis in axes):
        raise MeasurementError(
            **ERRORS["two_levels" if is_named else "no_quantity"],
            place=f'sheet "{source.sheet}"' if source.sheet else f"line {columns[0].points[0][0] - 1}",
            found=", ".join(dict.fromkeys(layout.written)),
        )

    several, rows = len({column.direction for column in columns}) > 1, list[KeyedValue]()
    for meaning, _, points, direction in columns:
        level, name = meaning.level or "", vocabulary.name_of(meaning.role or "")
        further = (level if _GROUPED.fullmatch(level) else plainest_value(level), *[direction] * several)
        name += f" [{meaning.unit}]" if meaning.unit else ""
        rows += [KeyedValue(number, (first, *further), name, cell) for number, first, cell in points]
    names = (
        f"{vocabulary.name_of(role or '')}{COUNTED[convention]}{f' [{unit}]' if unit else ''}"
        for role, unit, convention in chain(*axes)
    )
    keys = [*names, *["direction"] * several]
    return spread(source, replace(layout, header_line=min(row.number for row in rows) - 1), keys, rows)
