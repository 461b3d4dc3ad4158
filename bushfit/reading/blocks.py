"""Combine the blocks of a table (one below the other, or side by side) into one long table."""

from __future__ import annotations

import re
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import groupby, islice, zip_longest
from typing import NamedTuple

from bushfit import units
from bushfit.caveat import Caveat
from bushfit.reading.block_labels import is_of_block, label_columns, plain_numbers
from bushfit.reading.headers import WORDS, Vocabulary, plain, split_unit, without_mean
from bushfit.reading.layout import Layout
from bushfit.reading.lines import WITH_UNIT, Line, is_comment, is_row, is_summary_row, is_units_row, split
from bushfit.reading.names import NO_LABELS, labels_above, named_quantities
from bushfit.reading.numerals import common_decimal, is_like_number, plainest_value
from bushfit.reading.rejected import begins_other_table
from bushfit.reading.roles import UNIT_NAMES, is_test
from bushfit.reading.source import Channels, RowSource, Sheet, Text, cells_of

#: Letter that does not begin an exponent.
_LETTER = re.compile(r"[^\W\d_eEdD]|[eEdD](?![+-]?\d)")
#: Complex number: "1500+150i", "(1500 + 150j)".
_COMPLEX = re.compile(
    r"\(?\s*([+-]?[\d.,]+(?:[eEdD][+-]?\d+)?)\s*([+-]\s*[\d.,]+(?:[eEdD][+-]?\d+)?)\s*\*?\s*[ij]\s*\)?"
)
#: Magnitude with an angle in degrees: "612∠6.2°".
_POLAR = re.compile(r"([+-]?\d[\d.,]*(?:[eE][+-]?\d+)?)\s*∠\s*([+-]?\d[\d.,]*)\s*°")
#: Number with its uncertainty: "600 ± 3", "600 +/- 3", "600 (±3)", "600(3)".
_UNCERTAIN = re.compile(r"([+-]?\d[\d.,]*)\s*(?:\(?\s*(?:±|\+/?-)\s*\d[\d.,]*\s*%?\)?|\(\d+\))")
#: Name of a block in a header, with the number behind it: "K axial [N/mm]", "K*_S1", "tan d Part 1", "K* #2", "K 2"; or
#: its level: "Force 0.1 Hz [N]".
_NAME_OF_SIDE = re.compile(
    r"(?<![^\s_])(?=(\d+(?:[.,]\d+)?\s?(?:[^\W\d_]{1,3}|%)|(?:[^\W\d_][^\W_]*[\s_])?#?\d|[^\W\d_][^\W_]*)(?![^\s_]))"
)
#: Words for a set point, a deviation, a corrected value or a bound, which name no block.
_STATISTICS = frozenset(map(plain, (*WORDS["qualifiers"]["not_measured"], *WORDS["qualifiers"]["processed"])))
#: First rows that are searched for complex numbers and units; chosen: room for remarks.
_FIRST = 8


#: Column of a table: header, unit in the row of units, and cells.
PlainColumn = tuple[str | None, str | None, Sequence[str | float]]


class Segment(NamedTuple):
    """Rows of numbers of a file, and the lines between them and the rows of the segment before.

    Args:
        above: lines above the rows, such as titles, a header and units.
        rows: the rows; empty for the lines below the last row.
    """

    above: list[Line]
    rows: list[Line]


class Side(NamedTuple):
    """Columns of one of several blocks side by side.

    Args:
        shared: indices of the columns that all blocks have in common.
        columns: indices of the columns of the block.
        headers: headers of these columns, without the title of the block.
        title: title of the block, if its headers contain it.
    """

    shared: Sequence[int]
    columns: Sequence[int]
    headers: Sequence[str]
    title: str = ""


def find_segments(
    lines: Iterable[Line], kind: Callable[[Line], Hashable | None], fewest_rows: int = 1
) -> Iterator[Segment]:
    """Divide the lines of a file into runs of rows, each with the lines above it.

    Args:
        lines: lines or rows of the file.
        kind: function that returns None for a line that is not a row, and equal values for the rows of one run.
        fewest_rows: smallest number of rows of a run; rows of a shorter run belong to the lines above the next run.

    Yields:
        Each run with the lines above it; finally, the lines below the last run, if there are any.
    """
    above = list[Line]()
    for value, run in groupby(lines, key=kind):
        rows = list(run)
        if value is None or len(rows) < fewest_rows:
            above += rows
        else:
            yield Segment(above, rows)
            above = []
    if above:
        yield Segment(above, [])


