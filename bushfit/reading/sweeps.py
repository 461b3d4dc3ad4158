"""Stepped-sine sweeps read from files, or one error that tells why a file cannot be a sweep."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bushfit import units as si
from bushfit.geometry import Place, strain_factor_of_files
from bushfit.reading.headers import OF_MOTION, SWEEP_COLUMNS, AmplitudeConvention, Column
from bushfit.reading.measurement import SAME_TEMPERATURE, Complex, Floats, Sweep
from bushfit.reading.runs import runs_of
from bushfit.reading.stated import SweepFile
from bushfit.reading.table import Table

#: The pairs of columns that each make a complex stiffness, in order of preference.
STIFFNESS_PAIRS = (
    *(("stiffness", "loss_factor"), ("stiffness", "phase"), ("storage_stiffness", "loss_stiffness")),
    *(("storage_stiffness", "loss_factor"), ("storage_stiffness", "phase")),
)
#: Columns of which every value is above zero.
_POSITIVE = ("frequency", "amplitude", "amplitude_reached", "stiffness", "storage_stiffness", "relative_error")
#: Rows of the shortest sweep; chosen: fewer show no dependence on frequency or amplitude.
_FEWEST_SWEEP_ROWS = 3
#: Above every number of a repeat; chosen: a larger one is another quantity.
_MOST_REPEATS = 1_000_000
#: [-] Loss factors of a bushing; chosen: noise may push one below zero, and the softest rubber has many times less.
_LOSS_FACTORS = (-0.5, 5.0)
#: [-] Loss factor that every rubber exceeds somewhere; chosen: a tenth of what little-damping rubber has.
LEAST_LOSS_FACTOR = 0.005
#: Share of the points that are clearly below zero where a loss counts the other way; chosen: noise may lift some, and a
#: channel that is late leaves the loss of low frequencies above zero.
_THROUGHOUT = 0.95
#: Share within which an amplitude or frequency that is stated agrees with a column for it; chosen: rigs miss by less.
_STATED_AGREEMENT = 0.1
#: [K] Range of temperatures that one test may have; chosen: a rubber warms up by as much while it is tested.
ONE_TEST = 5.0
#: Share of |K| within which columns that say the same agree; chosen: some are rounded to few digits.
_AGREEMENT = 0.02
#: What else may be done about a column that is not there.
_HINTS = {
    "amplitude": 'or state at_amplitude = "0.1 mm" if all rows have it',
    "frequency": 'or state at_frequency = "10 Hz" if all rows have it',
}
#: Factors from an amplitude as it is counted to zero-to-peak.
_ZERO_TO_PEAK: dict[AmplitudeConvention, float] = {"zero-to-peak": 1.0, "peak-to-peak": 0.5}


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
        file: a table with columns frequency, amplitude and one of STIFFNESS_PAIRS, long or wide (see `wide`). More are
            optional: repeat (without it, an operating point that occurs again is a repeat), amplitude reached (where
            the rig missed the amplitude of the level), temperature, and relative error.
        direction, test, name, shared: as of `read_loop`; of a file with a column for the temperature, the rows near
            the one that is stated make the test.
        at_amplitude: that of the test in SI [m or rad, or strain]; it counts as file and campaign do, the sweep's are
            zero-to-peak.

    Raises:
        MeasurementError, UnitError: a file, column, unit or value that cannot be used.
    """
    rows = test.taken(shared=shared)
    table = Table.open(file, SWEEP_COLUMNS, test.columns, test.units, test, direction.motion, rows)
    pair = _stiffness_pair(table)
    stated = {"frequency": test.at_frequency, "amplitude": at_amplitude}
    at = {role: value for role, value in stated.items() if value is not None}
    wanted = _sweep_columns(table, direction, pair, at)
    to_peak = _ZERO_TO_PEAK[_convention(table, wanted.get("amplitude"), test.amplitude)]
    if at_amplitude is not None:  # as the file counts
        at["amplitude"] = (
            at_amplitude * strain_factor_of_files(direction) * _ZERO_TO_PEAK[test.amplitude or "zero-to-peak"] / to_peak
        )
    values = table.read(wanted, fewest_rows=_FEWEST_SWEEP_ROWS)
    table.check_positive(_POSITIVE, wanted, values)
    for role, value in at.items():
        values[role] = _stated(table, wanted.get(role), values, value)
    with np.errstate(over="ignore"):
        stiffness, loss_factor = _complex_stiffness(pair, values)
    _check_loss(table, wanted[pair[1]], loss_factor)
    _check_agreement(table, pair, values, stiffness)
    repeat = _repeats(table, wanted, values)
    taken, temperature, degrees = _of_temperature(table, values, test.temperature)
    frequency, level = values["frequency"][taken], to_peak * values["amplitude"][taken]
    reached = values["amplitude_reached"][taken] if "amplitude_reached" in values else None
    if reached is not None:
        own = wanted["amplitude_reached"].convention
        reached = reached * (_ZERO_TO_PEAK[own] if own else to_peak)
    runs = runs_of(frequency, level, None if repeat is None else repeat[taken], test.stepped)
    if reached is None and not np.array_equal(runs.amplitude, level):
        reached = level
    odd = table.not_understood(taken, frequency, runs.amplitude)
    return Sweep(
        name or file.stem,
        direction,
        frequency,
        runs.amplitude,
        stiffness[taken],
        runs.repeat,
        test.noise,
        test.source(table.sha256, temperature, odd),
        reached,
        runs.stepped,
        values["relative_error"][taken] if "relative_error" in values else None,
        weight=test.weight,
        temperature=degrees,
    )


