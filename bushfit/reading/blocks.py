"""Blocks of one table, one below the other or side by side, as one table with columns that identify the blocks."""

import re
from collections.abc import Sequence
from dataclasses import replace

from bushfit.reading.headers import AmplitudeConvention, Vocabulary, plain
from bushfit.reading.layout import Layout, Line, is_comment, is_row, is_units_row, split
from bushfit.reading.names import NO_LABELS, Labels, labels_above, labels_in_names, named_direction
from bushfit.reading.source import Channels, Combined, RowSource, Text, cells_of, rows

#: Bytes of the largest text that is searched for blocks without a header of their own; chosen: some 100,000 rows.
_MOST_BYTES = 1 << 22
#: A letter that is no exponent.
_LETTER = re.compile(r"[^\W\d_eE]|[eE](?![+-]?\d)")
#: Bytes of rows of numbers, which begin no block.
_NUMERIC = b"0123456789.,+-eE \t\r\n"
#: Amplitude conventions in the header of an added column.
COUNTED: dict[AmplitudeConvention | None, str] = {
    "peak-to-peak": " p-p", "zero-to-peak": " 0-p", "rms": " rms", None: ""
}  # fmt: skip


def combined(source: RowSource, layout: Layout, vocabulary: Vocabulary) -> tuple[RowSource, Layout]:
    """Combine blocks into one table.

    Args:
        source: lines of the file.
        layout: of its first block.
        vocabulary: meaning of headers.

    Returns:
        Source and layout of one table, with a column "block" and a column for each quantity that the titles of the
        blocks, or the lines between them, state; the arguments unchanged if there is one block.
    """
    if isinstance(source, Channels) or len(layout.headers) < 2 or layout.headerless:
        return source, layout
    if sides := _sides(layout):
        return _side_by_side(source, layout, sides, vocabulary)
    if isinstance(source, Text) and len(source.data) > _MOST_BYTES:
        start = source.offset(layout.header_line - 1)
        header = source.data[start : source.offset(layout.header_line)].strip()
        if source.data.find(header, start + len(header)) < 0:
            return source, layout
    if isinstance(source, Text):
        numbers = source.data[source.offset(layout.lines_before_data) :]
        if not numbers.translate(None, _NUMERIC + layout.delimiter.encode()):
            return source, layout
    return _stacked(source, layout, vocabulary)


def _sides(layout: Layout) -> list[slice]:
    """Columns of each of several blocks side by side; empty if there is one block."""
    headers = layout.headers
    first = next(index for index, header in enumerate(headers) if header)
    starts = [index for index, header in enumerate(headers) if header == headers[first]]
    sides = [slice(start, end) for start, end in zip(starts, [*starts[1:], len(headers)], strict=True)]
    names = [[header for header in headers[side] if header] for side in sides]
    are_equal = all(block_names == names[0] for block_names in names) and 1 < len(names[0]) == len(set(names[0]))
    return sides if len(sides) > 1 and are_equal else []


def _side_by_side(
    source: RowSource, layout: Layout, sides: Sequence[slice], vocabulary: Vocabulary
) -> tuple[RowSource, Layout]:
    """Blocks side by side, below titles that may be merged cells."""
    above = [line for line in source.head() if line.number < layout.header_line]
    cells = [split(line.content, layout.delimiter) for line in above]
    titles = []
    for side in sides:
        filled = (next((cell for cell in row[side] if cell), "") for row in reversed(cells))
        titles.append(next(filled, ""))
    width = len([header for header in layout.headers[sides[0]] if header])
    lines = list(rows(source, layout))
    labels = [labels_in_names(title) for title in titles]
    added = _label_columns(labels, titles, set(vocabulary.roles(layout.headers)), are_parts=True)
    numbers: list[int] = []
    content: list[Sequence[str | float]] = []
    for index, side in enumerate(sides):
        for number, row in lines:
            part = list(row[side.start : side.start + width])
            if any(cell != "" for cell in part):
                numbers.append(number)
                part = [*part, *[""] * (width - len(part))]
                content.append([*part, *(texts[index] for texts in added.values())])
    start = sides[0].start
    headers = (*layout.headers[start : start + width], *added)
    units = (*layout.units[start : start + width], *[""] * len(added))
    return Combined(source.sheet or "", content, numbers=numbers), replace(layout, headers=headers, units=units)