def combine_blocks(source: RowSource, layout: Layout, vocabulary: Vocabulary) -> tuple[RowSource, Layout]:
    """Combine the blocks of a file into one table, and split cells with a complex number or a unit.

    Args:
        source: lines or rows of the file.
        layout: location and headers of the first block.
        vocabulary: known column names, by which a header has a role such as "force".

    Returns:
        Source and layout of the table, with an added column "block" and a column for each quantity, such as the
        amplitude, that all titles or lines above the blocks state. If the file has one block of real numbers, `source`
        and `layout` are returned unchanged.
    """
    if isinstance(source, Channels) or len(layout.headers) < 2 or layout.headerless:
        return source, layout
    sides = _find_sides(layout, vocabulary)
    if sides and (blocks := _side_by_side(source, layout, sides)):
        first = [*sides[0].shared, *sides[0].columns]
        headers = (*(layout.headers[index] for index in sides[0].shared), *sides[0].headers)
        layout = replace(layout, headers=headers, units=tuple(layout.units[index] for index in first))
    elif isinstance(source, Text) and source.is_one_block(layout) and not source.repeats_header(layout):
        return source, layout
    else:
        blocks = _stacked_blocks(source, layout, vocabulary)
    if len(blocks) < 2:
        return _with_plain_cells(source, layout)
    headings = (vocabulary.heading(*column) for column in zip(layout.headers, layout.units, strict=True))
    roles = {heading.role for heading in headings if heading}
    cells_below = (((0, 0), cell) for row in blocks[0].rows for cell in split(row.content, layout.delimiter))
    decimal = common_decimal(cells_below)
    lines_above = [[plain_numbers(line, decimal) for line in block.above] for block in blocks]
    added = label_columns(lines_above, vocabulary, roles, are_sides=bool(sides))
    numbers, content, width = list[int](), list[Sequence[str | float]](), len(layout.headers)
    for index, row in ((index, row) for index, block in enumerate(blocks) for row in block.rows):
        cells, texts = cells_of(row, layout.delimiter), [column[index] for column in added.values()]
        is_remark = not any(is_like_number(str(cell)) for cell in cells)
        content.append(cells if is_remark or len(cells) > width else [*cells, *[""] * (width - len(cells)), *texts])
        numbers.append(row.number)
    layout = replace(layout, headers=(*layout.headers, *added), units=(*layout.units, *[""] * len(added)))
    head = [line for line in source.head if line.number < layout.header_line]
    of_titles = {line.number for block in blocks for line in block.above}
    above = [line for line in head if not (line.number in of_titles if sides else is_of_block(line, added, vocabulary))]
    return _with_plain_cells(Sheet(source.sheet or "", content, above=above, numbers=numbers), layout)


def _find_sides(layout: Layout, vocabulary: Vocabulary) -> list[Side]:
    """Find the columns of several blocks side by side, which may share other columns.

    The headers of the blocks are equal, or those of a sweep, or of loops with a time each, differ in a name: a level, a
    direction, a part, the number of a repeat, "before". Shared columns with the mean of the blocks are left out.
    """
    written = list(zip(layout.headers, layout.units, strict=True))
    columns = dict[str, dict[int, str]]()
    for index, (header, unit) in enumerate(written):
        if header and written.count((header, unit)) > 1:
            columns.setdefault(str(written[:index].count((header, unit))), {})[index] = header
        for match in _NAME_OF_SIDE.finditer(header):
            rest = f"{header[: match.start(1)].rstrip(' _')} {header[match.end(1) :].lstrip(' _')}".strip()
            if plain(match[1]) not in _STATISTICS and without_mean(match[1]):
                columns.setdefault(match[1], {})[index] = rest
    for names in map(list, {tuple(by_index.values()): by_index.values() for by_index in columns.values()}.values()):
        sides = {name: by_index for name, by_index in columns.items() if list(by_index.values()) == names}
        used, roles = set().union(*sides.values()), vocabulary.roles(names)
        plain_names = {plain(split_unit(name)[0]) for name in names}
        free = [index for index in range(len(written)) if index not in used]
        shared = [index for index in free if without_mean(split_unit(written[index][0])[0]) not in plain_names]
        are_repeats = next(iter(sides)).isdigit() and len(shared) < len(free)  # numbers beside their mean
        shared_roles = vocabulary.roles([layout.headers[index] for index in shared])
        levels = {"frequency"} if all(units.is_compatible(_unit_of(name), "Hz") for name in sides) else set()
        available = roles | levels | (shared_roles if are_repeats else shared_roles & {"frequency"})
        is_complete = is_test(available) and len(roles) == len(names)
        are_equal = names == [layout.headers[index] for index in next(iter(sides.values()))]
        is_named = are_repeats or (len(names) > 1 and not next(iter(sides)).isdigit())
        is_side = len(names) > 1 if are_equal else is_complete and (is_named or "time" in roles)
        if len(sides) > 1 and len({*names}) == len(names) and is_side:
            return [Side(shared, [*by_index], names, name * (not are_equal)) for name, by_index in sides.items()]
    return []


