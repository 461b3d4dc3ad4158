"""Hysteresis loops read from files."""

from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from bushfit.caveat import Caveat
from bushfit.geometry import ROTATION, Place
from bushfit.reading.block_labels import note_coupon
from bushfit.reading.finding import find_table
from bushfit.reading.headers import ERRORS, HINTS, LOOP_COLUMNS, Column, Vocabulary
from bushfit.reading.labelled import Rows, note_not_understood
from bushfit.reading.levels import rows_of_test
from bushfit.reading.measurement import FEWEST_LOOP_ROWS, Floats, Loop
from bushfit.reading.parts import OpenedFile
from bushfit.reading.si_columns import first_numbers, quantity_above, si_column
from bushfit.reading.source import LEAST_VALUE
from bushfit.reading.stated import LoopFile
from bushfit.reading.table import Table
from bushfit.reading.times import DAY, HOUR, are_day_numbers, sampling_rate_above, spread_rounded_times

#: Latest time of a record [s]; chosen: the year 5138 in seconds since 1970, or March 1973 in milliseconds.
_LATEST_SECOND = 1e11
#: Smallest time without a unit that is in nanoseconds since 1970, as databases write it; chosen: in 1973.
_SMALLEST_NANOSECONDS = 1e17
#: Names of a time; a column of another name that counts the rows is none.
_TIMES = Vocabulary({"time": LOOP_COLUMNS["time"]})
#: Relative difference up to which the step of a time agrees with a sampling rate; chosen: steps are rounded.
_RATE_AGREEMENT = 0.02


def read_loop(
    file: Path | OpenedFile, direction: Place, test: LoopFile, *, name: str | None = None, shared: bool = False
) -> Loop:
    """Read a hysteresis loop from a test file.

    Args:
        file: path, or opened file, of a table with columns time (optional), displacement and force.
        direction: direction of the bushing, or the specimen; it determines which headers and units are accepted.
        test: table [[loops]] of the campaign, with the information that the file does not contain.
        name: name of the loop; default the file name without its ending.
        shared: True if the file contains other tests too, so that a column has to distinguish them.

    Returns:
        Loop in SI.

    Raises:
        MeasurementError, UnitError: the file, a column, a unit or a value cannot be used.
    """
    rows = Rows(test.direction, test.specimen_number, test.rows, shared)
    table = find_table(file, LOOP_COLUMNS, test.columns, test.units, test, direction.motion, rows)
    stated_rate, note = (None, "") if test.states_time or "time" in table.roles else sampling_rate_above(table)
    test = replace(test, sampling_rate=stated_rate) if stated_rate else test
    wanted = loop_columns(table, direction, test)
    values, notes = table.read(wanted, fewest_rows=FEWEST_LOOP_ROWS)
    table = table.needing(wanted)
    selected, degrees = rows_of_test(table, test, direction, values["force"].size)
    if selected.size < values["force"].size:
        values = {role: numbers[selected] for role, numbers in values.items()}
    if direction.motion is ROTATION and np.ptp(turned := np.unwrap(values["displacement"]) - values["displacement"]):
        values["displacement"] += turned
        sentence = f'"{wanted["displacement"].header}" jumps by whole turns, which are left out'
        notes += (Caveat("angle_unwrapped", sentence),)
    displacement, force = values["displacement"], values["force"]
    for role in ("displacement", "force"):
        if np.ptp(values[role][:FEWEST_LOOP_ROWS]) < LEAST_VALUE and np.ptp(values[role]) < LEAST_VALUE:
            raise table.error(f"the {role} never changes", column=wanted[role], expected="a loop")
    if displacement @ force < displacement.sum() * force.sum() / force.size:  # a negative covariance
        sentence = f'"{wanted["force"].header}" falls where "{wanted["displacement"].header}" rises'
        if test.force_sign is not None:
            hint = f"take force_sign = {test.force_sign} out of the campaign"
            raise table.error(**ERRORS["falling_force"], column=wanted["force"], hint=hint)
        values["force"] = force = -force
        notes += (Caveat("reversed_force", f"{sentence}: the force has the opposite sign and is turned"),)
    if "time" in values:
        stuck = values["time"][1:] <= values["time"][:-1]
        copies = np.flatnonzero(stuck) + 1
        if copies.size and all(np.array_equal(x[copies], x[copies - 1]) for x in values.values()):
            values = {role: np.delete(numbers, copies) for role, numbers in values.items()}
            left_out = f"{copies.size} row{'s' * (copies.size > 1)} equal to the row before"
            notes += (Caveat("repeated_rows", f"left out: {left_out}, with the same time"),)
            displacement, force = values["displacement"], values["force"]
        time, more = increasing_time(table, wanted["time"], values["time"])
        notes = (*notes, *more)
    else:
        time = test.rebuild_time(displacement)
        notes += (Caveat("rate_from_header", note),) if stated_rate else ()
        if "time" in table.roles:
            sentence = f'"{table.roles["time"].header}" is not used, because the campaign states the time'
            notes += (Caveat("unused_time", sentence),)
    unknown = [*note_not_understood(table, table.row_labels, selected), *note_coupon(table, direction)]
    checksum, has_time = table.opened.checksum.result(), "time" in values or test.sampling_rate is not None
    properties = test.properties(direction, checksum, degrees, (*notes, *unknown))
    name = name or table.file.stem
    return Loop(name, direction, time, displacement, force, has_recorded_time=has_time, **properties)


