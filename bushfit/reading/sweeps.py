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
    OF_MOTION,
    PAIRS,
    SWEEP_COLUMNS,
    ZERO_TO_PEAK,
    AmplitudeConvention,
    Column,
    Vocabulary,
)
from bushfit.reading.measurement import SAME_TEMPERATURE, Complex, Floats, Sweep
from bushfit.reading.runs import runs_of
from bushfit.reading.stated import SweepFile
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
#: Loss factors of a bushing [-]; chosen: noise may push one below zero, and the softest rubber is far below 5.
_LOSS_FACTORS = (-0.5, 5.0)
#: Loss factor that every rubber exceeds somewhere [-]; chosen: a tenth of the least damping rubber.
LEAST_LOSS_FACTOR = 0.005
#: Share of the points below zero from which the sign of the loss is reversed; chosen: noise may lift some, and a late
#: channel leaves the loss at low frequencies positive.
_THROUGHOUT = 0.95
#: Share within which a stated amplitude or frequency agrees with its column; chosen: rigs miss by less.
_STATED_AGREEMENT = 0.1
#: Range of temperatures in one test [K]; chosen: rubber warms up by as much during a test.
ONE_TEST = 5.0
#: Share of |K| within which redundant columns agree; chosen: some are rounded to few digits.
_AGREEMENT = 0.02
_HINTS = {
    "amplitude": 'or state at_amplitude = "0.1 mm" if all rows have it',
    "frequency": 'or state at_frequency = "10 Hz" if all rows have it',
}
#: Damping that can be a loss factor or a damping ratio.
_DAMPING = Vocabulary({"damping": ["damping", "damp", "Dämpfung", "amortissement", "amortiguamiento", "阻尼"]}, {})


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
    stated = {"frequency": test.at_frequency, "amplitude": at_amplitude}
    held = {role: value for role, value in stated.items() if value is not None}
    wanted = sweep_columns(table, direction, pair, held)
    convention = amplitude_convention(table, wanted.get("amplitude"), test.amplitude)
    to_peak = ZERO_TO_PEAK[convention]
    if at_amplitude is not None:  # counted like the column of the file
        held["amplitude"] = (
            at_amplitude * strain_factor_of_files(direction) * ZERO_TO_PEAK[test.amplitude or "zero-to-peak"] / to_peak
        )
    values, notes = table.read_with_notes(wanted, fewest_rows=_FEWEST_SWEEP_ROWS)
    table = table.needing(wanted)
    table.check_positive(_POSITIVE, wanted, values)
    for role, value in held.items():
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
    taken, temperature, degrees = rows_at_temperature(table, values, test.temperature)
    frequency, level = values["frequency"][taken], to_peak * values["amplitude"][taken]
    reached = values["amplitude_reached"][taken] if "amplitude_reached" in values else None
    if reached is not None:
        reached_convention = wanted["amplitude_reached"].convention
        reached = reached * (ZERO_TO_PEAK[reached_convention] if reached_convention else to_peak)
    runs = runs_of(frequency, level, None if repeat is None else repeat[taken], test.stepped)
    if reached is None and not np.array_equal(runs.amplitude, level):
        reached = level
    notes = (*notes, *more, *table.not_understood(taken, frequency, runs.amplitude))
    return Sweep(
        name or file.stem,
        direction,
        frequency,
        runs.amplitude,
        stiffness[taken],
        runs.repeat,
        test.noise,
        test.source(table.sha256, temperature, notes),
        reached,
        runs.stepped,
        values["relative_error"][taken] if "relative_error" in values else None,
        weight=test.weight,
        temperature=degrees,
    )


def stiffness_pair(table: Table) -> tuple[str, str]:
    """First of PAIRS for which a table has columns.

    Raises:
        MeasurementError: there is none, or the damping can be read in two ways.
    """
    for pair in PAIRS:
        if set(pair) <= set(table.roles):
            return pair
    for role in {role: None for pair in PAIRS for role in pair if role in OF_MOTION}:
        table.refuse_other_motion(role)
    refuse_ambiguous_damping(table)
    usual = ", or ".join(" and ".join(pair) for pair in AGREEING_PAIRS).replace("_", " ")
    raise table.header_error(
        "no pair of columns gives a complex stiffness",
        expected=f"{usual}, or a force amplitude and its phase",
        hint='correct the header, or name the columns in the campaign: columns = { stiffness = "..." }',
    )


