"""Blocks of one table, one below the other or side by side, as one table with columns that identify the blocks."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import islice

from bushfit import units
from bushfit.errors import UnitError
from bushfit.reading.cells import Cells, FaultyRow
from bushfit.reading.headers import AmplitudeConvention, Column, Vocabulary, parse_unit, plain, split_unit
from bushfit.reading.layout import Layout, Line, is_comment, is_row, is_summary_row, is_units_row, split
from bushfit.reading.names import NO_LABELS, Labels, labels_above, labels_in_names, named_direction
from bushfit.reading.numerals import is_like_number
from bushfit.reading.source import Channels, Combined, RowSource, Text, cells_of

#: Largest text that is searched for blocks without their own headers [bytes]; chosen: some 100,000 rows.
_MOST_BYTES = 1 << 22
#: Letter that does not begin an exponent.
_LETTER = re.compile(r"[^\W\d_eE]|[eE](?![+-]?\d)")
#: Bytes that occur in rows of numbers, which cannot begin a block.
_NUMERIC = b"0123456789.,+-eE \t\r\n"
#: Complex number: "1500+150i", "(1500 + 150j)".
_COMPLEX = re.compile(r"\(?\s*([+-]?[\d.,]+(?:[eE][+-]?\d+)?)\s*([+-]\s*[\d.,]+(?:[eE][+-]?\d+)?)\s*\*?\s*[ij]\s*\)?")
#: First rows that are searched for complex numbers; chosen: room for remarks.
_FIRST = 8
#: Text of each amplitude convention in the header of an added column.
COUNTED: dict[AmplitudeConvention | None, str] = {
    "peak-to-peak": " p-p", "zero-to-peak": " 0-p", "rms": " rms", None: ""
}  # fmt: skip

#: Row of a block: line number, cells, and index of the block from 0.
_BlockRow = tuple[int, Sequence[str | float], int]


def combined(source: RowSource, layout: Layout, vocabulary: Vocabulary) -> tuple[RowSource, Layout]:
    """Combine the blocks of a file into one table, and split complex numbers into two columns.

    Args:
        source: lines or rows of the file.
        layout: location and headers of the first block.
        vocabulary: known column names.

    Returns:
        Source and layout of the table, with an added column "block" and a column for each quantity, such as the
        amplitude, that all titles or lines above the blocks state; the arguments if there is only one, real, block.
    """
    if isinstance(source, Channels) or len(layout.headers) < 2 or layout.headerless:
        return source, layout
    headers = layout.headers
    first = next(index for index, header in enumerate(headers) if header)
    starts = [index for index, header in enumerate(headers) if header == headers[first]]
    sides = [slice(start, end) for start, end in zip(starts, [*starts[1:], len(headers)], strict=True)]
    names = [[header for header in headers[side] if header] for side in sides]
    unlike = any(layout.units[side][: len(names[0])] != layout.units[sides[0]][: len(names[0])] for side in sides)
    if (
        len(sides) > 1
        and not unlike
        and all(side == names[0] for side in names)
        and 1 < len(names[0]) == len(set(names[0]))
    ):
        return _side_by_side(source, layout, sides, vocabulary)
    if isinstance(source, Text):
        start, end = source.offset(layout.header_line - 1), source.offset(layout.lines_before_data)
        header = source.data[start : source.offset(layout.header_line)].strip()
        is_large = len(source.data) > _MOST_BYTES
        if is_large and source.data.find(header, start + len(header)) < 0:
            return source, layout
        if not is_large and not source.data[end:].translate(None, _NUMERIC + layout.delimiter.encode()):
            return source, layout
    return _with_complex_parts(*_stacked(source, layout, vocabulary))


def _side_by_side(
    source: RowSource, layout: Layout, sides: Sequence[slice], vocabulary: Vocabulary
) -> tuple[RowSource, Layout]:
    """Combine blocks of columns side by side, each with the same headers and maybe a title above, into one table.

    Args:
        source: lines or rows of the file.
        layout: location and headers of the whole header line.
        sides: columns of each block.
        vocabulary: known column names.
    """
    above = [split(line.content, layout.delimiter) for line in source.head() if line.number < layout.header_line]
    titles = [next(filter(None, (cell for row in reversed(above) for cell in row[side])), "") for side in sides]
    width = len([header for header in layout.headers[sides[0]] if header])
    lines = [
        (line.number, cells_of(line, layout))
        for line in source.lines(layout.lines_before_data)
        if not is_comment(line.content, layout.delimiter)
    ]
    parts = [
        (number, row[side.start : side.start + width], block)
        for block, side in enumerate(sides)
        for number, row in lines
        if any(cell != "" for cell in row[side.start : side.start + width])
    ]
    start = sides[0].start
    layout = replace(layout, headers=layout.headers[start : start + width], units=layout.units[start : start + width])
    labels = [labels_in_names(title) for title in titles]
    return _one_table(source, layout, parts, _label_columns(labels, titles, titles, vocabulary.roles(layout.headers)))


def _stacked(source: RowSource, layout: Layout, vocabulary: Vocabulary) -> tuple[RowSource, Layout]:
    """Combine blocks one below the other, each with its header or lines that state a quantity, into one table.

    Args:
        source: lines or rows of the file.
        layout: location and headers of the first block.
        vocabulary: known column names.
    """
    above = [line for line in source.head() if line.number < layout.header_line]
    between: list[Line] = []
    groups, repeated, parts = [above], False, list[_BlockRow]()
    for line in source.lines(layout.lines_before_data):
        texts = [line.content] if isinstance(line.content, str) else [c for c in line.content if isinstance(c, str)]
        is_note = not layout.numbered and is_comment(line.content, layout.delimiter)
        if is_note or any(map(_LETTER.search, texts)):
            cells = [str(cell) for cell in cells_of(line, layout)]
            if layout.is_repeated(cells):
                repeated = True
                continue
            is_units = is_units_row([cell.strip("[]() ") for cell in cells])
            if parts and (is_summary_row(cells) or is_units or layout.is_header(cells)):  # left out later, or refused
                parts.append((line.number, cells, len(groups) - 1))
                continue
            if is_note or not is_row(cells):
                between.append(line)
                continue
        repeated = repeated or (bool(between) and labels_above(between) != NO_LABELS)
        if repeated:
            groups = [*groups, between] if parts else [[*above, *between]]
        else:  # rows that are left out later, with a note
            parts += [
                (part.number, cells_of(part, layout), len(groups) - 1)
                for part in between
                if not is_comment(part.content, layout.delimiter)
            ]
        parts.append((line.number, cells_of(line, layout), len(groups) - 1))
        between, repeated = [], False
    if len(groups) < 2:
        return source, layout
    parts += [(line.number, cells_of(line, layout), len(groups) - 1) for line in between]
    last = [lines[-1].content if lines else "" for lines in groups]
    titles = [(text if isinstance(text, str) else " ".join(map(str, text))).strip() for text in last]
    labels = [labels_above(lines) | labels_in_names(title) for lines, title in zip(groups, titles, strict=True)]
    directions = ["" if re.search(r"[\t;:=]", title) else title for title in titles]
    return _one_table(source, layout, parts, _label_columns(labels, directions, [], vocabulary.roles(layout.headers)))


def _one_table(
    source: RowSource, layout: Layout, parts: Iterable[_BlockRow], added: dict[str, list[str]]
) -> tuple[RowSource, Layout]:
    """Build one table of the rows of all blocks, with added columns that show the block of each row.

    Args:
        source: lines or rows of the file.
        layout: location and headers of the first block.
        parts: rows of the blocks, each with the index of its block.
        added: one text per block, by the header of the added column.
    """
    width = len(layout.headers)
    numbers: list[int] = []
    content: list[Sequence[str | float]] = []
    for number, row, block in parts:
        padded = [*row, *[""] * (width - len(row)), *(texts[block] for texts in added.values())]
        content.append(padded if len(row) <= width else row)
        numbers.append(number)
    layout = replace(layout, headers=(*layout.headers, *added), units=(*layout.units, *[""] * len(added)))
    return Combined(source.sheet or "", content, numbers=numbers), layout


def _label_columns(
    labels: Sequence[Labels], titles: Sequence[str], parts: Sequence[str], roles: set[str]
) -> dict[str, list[str]]:
    """Columns to add to a table, so that its rows show the block from which they come.

    Args:
        labels: labels of each block.
        titles: title of each block, which may name a direction.
        parts: name of the part in each block, used if no quantity distinguishes the blocks.
        roles: roles for which the blocks have a column already.

    Returns:
        One text per block, by header: quantities that all blocks state, direction, part, and number of the block.
    """
    columns: dict[str, list[str]] = {}
    for role, expected in (("amplitude", "m"), ("amplitude", "rad"), ("amplitude", "1"), ("frequency", "Hz")):
        quantities = [label.of_dimension(expected) for label in labels]
        if role not in roles and all(len(matches) == 1 for matches in quantities):
            kinds = {(matches[0].unit, matches[0].convention) for matches in quantities}
            if len(kinds) == 1:
                unit, convention = kinds.pop()
                texts = [matches[0].text.split()[0] for matches in quantities]
                columns[f"{role}{COUNTED[convention]} [{unit}]"] = texts
    if "temperature" not in roles and all(label.temperature for label in labels):
        degrees = [str(label.temperature).partition(" ") for label in labels]
        if len({unit for *_, unit in degrees}) == 1:
            columns[f"temperature [{degrees[0][2]}]"] = [number for number, *_ in degrees]
    directions = [named_direction([title], short=True) for title in titles]
    if all(directions):
        columns["direction"] = [str(direction) for direction in directions]
    numbers = [label.specimen_number or "" for label in labels]
    named = numbers if all(numbers) else [] if columns else parts
    if named and all(named) and len(set(named)) > 1:
        columns["part"] = list(named)
    columns["block"] = [str(number) for number in range(1, len(labels) + 1)]
    return columns


def _with_complex_parts(source: RowSource, layout: Layout) -> tuple[RowSource, Layout]:
    """Replace each column of complex numbers by two columns, real and imaginary part."""
    first = [cells_of(line, layout) for line in islice(source.lines(layout.lines_before_data), _FIRST)]
    indices = {n for row in first for n, cell in enumerate(row) if isinstance(cell, str) and _COMPLEX.fullmatch(cell)}
    if not indices or max(indices) >= len(layout.headers):
        return source, layout
    headers, row_of_units = list(layout.headers), list(layout.units)
    for index in sorted(indices, reverse=True):
        name, unit = units.split_header(headers[index])
        headers[index : index + 1] = [f"{name} {part}{f' [{unit}]' if unit else ''}" for part in ("real", "imaginary")]
        row_of_units[index : index + 1] = [row_of_units[index]] * 2
    content: list[Sequence[str | float]] = []
    numbers: list[int] = []
    for line in source.lines(layout.lines_before_data):
        cells = list(cells_of(line, layout))
        for index in sorted(indices & set(range(len(cells))), reverse=True):
            match = _COMPLEX.fullmatch(str(cells[index]))
            cells[index : index + 1] = [match[1], re.sub(r"\s|^\+", "", match[2])] if match else [cells[index], ""]
        content.append(cells)
        numbers.append(line.number)
    layout = replace(layout, headers=tuple(headers), units=tuple(row_of_units))
    return Combined(source.sheet or "", content, numbers=numbers, above=source.head()), layout


def refuse_other_columns(table: Cells, left_out: Iterable[FaultyRow]) -> None:
    """Refuse a header or row of units that states another order or other units for the rows below it.

    Args:
        table: table with its columns by role.
        left_out: rows of the table that are not data.

    Raises:
        MeasurementError: a header repeats the columns in another order.
        UnitError: a header or row of units states other units.
    """
    first = table.layout.units_line or table.layout.header_line
    for line, cells, _ in left_out:
        texts = [str(cell) for cell in cells]
        is_header, compatible, different = table.layout.is_header(texts), 0, list[Column]()
        for column in sorted(table.roles.values(), key=lambda column: column.index):
            text = texts[column.index]
            name, unit, convention = split_unit(text) if is_header else ("", *parse_unit(text.strip("[]() "))[:2])
            if is_header and plain(name) != plain(split_unit(column.header)[0]):
                raise table.error(
                    "a header repeats the columns in another order",
                    line=line,
                    found=", ".join(filter(None, texts)),
                    expected=f"the columns of line {table.layout.header_line}: {', '.join(table.headers)}",
                    hint="write all blocks with the same columns, or each to a file of its own",
                )
            is_unit = unit != "-" and not is_like_number(unit or "1")
            if not (unit and column.unit and is_unit):
                continue
            degrees = [units.kelvin_scale(text) for text in (unit, column.unit)]
            if all(degrees) or units.is_compatible(unit, column.unit):
                compatible += 1
                scale, usual = degrees if all(degrees) else (units.si_factor(t, t) for t in (unit, column.unit))
                different += [column] * (scale != usual or convention not in (None, column.convention))
        if different and (is_header or compatible > 1):
            raise UnitError(
                f"the {different[0].role.replace('_', ' ')} has two units",
                file=table.file,
                place=table.place(line, different[0]),
                found=f"{', '.join(texts[column.index] for column in different)} on line {line}, "
                f"{', '.join(str(column.unit) for column in different)} on line {first}",
                expected="the same units in all blocks of a file",
                hint="convert all blocks to the same units, or write each to a file of its own",
            )
