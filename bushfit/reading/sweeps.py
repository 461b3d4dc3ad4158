"""Stepped-sine sweeps read from files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bushfit import units as si
from bushfit.geometry import STRAINING, Place, strain_factor_of_files
from bushfit.reading.headers import (
    AGREEING_PAIRS,
    SWEEP_COLUMNS,
    ZERO_TO_PEAK,
    AmplitudeConvention,
    Column,
)
from bushfit.reading.labelled import column_texts, note_not_understood
from bushfit.reading.measurement import SAME_TEMPERATURE, Floats, Sweep
from bushfit.reading.runs import runs_of
from bushfit.reading.stated import SweepFile
from bushfit.reading.stiffness import (
    check_agreement,
    check_loss,
    complex_stiffness,
    force_amplitude_convention,
    stiffness_pair,
    with_positive_loss,
)
from bushfit.reading.table import Table

#: Columns whose values must be positive.
_POSITIVE = (
    *("frequency", "amplitude", "amplitude_reached", "stiffness", "storage_stiffness", "force_amplitude"),
    "relative_error",
)
#: Rows of the shortest sweep; chosen: fewer show no dependence on frequency or amplitude.
_FEWEST_SWEEP_ROWS = 3
#: Above every repeat number; chosen: a larger number is another quantity.
_MOST_REPEATS = 1_000_000
#: Share within which a stated amplitude or frequency agrees with its column; chosen: rigs miss by less.
_STATED_AGREEMENT = 0.1
#: Range of temperatures in one test [K]; chosen: rubber warms up by as much during a test.
ONE_TEST = 5.0
_HINTS = {
    "amplitude": 'or state at_amplitude = "0.1 mm" if all rows have it',
    "frequency": 'or state at_frequency = "10 Hz" if all rows have it',
}


def read_sweep(
    file: Path,
    direction: Place,
    test: SweepFile,
    *,
    name: str | None = None,
    shared: bool = False,
    at_amplitude: float | None = None,
) -> Sweep:
    """Read a sweep.

    Args:
        file: long or wide table (see `wide`) with columns frequency, amplitude and one of PAIRS. Optional
            columns: repeat (by default, an operating point that occurs again is a repeat), amplitude reached,
            temperature, and relative error.
        direction: of the bushing, or the specimen.
        test: what the file does not state. The temperature selects rows of a file with several temperatures.
        name: of the sweep; default the stem of the file.
        shared: True if the file contains other tests too.
        at_amplitude: amplitude of all rows [m or rad, or strain], counted like the amplitudes of file and campaign.

    Returns:
        The sweep, with amplitudes zero-to-peak.

    Raises:
        MeasurementError, UnitError: a file, column, unit or value that cannot be used.
    """
    rows = test.rows_of_test(shared=shared)
    table = Table.open(file, SWEEP_COLUMNS, test.columns, test.units, test, direction.motion, rows)
    pair = stiffness_pair(table)
    stated_values = {"frequency": test.at_frequency, "amplitude": at_amplitude}
    constants = {role: value for role, value in stated_values.items() if value is not None}
    wanted = sweep_columns(table, direction, pair, constants)
    convention = amplitude_convention(table, wanted.get("amplitude"), test.amplitude)
    to_peak = ZERO_TO_PEAK[convention]
    if at_amplitude is not None:  # counted like the column of the file
        constants["amplitude"] = (
            at_amplitude * strain_factor_of_files(direction) * ZERO_TO_PEAK[test.amplitude or "zero-to-peak"] / to_peak
        )
    values, notes = table.read_with_notes(wanted, fewest_rows=_FEWEST_SWEEP_ROWS)
    table = table.needing(wanted)
    table.check_positive(_POSITIVE, wanted, values)
    for role, value in constants.items():
        values[role] = check_stated(table, wanted.get(role), values, value)
    if pair[0] == "force_amplitude":
        force_convention = force_amplitude_convention(table, wanted["force_amplitude"], convention)
        values["force_amplitude"] = values["force_amplitude"] * ZERO_TO_PEAK[force_convention] / to_peak
    values, more = with_positive_loss(values, wanted, test)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        stiffness, loss_factor = complex_stiffness(pair, values)
    check_loss(table, wanted[pair[1]], loss_factor)
    check_agreement(table, pair, values, stiffness)
    repeat = repeat_numbers(table, wanted, values)
    selected, temperature, degrees = rows_at_temperature(table, values, test.temperature)
    frequency, level = values["frequency"][selected], to_peak * values["amplitude"][selected]
    reached = values["amplitude_reached"][selected] if "amplitude_reached" in values else None
    if reached is not None:
        reached_convention = wanted["amplitude_reached"].convention
        reached = reached * (ZERO_TO_PEAK[reached_convention] if reached_convention else to_peak)
    runs = runs_of(frequency, level, None if repeat is None else repeat[selected], test.stepped)
    if reached is None and not np.array_equal(runs.amplitude, level):
        reached = level
    notes = (*notes, *more, *note_not_understood(table, table.row_labels, selected, frequency, runs.amplitude))
    return Sweep(
        name or file.stem,
        direction,
        frequency,
        runs.amplitude,
        stiffness[selected],
        runs.repeat,
        test.noise,
        test.source(table.sha256, temperature, notes),
        reached,
        runs.stepped,
        values["relative_error"][selected] if "relative_error" in values else None,
        weight=test.weight,
        temperature=degrees,
    )


def sweep_columns(
    table: Table, direction: Place, pair: tuple[str, str], constants: Mapping[str, float]
) -> dict[str, Column]:
    """Columns of a sweep with their factors to SI, in the order in which they are checked.

    Args:
        table: of the sweep.
        direction: of the bushing, or the specimen.
        pair: of PAIRS.
        constants: frequency or amplitude that the campaign states, which then need no column.

    Returns:
        Columns by role: those that are needed, those of other pairs if their units fit, and optional ones. A
        temperature counts from the zero of its unit.
    """
    motion = direction.motion
    seconds = "Pa*s" if motion is STRAINING else motion.stiffness_unit.replace("/", "*s/", 1)
    units = dict.fromkeys(SWEEP_COLUMNS, "1") | {"frequency": "Hz", "phase": "rad", "temperature": "K"}
    units |= dict.fromkeys(("amplitude", "amplitude_reached"), motion.displacement_unit)
    units |= dict.fromkeys(("stiffness", "storage_stiffness", "loss_stiffness"), motion.stiffness_unit)
    units |= {"force_amplitude": motion.force_unit, "damping_coefficient": seconds}
    needed = [role for role in ("frequency", "amplitude") if role in table.roles or role not in constants]
    degrees = table.roles.get("temperature")
    optional = [role for role in ("amplitude_reached", "repeat", "relative_error") if role in table.roles]
    optional = [role for role in optional if role != "repeat" or table.holds_numbers(table.roles[role].index)]
    optional += ["temperature"] if degrees and degrees.unit and table.holds_numbers(degrees.index) else []
    redundant = [
        role for pair_of_roles in AGREEING_PAIRS if set(pair_of_roles) <= set(table.roles) for role in pair_of_roles
    ]
    redundant = [role for role in redundant if units[role] == "1" or table.agrees(role, units[role])]
    columns = {
        role: table.column(role, units[role], _HINTS.get(role)) for role in (*needed, *pair, *optional, *redundant)
    }
    for role in ("amplitude", "amplitude_reached"):
        if role in columns:
            columns[role] = replace(columns[role], scale=strain_factor_of_files(direction) * columns[role].scale)
    return columns if degrees is None or not table.holds_numbers(degrees.index) else {"temperature": degrees, **columns}


def amplitude_convention(
    table: Table, column: Column | None, stated_convention: AmplitudeConvention | None
) -> AmplitudeConvention:
    """Determine the convention of the amplitudes.

    Args:
        table: of the sweep.
        column: of the amplitude; None if there is none.
        stated_convention: in the campaign.

    Returns:
        Convention in the header, or else in the campaign; zero-to-peak if neither states one.

    Raises:
        MeasurementError: header and campaign state different conventions.
    """
    if column is None:
        return stated_convention or "zero-to-peak"
    if column.convention and stated_convention and column.convention != stated_convention:
        raise table.header_error(
            "header and campaign state different counts of the amplitude",
            column=column,
            found=f'{column.convention} in the header, amplitude = "{stated_convention}" in the campaign',
            expected="one convention",
            hint="correct one of them; what the header says needs no key in the campaign",
        )
    return column.convention or stated_convention or "zero-to-peak"


def check_stated(table: Table, column: Column | None, values: Mapping[str, Floats], stated_value: float) -> Floats:
    """Amplitude or frequency of each row: its column, which must agree with the stated one, or else the stated one.

    Args:
        table: of the sweep.
        column: for the amplitude or frequency; None if there is none.
        values: in SI by role, (n,) each.
        stated_value: amplitude or frequency in SI.

    Returns:
        Amplitude or frequency in SI, (n,).

    Raises:
        MeasurementError: the column does not agree.
    """
    if column is None:
        return np.full(next(iter(values.values())).size, stated_value)
    table.refuse(
        np.abs(values[column.role] - stated_value) > _STATED_AGREEMENT * stated_value,
        column,
        f"the {column.role} is not the one that is stated",
        f"at_{column.role} as the campaign states it, {stated_value / column.scale:.6g} {column.unit}, within 10 %",
        f"take at_{column.role} out of the campaign: the file has a column for it",
    )
    return values[column.role]


def rows_at_temperature(
    table: Table, values: Mapping[str, Floats], stated_temperature: float | None
) -> tuple[NDArray[np.intp], float | None, Floats | float | None]:
    """Select the rows at the temperature of a test.

    Args:
        table: of the sweep.
        values: by role, (n,) each; the temperature in its unit.
        stated_temperature: temperature [K].

    Returns:
        Indices of the rows, temperature of the test [K], as stated or else the mean, and that of each row [K].

    Raises:
        MeasurementError: rows at several temperatures, or none near the stated one.
    """
    rows = np.arange(values["frequency"].size)
    if "temperature" not in values:
        return rows, stated_temperature, stated_temperature
    unit = table.roles["temperature"].unit
    if unit is None and stated_temperature is None and np.ptp(values["temperature"]) <= ONE_TEST:
        return rows, None, None
    column = table.column("temperature", "K")
    celsius = values["temperature"] + (si.kelvin_scale(unit or "") or (1.0, 0.0))[1] - si.CELSIUS
    kelvin = celsius + si.CELSIUS
    if stated_temperature is None:
        if np.ptp(celsius) <= ONE_TEST:
            return rows, round(float(celsius.mean()), 2) + si.CELSIUS, kelvin
        problem, expected = "this file contains tests at several temperatures", "one temperature"
    else:
        rows = np.flatnonzero(np.abs(kelvin - stated_temperature) <= SAME_TEMPERATURE)
        if rows.size >= _FEWEST_SWEEP_ROWS:
            return rows, stated_temperature, kelvin[rows]
        problem = "too few rows are near the temperature that is stated"
        degrees = f"{stated_temperature - si.CELSIUS:.4g} degC"
        expected = f"{_FEWEST_SWEEP_ROWS} rows or more within {SAME_TEMPERATURE:g} K of {degrees}"
    ordered = np.sort(celsius)
    means = [part.mean() for part in np.split(ordered, np.flatnonzero(np.diff(ordered) > SAME_TEMPERATURE) + 1)]
    nearest = min(means, key=lambda mean: abs(mean + si.CELSIUS - (stated_temperature or 0.0)))
    raise table.error(
        problem,
        column=column,
        found=", ".join(f"{mean:.1f}" for mean in means) + " degC",
        expected=expected,
        hint=f'state temperature = "{nearest:.1f} degC" in the campaign; several tests may name one file',
    )


def repeat_numbers(
    table: Table, columns: Mapping[str, Column], values: Mapping[str, Floats]
) -> NDArray[np.int64] | None:
    """Read the repeat number of each row.

    Args:
        table: of the sweep.
        columns: by role.
        values: by role, (n,) each.

    Returns:
        Numbers, (n,), in order of appearance if the column contains texts; None without such a column.

    Raises:
        MeasurementError: a number that is no whole number.
    """
    if "repeat" in table.roles and "repeat" not in values:
        return column_texts(table, table.roles["repeat"].index).codes.astype(np.int64) + 1
    if (repeat := values.get("repeat")) is None:
        return None
    is_count = (repeat == np.round(repeat)) & (repeat >= 0) & (repeat < _MOST_REPEATS)
    table.refuse(~is_count, columns["repeat"], "this is no repeat number", "a whole number")
    return repeat.astype(np.int64)
