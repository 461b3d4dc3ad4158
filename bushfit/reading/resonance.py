"""Resonance tests read from files: a mass on a mount on a shaker, as accelerations or as their ratio."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bushfit.geometry import Place
from bushfit.reading.headers import ERRORS, RESONANCE_COLUMNS, WORDS, ZERO_TO_PEAK, Column
from bushfit.reading.measurement import Complex, Floats, Source
from bushfit.reading.rejected import check_positive
from bushfit.reading.si_columns import si_column
from bushfit.reading.table import Table

#: Sets of columns that give a transmissibility, in order of preference.
_COLUMN_SETS = [columns.split() for columns in WORDS["sets"]["transmissibility"]]
#: Roles that only a resonance test has.
_SPECIFIC = {role for role in RESONANCE_COLUMNS if role not in ("frequency", "phase")}
#: Smallest number of rows of a test; chosen: enough for a curve with five parameters and an estimate of its scatter.
FEWEST_ROWS = 12


@dataclass(frozen=True, eq=False)
class ResonanceTest:
    """Resonance test: a mass on a mount whose base is shaken by a sine of stepped frequency.

    Args:
        name: name of the test.
        direction: direction of the bushing, or the specimen, that is the mount.
        source: provenance of the test.
        frequency: frequency [Hz], (n,), rising.
        transmissibility: complex ratio of the acceleration of the mass to that of the base [-], (n,).
        base_acceleration: zero-to-peak acceleration of the base [m/s^2], (n,).
    """

    name: str
    direction: Place
    frequency: Floats
    transmissibility: Complex
    base_acceleration: Floats
    source: Source


def is_resonance(table: Table) -> bool:
    """Return True if a table, opened with RESONANCE_COLUMNS, has a column that occurs only in resonance tests."""
    return not _SPECIFIC.isdisjoint(table.roles)


def read_resonance(table: Table, direction: Place, base_acceleration: float | None = None) -> ResonanceTest:
    """Read a resonance test from a table.

    Args:
        table: table whose columns have the roles of a resonance test (RESONANCE_COLUMNS), such as "transmissibility".
        direction: direction of the bushing, or the specimen, that is the mount.
        base_acceleration: zero-to-peak acceleration of the base [m/s^2], for a table without a column for it.

    Returns:
        Resonance test in SI, sorted by frequency.

    Raises:
        MeasurementError, UnitError: a column, a unit or a value cannot be used.
    """
    wanted = _resonance_columns(table, direction, has_stated_base=base_acceleration is not None)
    values, _ = table.read(wanted, fewest_rows=FEWEST_ROWS)
    check_positive(table, wanted, values)
    ratio, base = _transmissibility(values, base_acceleration)
    bad = ~(np.isfinite(ratio) & (base > 0.0) & (ratio != 0.0))
    table.refuse(bad, wanted["frequency"], "base or mass does not move here", "two accelerations above zero")
    order = np.argsort(values["frequency"], kind="stable")
    source = Source(Path(table.file.name), table.opened.checksum.result())
    return ResonanceTest(table.file.stem, direction, values["frequency"][order], ratio[order], base[order], source)


def _resonance_columns(table: Table, place: Place, *, has_stated_base: bool) -> dict[str, Column]:
    """Find the columns of a resonance test: frequency, and either transmissibility or accelerations of base and mass.

    Args:
        table: table that was opened with RESONANCE_COLUMNS.
        place: direction of the bushing, or the specimen, that is the mount.
        has_stated_base: True if the user states the acceleration of the base.

    Returns:
        Columns with their factors to SI, by role such as "mass_acceleration".
    """
    columns = next((columns for columns in _COLUMN_SETS if set(columns) <= set(table.roles)), None)
    if columns is None:
        raise table.header_error(**ERRORS["no_transmissibility"])
    has_base = any(role.startswith("base") for role in columns) or "base_acceleration" in table.roles
    if has_base == has_stated_base:
        problem, found, expected = "stated twice", "a column, and --base-acceleration", "one of them"
        hint = "leave --base-acceleration out"
        if not has_base:
            problem, found, expected = "not stated", ", ".join(table.headers), "a column such as base acceleration [g]"
            hint = 'state it: --base-acceleration "0.1 g"'
        problem = f"the acceleration of the base is {problem}"
        raise table.header_error(problem, found=found, expected=expected, hint=hint)
    roles = [role for role in ("base_acceleration",) if role in table.roles and role not in columns]
    wanted = {role: si_column(table, role, place) for role in ("frequency", *columns, *roles)}
    return {
        role: replace(column, scale=ZERO_TO_PEAK[column.convention or "zero-to-peak"] * column.scale)
        for role, column in wanted.items()
    }


def _transmissibility(values: Mapping[str, Floats], stated_base: float | None) -> tuple[Complex, Floats]:
    """Compute the transmissibility and the acceleration of the base.

    Args:
        values: columns of the file by role, such as "transmissibility", or accelerations and phases, (n,) each.
        stated_base: zero-to-peak acceleration of the base [m/s^2], for a file without a column for it.

    Returns:
        Complex transmissibility [-], and zero-to-peak acceleration of the base [m/s^2], (n,) each.
    """
    base = values.get("base_acceleration", np.full(values["frequency"].shape, stated_base or 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        if "transmissibility" in values:
            return values["transmissibility"] * np.exp(1j * values["phase"]), base
        if "transmissibility_real" in values:
            return values["transmissibility_real"] + 1j * values["transmissibility_imaginary"], base
        if "base_real" in values:
            complex_base: Complex = values["base_real"] + 1j * values["base_imaginary"]
            return (values["mass_real"] + 1j * values["mass_imaginary"]) / complex_base, np.abs(complex_base)
        phase = values["phase"] if "phase" in values else values["mass_phase"] - values["base_phase"]
        return values["mass_acceleration"] / base * np.exp(1j * phase), base
