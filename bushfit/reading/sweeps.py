"""Stepped-sine sweeps read from files, or one error that tells why a file cannot be a sweep."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bushfit.geometry import Place
from bushfit.reading.headers import SWEEP_COLUMNS, AmplitudeConvention, Column
from bushfit.reading.layout import FileFormat
from bushfit.reading.measurement import Complex, Floats, Sweep, source_of
from bushfit.reading.runs import runs_of
from bushfit.reading.table import Table

#: The pairs of columns that each make a complex stiffness, in order of preference.
STIFFNESS_PAIRS = (("stiffness", "loss_factor"), ("stiffness", "phase"), ("storage_stiffness", "loss_stiffness"))
#: Columns of which every value is above zero.
_POSITIVE = ("frequency", "amplitude", "amplitude_reached", "stiffness", "storage_stiffness")
#: Rows of the shortest sweep; chosen: fewer show no dependence on frequency or amplitude.
_FEWEST_SWEEP_ROWS = 3
#: Above every number of a repeat; chosen: a larger one is another quantity.
_MOST_REPEATS = 1_000_000
#: [-] Loss factor below which no point of a bushing lies; noise may push one below zero.
_LOWEST_LOSS_FACTOR = -0.5
#: [-] Loss factor above which no point of a bushing lies; chosen: many times that of the softest rubber.
_HIGHEST_LOSS_FACTOR = 5.0
#: [-] Loss factor that every rubber exceeds somewhere; chosen: a tenth of what little-damping rubber has.
_LEAST_LOSS_FACTOR = 0.005
#: Share of |K| within which columns that say the same agree; chosen: some are rounded to few digits.
_AGREEMENT = 0.02
#: Factors from an amplitude as it is counted to zero-to-peak.
_ZERO_TO_PEAK: dict[AmplitudeConvention, float] = {"zero-to-peak": 1.0, "peak-to-peak": 0.5}


def read_sweep(
    file: Path,
    direction: Place,
    *,
    name: str | None = None,
    listed_as: Path | None = None,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    written: FileFormat | None = None,
    amplitude: AmplitudeConvention | None = None,
    noise: float | None = None,
    weight: float = 1.0,
    temperature: float | None = None,
    conditions: Mapping[str, str | float] | None = None,
) -> Sweep:
    """Read a stepped-sine sweep.

    Args:
        file: a table with columns frequency, amplitude and one of STIFFNESS_PAIRS. Two more are optional: repeat
            (without it, an operating point that occurs again is a repeat) and amplitude reached (where the rig missed
            the amplitude of the level).
        direction: direction of the test, which settles the units that fit.
        name: of the sweep; default the stem of the file.
        listed_as: the file as the campaign names it, for provenance; default its name.
        columns: header of a role (a key of SWEEP_COLUMNS), where it is not a usual one.
        units: unit of a role, where the file does not tell it.
        written: how the file is written, where it does not tell.
        amplitude: how the file counts amplitudes, where its header does not say so: zero-to-peak unless stated.
            The sweep has them zero-to-peak.
        noise, weight: of the sweep, see `Sweep`.
        temperature: at which it was tested [K], where it is stated.
        conditions: what else is stated of the test, for provenance.

    Raises:
        MeasurementError, UnitError: a file, column, unit or value that cannot be used.
    """
    table = Table.open(file, SWEEP_COLUMNS, columns, units, written)
    pair = _stiffness_pair(table)
    wanted = _sweep_columns(table, direction, pair)
    to_peak = _ZERO_TO_PEAK[_convention(table, wanted["amplitude"], amplitude)]
    values = table.read(wanted, fewest_rows=_FEWEST_SWEEP_ROWS)
    _check_positive(table, wanted, values)
    with np.errstate(over="ignore"):
        stiffness, loss_factor = _complex_stiffness(pair, values)
    _check_loss(table, wanted[pair[1]], loss_factor)
    _check_agreement(table, pair, values, stiffness)
    frequency, level = values["frequency"], to_peak * values["amplitude"]
    reached = to_peak * values["amplitude_reached"] if "amplitude_reached" in values else None
    runs = runs_of(frequency, level, _repeats(table, wanted, values))
    if reached is None and not np.array_equal(runs.amplitude, level):
        reached = level
    source = source_of(file, listed_as, table.sha256, temperature, conditions)
    return Sweep(
        name or file.stem,
        direction,
        frequency,
        runs.amplitude,
        stiffness,
        runs.repeat,
        noise,
        source,
        reached,
        runs.stepped,
        weight=weight,
    )


def _stiffness_pair(table: Table) -> tuple[str, str]:
    """The first of STIFFNESS_PAIRS that a table has columns for."""
    for pair in STIFFNESS_PAIRS:
        if set(pair) <= set(table.roles):
            return pair
    raise table.error(
        "no pair of columns gives a complex stiffness",
        line=table.layout.header_line,
        found=", ".join(table.headers),
        expected=", or ".join(" and ".join(pair) for pair in STIFFNESS_PAIRS).replace("_", " "),
        hint='correct the header, or name the columns in the campaign: columns = { stiffness = "..." }',
    )


def _sweep_columns(table: Table, direction: Place, pair: tuple[str, str]) -> dict[str, Column]:
    """The columns of a sweep with their units, in the order in which they are checked.

    Beside those that are needed, the pairs that say the same are read, if their units fit.
    """
    length, stiffness = direction.motion.displacement_unit, direction.motion.stiffness_unit
    units = dict.fromkeys(SWEEP_COLUMNS, stiffness) | {
        "frequency": "Hz",
        "amplitude": length,
        "amplitude_reached": length,
        "phase": "rad",
        "loss_factor": "1",
        "repeat": "1",
    }
    optional = [role for role in ("amplitude_reached", "repeat") if role in table.roles]
    again = [role for other in STIFFNESS_PAIRS if set(other) <= set(table.roles) for role in other]
    again = [role for role in again if units[role] == "1" or table.agrees(role, units[role])]
    return {role: table.column(role, units[role]) for role in ("frequency", "amplitude", *pair, *optional, *again)}


def _check_positive(table: Table, wanted: Mapping[str, Column], values: Mapping[str, Floats]) -> None:
    """Refuse a column of _POSITIVE with a value that is not."""
    for role in _POSITIVE:
        if role in values:
            table.refuse(
                values[role] <= 0.0,
                wanted[role],
                f"the {role.replace('_', ' ')} is not positive",
                "a number above zero",
            )


def _check_loss(table: Table, column: Column, loss_factor: Floats) -> None:
    """Refuse a loss that counts the other way, ratios that are stated in %, and a loss that no bushing has."""
    if np.median(loss_factor) < -_LEAST_LOSS_FACTOR:
        raise table.error(
            "the loss counts the other way",
            column=column,
            found=f"{int(np.count_nonzero(loss_factor < 0.0))} of {loss_factor.size} rows below zero",
            expected="a force that leads the displacement: phase, loss factor and loss stiffness above zero",
            hint="turn the sign of this column in the file",
        )
    largest = float(np.abs(loss_factor).max())
    if column.role == "loss_factor" and column.scale != 1.0 and 0.0 < largest < _LEAST_LOSS_FACTOR:
        raise table.error(
            "no rubber loses so little",
            column=column,
            found=f"{largest / column.scale:.3g} {column.unit} at most",
            expected=f"a loss factor above {_LEAST_LOSS_FACTOR / column.scale:g} {column.unit} somewhere",
            hint=f'if these are ratios, write "[-]" for "[{column.unit}]" in the header',
        )
    table.refuse(
        ~((loss_factor >= _LOWEST_LOSS_FACTOR) & (loss_factor <= _HIGHEST_LOSS_FACTOR)),
        column,
        "no bushing has this loss",
        f"a loss factor (loss over storage stiffness) from {_LOWEST_LOSS_FACTOR:g} to {_HIGHEST_LOSS_FACTOR:g}",
        "check the unit: a phase in deg or rad, a loss factor in % or as a ratio [-]",
    )


def _check_agreement(table: Table, pair: tuple[str, str], values: Mapping[str, Floats], stiffness: Complex) -> None:
    """Refuse rows in which another of STIFFNESS_PAIRS says something else; its loss may have the other sign."""
    for other in STIFFNESS_PAIRS:
        if other == pair or not set(other) <= set(values):
            continue
        again, _ = _complex_stiffness(other, values)
        apart = np.hypot(again.real - stiffness.real, np.abs(again.imag) - np.abs(stiffness.imag))
        own, others = (" and ".join(f'"{table.roles[role].header}"' for role in both) for both in (pair, other))
        table.refuse(
            ~(apart <= _AGREEMENT * np.abs(stiffness)),
            table.roles[other[1] if other[0] == pair[0] else other[0]],
            "the columns contradict each other",
            f"the complex stiffness of {own}, within {100 * _AGREEMENT:g} %, in {others}",
            "correct the columns that are wrong, or take them out",
        )


def _convention(table: Table, column: Column, stated: AmplitudeConvention | None) -> AmplitudeConvention:
    """How amplitudes are counted: as their header says, or else the campaign; zero-to-peak where neither says."""
    if column.convention and stated and column.convention != stated:
        raise table.error(
            "header and campaign count amplitudes differently",
            line=table.layout.header_line,
            column=column,
            found=f'{column.convention} in the header, amplitude = "{stated}" in the campaign',
            expected="one convention",
            hint="correct one of them; what the header says needs no key in the campaign",
        )
    return column.convention or stated or "zero-to-peak"


def _complex_stiffness(pair: tuple[str, str], values: Mapping[str, Floats]) -> tuple[Complex, Floats]:
    """Complex stiffness and loss factor by one of STIFFNESS_PAIRS, (n,) each; from 90 deg on the latter is nan."""
    first, second = (values[role] for role in pair)
    match pair:
        case ("stiffness", "loss_factor"):
            return (first / np.hypot(1.0, second)) * (1.0 + 1j * second), second
        case ("stiffness", "phase"):
            return first * np.exp(1j * second), np.where(np.abs(second) < np.pi / 2, np.tan(second), np.nan)
        case _:
            return first + 1j * second, second / first


def _repeats(table: Table, wanted: Mapping[str, Column], values: Mapping[str, Floats]) -> NDArray[np.int64] | None:
    """Number of each row's repeat as its column has it, (n,); None where there is none."""
    if "repeat" not in values:
        return None
    repeat = values["repeat"]
    is_count = (repeat == np.round(repeat)) & (repeat >= 0) & (repeat < _MOST_REPEATS)
    table.refuse(~is_count, wanted["repeat"], "this is no repeat number", "a whole number")
    return repeat.astype(np.int64)
