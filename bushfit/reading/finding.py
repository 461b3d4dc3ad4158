"""Search for the table of a test in a file: its part, layout, columns and rows."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from bushfit.caveat import Caveat
from bushfit.errors import BushfitError, MeasurementError, error_location
from bushfit.geometry import TRANSLATION, Direction, Motion
from bushfit.reading.blocks import combine_blocks
from bushfit.reading.classification import classify
from bushfit.reading.header_line import find_layout
from bushfit.reading.headers import ALL_COLUMNS, ERRORS, LOOP_COLUMNS, Vocabulary
from bushfit.reading.labelled import Rows, select_rows
from bushfit.reading.layout import DELIMITERS, MOST_HEAD_LINES, FileFormat, Layout
from bushfit.reading.names import direction_of_file, named_direction
from bushfit.reading.parts import OpenedFile, open_file
from bushfit.reading.reshape import reshape_table
from bushfit.reading.roles import PAIRS, is_test, names_for_motion
from bushfit.reading.source import RowSource, Sheet
from bushfit.reading.table import Table
from bushfit.reading.wide import unpivot


def find_table(
    file: Path | OpenedFile,
    names: Mapping[str, Sequence[str]],
    columns: Mapping[str, str] | None = None,
    stated_units: Mapping[str, str] | None = None,
    file_format: FileFormat | None = None,
    motion: Motion = TRANSLATION,
    rows: Rows | None = None,
) -> Table:
    """Find the table of a test in a file, and the roles of its columns; its numbers are read later, by `Table.read`.

    Args:
        file: path of a text in any dialect, a workbook or a recording, or the opened file. There may be other lines
            above the header, and a row of units below it.
        names: usual column names by role such as "force": LOOP_COLUMNS, SWEEP_COLUMNS or RESONANCE_COLUMNS.
        columns: header, or number from 1, of columns with unusual names, by role.
        stated_units: units that the file does not state, by role.
        file_format: format of the file as the user states it; default detected.
        motion: kind of motion; columns of a test of strain and modulus have other names.
        rows: criteria that select the rows of the test; default all rows.

    Returns:
        Table with its columns by role.

    Raises:
        MeasurementError: the file, its table, the header or the selected rows are missing, or roles are unclear.
        UnitError: two different units for one column.
    """
    opened = file if isinstance(file, OpenedFile) else open_file(file, file_format or FileFormat())
    columns, stated_units, header_line = dict(columns or {}), dict(stated_units or {}), opened.stated.header_line
    named = {role: text for role, text in columns.items() if not text.isdecimal()}
    vocabulary = Vocabulary(names_for_motion(names, motion), named, stated_units)
    every_name = Vocabulary(ALL_COLUMNS, named, stated_units)
    may_be_wide, layouts = "amplitude" in names and header_line is None, list[tuple[RowSource, Layout]]()
    with error_location(opened.file):
        for as_written, in_one in _locate(opened, named, stated_units):
            is_loop = {"time", "displacement", "force"} <= Vocabulary(LOOP_COLUMNS, named).roles(as_written[1].headers)
            wide = unpivot(*as_written, vocabulary) if may_be_wide and not is_loop else None
            layouts.append((wide, wide.layout) if wide and wide.layout else in_one)
    if len(layouts) > 1:
        layouts = [entry for entry in layouts if len(vocabulary.roles(entry[1].headers) - {"time"}) > 1]
    if len(opened.parts) > 1 and not any(is_test(every_name.roles(layout.headers)) for _, layout in layouts):
        with suppress(BushfitError):  # the parts together are no test either
            together = find_table(opened.join_sheets(), names, columns, stated_units, motion=motion, rows=rows)
            if is_test(set(together.roles)):
                sentence = "the sheets of this workbook are read together, because each has a part of the test"
                return replace(together, notes=(*together.notes, Caveat("joined_sheets", sentence)))
    if len(layouts) != 1:
        raise opened.part_error([source for source, _ in layouts])
    table = Table(opened, *layouts[0], names, motion)
    if header_line not in (None, table.layout.header_line):
        raise MeasurementError(**ERRORS["no_such_line"], file=opened.file, found=f"header_line = {header_line}")
    if len(table.headers) < 2:
        raise table.header_error(**ERRORS["one_column"])
    if table.layout.headerless and not any(text.isdecimal() for text in columns.values()):
        raise table.header_error(**ERRORS["no_header"])
    table = classify(table, vocabulary, columns, stated_units)
    essential = ({"displacement", "force"}, *map(set, PAIRS))
    present = next((pair for pair in essential if pair <= set(table.roles)), {"displacement", "force"})
    table = table.needing({role: table.roles[role] for role in present if role in table.roles})
    return replace(table, selected=select_rows(table, table.row_labels, rows)) if rows else table


def _locate(
    opened: OpenedFile, columns: Mapping[str, str], stated_units: Mapping[str, str]
) -> list[tuple[tuple[RowSource, Layout], tuple[RowSource, Layout]]]:
    """Find the header of the table in each part of a file, once for all kinds of tests.

    Args:
        opened: the file, which keeps the result.
        columns: headers that the user states, by role.
        stated_units: units that the user states, by role.

    Returns:
        Rows and layout of each table: as it is written, and with its blocks in one table.

    Raises:
        MeasurementError: a line is far too long.
    """
    key = tuple(columns.items()), tuple(stated_units.items())
    if key not in opened.located:
        vocabulary, stated = Vocabulary(ALL_COLUMNS, columns, stated_units), opened.stated
        located = opened.located[key] = []
        for source in opened.parts:
            if (stated.header_line or 0) > MOST_HEAD_LINES // 2:
                source = source.after((stated.header_line or 0) - MOST_HEAD_LINES // 2)
            mark = "" if isinstance(source, Sheet) else DELIMITERS.get(stated.delimiter or "")
            layout = source.layout or find_layout(source.head, vocabulary, mark, stated.header_line)
            if not stated.header_line and (long := reshape_table(source, layout, vocabulary)):
                source, layout = long, long.layout or find_layout(long.head, vocabulary, "")
            located.append(((source, layout), combine_blocks(source, layout, vocabulary)))
    return opened.located[key]


def direction_of_table(table: Table, option: str | None = None) -> Direction | None:
    """Determine the direction of a test of the bushing from the option --direction, or else from the file.

    Args:
        table: table of the test.
        option: direction that the user states; None without one.

    Returns:
        The direction; None if neither option nor file states it.

    Raises:
        MeasurementError: the file states another direction than the option, or several directions.
    """
    is_torsion = any(table.agrees(role, "rad") for role in ("displacement", "amplitude"))
    headers = table.layout.written or table.headers
    in_column = dict.fromkeys(table.row_labels.get("direction", (0, ()))[1])
    by_name = direction_of_file(table.file, (), turns=is_torsion, sheet=table.source.sheet)
    # test machines call the channels of their actuator axial, whatever the direction of the bushing
    of_channels = named_direction(headers)
    stated = Direction(*in_column) if len(in_column) == 1 else by_name or table.labels_above.direction
    in_text = named_direction(line.text for line in table.lines_above)
    is_doubtful = of_channels is Direction.AXIAL and (option or in_text not in (None, of_channels))
    found = stated or (None if is_doubtful else of_channels)
    texts, problem = list(in_column), ""
    if option is None and len(in_column) > 1:
        problem, hint = "this file contains tests in several directions", "state one: --direction axial"
    elif option and found and found != option and len(in_column) < 2:
        problem = f"{'the units say' if is_torsion else 'the file says'} {found}, but --direction says {option}"
        texts = [table.file.name, table.source.sheet or "", *headers]
        hint = "leave --direction out, or correct what the file states"
    if problem:
        raise table.header_error(problem, found=", ".join(filter(None, texts)), expected="one direction", hint=hint)
    return Direction(option) if option else found
