"""Inspection of a test file: its test, the keys of its table in a campaign, contents and oddities."""

from collections.abc import Mapping
from dataclasses import fields
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from bushfit.campaign.campaign import reader_keywords
from bushfit.campaign.strain import implausible_strain
from bushfit.caveat import Caveat
from bushfit.errors import error_location
from bushfit.geometry import Direction, Place, Specimen
from bushfit.inspection.labels import contradicting_lines, count_temperatures, keys_from_labels, labels_of_file
from bushfit.inspection.loops import describe_history, describe_loop, describe_programme
from bushfit.inspection.recognition import recognize_table, tested_body
from bushfit.inspection.record import ColumnDescription, Findings, Inspection, Kind
from bushfit.inspection.sweeps import describe_sweep
from bushfit.reading.finding import direction_of_table
from bushfit.reading.headers import ERRORS, LOOP_COLUMNS, SWEEP_COLUMNS
from bushfit.reading.layout import DELIMITERS
from bushfit.reading.loops import read_loop
from bushfit.reading.measurement import Loop, Sweep
from bushfit.reading.names import NO_LABELS, Labels
from bushfit.reading.preload import parse_preload
from bushfit.reading.roles import CONDITIONS, PAIRS
from bushfit.reading.source import Channels, Sheet
from bushfit.reading.stated import LoopFile, SweepFile
from bushfit.reading.sweeps import read_sweep
from bushfit.reading.table import Table
from bushfit.reduction.programme import split_record
from bushfit.reduction.steps import distinct_points, is_stepped_sine, steady_sines
from bushfit.validation import validate_tables

#: [Hz] Frequency above which a motion in steps is a stepped sine; chosen: quasi-static loops are slower.
_QUASI_STATIC = 1.0
#: Distance of a stated preload from the mean of a loop, relative to its range, from which they contradict each other;
#: chosen: rubber relaxes by less.
_FAR_FROM_MEAN = 0.5


def inspect_file(
    file: Path, test_options: Mapping[str, Any], of_book: Labels = NO_LABELS, *, differs_in_force: bool = False
) -> Inspection:
    """Recognize a test file, read the test, and describe its contents and oddities.

    Args:
        file: test file.
        test_options: keys of [[loops]] and [[sweeps]], as TOML gives them, and sizes of a specimen in shear; keys that
            do not apply are ignored.
        of_book: labels in the other sheets of its workbook.
        differs_in_force: True if the force in the name is the preload.

    Returns:
        The inspection, with the test in SI.

    Raises:
        NoTestError: a file without a test.
        MeasurementError, UnitError, CampaignError, FitError: a file or an option that cannot be used.
    """
    table, is_sweep = recognize_table(file, test_options)
    place = tested_body(table, test_options) or of_book.direction
    read_as = place or Direction.AXIAL  # which of two translations it is makes no difference to reading
    entry = campaign_entry(table, place, test_options, is_sweep=is_sweep)
    by_name = labels_of_file(file, table.source.sheet or "", test_options)
    by_name |= Labels(preload=by_name.force if differs_in_force else None)
    label_keys, label_facts, counted = keys_from_labels(table, read_as, entry, by_name, of_book, is_sweep=is_sweep)
    labels = {"name": by_name, "text above the table": table.labels_above}
    if "at_amplitude" in label_keys:
        entry.pop("amplitude", None)  # counted already
    entry |= label_keys
    kind: Kind = "sweep"
    measured: Loop | Sweep
    if is_sweep:
        measured = read_sweep(**reader_arguments(table, read_as, entry, SweepFile))
        facts, odd = describe_sweep(measured, labels)
        if amplitude := table.roles.get("amplitude"):
            counted = amplitude.convention is not None
            if "peak-to-peak" in (amplitude.convention, entry.get("amplitude")):
                facts["amplitudes"] += f', half of "{amplitude.header}", which is peak-to-peak'
    else:
        arguments = reader_arguments(table, read_as, entry, LoopFile)
        measured = read_loop(**arguments)
        kind, (facts, odd) = classify_recording(measured, labels, arguments["test"])
        if preload := facts.get("preload"):
            if "preload" in label_keys and is_contradicted(entry["preload"], measured):
                stated = entry.pop("preload")
                sentence = f"the preload {stated} that the text states is not in the record: {preload}"
                odd.append(Caveat("wrong_preload", sentence))
            entry.setdefault("preload", preload)
    time_step = measured.time_step if isinstance(measured, Loop) and measured.has_recorded_time else None
    odd += contradicting_lines(table, time_step)
    odd += implausible_strain(measured, None) if isinstance(place, Specimen) else ()
    contents = describe_format(table), describe_columns(table, is_sweep=is_sweep), facts | label_facts, tuple(odd)
    is_uncounted = is_sweep and not counted and "amplitude" not in entry
    return Inspection(file, kind, place, *contents, entry, measured, amplitude_convention_unknown=is_uncounted)