def _unit_of(text: str) -> str:
    """Unit of a quantity such as "5 Hz"; "?" if the text is no quantity."""
    return match["unit"] if (match := WITH_UNIT.fullmatch(text)) else "?"


def _side_by_side(source: RowSource, layout: Layout, sides: Sequence[Side]) -> list[Segment]:
    """Separate blocks of columns side by side into segments, each with the rows of one block.

    The lines above a segment are the cells above its columns that the other blocks lack. Blocks that share columns are
    separated only if their titles differ; otherwise the list is empty.
    """
    head = [line for line in source.head if line.number < layout.header_line]
    rows = [line for line in source.lines(layout.lines_before_data) if not is_comment(line.content, layout.delimiter)]
    width = len(layout.headers)
    legend = {name: " ".join(quantity) for line in head for name, quantity in named_quantities(line).items()}
    names = [legend.get(side.title, side.title) for side in sides]  # "A1 = 0.1 mm" above "K* A1 [N/mm]"
    titles: list[list[Line]] = [[Line(layout.header_line, name)] * bool(name) for name in names]
    for line in head if not sides[0].title else ():
        cells = list(map(str, cells_of(line, layout.delimiter)))
        padded = [*cells, *[""] * width]
        of_sides = [next((padded[n] for n in side.columns if padded[n]), "") for side in sides]
        of_sides = cells[1:] if len(cells) == len(sides) + 1 and "" in of_sides else of_sides
        if "" not in of_sides and len(set(of_sides)) > 1:
            name = cells[0].strip("# ").rstrip(":") if cells[0] != of_sides[0] else ""
            for lines, cell in zip(titles, of_sides, strict=True):
                lines.append(Line(line.number, f"{name}: {cell}" if name else cell))
    if sides[0].shared and len({tuple(line.text for line in lines) for lines in titles}) < len(sides):
        return []
    below = [(line.number, [*cells_of(line, layout.delimiter), *[""] * width]) for line in rows]
    return [
        Segment(
            lines,
            [
                Line(number, [cells[n] for n in (*side.shared, *side.columns)])
                for number, cells in below
                if any(cells[n] != "" for n in side.columns)
            ],
        )
        for side, lines in zip(sides, titles, strict=True)
    ]


