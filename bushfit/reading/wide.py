"""Wide tables of a sweep, turned into long ones: frequencies down and amplitudes across, or the reverse.

A wide table has one block or more, side by side or one below the other. The first column of a block holds the values of
one of frequency and amplitude; above every other column stand the value of the other and what the column holds, in one
cell ("K* 0.1 mm [N/mm]") or in several, of which those that are merged over columns are filled at the left only:

    K* [N/mm];0.1 mm;0.2 mm            ;0.1 mm;       ;0.2 mm;              f [Hz];K*_0.1mm [N/mm];tan_d_0.1mm;...
    5        ;1520  ;1390        f [Hz];K*    ;tan d  ;K*    ;tan d         5     ;1520           ;0.101      ;...
"""

import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import accumulate, groupby
from pathlib import Path
from typing import NamedTuple

from bushfit import units
from bushfit.errors import MeasurementError
from bushfit.reading.blocks import COUNTED
from bushfit.reading.headers import AmplitudeConvention, Heading, Vocabulary, split_convention
from bushfit.reading.layout import DELIMITERS, Content, Layout, is_comment, split
from bushfit.reading.numerals import is_like_number
from bushfit.reading.source import Combined, RowSource

#: The two roles of which one runs down and the other across.
_STEPPED = ("frequency", "amplitude")
#: The two in the plural.
_PLURAL = {"frequency": "frequencies", "amplitude": "amplitudes"}
#: Rows above a block that may be its header; chosen: a title, levels, quantities, and units.
_MOST_HEADER_ROWS = 4
#: A number in a header, with what names it before ("A = 0.1") and what may be its unit after it.
_LEVEL = re.compile(
    r"(?:(?P<name>[^\W\d_]+)\s*=\s*)?(?<![\w.,*'|])±?(?P<number>\d+(?:[.,]\d+)?(?:e[+-]?\d+)?)(?![.,]?\d)"
    r"(?:\s*[\[(]?\s*(?P<unit>[^\W\d_]+|%|°)[\])]?)?",
    re.IGNORECASE,
)
#: What a symbol before a level stands for: "A = 0.1".
_SYMBOLS = {"f": "frequency", "a": "amplitude", "x": "amplitude", "s": "amplitude", "\u03b3": "amplitude"}
#: Columns of a wide table; chosen: two for each of a hundred levels.
_MOST_COLUMNS = 200
#: What joins a level to a quantity in a header, and says no more.
_JOINTS = re.compile(r"[\[(]\s*(?:at|bei)?\s*[\])]|(?<!\w)(?:at|bei|für|for|à|a|@|:|,|;|=|-)(?!\w)")
#: Characters of a header; chosen: the rest of a longer text says nothing.
_LONGEST_HEADER = 200
#: A level that may have thousands: 1,250.
_OPEN = re.compile(r"[1-9]\d{0,2}[.,]\d{3}")
#: What parts the two roles that a corner names: "f [Hz] \ A [mm]".
_CORNER = re.compile(r"\s*[\\|]\s*|\s+/\s+")


class _WideHeading(NamedTuple):
    """What header cells say of a column: what it holds, in which unit, at which level of frequency or amplitude.

    Of what they do not say, it has None.
    """

    role: str | None = None
    unit: str | None = None
    level: str | None = None
    stepped: str | None = None
    level_unit: str | None = None
    convention: AmplitudeConvention | None = None

    def filled_by(self, other: "_WideHeading") -> "_WideHeading":
        """What this says, and where it does not, the other."""
        return other._replace(**{name: value for name, value in self._asdict().items() if value is not None})


class _Series(NamedTuple):
    """A column of a wide table: what its header says of it and of the column down; line, value down and cell each."""

    heading: _WideHeading
    down: _WideHeading
    points: list[tuple[int, str | float, str | float]]


#: A row of a wide table: its line and cells.
_Row = tuple[int, list[str | float]]


def as_long(
    source: RowSource, file: Path, vocabulary: Vocabulary, layout: Layout, delimiter: str | None
) -> tuple[RowSource, Layout] | None:
    """A wide table as a long one, of which the headers are names of roles; None where a file holds no wide table.

    `layout` is that of the file read as a long table, `delimiter` what parts the cells, where that is known.

    Raises:
        MeasurementError: blocks that do not belong together, or that do not say what they hold.
    """
    if len(layout.headers) > _MOST_COLUMNS:
        return None
    named = [heading.role for cell in layout.headers if (heading := vocabulary.heading(cell))]
    if len(named) > 2 and len(set(named)) == len(named) and set(named) & set(_STEPPED):
        return None
    for mark in DELIMITERS.values() if delimiter is None else (delimiter,):
        lines = (line for line in source.head() if not is_comment(line.content, mark))
        rows: list[_Row] = [
            (number, [c[:_LONGEST_HEADER] if isinstance(c, str) else c for c in _cells(content, mark)])
            for number, content in lines
        ]
        blocks = list(_blocks(rows, vocabulary))
        if series := [one for block in blocks for one in _series(*block, vocabulary)]:
            long, long_layout = _as_long_table(series, source, file, mark)
            cells = (cell for headers, _ in blocks for row in headers for cell in row)
            read = ((cell, [_read_heading(part, vocabulary) for part in _CORNER.split(cell)]) for cell in cells)
            written = tuple(cell for cell, parts in read if any(part.role or part.stepped for part in parts))
            return long, replace(long_layout, written=written)
    return None