def read_history(file: Path, test_options: Mapping[str, Any]) -> tuple[Loop, Direction | None]:
    """Read a raw history of displacement and force over time.

    Args:
        file: test file.
        test_options: what the user states on the test, by key of [[loops]], with values as TOML gives them.

    Returns:
        The history in SI, and its direction; None if neither file nor options state it.

    Raises:
        MeasurementError, UnitError, CampaignError: a file or an option that cannot be used.
    """
    table, is_sweep = recognize_table(file, test_options)
    if is_sweep:
        raise table.header_error(**ERRORS["sweep_already"])
    direction = direction_of_table(table, test_options.get("direction"))
    entry = campaign_entry(table, direction, test_options, is_sweep=False)
    return read_loop(**reader_arguments(table, direction or Direction.AXIAL, entry, LoopFile)), direction


def campaign_entry(
    table: Table, place: Place | None, test_options: Mapping[str, Any], *, is_sweep: bool
) -> dict[str, Any]:
    """Keys that the [[loops]] or [[sweeps]] table of a campaign has to state for a test.

    Args:
        table: table of the test.
        place: direction or specimen; None if unknown.
        test_options: what the user states on the test, by campaign key such as "direction".
        is_sweep: True for a sweep, False for a loop.

    Returns:
        The options that apply to the test, without those that the file itself states.
    """
    roles, schema = (SWEEP_COLUMNS, SweepFile) if is_sweep else (LOOP_COLUMNS, LoopFile)
    needless = {"direction", "specimen", "columns", "units"}
    needless |= {"temperature"} if test_options.get("temperature") and count_temperatures(table) == 1 else set()
    keys = {field.name for field in fields(schema)} - needless
    entry: dict[str, Any] = {"specimen": place.name} if isinstance(place, Specimen) else {}
    entry |= {key: value for key, value in test_options.items() if key in keys and value not in (None, {})}
    for key in ("columns", "units"):
        if by_role := {role: text for role, text in test_options.get(key, {}).items() if role in roles}:
            entry[key] = by_role
    return entry


def reader_arguments(
    table: Table, place: Place, entry: Mapping[str, Any], schema: type[LoopFile] | type[SweepFile]
) -> dict[str, Any]:
    """Keyword arguments of `read_loop` or `read_sweep` for a test file with the given campaign keys.

    Args:
        table: table of the file, which is not opened again.
        place: direction or specimen.
        entry: keys of the test's table in a campaign.
        schema: dataclass of the table, for a loop or a sweep.

    Returns:
        Keyword arguments of the reader.
    """
    file, specimens = table.file, [place] if isinstance(place, Specimen) else []
    tested = {} if specimens else {"direction": str(place)}
    test = validate_tables({**entry, "file": str(file), **tested}, file, schema)
    with error_location(file, "at_amplitude"):  # which alone is converted there
        return {**next(reader_keywords(Path(), [test], [file.stem], specimens)), "file": table.opened}