def _stiffness_pair(table: Table) -> tuple[str, str]:
    """The first of STIFFNESS_PAIRS that a table has columns for."""
    for pair in STIFFNESS_PAIRS:
        if set(pair) <= set(table.roles):
            return pair
    for role in {role: None for pair in STIFFNESS_PAIRS for role in pair if role in OF_MOTION}:
        table.refuse_other_motion(role)
    raise table.header_error(
        "no pair of columns gives a complex stiffness",
        expected=", or ".join(" and ".join(pair) for pair in STIFFNESS_PAIRS).replace("_", " "),
        hint='correct the header, or name the columns in the campaign: columns = { stiffness = "..." }',
    )


def _sweep_columns(table: Table, direction: Place, pair: tuple[str, str], at: Mapping[str, float]) -> dict[str, Column]:
    """The columns of a sweep with their units, in the order in which they are checked.

    Roles that are stated (`at`) are not needed; other pairs are read, too, if their units fit. A temperature still
    counts from the zero of its unit.
    """
    length, stiffness = direction.motion.displacement_unit, direction.motion.stiffness_unit
    units = dict.fromkeys(SWEEP_COLUMNS, "1") | {"frequency": "Hz", "phase": "rad", "temperature": "K"}
    units |= dict.fromkeys(("amplitude", "amplitude_reached"), length)
    units |= dict.fromkeys(("stiffness", "storage_stiffness", "loss_stiffness"), stiffness)
    needed = [role for role in ("frequency", "amplitude") if role in table.roles or role not in at]
    degrees = table.roles.get("temperature")
    optional = [role for role in ("amplitude_reached", "repeat", "relative_error") if role in table.roles]
    optional = [role for role in optional if role != "repeat" or table.holds_numbers(table.roles[role].index)]
    optional += ["temperature"] if degrees and degrees.unit else []
    other_pairs = [role for other in STIFFNESS_PAIRS if set(other) <= set(table.roles) for role in other]
    other_pairs = [role for role in other_pairs if units[role] == "1" or table.agrees(role, units[role])]
    wanted = (*needed, *pair, *optional, *other_pairs)
    found = {role: table.column(role, units[role], _HINTS.get(role)) for role in wanted}
    for role in ("amplitude", "amplitude_reached"):
        if role in found:
            found[role] = replace(found[role], scale=strain_factor_of_files(direction) * found[role].scale)
    return found if degrees is None else {"temperature": degrees, **found}


def _check_loss(table: Table, column: Column, loss_factor: Floats) -> None:
    """Refuse a loss that counts the other way throughout, ratios stated in %, and a loss that no bushing has."""
    if np.mean(loss_factor < -LEAST_LOSS_FACTOR) > _THROUGHOUT:
        raise table.error(
            "the loss counts the other way",
            column=column,
            found=f"{np.count_nonzero(loss_factor < 0.0)} of {loss_factor.size} rows below zero",
            expected="a force that leads the displacement: phase, loss factor and loss stiffness above zero",
            hint="turn the sign of this column in the file",
        )
    largest = float(np.abs(loss_factor).max())
    if column.role == "loss_factor" and column.scale != 1.0 and 0.0 < largest < LEAST_LOSS_FACTOR:
        raise table.error(
            "no rubber loses so little",
            column=column,
            found=f"{largest / column.scale:.3g} {column.unit} at most",
            expected=f"a loss factor above {LEAST_LOSS_FACTOR / column.scale:g} {column.unit} somewhere",
            hint=f'if these are ratios, write "[-]" for "[{column.unit}]" in the header',
        )
    least, most = _LOSS_FACTORS
    table.refuse(
        ~((loss_factor >= least) & (loss_factor <= most)),
        column,
        "no bushing has this loss",
        f"a loss factor (loss over storage stiffness) from {least:g} to {most:g}",
        "check the unit: a phase in deg or rad, a loss factor in % or as a ratio [-]; or is it 90 deg less the loss?",
    )


