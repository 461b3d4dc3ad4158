"""A table of frequency, amplitude and complex stiffness -> Sweep in SI, with one clear error for what cannot be one."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bushfit.geometry import Direction
from bushfit.reading.headers import SWEEP_COLUMNS, AmplitudeConvention, Column
from bushfit.reading.layout import FileFormat
from bushfit.reading.measurement import Floats, Source, Sweep
from bushfit.reading.table import Table

#: The pairs of columns that a complex stiffness can be read from, in order of preference.
STIFFNESS_PAIRS = (("stiffness", "loss_factor"), ("stiffness", "phase"), ("storage_stiffness", "loss_stiffness"))
_FEWEST_SWEEP_ROWS = 3
_MOST_REPEATS = 1_000_000
#: Noise may push a loss factor below zero; what lies outside these limits is no measured bushing.
_LOSS_FACTOR_RANGE = (-0.5, 5.0)
#: No rubber loses less than this throughout; columns that say the same agree within this share of |K|.
_LEAST_LOSS_FACTOR, _AGREE = 0.005, 0.02


def read_sweep(
    file: Path,
    direction: Direction,
    *,
    name: str | None = None,
    listed_as: Path | None = None,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    written: FileFormat | None = None,
    amplitude: AmplitudeConvention | None = None,
    noise: float | None = None,
) -> Sweep:
    """Read a stepped-sine sweep.

    Args:
        file: a table with columns frequency, amplitude, one of STIFFNESS_PAIRS, and repeat (optional: without it,
            an operating point that occurs again is a repeat) and amplitude reached (optional: where the rig missed
            the amplitude of the level).
        direction: direction of the test, which settles the units that fit.
        name: of the sweep; default the stem of the file.
        listed_as: the file as the campaign names it, for provenance; default its name.
        columns: header of a role (a key of SWEEP_COLUMNS), where it is not the usual one.
        units: unit of a role, where the file does not carry it.
        written: how the file is written, where it does not tell.
        amplitude: how the file counts amplitudes, where its header does not say so: zero-to-peak unless stated.
            The sweep has them zero-to-peak.
        noise: passed on.

    Raises:
        MeasurementError, UnitError: a file, column, unit or value that cannot be used.
    """
    table = Table.open(file, SWEEP_COLUMNS, columns, units, written)
    pair = next((pair for pair in STIFFNESS_PAIRS if set(pair) <= set(table.roles)), None)
    if pair is None:
        raise table.error(
            "no pair of columns gives a complex stiffness",
            line=table.layout.header_line,
            found=", ".join(table.headers),
            expected=", or ".join(" and ".join(pair) for pair in STIFFNESS_PAIRS).replace("_", " "),
            hint='correct the header, or name the columns in the campaign: columns = { stiffness = "..." }',
        )
    expected = {
        "frequency": "Hz",
        **dict.fromkeys(("amplitude", "amplitude_reached"), direction.motion.displacement_unit),
        **dict.fromkeys(("loss_factor", "repeat"), "1"),
        "phase": "rad",
    }
    also = (role for role in ("amplitude_reached", "repeat") if role in table.roles)
    roles = ["frequency", "amplitude", *pair, *also]
    units_of = {role: expected.get(role, direction.motion.stiffness_unit) for role in SWEEP_COLUMNS}
    again = (role for other in STIFFNESS_PAIRS if set(other) <= set(table.roles) for role in other)
    roles += [role for role in again if units_of[role] == "1" or table.agrees(role, units_of[role])]
    wanted = {role: table.column(role, units_of[role]) for role in roles}
    convention = _convention(table, wanted["amplitude"], amplitude)
    values = table.read(wanted, fewest_rows=_FEWEST_SWEEP_ROWS)

    for role in {"frequency", "amplitude", "amplitude_reached", "stiffness", "storage_stiffness"} & set(values):
        label = role.replace("_", " ")
        table.refuse(values[role] <= 0.0, wanted[role], f"the {label} is not positive", "a number above zero")
    with np.errstate(over="ignore"):
        stiffness, loss_factor = _complex_stiffness(pair, values[pair[0]], values[pair[1]])
    _check_loss(table, wanted[pair[1]], loss_factor)
    low, high = _LOSS_FACTOR_RANGE
    table.refuse(
        ~((loss_factor >= low) & (loss_factor <= high)),
        wanted[pair[1]],
        "no bushing has this loss",
        f"a loss factor (loss over storage stiffness) from {low:g} to {high:g}",
        "check the unit: a phase in deg or rad, a loss factor in % or as a ratio [-]",
    )
    _check_agreement(table, pair, values, stiffness)
    counted = 0.5 if convention == "peak-to-peak" else 1.0
    zero_to_peak = counted * values["amplitude"]
    reached = counted * values["amplitude_reached"] if "amplitude_reached" in values else None
    repeat = _repeats(table, wanted, values)
    source = Source(listed_as or Path(file.name), table.sha256)
    return Sweep(
        name or file.stem, direction, values["frequency"], zero_to_peak, stiffness, repeat, noise, source, reached
    )


def _check_loss(table: Table, column: Column, loss_factor: Floats) -> None:
    """Refuse a loss that is below zero throughout, and a loss factor in % whose values are ratios."""
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


def _check_agreement(
    table: Table, pair: tuple[str, str], values: Mapping[str, Floats], stiffness: NDArray[np.complex128]
) -> None:
    """Refuse rows in which another of STIFFNESS_PAIRS says something else; the sign of its loss is left open."""
    for other in STIFFNESS_PAIRS:
        if other == pair or not set(other) <= set(values):
            continue
        again, _ = _complex_stiffness(other, values[other[0]], values[other[1]])
        apart = np.hypot(again.real - stiffness.real, np.abs(again.imag) - np.abs(stiffness.imag))
        own, others = (" and ".join(f'"{table.roles[role].header}"' for role in both) for both in (pair, other))
        table.refuse(
            ~(apart <= _AGREE * np.abs(stiffness)),
            table.roles[other[1] if other[0] == pair[0] else other[0]],
            "the columns contradict each other",
            f"the complex stiffness of {own}, within {100 * _AGREE:g} %, in {others}",
            "correct the columns that are wrong, or take them out",
        )


def _convention(table: Table, column: Column, stated: AmplitudeConvention | None) -> AmplitudeConvention:
    """How amplitudes are counted, by their header or else by the campaign; zero-to-peak where neither says so."""
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


def _complex_stiffness(pair: tuple[str, str], first: Floats, second: Floats) -> tuple[NDArray[np.complex128], Floats]:
    """Complex stiffness and loss factor from one of STIFFNESS_PAIRS; the loss factor is nan from 90 deg on."""
    match pair:
        case ("stiffness", "loss_factor"):
            return (first / np.hypot(1.0, second)) * (1.0 + 1j * second), second
        case ("stiffness", "phase"):
            return first * np.exp(1j * second), np.where(np.abs(second) < np.pi / 2, np.tan(second), np.nan)
        case _:
            return first + 1j * second, second / first


def _repeats(table: Table, wanted: Mapping[str, Column], values: Mapping[str, Floats]) -> NDArray[np.int64]:
    """The repeat column, or else the count of earlier rows at the same frequency and amplitude, from 1."""
    if "repeat" in values:
        repeat = values["repeat"]
        is_count = (repeat == np.round(repeat)) & (repeat >= 0) & (repeat < _MOST_REPEATS)
        table.refuse(~is_count, wanted["repeat"], "this is no repeat number", "a whole number")
        return repeat.astype(np.int64)
    import pandas as pd

    points = pd.DataFrame({role: values[role] for role in ("frequency", "amplitude")})
    return np.asarray(points.groupby(["frequency", "amplitude"]).cumcount(), dtype=np.int64) + 1