def _stacked_blocks(source: RowSource, layout: Layout, vocabulary: Vocabulary) -> list[Segment]:
    """Separate blocks one below the other, each with its header or lines that state a quantity.

    The header of a later block may have other names, such as German ones, for the same quantities and units. Rows that
    are not data, such as means, remain among the rows of a block; they are left out later.
    """
    has_meaning = len(vocabulary.roles(layout.headers)) > 1
    meanings = [vocabulary.heading(header) or header for header in layout.headers]

    def texts(line: Line) -> list[str]:
        return [str(cell) for cell in cells_of(line, layout.delimiter)]

    first = next((texts(line)[0] for line in source.lines(layout.lines_before_data) if is_row(texts(line))), "")

    def is_note(line: Line) -> bool:
        return not layout.numbered and is_comment(line.content, layout.delimiter)

    def is_data(line: Line) -> bool | None:
        """True for a row of numbers, None for any other line."""
        cells = [line.content] if isinstance(line.content, str) else [c for c in line.content if isinstance(c, str)]
        has_letters = is_note(line) or any(map(_LETTER.search, cells))
        is_named_row = has_letters and is_like_number(first) and not is_like_number(texts(line)[0])
        return not has_letters or (not is_note(line) and is_row(texts(line)) and not is_named_row) or None

    def is_left_out(line: Line) -> bool:
        cells = texts(line)
        return is_summary_row(cells) or is_units_row(cells) or layout.is_header(cells, vocabulary)

    def is_header(line: Line) -> bool:
        cells = texts(line)
        is_same = has_meaning and [vocabulary.heading(cell) or cell for cell in cells] == meanings
        return is_same or layout.is_repeated(cells)

    blocks = [Segment([line for line in source.head if line.number < layout.header_line], [])]
    for above, rows in find_segments(source.lines(layout.lines_before_data), is_data):
        between = [line for line in above if not is_header(line)]
        labels = between
        if blocks[-1].rows:  # below rows, a mean or a header with other names is no label, but a row to be left out
            labels = [line for line in between if not is_left_out(line)]
        is_stated = labels_above(labels) != NO_LABELS and not any(begins_other_table(texts(line)) for line in labels)
        begins = bool(rows) and (len(between) < len(above) or is_stated)
        left_out = [line for line in between if not (is_note(line) or (begins and line in labels))]
        blocks[-1].rows.extend(left_out)
        if begins and blocks[-1].rows:
            blocks.append(Segment(labels, rows))
        else:
            blocks[-1].above.extend(labels if begins else ())
            blocks[-1].rows.extend(rows)
    return blocks


def _with_plain_cells(source: RowSource, layout: Layout) -> tuple[RowSource, Layout]:
    """Split columns whose cells contain a complex number, a magnitude and angle, a unit or an uncertainty.

    Returns:
        Sheet and layout with a number per cell; `source` and `layout` unchanged without such columns.
    """
    source, layout = _with_units_in_cells(source, layout)
    width = len(layout.headers)

    def columns(lines: Iterable[Line]) -> Iterator[PlainColumn]:
        """Header, unit and cells of each column of some rows; the header is None behind the last named column."""
        rows = (cells_of(line, layout.delimiter) for line in lines)
        cells = zip_longest(*([*row, *[""] * (width - len(row))] for row in rows), fillvalue="")
        named = zip_longest(layout.headers, layout.units, cells)
        return ((header, unit, column or ()) for header, unit, column in named)

    if not any(_plain_columns(*column) for column in columns(islice(source.lines(layout.lines_before_data), _FIRST))):
        return source, layout
    lines = list(source.lines(layout.lines_before_data))
    parts = [part for column in columns(lines) for part in _plain_columns(*column) or [column]]
    named = [(header, unit or "") for header, unit, _ in parts if header is not None]
    headers, row_of_units = zip(*named, strict=True)
    notes = layout.notes
    if uncertain := [f'"{header}"' for header, _, cells in columns(lines[:_FIRST]) if _are_uncertain(cells)]:
        sentence = f"{', '.join(uncertain)}: plus-minus signs and uncertainties are left out"
        notes = (*notes, Caveat("uncertainty_left_out", sentence))
    content = list(zip(*(cells for *_, cells in parts), strict=True))
    sheet = Sheet(source.sheet or "", content, numbers=[line.number for line in lines], above=source.head)
    return sheet, replace(layout, headers=headers, units=row_of_units, notes=notes)