def _cells(content: Content, delimiter: str) -> Sequence[str | float]:
    return split(content, delimiter) if isinstance(content, str) else content


def _blocks(rows: Sequence[_Row], vocabulary: Vocabulary) -> Iterator[tuple[list[list[str]], list[_Row]]]:
    """Header cells and rows of numbers of each block, without the columns before and after it."""
    starts = [_first_number(cells) for _, cells in rows]
    done = 0
    for start, run in groupby(range(len(rows)), key=starts.__getitem__):
        numbers = list(run)
        if start is None or len(numbers) < 2:
            continue
        part = rows[max(done, numbers[0] - _MOST_HEADER_ROWS) : numbers[-1] + 1]
        done = numbers[-1] + 1
        width = max(len(cells) for _, cells in part)
        padded = [(line, cells + [""] * (width - len(cells))) for line, cells in part]
        headers = [[str(cell) for cell in cells] for _, cells in padded[: -len(numbers)]]
        bottom = headers[-1] if headers else [""] * width
        corners = [[one.stepped for one in _corner(cell, vocabulary)] for cell in bottom]
        edges = [start, *(at for at in range(start + 1, width) if any(corners[at]) and corners[at] == corners[start])]
        for first, last in zip(edges, [*edges[1:], width], strict=True):
            data = [(line, cells[first:last]) for line, cells in padded[-len(numbers) :]]
            yield [cells[first:last] for cells in headers], data


def _first_number(cells: Sequence[str | float]) -> int | None:
    """Index of the first filled cell, if it is a number and so is another, and half of the row or more."""
    numbers = {index: is_like_number(str(cell)) for index, cell in enumerate(cells) if cell != ""}
    first = next(iter(numbers), 0)
    return first if sum(numbers.values()) > max(1, len(numbers) / 2 - 1) and numbers[first] else None


def _series(headers: Sequence[list[str]], data: Sequence[_Row], vocabulary: Vocabulary) -> list[_Series]:
    """The columns of a block; none where it is no block of a wide table."""
    columns = [index for index in range(1, len(data[0][1])) if any(cells[index] != "" for _, cells in data)]
    headings = dict.fromkeys(columns, _WideHeading())
    down, across = _WideHeading(), _WideHeading()
    for distance, cells in enumerate(reversed(headers)):
        # an empty cell is merged with the one before it
        merged: Iterator[str] = accumulate(cells, lambda before, cell: cell or before)
        texts = list(merged) if distance else cells
        row = {column: _read_heading(texts[column], vocabulary) for column in columns}
        if any(texts[column] and row[column] == _WideHeading() for column in columns):
            break
        levels = {one.stepped for one in row.values() if one.level}
        for corner in _corner(cells[0], vocabulary):
            named = corner._replace(level_unit=corner.level_unit or corner.unit, role=None, unit=None)
            if corner.role is not None:
                continue
            if corner.stepped in levels - {None} or (levels and down.stepped not in (None, corner.stepped)):
                across = across.filled_by(named)
            else:
                down = down.filled_by(named)
        headings = {column: one.filled_by(row[column]) for column, one in headings.items()}
    stepped = next((one.stepped for one in (*headings.values(), across) if one.stepped), None)
    stepped = stepped or next((role for role in _STEPPED if down.stepped and role != down.stepped), None)
    headings = {c: one.filled_by(across)._replace(stepped=one.stepped or stepped) for c, one in headings.items()}
    if stepped is None or len(columns) < 2 or not all(one.level for one in headings.values()):
        return []
    down = down._replace(stepped=_STEPPED[stepped == _STEPPED[0]])
    return [_Series(one, down, [(line, cells[0], cells[c]) for line, cells in data]) for c, one in headings.items()]


def _corner(text: str, vocabulary: Vocabulary) -> list[_WideHeading]:
    """What the cells of a corner say that names one thing or two: "f [Hz]", "f [Hz] \\ A [mm]"; no level."""
    return [one for part in _CORNER.split(text) if not (one := _read_heading(part, vocabulary)).level]