def loop_columns(table: Table, direction: Place, test: LoopFile) -> dict[str, Column]:
    """Find the columns of a loop, with their factors to SI.

    Args:
        table: table of the loop.
        direction: direction of the bushing, or the specimen.
        test: table [[loops]] of the campaign; if it states the time, the file needs no time column.

    Returns:
        Columns by "displacement", "force" and, if the file has one, "time".

    Raises:
        MeasurementError: a column is missing, or displacement and force are swapped.
        UnitError: a unit is missing or does not fit.
    """
    swapped = {"displacement": direction.motion.force_unit, "force": direction.motion.displacement_unit}
    if all(table.agrees(role, unit) for role, unit in swapped.items()):
        displacement, force = (table.roles[role].header for role in ("displacement", "force"))
        keys = f'{{ displacement = "{force}", force = "{displacement}" }}'
        hint = f"correct the header, or name the columns in the campaign: columns = {keys}"
        raise table.header_error(**ERRORS["swapped_columns"], found=f'"{displacement}" and "{force}"', hint=hint)
    wanted = {role: si_column(table, role, direction) for role in ("displacement", "force")}
    wanted["force"] = replace(wanted["force"], scale=(test.force_sign or 1) * wanted["force"].scale)
    if "time" in table.roles and not test.states_time:
        wanted["time"] = time_column(table, direction)
    elif not test.states_time:
        rate = quantity_above(table, "m/s") or "... mm/min"
        si_column(table, "time", direction, f'or state rate = "{rate}", {HINTS["time"]}')
    return wanted


def time_column(table: Table, place: Place) -> Column:
    """Return the time column of a table with its factor to seconds.

    If its header has no unit, day numbers of a spreadsheet or a sampling rate above the table show the unit.
    """
    time = table.roles.get("time")
    has_known_name = time is None or _TIMES.heading(time.header) is not None
    if time is None or time.index in table.clocks or (has_known_name and time.unit):
        return si_column(table, "time", place)
    numbers = first_numbers(table, [time])
    if not has_known_name and numbers.size > 2 and np.all(np.diff(numbers[:, 0]) == 1.0):
        raise table.error(**ERRORS["row_counter"], column=time)
    if time.unit:
        return si_column(table, "time", place)
    if np.min(numbers, initial=np.inf) > _SMALLEST_NANOSECONDS:
        return replace(time, scale=1e-9)
    with suppress(ValueError):  # which the reading of the table reports
        values = table.read({"time": time}, fewest_rows=2)[0]["time"]
        step = (values[-1] - values[0]) / (values.size - 1)
        rate, _ = sampling_rate_above(table)
        scales = [DAY] if are_day_numbers(values) else [1.0, 1e-3, 60.0] if rate else []
        fitting = [scale for scale in scales if scale == DAY or abs(rate * step * scale - 1.0) < _RATE_AGREEMENT]
        if fitting:
            return replace(time, scale=fitting[0])
    return si_column(table, "time", place)


def increasing_time(table: Table, column: Column, time: Floats) -> tuple[Floats, tuple[Caveat, ...]]:
    """Correct a recorded time so that it increases from row to row.

    Clock times continue after midnight, and those without hours after the full hour. Rounded times that repeat are
    spread evenly.

    Args:
        table: table of the loop, for errors.
        column: time column.
        time: time as recorded [s], (n,).

    Returns:
        Time [s], (n,), and a warning if repeated times were spread.

    Raises:
        MeasurementError: the time decreases or is constant, or its unit is in doubt.
    """
    if column.index in table.clocks:
        turn = DAY if time.max() >= HOUR else HOUR  # clock times fall back at midnight, minutes at the full hour
        time = time + turn * np.cumsum(np.append(0.0, np.diff(time) < -0.5 * turn))
        time = time - time[0]
    likelier = ("ms", "milliseconds since 1970", "") if time.size and time[0] > _LATEST_SECOND else None
    if column.scale == 1.0 and column.unit and are_day_numbers(time):
        likelier = ("d", "day numbers of a spreadsheet", ", or days")
    if likelier:
        raise table.error(
            f"these times look like {likelier[1]}, not seconds",
            column=column,
            found=f"{time[0] / column.scale:.15g} {column.unit or 's'} in the first row",
            expected=f"times in seconds{likelier[2]}",
            hint=f'units = {{ time = "{likelier[0]}" }} in the campaign; or subtract the first time from all',
        )
    stuck = time[1:] <= time[:-1]
    if stuck.any() and (even := spread_rounded_times(time)) is not None:
        rate = (time.size - 1) / (even[-1] - even[0])
        sentence = f'"{column.header}" is rounded and repeats: its rows are spread evenly, at {rate:.6g} Hz'
        return even, (Caveat("rows_spread", sentence),)
    steps = np.diff(time)[~stuck]
    rate = f"{1.0 / np.median(steps):.6g} Hz" if steps.size else "... Hz"
    even_rows = f'if the rows are evenly spaced, sampling_rate = "{rate}" in the campaign replaces this column'
    hint = f"{even_rows}; if a column numbers the runs, bushfit init makes one loop of each run"
    if "block" in table.headers:
        hint = HINTS["block"]
    elif np.all(np.diff(time) >= 0.0):
        hint = f"export the file again with more digits of the time; or, {even_rows}"
    elif steps.size and time[1:].min() <= time[0] + np.median(steps):
        hint = 'the time starts again: number the runs in a column "run", or write each run to a file of its own'
    table.refuse(np.append(False, stuck), column, "time does not increase", "a later time in each row", hint)
    if time[-1] - time[0] < LEAST_VALUE:
        raise table.error("the duration of the record is zero", column=column, expected=f"{LEAST_VALUE:g} s or more")
    return time, ()