def _check_agreement(table: Table, pair: tuple[str, str], values: Mapping[str, Floats], stiffness: Complex) -> None:
    """Refuse rows in which another of STIFFNESS_PAIRS says something else; its loss may have the other sign."""
    for other in STIFFNESS_PAIRS:
        if other == pair or not set(other) <= set(values):
            continue
        said, _ = _complex_stiffness(other, values)
        distance = np.hypot(said.real - stiffness.real, np.abs(said.imag) - np.abs(stiffness.imag))
        own, others = (" and ".join(f'"{table.roles[role].header}"' for role in both) for both in (pair, other))
        table.refuse(
            ~(distance <= _AGREEMENT * np.abs(stiffness)),
            table.roles[other[1] if other[0] == pair[0] else other[0]],
            "the columns contradict each other",
            f"the complex stiffness of {own}, within {100 * _AGREEMENT:g} %, in {others}",
            "correct the columns that are wrong, or take them out",
        )


def _stated(table: Table, column: Column | None, values: Mapping[str, Floats], stated: float) -> Floats:
    """The amplitude or frequency of each row [SI], (n,): as stated, or as its column has it, which must agree."""
    if column is None:
        return np.full(next(iter(values.values())).size, stated)
    found = values[column.role]
    table.refuse(
        np.abs(found - stated) > _STATED_AGREEMENT * stated,
        column,
        f"the {column.role} is not the one that is stated",
        f"at_{column.role} as the campaign states it, {stated / column.scale:.6g} {column.unit}, within 10 %",
        f"take at_{column.role} out of the campaign: the file has a column for it",
    )
    return found


def _of_temperature(
    table: Table, values: Mapping[str, Floats], stated: float | None
) -> tuple[NDArray[np.intp], float | None, Floats | float | None]:
    """The rows of a test, by index, its temperature [K], as stated or else the mean of its column, and that of each."""
    rows = np.arange(values["frequency"].size)
    if "temperature" not in values:
        return rows, stated, stated
    found, unit = values["temperature"], table.roles["temperature"].unit
    if unit is None and stated is None and np.ptp(found) <= ONE_TEST:
        return rows, None, None
    column = table.column("temperature", "K")
    celsius = found + (si.kelvin_scale(unit or "") or (1.0, 0.0))[1] - si.CELSIUS
    each = celsius + si.CELSIUS
    if stated is None:
        if np.ptp(celsius) <= ONE_TEST:
            return rows, round(float(celsius.mean()), 2) + si.CELSIUS, each
        problem, expected = "this file holds tests at several temperatures", "one temperature"
    else:
        rows = np.flatnonzero(np.abs(each - stated) <= SAME_TEMPERATURE)
        if rows.size >= _FEWEST_SWEEP_ROWS:
            return rows, stated, each[rows]
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


def _convention(table: Table, column: Column | None, stated: AmplitudeConvention | None) -> AmplitudeConvention:
    """How amplitudes are counted: as their header says, or else the campaign; zero-to-peak where neither says."""
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


def _complex_stiffness(pair: tuple[str, str], values: Mapping[str, Floats]) -> tuple[Complex, Floats]:
    """Complex stiffness and loss factor by one of STIFFNESS_PAIRS, (n,) each."""
    size, loss = (values[role] for role in pair)
    if pair[1] == "loss_stiffness":
        return size + 1j * loss, loss / size
    factor = loss
    if pair[1] == "phase":
        factor = np.where(np.abs(loss) < np.pi / 2, np.tan(loss), np.nan)  # none from 90 deg on
    if pair == ("stiffness", "phase"):
        return size * np.exp(1j * loss), factor
    storage = size / np.hypot(1.0, factor) if pair[0] == "stiffness" else size
    return storage * (1.0 + 1j * factor), factor


def _repeats(table: Table, wanted: Mapping[str, Column], values: Mapping[str, Floats]) -> NDArray[np.int64] | None:
    """Number of each row's repeat as its column has it, (n,), texts by their order; None where there is none."""
    if "repeat" in table.roles and "repeat" not in values:
        texts = table.texts(table.roles["repeat"].index)
        return np.array([*map([*dict.fromkeys(texts)].index, texts)], dtype=np.int64) + 1
    if (repeat := values.get("repeat")) is None:
        return None
    is_count = (repeat == np.round(repeat)) & (repeat >= 0) & (repeat < _MOST_REPEATS)
    table.refuse(~is_count, wanted["repeat"], "this is no repeat number", "a whole number")
    return repeat.astype(np.int64)