def is_contradicted(text: str, loop: Loop) -> bool:
    """True if a preload stated in text, such as "5 N", is far from the mean of the loop, whatever its sign."""
    if (preload := parse_preload(text, loop.direction)) is None:
        return False
    channel = loop.force if preload.unit == loop.direction.motion.force_unit else loop.displacement
    return abs(abs(preload.value) - abs(float(channel.mean()))) > _FAR_FROM_MEAN * float(np.ptp(channel))


def classify_recording(measured: Loop, labels: Mapping[str, Labels], test: LoopFile) -> tuple[Kind, Findings]:
    """Determine whether a recording is a loop, a programme of several loops, or a raw stepped-sine history.

    Args:
        measured: recording in SI.
        labels: amplitudes and frequencies stated in texts, by origin: "name" or "text above the table".
        test: table of the recording in a campaign.

    Returns:
        Kind of the recording, with its facts and oddities.
    """
    sines, cycles = steady_sines(measured)
    fastest = max((sine.frequency for sine in sines), default=0.0)
    is_fast = fastest > _QUASI_STATIC
    if is_fast and is_stepped_sine(measured, sines, cycles):
        return "history", describe_history(measured, labels)
    loops = split_record(measured, test)
    if len(loops) > 1:
        return "loop", describe_programme(measured, loops, labels)
    facts, odd = describe_loop(loops[0], labels)
    if is_fast or len(distinct_points(sines)) > 1:
        description = f"at {fastest:.3g} Hz" if is_fast else "of several amplitudes"
        sentence = f"a motion {description} is read as a loop; if it is a stepped sine, run bushfit reduce"
        odd.append(Caveat("read_as_loop", sentence))
    return "loop", (facts, odd)


def describe_columns(table: Table, *, is_sweep: bool) -> tuple[ColumnDescription, ...]:
    """Describe the columns of a test file: header, role (quantity, such as "force"), unit and range.

    Returns:
        The columns in order, with the range of their values in the unit of the file.
    """
    ranged = {*chain(*PAIRS), "frequency", "amplitude", "repeat"} if is_sweep else {"time", "displacement", "force"}
    ranged |= {*CONDITIONS}
    wanted = {
        role: column for role, column in table.roles.items() if role in ranged and table.holds_numbers(column.index)
    }
    values, _ = table.read(wanted, fewest_rows=1)  # the scales of `roles` are 1: not in SI
    columns = [ColumnDescription(header, None, None) for header in table.headers]
    for key, (index, _) in table.row_labels.items():
        columns[index] = ColumnDescription(table.headers[index], key.replace("_", " "), None)
    for role, column in table.roles.items():
        is_read = role in values and not column.terms
        ends = (float(values[role].min()), float(values[role].max())) if is_read else (None, None)
        for index in column.indices:
            columns[index] = ColumnDescription(table.headers[index], column.role.replace("_", " "), column.unit, *ends)
    return tuple(columns)


def describe_format(table: Table) -> dict[str, str]:
    """Describe the format of a file.

    Returns:
        Texts such as encoding, delimiter, decimal mark and line of the header, by label.
    """
    source, layout = table.source, table.layout
    if isinstance(source, Channels):
        written = {"format": source.format} | ({"group": source.sheet} if source.sheet else {})
    elif isinstance(source, Sheet):
        written = ({"sheet": source.sheet} if source.sheet else {}) | {"header": f"row {layout.header_line}"}
    else:
        written = {
            "encoding": source.encoding or "UTF-8",
            "columns separated by": next(name for name, mark in DELIMITERS.items() if mark == layout.delimiter),
            "decimal mark": "comma" if table.numerals.decimal == "," else "point",
            "header": f"line {layout.header_line}",
        }
    if table.numerals.thousands:
        written["thousands separated by"] = repr(table.numerals.thousands)
    if layout.units_line and any(layout.units):
        written["units"] = f"line {layout.units_line}"
    return written
