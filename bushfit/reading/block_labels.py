"""Lines above a table and its blocks: remarks, and columns for the quantities that titles and lines state.

A stated value holds for the rows of its block. A condition, a direction and a part hold until others are stated.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

from bushfit import units
from bushfit.caveat import Caveat
from bushfit.geometry import Place, Specimen
from bushfit.reading.headers import COUNTED, HINTS, SWEEP_COLUMNS, Vocabulary, plain, plain_name, split_unit
from bushfit.reading.layout import SCALES, STEPS
from bushfit.reading.lines import Line, is_summary_row
from bushfit.reading.names import (
    is_remark,
    labels_above,
    labels_and_text_above,
    labels_in_names,
    named_direction,
    named_quantities,
    names_coupon,
)
from bushfit.reading.numerals import is_like_number, plainest_value, without_groups
from bushfit.reading.roles import CONDITIONS
from bushfit.reading.source import cells_of

if TYPE_CHECKING:
    from bushfit.reading.table import Table

#: Mark of a footnote in a header, such as "Amplitude¹ [mm]".
_FOOTNOTE_MARK = re.compile("[\u00b9\u00b2\u00b3\u2074\u2020\u2021]")
#: Largest number of characters of a remark that is quoted.
_LONGEST_QUOTE = 100

#: Names of the runs of a test, in the titles of blocks.
_RUNS = Vocabulary({"repeat": SWEEP_COLUMNS["repeat"]})
#: Sign of a value, or of more than one cell, in a line that is no title.
_VALUE = re.compile(r"[:=;,\t]|^[\W\d]*$")
#: Roles whose values hold until others are stated, with the value for blocks before the first one.
_HOLDING = {**dict.fromkeys(CONDITIONS, ""), "direction": "not stated", "part": "not stated"}


def find_lines_above(table: Table) -> list[Line]:
    """Find the lines above a table, and the notes below it.

    Args:
        table: table of a file.

    Returns:
        Non-empty lines above the table, and notes below it; a footnote stands behind the header it refers to.
    """
    layout, last = table.layout, table.layout.lines_before_data
    not_above = (layout.header_line, layout.units_line)
    lines = list[Line]()
    for line in (line for line in table.source.head if line.number <= last and line.number not in not_above):
        cells = cells_of(line, layout.delimiter) if line.number > layout.header_line else line.content
        lines.append(plain_numbers(Line(line.number, cells), table.first_decimal))
    for index, (header, unit) in enumerate(zip(table.headers, layout.units, strict=True)):
        is_step = plain_name(header) in STEPS
        if is_step and is_like_number(unit):  # of an oscilloscope
            lines.append(Line(last, [header, unit]))
        elif is_step and (unit or split_unit(header)[1]) and len({row[index] for row in table.first_rows} - {""}) == 1:
            lines.append(Line(last, [header, table.first_row[index], unit]))
    marks = {mark: header for header in table.headers for mark in _FOOTNOTE_MARK.findall(header)}
    for line in () if table.other_tables else table.source.tail():  # which may be notes of another table
        texts = list(map(str, cells_of(line, layout.delimiter)))
        is_note = not (any(map(is_like_number, texts)) or is_summary_row(texts) or layout.is_repeated(texts))
        if line.number > last and is_note:
            mark = line.text[:1]
            lines.append(Line(line.number, f"{marks[mark]}: {line.text[1:]}") if mark in marks else line)
    return lines


def plain_numbers(line: Line, decimal: str | None) -> Line:
    """Copy of a line without thousands separators in its numbers, where their value is clear ("1,500.0")."""
    if isinstance(line.content, str):
        return line._replace(content=without_groups(line.content, decimal))
    cells = [without_groups(cell, decimal) if isinstance(cell, str) else cell for cell in line.content]
    return line._replace(content=cells)


def find_remarks(table: Table) -> tuple[Caveat, ...]:
    """Warn of remarks in a file that may change what the test means.

    Args:
        table: table of the file.

    Returns:
        Warnings on lines above the table, marked rows, hidden rows and cells that a number format divides.
    """
    remarks = ((line.number, line.text[:_LONGEST_QUOTE]) for line in table.lines_above if is_remark(line.text))
    warnings = [Caveat("remark", f'line {number} is not understood: "{text}"') for number, text in remarks]
    for line in table.lines_above:
        name, *cells = [str(cell) for cell in cells_of(line, table.layout.delimiter)] or [""]
        if plain(name) in SCALES and any(plainest_value(cell) != 1.0 for cell in cells if is_like_number(cell)):
            sentence = f'line {line.number} is not used: "{line.text[:_LONGEST_QUOTE]}"; {HINTS["scales"]}'
            warnings.append(Caveat("remark", sentence))
    names = [Line(0, name.replace("_", " ")) for name in (table.source.sheet, table.file.stem) if name]
    for line in [*names, *(table.lines_above if table.first_decimal is None else ())]:
        forms = [plain_numbers(line, mark) for mark in ".,"]
        read = [labels_above([form]) if line.number else labels_in_names(form.text) for form in forms]
        if read[0] != read[1]:
            meanings = " or ".join(f'"{form.text[:_LONGEST_QUOTE]}"' for form in forms)
            place = f"line {line.number}" if line.number else f'the name "{line.text}"'
            sentence = f"{place} can be read in two ways: {meanings}; the number is not used"
            warnings.append(Caveat("remark", f"{sentence}. Options state what is right"))
    rows = [] if all(is_like_number(str(cell)) for cell in table.first_row) else table.first_rows
    texts = Counter(cell for row in rows for cell in row if isinstance(cell, str) and cell[:1].isalpha())
    warnings += [
        Caveat("marked_rows", f'{count} rows are marked "{cell[:_LONGEST_QUOTE]}"')
        for cell, count in texts.items()
        if is_remark(cell)
    ]
    source = table.source
    if hidden := [number for number in source.hidden if number > table.layout.header_line]:
        sentence = f"{len(hidden)} rows from row {hidden[0]} on are hidden in the workbook, but are read"
        warnings.append(Caveat("hidden_rows", sentence))
    if source.divided:
        sentence = (
            f"{source.divided} cells are shown divided by 1000 by their number format: the shown numbers are read"
        )
        warnings.append(Caveat("divided_cells", sentence))
    return tuple(warnings)


def note_coupon(table: Table, place: Place) -> Iterator[Caveat]:
    """Warn if the texts of a file name a coupon of rubber, but its test is read as one of a bushing.

    Yields:
        The warning, or nothing.
    """
    texts = [table.file.stem, table.source.sheet or "", *(line.text for line in table.lines_above), *table.headers]
    if not isinstance(place, Specimen) and (named := [text for text in texts if names_coupon(text)]):
        sentence = f'"{named[0][:_LONGEST_QUOTE]}" may name a coupon, but the test is read as one of a bushing'
        yield Caveat("coupon", f"{sentence}. {HINTS['coupon']}")


def label_columns(
    above: Sequence[Sequence[Line]], vocabulary: Vocabulary, roles: set[str], *, are_sides: bool
) -> dict[str, list[str | float]]:
    """Make columns that show what is stated above the block from which a row comes.

    Args:
        above: lines above each block. The last line can be its title, which is used if nothing else distinguishes the
            blocks: "Run 2" counts the repeats, and "before" or "S1" names a part.
        vocabulary: known column names, by which a header has a role such as "force".
        roles: roles for which the blocks already have a column.
        are_sides: True for blocks side by side, which are not repeats if their titles differ in a number alone.

    Returns:
        One text or number per block, by header: quantities that all blocks state, conditions, direction, part, and
        block number.
    """
    blocks = [stated_above(lines, vocabulary) for lines in above]
    for before, after in pairwise(blocks):
        new = set(map(_role, after))
        after |= {header: value for header, value in before.items() if _role(header) in {*_HOLDING} - new}
    columns: dict[str, list[str | float]] = {}
    for header in dict.fromkeys(header for block in blocks for header in block):
        role = _role(header)
        values = [block.get(header, _HOLDING.get(role)) for block in blocks]
        distinguishes = len(set(values)) > 1 or role in ("amplitude", "frequency", "direction", *CONDITIONS)
        if role not in roles and distinguishes and None not in values:
            columns[header] = [value for value in values if value is not None]
    titles = [lines[-1].text.rpartition(": ")[2] if lines else "" for lines in above]
    are_titles = are_sides or ("displacement" not in roles and not any(map(_VALUE.search, titles)))
    names = {title.rstrip(" #.0123456789") for title in titles}
    are_runs = names == {""} or all(map(_RUNS.heading, names))
    if not columns and len(set(titles)) > 1 and are_titles and (are_sides or len(names) > 1 or are_runs):
        columns["repeat" if are_runs else "part"] = list(titles)
    return columns | {"block": [str(number) for number in range(1, len(blocks) + 1)]}


def is_of_block(line: Line, columns: Collection[str], vocabulary: Vocabulary) -> bool:
    """True if a line above the first block states an operating point, or one of some columns, for this block alone.

    Args:
        line: line above the first block.
        columns: headers of the columns that are made from the lines above the blocks.
        vocabulary: known column names, by which a header has a role such as "force".

    Returns:
        True or False; a line for all blocks is False.
    """
    headers = stated_above([line], vocabulary)
    return any(header in columns or _role(header) in ("amplitude", "frequency") for header in headers)


def stated_above(lines: Sequence[Line], vocabulary: Vocabulary) -> dict[str, str | float]:
    """Read the values that the lines above a block state.

    Args:
        lines: lines above the block, of which the last is its title.
        vocabulary: known column names, by which a header has a role such as "force".

    Returns:
        Number or text by header of the column that would contain it, such as "amplitude [mm]".
    """
    labels = labels_and_text_above(lines) | labels_in_names(lines[-1].text if lines else "")
    values: dict[str, str | float] = {}
    for si in ("m", "rad", "1", "Hz"):
        matches, role = labels.of_dimension(si), "frequency" if si == "Hz" else "amplitude"
        if len(matches) == 1:
            values[f"{role}{COUNTED[matches[0].convention]} [{matches[0].unit}]"] = float(matches[0].text.split()[0])
    for role in CONDITIONS:
        number, _, unit = (getattr(labels, role) or "").strip().partition(" ")
        values |= {f"{role} [{unit}]": float(number)} if number else {}
    if direction := labels.direction or named_direction(line.text for line in lines):
        values["direction"] = str(direction)
    if labels.specimen_number:
        values["part"] = labels.specimen_number
    for name, (number, unit) in (item for line in lines for item in named_quantities(line).items()):
        heading = vocabulary.heading(f"{name} [{unit}]")
        if heading is None and name and units.is_unit(unit):
            values[name] = f"= {number} {unit}"  # a text, because the unit says nothing about its role
        elif heading and heading.role in CONDITIONS:
            values.setdefault(f"{heading.role} [{unit}]", float(number))
    return values


def _role(header: str) -> str:
    """Role in the header of a column that states a quantity: "amplitude" of "amplitude p-p [mm]"."""
    return header.partition(" ")[0]
