"""Resonance tests read from files: a mass on a mount on a shaker, as accelerations or as their ratio."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bushfit.errors import MeasurementError
from bushfit.geometry import Place
from bushfit.reading.headers import RESONANCE_COLUMNS, Column
from bushfit.reading.measurement import Complex, Floats, Source
from bushfit.reading.table import Table

#: The columns that each make a transmissibility, in order of preference; a base acceleration may stand beside them.
_WAYS = (
    ("transmissibility", "phase"),
    ("transmissibility_real", "transmissibility_imaginary"),
    ("base_acceleration", "mass_acceleration", "base_phase", "mass_phase"),
    ("base_acceleration", "mass_acceleration", "phase"),
    ("base_real", "base_imaginary", "mass_real", "mass_imaginary"),
)
#: Roles that no other test has: a file with one of them is a resonance test.
_TELLING = {role for role in RESONANCE_COLUMNS if role not in ("frequency", "phase")}
#: Columns of which every value is above zero.
_POSITIVE = ("frequency", "base_acceleration", "mass_acceleration", "transmissibility")
#: SI units by the end of a role; else a role is a ratio.
_UNITS = {"phase": "rad", "frequency": "Hz"} | dict.fromkeys(
    ("acceleration", "base_real", "base_imaginary", "mass_real", "mass_imaginary"), "m/s^2"
)
#: Rows of the shortest test; chosen: a curve of five values over the frequency, and some scatter about it.
FEWEST_ROWS = 12


@dataclass(frozen=True, eq=False)
class ResonanceTest:
    """A mass on a mount whose base is shaken with a sine, by frequency.

    Args:
        name, direction, source: as of a `Loop`.
        frequency: [Hz], (n,), rising.
        transmissibility: acceleration of the mass over that of the base, complex [-], (n,).
        base_acceleration: amplitude, zero-to-peak [m/s^2], (n,).
    """

    name: str
    direction: Place
    frequency: Floats
    transmissibility: Complex
    base_acceleration: Floats
    source: Source


def is_resonance(table: Table) -> bool:
    """Whether a table that was opened with RESONANCE_COLUMNS has a column that only a resonance test has."""
    return not _TELLING.isdisjoint(table.roles)


def read_resonance(table: Table, direction: Place, base_acceleration: float | None = None) -> ResonanceTest:
    """The resonance test in a table that was opened with RESONANCE_COLUMNS.

    For a table without the amplitude of the base's acceleration, it is stated [m/s^2].

    Raises:
        MeasurementError, UnitError: a column, unit or value that cannot be used.
    """
    wanted = _wanted(table, stated=base_acceleration is not None)
    values = table.read(wanted, fewest_rows=FEWEST_ROWS)
    table.check_positive(_POSITIVE, wanted, values)
    ratio, base = _ratio(values, base_acceleration)
    bad = ~(np.isfinite(ratio) & (base > 0.0) & (ratio != 0.0))
    table.refuse(bad, wanted["frequency"], "base or mass stands still here", "two accelerations that are not zero")
    order = np.argsort(values["frequency"], kind="stable")
    source = Source(Path(table.file.name), table.sha256)
    return ResonanceTest(table.file.stem, direction, values["frequency"][order], ratio[order], base[order], source)


def _wanted(table: Table, *, stated: bool) -> dict[str, Column]:
    """The frequency, and the columns of the first of _WAYS that a table has; the base's acceleration may be stated."""
    way = next((way for way in _WAYS if set(way) <= set(table.roles)), None)
    if way is None:
        ways = ", or ".join(" and ".join(way) for way in _WAYS).replace("_", " ")
        raise table.header_error(
            "the columns give no complex transmissibility",
            expected=f"frequency, and {ways}",
            hint='correct the header, or name the column: --column "mass_acceleration=..."',
        )
    has_base = any(role.startswith("base") for role in way) or "base_acceleration" in table.roles
    if has_base and stated:
        raise MeasurementError(
            "the acceleration of the base is stated twice",
            file=table.file,
            found="a column of the file, and --base-acceleration",
            expected="one of them",
            hint="leave --base-acceleration out",
        )
    if not (has_base or stated):
        raise table.header_error(
            "nothing says how strongly the base was shaken",
            expected="a column such as base acceleration [g]",
            hint='state it: --base-acceleration "0.1 g"',
        )
    roles = dict.fromkeys(("frequency", *way, "base_acceleration"))
    wanted = {}
    for role in (role for role in roles if role != "base_acceleration" or role in table.roles):
        unit = next((unit for end, unit in _UNITS.items() if role.endswith(end)), "1")
        column = table.column(role, unit)
        to_peak = 0.5 if column.convention == "peak-to-peak" else 1.0
        wanted[role] = replace(column, scale=to_peak * column.scale)
    return wanted


def _ratio(values: Mapping[str, Floats], stated: float | None) -> tuple[Complex, Floats]:
    """Transmissibility and amplitude of the base's acceleration [m/s^2], (n,) each."""

    def number(real: str, imaginary: str) -> Complex:
        return values[real] + 1j * values[imaginary]

    base = values.get("base_acceleration", np.full(values["frequency"].shape, stated or 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        if "transmissibility" in values:
            return values["transmissibility"] * np.exp(1j * values["phase"]), base
        if "transmissibility_real" in values:
            return number("transmissibility_real", "transmissibility_imaginary"), base
        if "base_real" in values:
            complex_base = number("base_real", "base_imaginary")
            return number("mass_real", "mass_imaginary") / complex_base, np.abs(complex_base)
        phase = values["phase"] if "phase" in values else values["mass_phase"] - values["base_phase"]
        return values["mass_acceleration"] / base * np.exp(1j * phase), base
