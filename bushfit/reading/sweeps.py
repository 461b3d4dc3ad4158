"""Stepped-sine sweeps read from files."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bushfit import units as si
from bushfit.caveat import Caveat
from bushfit.geometry import Place, strain_factor_of_files
from bushfit.reading.block_labels import note_coupon
from bushfit.reading.finding import find_table
from bushfit.reading.headers import ERRORS, HINTS, SWEEP_COLUMNS, WORDS, ZERO_TO_PEAK, AmplitudeConvention, Column
from bushfit.reading.labelled import Rows, column_texts, note_not_understood
from bushfit.reading.levels import rows_of_test
from bushfit.reading.measurement import Complex, Floats, Sweep
from bushfit.reading.parts import OpenedFile
from bushfit.reading.rejected import check_positive
from bushfit.reading.roles import AGREEING_PAIRS, si_unit
from bushfit.reading.runs import Runs, runs_of
from bushfit.reading.si_columns import si_column
from bushfit.reading.stated import SweepFile
from bushfit.reading.stiffness import (
    check_stiffness,
    complex_stiffness,
    convert_values,
    stiffness_pair,
    with_positive_loss,
)
from bushfit.reading.table import Table

#: Smallest number of rows of a sweep; chosen: fewer show no dependence on frequency or amplitude.
_FEWEST_SWEEP_ROWS = 3
#: Limit of repeat numbers; chosen: a larger number is another quantity.
_MOST_REPEATS = 1_000_000
#: Relative difference up to which a stated amplitude or frequency agrees with its column; chosen: rigs miss by less.
_STATED_AGREEMENT = 0.1
#: Largest difference of ln |K| of repeats at one amplitude and frequency; chosen: mountings differ by less.
_LARGEST_REPEAT = 0.03
#: Smallest such difference of blocks without titles that is reported; chosen: repeats in one mounting differ by less.
_NOTED_REPEAT = 0.01
#: Name of an amplitude that may be peak-to-peak: a stroke, unless it is called its amplitude.
_STROKE = re.compile("|".join(WORDS["counting"]["stroke"]), re.IGNORECASE)


def read_sweep(
    file: Path | OpenedFile,
    direction: Place,
    test: SweepFile,
    *,
    name: str | None = None,
    shared: bool = False,
    at_amplitude: float | None = None,
) -> Sweep:
    """Read a stepped-sine sweep from a test file.

    Args:
        file: path, or opened file, of a table with frequency, amplitude and two quantities that give the complex
            stiffness, such as |K| and loss factor; frequencies or amplitudes may be across. Optional columns: repeat
            (by default, an operating point that occurs again is a repeat), amplitude reached, temperature, and relative
            error.
        direction: direction of the bushing, or the specimen.
        test: table [[sweeps]] of the campaign, with the information that the file does not contain. Its temperature
            selects rows of a file with several temperatures.
        name: name of the sweep; default the file name without its ending.
        shared: True if the file contains other tests too, so that a column has to distinguish them.
        at_amplitude: amplitude of all rows [m or rad, or strain], in the convention `test.amplitude`.

    Returns:
        Sweep in SI, with zero-to-peak amplitudes.

    Raises:
        MeasurementError, UnitError: the file, a column, a unit or a value cannot be used.
    """
    rows = Rows(test.direction, test.specimen_number, test.rows, shared)
    table = find_table(file, SWEEP_COLUMNS, test.columns, test.units, test, direction.motion, rows)
    pair = stiffness_pair(table)
    to_peak = strain_factor_of_files(direction) * ZERO_TO_PEAK[test.amplitude or "zero-to-peak"]
    stated = {"frequency": test.at_frequency, "amplitude": at_amplitude and at_amplitude * to_peak}
    constants = {role: value for role, value in stated.items() if value is not None}
    columns = sweep_columns(table, direction, pair, constants, test.amplitude)
    values, notes = table.read(columns, fewest_rows=_FEWEST_SWEEP_ROWS)
    table = table.needing(columns)
    check_positive(table, columns, values)
    values, converted = convert_values(values, columns)
    for role, value in constants.items():
        if role in columns:
            table.refuse(
                np.abs(values[role] - value) > _STATED_AGREEMENT * value,
                columns[role],
                f"the {role} in the file differs from the stated {role}",
                f"at_{role} as the campaign states it, {value / columns[role].scale:.6g} {columns[role].unit}, "
                f"within {100 * _STATED_AGREEMENT:g} %",
                f"remove at_{role} from the campaign: the file has a column for the {role}",
            )
        values.setdefault(role, np.full(values[pair[0]].size, value))
    values, corrections = with_positive_loss(values, columns, test)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        stiffness, loss_factor = complex_stiffness(pair, values)
    check_stiffness(table, pair, columns, values, stiffness, loss_factor)
    frequency = values["frequency"]
    points = (frequency, values["amplitude"])
    selected, degrees = rows_of_test(table, test, direction, frequency.size, points)
    repeat = _repeat_numbers(table, values)
    if repeat is None and (copies := _copied_rows(points, values.values())).any():
        selected = selected[~copies[selected]]
        count = int(copies.sum())
        sentence = f"left out: {count} row{'s' * (count > 1)} equal to another row of the same point, in all columns"
        notes += (Caveat("repeated_rows", sentence),)
    frequency, amplitude = frequency[selected], values["amplitude"][selected]
    reached = values["amplitude_reached"][selected] if "amplitude_reached" in values else None
    runs = runs_of(frequency, amplitude, None if repeat is None else repeat[selected], test.stepped)
    if repeat is None and runs.repeat.max() > 1:
        difference = _largest_offset((frequency, runs.amplitude), runs.repeat, stiffness[selected])
        for role in constants.keys() - columns.keys():
            _refuse_several_levels(table, role, (frequency, amplitude), runs.repeat, difference)
        if "block" in table.headers and difference > _NOTED_REPEAT:
            sentence = f"the blocks are read as repeats, although their stiffness differs by {100 * difference:.2g} %"
            notes += (Caveat("column_not_understood", f"{sentence}: if they differ in anything, {HINTS['repeats']}"),)
    if "amplitude" in columns and columns["amplitude"].role == "force_amplitude":
        runs = Runs(None, amplitude, runs.repeat)  # no amplitude is kept under a force that is
    if reached is None and not np.array_equal(runs.amplitude, amplitude):
        reached = amplitude
    unknown = [*note_not_understood(table, table.row_labels, selected, frequency, runs.amplitude)]
    unknown += note_coupon(table, direction)
    notes = (*notes, *converted, *corrections, *unknown)
    properties = test.properties(direction, table.opened.checksum.result(), degrees, notes)
    return Sweep(
        name or table.file.stem,
        direction,
        frequency,
        runs.amplitude,
        stiffness[selected],
        runs.repeat,
        reached=reached,
        stepped=runs.stepped,
        relative_error=values["relative_error"][selected] if "relative_error" in values else None,
        **{**properties, "temperature": test.temperature if degrees is None else degrees + si.CELSIUS},
    )


def sweep_columns(
    table: Table,
    direction: Place,
    pair: tuple[str, str],
    constants: Mapping[str, float],
    convention: AmplitudeConvention | None,
) -> dict[str, Column]:
    """Find the columns of a sweep, with their factors to SI and, for amplitudes, to zero-to-peak.

    Args:
        table: table of the sweep.
        direction: direction of the bushing, or the specimen.
        pair: roles of the two columns that give the stiffness, such as ("stiffness", "loss_factor").
        constants: frequency [Hz] or amplitude of all rows as the campaign states it, by role; needs no column.
        convention: convention of the amplitudes; None if the campaign does not state it.

    Returns:
        Columns by role: the needed ones, those of other pairs if their units fit, and optional ones.

    Raises:
        MeasurementError: a column is missing, or the convention of an amplitude is unknown or contradictory.
        UnitError: a unit is missing or does not fit.
    """
    roles = table.roles
    numeric = {role for role, column in roles.items() if table.holds_numbers(column.index)}
    wanted = [role for role in ("frequency", "amplitude") if role in roles or role not in constants] + [*pair]
    wanted += [role for role in ("amplitude_reached", "relative_error") if role in roles]
    wanted += ["repeat"] if "repeat" in numeric else []
    wanted += ["stiffness"] if "amplitude" in roles and roles["amplitude"].role == "force_amplitude" else []
    redundant = (role for other_pair in AGREEING_PAIRS if set(other_pair) <= set(roles) for role in other_pair)
    wanted += [role for role in redundant if table.agrees(role, si_unit(role, direction.motion))]
    columns = {role: si_column(table, role, direction, HINTS.get(role)) for role in wanted}
    amplitude, force = columns.get("amplitude"), columns.get("force_amplitude")
    in_header, error = amplitude.convention if amplitude else None, dict[str, Any]()
    used = in_header or convention or "zero-to-peak"
    if in_header and convention and in_header != convention:
        found = f'{in_header} in the header, amplitude = "{convention}" in the campaign'
        error = {**ERRORS["two_conventions"], "found": found}
    elif amplitude and not (in_header or convention) and _STROKE.match(amplitude.header):
        error = {**ERRORS["stroke"], "found": f'"{amplitude.header}"'}
    elif force and not force.convention and used != "zero-to-peak":
        found = f'"{force.header}" beside a displacement that is {used}'
        forms = ("p-p" if used == "peak-to-peak" else "rms", "0-p")
        units = " or ".join(f'units = {{ force_amplitude = "{force.unit} {form}" }}' for form in forms)
        error = {**ERRORS["no_convention"], "found": found, "hint": f"{units} in the campaign"}
    if error:
        raise table.header_error(**error)
    for role in ("amplitude", "amplitude_reached", "force_amplitude"):
        if column := columns.get(role):
            columns[role] = replace(column, scale=ZERO_TO_PEAK[column.convention or used] * column.scale)
    return columns


def _copied_rows(points: Sequence[Floats], values: Collection[Floats]) -> NDArray[np.bool_]:
    """Mask of the rows, (n,), that were probably copied, such as where two saved files were joined.

    A copied row has the numbers of an earlier row, and its operating point has more rows than most points have.

    Args:
        points: frequency and amplitude of each row, (n,) each.
        values: all numbers of each row, (n,) each.
    """
    import pandas as pd

    groups = pd.DataFrame(dict(enumerate(points))).groupby([0, 1])
    copied = pd.DataFrame(dict(enumerate(values))).duplicated()
    return np.asarray(copied & (groups[0].transform("size") > groups.size().median()))


def _largest_offset(points: Sequence[Floats], run: NDArray[np.int64], stiffness: Complex) -> float:
    """Largest difference of the mean of ln |K| between two runs over equal points.

    Args:
        points: frequency and amplitude of each row, (n,) each.
        run: number of the run of each row, (n,).
        stiffness: complex stiffness of each row, (n,).
    """
    import pandas as pd

    size = pd.Series(np.log(np.abs(stiffness)))
    return float(np.ptp((size - size.groupby([*points]).transform("mean")).groupby(run).mean()))


def _refuse_several_levels(
    table: Table, role: str, points: Sequence[Floats], run: NDArray[np.int64], difference: float
) -> None:
    """Refuse one stated amplitude or frequency if the runs of a file differ by more than repeats.

    Args:
        table: table of the sweep.
        role: "amplitude" or "frequency".
        points: frequency and amplitude of each row, (n,) each.
        run: number of the run of each row, (n,).
        difference: difference of ln |K| between two runs, from `_largest_offset`.

    Raises:
        MeasurementError: the mean stiffness of two runs over equal points differs by more than 3 %.
    """
    begins_again = any(np.unique(x).size > 2 and np.abs(np.diff(x)).max() == np.ptp(x) for x in points)
    if begins_again and difference > _LARGEST_REPEAT:
        problem, expected = f"one {role} is stated, but this file may have several", f"the {role} of each run"
        found = f"{run.max()} runs over the same points, whose stiffness differs by {100 * difference:.2g} %"
        hint = f"{HINTS['level_of_blocks']} at_{role}" if "block" in table.headers else f"add a column for the {role}"
        raise table.header_error(problem, found=found, expected=expected, hint=hint)


def _repeat_numbers(table: Table, values: Mapping[str, Floats]) -> NDArray[np.int64] | None:
    """Repeat number of each row, (n,); texts are numbered in order of appearance. None without a column of repeats.

    Raises:
        MeasurementError: the column contains a number that is not a whole number.
    """
    if "repeat" not in table.roles:
        return None
    column = table.roles["repeat"]
    if "repeat" not in values:
        return next(column_texts(table, column.index)).codes.astype(np.int64) + 1
    repeat = values["repeat"]
    is_count = (repeat == np.round(repeat)) & (repeat >= 0) & (repeat < _MOST_REPEATS)
    table.refuse(~is_count, column, "this is not a repeat number", "a whole number")
    return repeat.astype(np.int64)