def refuse_ambiguous_damping(table: Table) -> None:
    """Refuse a damping that can be a loss factor or a damping ratio.

    Raises:
        MeasurementError: there is such a column beside a stiffness or an amplitude of the force.
    """
    damping = next((header for header in table.headers if header and _DAMPING.heading(header)), None)
    if damping and {"stiffness", "storage_stiffness", "force_amplitude"} & set(table.roles):
        keys = (f'columns = {{ {role} = "{damping}" }}' for role in ("loss_factor", "damping_ratio"))
        coefficient = f'columns = {{ damping_coefficient = "{damping}" }}'
        raise table.header_error(
            "this damping can be a loss factor or a damping ratio, which is half as large",
            found=f'"{damping}"',
            expected="one of them, or a damping coefficient in N s/mm",
            hint=f"{' or '.join(keys)} or {coefficient} in the campaign",
        )


def sweep_columns(
    table: Table, direction: Place, pair: tuple[str, str], held: Mapping[str, float]
) -> dict[str, Column]:
    """Columns of a sweep with their factors to SI, in the order in which they are checked.

    Args:
        table: of the sweep.
        direction: of the bushing, or the specimen.
        pair: of PAIRS.
        held: frequency or amplitude that the campaign states, which then need no column.

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
    needed = [role for role in ("frequency", "amplitude") if role in table.roles or role not in held]
    degrees = table.roles.get("temperature")
    optional = [role for role in ("amplitude_reached", "repeat", "relative_error") if role in table.roles]
    optional = [role for role in optional if role != "repeat" or table.holds_numbers(table.roles[role].index)]
    optional += ["temperature"] if degrees and degrees.unit and table.holds_numbers(degrees.index) else []
    others = [role for other in AGREEING_PAIRS if set(other) <= set(table.roles) for role in other]
    others = [role for role in others if units[role] == "1" or table.agrees(role, units[role])]
    columns = {role: table.column(role, units[role], _HINTS.get(role)) for role in (*needed, *pair, *optional, *others)}
    for role in ("amplitude", "amplitude_reached"):
        if role in columns:
            columns[role] = replace(columns[role], scale=strain_factor_of_files(direction) * columns[role].scale)
    return columns if degrees is None or not table.holds_numbers(degrees.index) else {"temperature": degrees, **columns}


def amplitude_convention(
    table: Table, column: Column | None, stated: AmplitudeConvention | None
) -> AmplitudeConvention:
    """Convention of the amplitudes: that of the header, or else of the campaign; zero-to-peak if neither states one.

    Args:
        table: of the sweep.
        column: of the amplitude; None if there is none.
        stated: in the campaign.

    Raises:
        MeasurementError: header and campaign state different conventions.
    """
    if column is None:
        return stated or "zero-to-peak"
    if column.convention and stated and column.convention != stated:
        raise table.header_error(
            "header and campaign count amplitudes differently",
            column=column,
            found=f'{column.convention} in the header, amplitude = "{stated}" in the campaign',
            expected="one convention",
            hint="correct one of them; what the header says needs no key in the campaign",
        )
    return column.convention or stated or "zero-to-peak"


def force_amplitude_convention(table: Table, column: Column, of_motion: AmplitudeConvention) -> AmplitudeConvention:
    """Convention of the amplitudes of the force: that of their header, or zero-to-peak if the motion has the same.

    Args:
        table: of the sweep.
        column: of the amplitudes of the force.
        of_motion: convention of the amplitudes of the displacement.

    Raises:
        MeasurementError: only the header of the displacement states peak-to-peak or rms.
    """
    if column.convention is None and of_motion != "zero-to-peak":
        forms = {"peak-to-peak": "p-p", "rms": "rms"}
        keys = (f'units = {{ force_amplitude = "{column.unit} {form}" }}' for form in (forms[of_motion], "0-p"))
        raise table.header_error(
            "nothing says how the amplitudes of the force are counted",
            found=f'"{column.header}" beside a displacement that is {of_motion}',
            expected="p-p, rms or 0-p in the header",
            hint=f"{' or '.join(keys)} in the campaign",
        )
    return column.convention or "zero-to-peak"


def with_positive_loss(
    values: Mapping[str, Floats], columns: Mapping[str, Column], test: SweepFile
) -> tuple[dict[str, Floats], tuple[str, ...]]:
    """Correct the sign of a loss that is negative throughout, and the range of a phase.

    Args:
        values: in SI by role, (n,) each.
        columns: by role.
        test: force_sign and phase_sign as the user states them; None for an automatic choice.

    Returns:
        Corrected values, and a sentence on each correction.

    Notes:
        A phase is wrapped to -180 to 180 deg. Beyond 90 deg the force has the other sign, which turns it by 180 deg. A
        phase that is negative throughout is that of the displacement relative to the force.
    """
    corrected, notes = dict(values), []
    if (phase := values.get("phase")) is not None:
        header = columns["phase"].header
        wrapped = np.angle(np.exp(1j * phase))
        if np.abs(phase).max() > np.pi * (1.0 + 1e-9):
            notes.append(f'"{header}" goes beyond 180 deg and is wrapped')
        else:
            wrapped = phase
        automatic = test.force_sign is None and np.median(np.abs(wrapped)) > np.pi / 2.0
        if test.force_sign == -1 or automatic:
            wrapped = np.angle(-np.exp(1j * wrapped))
        if automatic:
            notes.append(
                f'"{header}" lies beyond 90 deg: the force counts the other way, and the phase is turned by 180 deg; '
                "force_sign = 1 in the campaign keeps it"
            )
        corrected["phase"] = wrapped
    for role in ("phase", "loss_factor", "loss_stiffness", "damping_coefficient", "damping_ratio"):
        if role not in corrected or role not in columns:
            continue
        size = (
            corrected[role] / np.median(values.get("storage_stiffness", values.get("stiffness", 1.0)))
            if role == "loss_stiffness"
            else corrected[role]
        )
        automatic = test.phase_sign is None and np.mean(size < -LEAST_LOSS_FACTOR) > _THROUGHOUT
        if test.phase_sign == -1 or automatic:
            corrected[role] = -corrected[role]
        if automatic:
            notes.append(
                f'"{columns[role].header}" is negative throughout and is taken with the other sign; '
                "phase_sign = 1 in the campaign keeps it"
            )
    return corrected, tuple(notes)


def complex_stiffness(pair: tuple[str, str], values: Mapping[str, Floats]) -> tuple[Complex, Floats]:
    """Complex stiffness and loss factor.

    Args:
        pair: one of PAIRS.
        values: in SI by role, (n,) each.

    Returns:
        Complex stiffness [N/m or N m/rad, or Pa], (n,), and loss factor [-], (n,), NaN from a phase of 90 deg on.

    Notes:
        K* = K' + i K'' with K'' = 2 pi f c of a damping coefficient c, and tan delta = 2 zeta of a damping ratio zeta.
        A force amplitude F at a displacement amplitude x gives |K*| = F / x.
    """
    size, loss = values[pair[0]], values[pair[1]]
    if pair[0] == "force_amplitude":
        size = size / values["amplitude"]
    if pair[1] in ("loss_stiffness", "damping_coefficient"):
        loss = loss * (2.0 * np.pi * values["frequency"] if pair[1] == "damping_coefficient" else 1.0)
        storage = size if pair[0] == "storage_stiffness" else np.sqrt(size**2 - loss**2)
        return storage + 1j * loss, loss / storage
    factor = 2.0 * loss if pair[1] == "damping_ratio" else loss
    if pair[1] == "phase":
        factor = np.where(np.abs(loss) < np.pi / 2, np.tan(loss), np.nan)
        if pair[0] != "storage_stiffness":
            return size * np.exp(1j * loss), factor
    storage = size if pair[0] == "storage_stiffness" else size / np.hypot(1.0, factor)
    return storage * (1.0 + 1j * factor), factor


def check_loss(table: Table, column: Column, loss_factor: Floats) -> None:
    """Refuse ratios that are stated in %, and a loss that no bushing has.

    Args:
        table: of the sweep.
        column: of the loss.
        loss_factor: [-], (n,).

    Raises:
        MeasurementError: such a loss.
    """
    if np.mean(loss_factor < -LEAST_LOSS_FACTOR) > _THROUGHOUT:
        raise table.error(
            "the loss counts the other way",
            column=column,
            found=f"{np.count_nonzero(loss_factor < 0.0)} of {loss_factor.size} rows below zero",
            expected="a force that leads the displacement: phase, loss factor and loss stiffness above zero",
            hint="take phase_sign out of the campaign, or state phase_sign = -1",
        )
    largest = float(np.nan_to_num(np.abs(loss_factor), nan=np.inf).max())
    if column.role == "loss_factor" and column.scale != 1.0 and 0.0 < largest < LEAST_LOSS_FACTOR:
        raise table.error(
            "no rubber loses so little",
            column=column,
            found=f"{largest / column.scale:.3g} {column.unit} at most",
            expected=f"a loss factor above {LEAST_LOSS_FACTOR / column.scale:g} {column.unit} somewhere",
            hint=f'if these are ratios, write "[-]" for "[{column.unit}]" in the header',
        )
    low, high = _LOSS_FACTORS
    table.refuse(
        ~((loss_factor >= low) & (loss_factor <= high)),
        column,
        "no bushing has this loss",
        f"a loss factor (loss over storage stiffness) from {low:g} to {high:g}",
        "check the unit: a phase in deg or rad, a loss factor in % or as a ratio [-]; or is it 90 deg less the loss?",
    )


def check_agreement(table: Table, pair: tuple[str, str], values: Mapping[str, Floats], stiffness: Complex) -> None:
    """Refuse rows in which other columns give another stiffness; their loss may have the other sign.

    Args:
        table: of the sweep.
        pair: of PAIRS that gave the stiffness.
        values: in SI by role, (n,) each.
        stiffness: complex [N/m or N m/rad, or Pa], (n,).

    Raises:
        MeasurementError: there is such a row.
    """
    for other in AGREEING_PAIRS:
        if other == pair or not set(other) <= set(values):
            continue
        redundant, _ = complex_stiffness(other, values)
        distance = np.hypot(redundant.real - stiffness.real, np.abs(redundant.imag) - np.abs(stiffness.imag))
        used, others = (" and ".join(f'"{table.roles[role].header}"' for role in both) for both in (pair, other))
        table.refuse(
            ~(distance <= _AGREEMENT * np.abs(stiffness)),
            table.roles[other[1] if other[0] == pair[0] else other[0]],
            "the columns contradict each other",
            f"the complex stiffness of {used}, within {100 * _AGREEMENT:g} %, in {others}",
            "correct the columns that are wrong, or take them out",
        )


def check_stated(table: Table, column: Column | None, values: Mapping[str, Floats], stated: float) -> Floats:
    """Amplitude or frequency of each row: its column, which must agree with the stated one, or else the stated one.

    Args:
        table: of the sweep.
        column: for the amplitude or frequency; None if there is none.
        values: in SI by role, (n,) each.
        stated: amplitude or frequency in SI.

    Returns:
        Amplitude or frequency in SI, (n,).

    Raises:
        MeasurementError: the column does not agree.
    """
    if column is None:
        return np.full(next(iter(values.values())).size, stated)
    table.refuse(
        np.abs(values[column.role] - stated) > _STATED_AGREEMENT * stated,
        column,
        f"the {column.role} is not the one that is stated",
        f"at_{column.role} as the campaign states it, {stated / column.scale:.6g} {column.unit}, within 10 %",
        f"take at_{column.role} out of the campaign: the file has a column for it",
    )
    return values[column.role]


def rows_at_temperature(
    table: Table, values: Mapping[str, Floats], stated: float | None
) -> tuple[NDArray[np.intp], float | None, Floats | float | None]:
    """Select the rows at the temperature of a test.

    Args:
        table: of the sweep.
        values: by role, (n,) each; the temperature in its unit.
        stated: temperature [K].

    Returns:
        Indices of the rows, temperature of the test [K], as stated or else the mean, and that of each row [K].

    Raises:
        MeasurementError: rows at several temperatures, or none near the stated one.
    """
    rows = np.arange(values["frequency"].size)
    if "temperature" not in values:
        return rows, stated, stated
    unit = table.roles["temperature"].unit
    if unit is None and stated is None and np.ptp(values["temperature"]) <= ONE_TEST:
        return rows, None, None
    column = table.column("temperature", "K")
    celsius = values["temperature"] + (si.kelvin_scale(unit or "") or (1.0, 0.0))[1] - si.CELSIUS
    kelvin = celsius + si.CELSIUS
    if stated is None:
        if np.ptp(celsius) <= ONE_TEST:
            return rows, round(float(celsius.mean()), 2) + si.CELSIUS, kelvin
        problem, expected = "this file holds tests at several temperatures", "one temperature"
    else:
        rows = np.flatnonzero(np.abs(kelvin - stated) <= SAME_TEMPERATURE)
        if rows.size >= _FEWEST_SWEEP_ROWS:
            return rows, stated, kelvin[rows]
        problem = "too few rows are near the temperature that is stated"
        expected = f"{_FEWEST_SWEEP_ROWS} rows or more within {SAME_TEMPERATURE:g} K of {stated - si.CELSIUS:.4g} degC"
    ordered = np.sort(celsius)
    means = [part.mean() for part in np.split(ordered, np.flatnonzero(np.diff(ordered) > SAME_TEMPERATURE) + 1)]
    nearest = min(means, key=lambda mean: abs(mean + si.CELSIUS - (stated or 0.0)))
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
    """Repeat number of each row as its column states it, (n,), texts in their order; None without such a column.

    Args:
        table: of the sweep.
        columns: by role.
        values: by role, (n,) each.

    Raises:
        MeasurementError: a number that is no whole number.
    """
    if "repeat" in table.roles and "repeat" not in values:
        texts = table.texts(table.roles["repeat"].index)
        return np.array([*map([*dict.fromkeys(texts)].index, texts)], dtype=np.int64) + 1
    if (repeat := values.get("repeat")) is None:
        return None
    is_count = (repeat == np.round(repeat)) & (repeat >= 0) & (repeat < _MOST_REPEATS)
    table.refuse(~is_count, columns["repeat"], "this is no repeat number", "a whole number")
    return repeat.astype(np.int64)