def _read_heading(text: str, vocabulary: Vocabulary) -> _WideHeading:
    """What a header cell says; nothing where a part of it is not understood."""
    whole, convention = split_convention(text.replace("_", " "))
    if is_like_number(text):
        return _WideHeading(level=text)
    heading = vocabulary.heading(text)
    glued = _LEVEL.fullmatch((heading and heading.unit) or "")  # "tan delta 1 %" is at a level, and no unit of 1 %
    if heading and not (glued and _stepped_in(glued["unit"])) and units.is_unit(heading.unit or "1"):
        return _of_role(heading)
    if text and units.is_unit(bare := whole.strip("[]() ")):
        return _WideHeading(unit=bare, convention=convention)
    if not (found := _LEVEL.search(whole)):
        return _WideHeading()
    unit, end = found["unit"], found.end()
    stepped = _stepped_in(unit)
    if unit and not stepped:
        unit, end = None, found.end("number")
    rest = _JOINTS.sub(" ", whole[: found.start()] + " " + whole[end:]).strip()
    stepped = stepped or _SYMBOLS.get((found["name"] or "").lower())
    level = _WideHeading(level=found["number"], stepped=stepped, level_unit=unit, convention=convention)
    if not rest:
        return level
    if heading := vocabulary.heading(rest):
        return level.filled_by(_of_role(heading)._replace(convention=convention))
    bare = rest.strip("[]() ")
    if unit or not _stepped_in(bare):
        return _WideHeading()
    return level._replace(level_unit=bare, stepped=_stepped_in(bare))


def _of_role(heading: Heading) -> _WideHeading:
    """What a header says that names a role."""
    if heading.role in _STEPPED:
        return _WideHeading(stepped=heading.role, level_unit=heading.unit, convention=heading.convention)
    return _WideHeading(heading.role, heading.unit)


def _stepped_in(unit: str | None) -> str | None:
    """What has a unit: a frequency, or an amplitude."""
    roles = {"Hz": "frequency", "m": "amplitude", "rad": "amplitude", "1": "amplitude"}
    return next((role for si, role in roles.items() if unit and units.is_compatible(unit, si)), None)


def _as_long_table(
    series: Sequence[_Series], source: RowSource, file: Path, delimiter: str
) -> tuple[RowSource, Layout]:
    """The columns of all blocks as one long table: a row for each value down at each level."""
    by_role: dict[str | None, list[_Series]] = {}
    for one in series:
        by_role.setdefault(one.heading.role, []).append(one)
    blocks = [sorted(columns, key=lambda one: _value(one.heading.level)) for columns in by_role.values()]
    levels = [
        [(_value(one.heading.level), [_value(text) for _, text, _ in one.points]) for one in columns]
        for columns in blocks
    ]
    down = {(one.down.stepped, one.down.level_unit, one.down.convention) for one in series}
    across = {(one.heading.stepped, one.heading.level_unit, one.heading.convention) for one in series}
    quantities = dict.fromkeys((one.heading.role, one.heading.unit, None) for one in series)
    faults = {
        "a block of this wide table does not say what it holds": (
            None in by_role,
            "a quantity such as K* [N/mm] or tan delta above each block, or in each header",
        ),
        "the blocks of this wide table differ": (
            any(own != levels[0] for own in levels),
            "the same frequencies and amplitudes in all blocks",
        ),
        "this wide table counts one thing in two ways": (
            len(down) > 1 or len(across) > 1 or len(quantities) > len(by_role),
            "one unit for each quantity, and levels of one kind",
        ),
    }
    for problem, (is_so, expected) in faults.items():
        if is_so:
            place = f'sheet "{source.sheet}"' if source.sheet else f"line {series[0].points[0][0] - 1}"
            hint = "correct the wide table, or write it as a long one: a row for each frequency and amplitude"
            raise MeasurementError(
                problem, file=file, place=place, found=_described(series), expected=expected, hint=hint
            )
    headers = [
        f"{role}{COUNTED[convention]}{f' [{unit}]' if unit else ''}".replace("_", " ")
        for role, unit, convention in (*down, *across, *quantities)
    ]
    numbers: list[int] = []
    rows: list[list[str | float]] = []
    for beside in zip(*blocks, strict=True):
        text = beside[0].heading.level or ""
        level = text if _OPEN.fullmatch(text) else _value(text)
        for points in zip(*(column.points for column in beside), strict=True):
            numbers.append(points[0][0])
            rows.append([points[0][1], level, *(cell for _, _, cell in points)])
    sheet = Combined(source.sheet or "", rows, numbers=numbers)
    return sheet, Layout(delimiter, tuple(headers), min(numbers) - 1, ("",) * len(headers), None)


def _value(text: str | float | None) -> float:
    """A number of a header, whichever its decimal mark; nan where it has separators between thousands."""
    try:
        return float(str(text).replace(",", "."))
    except ValueError:
        return math.nan


def _described(series: Sequence[_Series]) -> str:
    """The columns of a wide table in words: what each holds, at which level, over how many rows."""
    counted = Counter((one.heading.role, one.heading.unit, one.heading.stepped, len(one.points)) for one in series)
    return "; ".join(
        f"{(role or 'not named').replace('_', ' ')}{f' [{unit}]' if unit else ''} of "
        f"{count} {_PLURAL[stepped or 'amplitude']}, {n} rows"
        for (role, unit, stepped, n), count in counted.items()
    )