def _stacked(source: RowSource, layout: Layout, vocabulary: Vocabulary) -> tuple[RowSource, Layout]:
    """Blocks one below the other: each begins with the header again, or with lines that state a quantity."""
    header, width = [plain(text) for text in layout.headers], len(layout.headers)
    above = [line for line in source.head() if line.number < layout.header_line]
    between: list[Line] = []
    repeated = False
    groups = [above]
    contents: list[tuple[Line, int]] = []
    for line in source.lines(layout.lines_before_data):
        texts = [line.content] if isinstance(line.content, str) else [c for c in line.content if isinstance(c, str)]
        is_note = not layout.numbered and is_comment(line.content, layout.delimiter)
        if is_note or any(map(_LETTER.search, texts)):
            cells = [str(cell) for cell in cells_of(line, layout)]
            if [plain(cell) for cell in cells] == header:
                repeated = True
                continue
            if is_units_row(cells):
                continue
            if is_note or not is_row(cells):
                between.append(line)
                continue
        if between and not repeated and labels_above(between) != NO_LABELS:
            repeated = True
        if repeated:
            groups = [*groups, between] if contents else [[*above, *between]]
        unassigned = [] if repeated else [part for part in between if not is_comment(part.content, layout.delimiter)]
        block, repeated = len(groups) - 1, False
        contents += [(part, block) for part in (*unassigned, line)]
        between = []
    if len(groups) < 2:
        return source, layout
    titles = [_title(lines) for lines in groups]
    labels = [labels_above(lines) | labels_in_names(_last_text(lines)) for lines in groups]
    added = _label_columns(labels, titles, set(vocabulary.roles(layout.headers)), are_parts=False)
    contents += [(part, len(groups) - 1) for part in between]
    content: list[Sequence[str | float]] = []
    for part, block in contents:
        row = cells_of(part, layout)
        padded = [*row, *[""] * (width - len(row))]
        content.append([*padded, *(texts[block] for texts in added.values())] if len(row) <= width else row)
    layout = replace(layout, headers=(*layout.headers, *added), units=(*layout.units, *[""] * len(added)))
    return Combined(source.sheet or "", content, numbers=[part.number for part, _ in contents]), layout


def _title(lines: Sequence[Line]) -> str:
    """Text of the last line above a block if it is a single cell."""
    text = _last_text(lines)
    return "" if re.search(r"[\t;:=]", text) else text


def _last_text(lines: Sequence[Line]) -> str:
    """Text of the last line."""
    content = lines[-1].content if lines else ""
    return (content if isinstance(content, str) else " ".join(map(str, content))).strip()


def _label_columns(
    labels: Sequence[Labels], titles: Sequence[str], roles: set[str], *, are_parts: bool
) -> dict[str, list[str]]:
    """Texts of the added columns by header: quantities that all blocks state, direction, part, and block number."""
    columns: dict[str, list[str]] = {}
    for role, expected in (("amplitude", "m"), ("amplitude", "rad"), ("amplitude", "1"), ("frequency", "Hz")):
        quantities = [label.of_dimension(expected) for label in labels]
        if role not in roles and all(len(found_quantities) == 1 for found_quantities in quantities):
            parts = {(found_quantities[0].unit, found_quantities[0].convention) for found_quantities in quantities}
            if len(parts) == 1:
                unit, convention = parts.pop()
                columns[f"{role}{COUNTED[convention]} [{unit}]"] = [
                    found_quantities[0].text.split()[0] for found_quantities in quantities
                ]
    if "temperature" not in roles and all(label.temperature for label in labels):
        texts = [str(label.temperature).partition(" ") for label in labels]
        if len({unit for *_, unit in texts}) == 1:
            columns[f"temperature [{texts[0][2]}]"] = [number for number, *_ in texts]
    directions = [named_direction([title], short=True) for title in titles]
    if all(directions):
        columns["direction"] = [str(direction) for direction in directions]
    numbers = [label.specimen_number for label in labels]
    parts_named = numbers if all(numbers) else titles if are_parts and not columns else []
    if parts_named and all(parts_named) and len(set(parts_named)) > 1:
        columns["part"] = [str(text) for text in parts_named]
    columns["block"] = [str(number) for number in range(1, len(labels) + 1)]
    return columns