def _plain_columns(header: str | None, unit: str | None, cells: Sequence[str | float]) -> list[PlainColumn]:
    """Split a column whose cells contain more than a number each.

    Args:
        header, unit: name of the column, and its unit in the row of units; None behind the last named column.
        cells: cells of the column.

    Returns:
        Two columns for complex numbers, and for magnitudes with an angle; or one column, whose units are split off (the
        first of compatible units is that of the column), or which lacks plus-minus signs and uncertainties. An empty
        list if the cells are plain.
    """
    if header is None:
        return []
    texts = list(map(str, cells))
    first, (name, in_header, _) = [text for text in texts[:_FIRST] if text], split_unit(header)
    if common := _common_unit(first, unit or in_header or ""):
        return [(header, unit or common, [_in_unit(text, common) for text in texts])]
    if _are_uncertain(cells):
        return [(header, unit, [_UNCERTAIN.sub(r"\1", text).lstrip("± ") for text in texts])]
    bracket = f" [{in_header}]" if in_header else ""
    complex_names = (f"{name} real{bracket}", unit), (f"{name} imaginary{bracket}", unit)
    for pattern, names in ((_COMPLEX, complex_names), (_POLAR, ((header, unit), ("phase", "deg")))):
        if any(map(pattern.fullmatch, first)):
            pairs = [match.groups() if (match := pattern.fullmatch(text)) else (text, "") for text in texts]
            numbers, second = zip(*pairs, strict=True)
            return [(*names[0], numbers), (*names[1], [re.sub(r"\s|^\+", "", part) for part in second])]
    return []


def _are_uncertain(cells: Sequence[str | float]) -> bool:
    """True if the first cells of a column have uncertainties behind, or plus-minus signs before, their numbers."""
    first = [str(cell) for cell in cells[:_FIRST] if cell != ""]
    return bool(first) and all(_UNCERTAIN.fullmatch(text) or text[0] == "±" for text in first)


def _with_units_in_cells(source: RowSource, layout: Layout) -> tuple[RowSource, Layout]:
    """Write the units in columns such as "Stiffness unit", or "unit" on the right of a quantity, behind its numbers."""
    columns = dict[int, int]()
    for index, header in enumerate(layout.headers):
        words = re.split(r"[\s_]+", header)
        names = [" ".join(word for word in words if plain(word) not in UNIT_NAMES)]
        if names[0] != " ".join(words):
            columns[index] = layout.headers.index(names[0]) if names[0] in layout.headers else index - 1
    rows = source.lines(layout.lines_before_data) if columns else ()  # a long file is not read in vain
    lines = [(line.number, [*cells_of(line, layout.delimiter)]) for line in rows]
    filled = [str(cells[index]) for _, cells in lines[:_FIRST] for index in columns if len(cells) > index]
    if -1 in columns.values() or not filled or not all(units.is_unit(text) for text in filled):
        return source, layout
    for _, cells in lines:
        for index in (index for index in sorted(columns, reverse=True) if len(cells) > index):
            unit = str(cells.pop(index)).strip(" -")
            cells[columns[index]] = f"{cells[columns[index]]} {unit}".strip()
    kept = [index for index in range(len(layout.headers)) if index not in columns]
    headers, row = (tuple(texts[index] for index in kept) for texts in (layout.headers, layout.units))
    numbers, content = zip(*lines, strict=True)
    above = [line for line in source.head if line.number < layout.header_line]
    return Sheet(source.sheet or "", content, numbers=numbers, above=above), replace(layout, headers=headers, units=row)


def _common_unit(texts: Sequence[str], stated: str) -> str:
    """Unit behind the number in each of several cells, such as "mm" of "0.5 mm"; "" without such a unit.

    If the header states the same unit in other words, such as deg for °, or two ratios, its unit is returned.
    """
    found = list(dict.fromkeys(map(_unit_of, texts)))
    is_temperature = bool(found) and all(map(units.kelvin_scale, found)) and len(found) == 1
    is_unit = bool(found) and all(units.is_compatible(unit, found[0]) for unit in found)
    if is_unit and stated and units.is_compatible(found[0], stated):
        sizes = [units.si_factor(unit, found[0]) for unit in (found[0], stated)]
        return stated if sizes[0] == sizes[1] or units.is_compatible(stated, "1") else found[0]
    return found[0] if is_temperature or is_unit else ""


def _in_unit(text: str, unit: str) -> str | float:
    """Number of a cell such as "500 um" in a unit; the text itself if it states no compatible unit."""
    match = WITH_UNIT.fullmatch(text)
    if match and match["unit"] == unit:
        return match["number"]
    if match is None or not units.is_compatible(match["unit"], unit):
        return text
    ratio = units.si_factor(match["unit"], match["unit"]) / units.si_factor(unit, unit)
    return float(f"{plainest_value(match['number']) * ratio:.12g}")
