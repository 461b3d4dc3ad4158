"""Roles of columns: names and SI units for each kind of motion, and pairs that determine a complex stiffness."""

from collections.abc import Iterable, Mapping, Sequence

from bushfit import units
from bushfit.geometry import STRAINING, Motion
from bushfit.reading.headers import STRAINING_COLUMNS, SWEEP_COLUMNS, WORDS, Vocabulary, plain, split_convention

#: First cells of a row of units, such as "Unit", and of a row with the unit of the x axis.
UNIT_NAMES, X_UNIT_NAMES = (frozenset(map(plain, WORDS["rows_of"][key])) for key in ("units", "x_units"))
#: Names of columns in a test of strain and modulus, by role; they replace those of loops and sweeps.
_STRAINING = STRAINING_COLUMNS | {"amplitude": SWEEP_COLUMNS["amplitude"] + STRAINING_COLUMNS["amplitude"]}
#: Roles whose names depend on the motion: displacement or strain, force or stress, stiffness or modulus.
OF_MOTION = (*_STRAINING, "amplitude_reached", "force_amplitude", "damping_coefficient")
#: Pairs of columns that determine a complex stiffness and must agree, in order of preference.
AGREEING_PAIRS = [(size, loss) for size, loss in map(str.split, WORDS["sets"]["agreeing"])]
#: All pairs of columns that determine a complex stiffness, in order of preference.
PAIRS = AGREEING_PAIRS + [(size, loss) for size, loss in map(str.split, WORDS["sets"]["stiffness"])]
#: Roles of conditions, whose levels belong to different tests.
CONDITIONS = ("temperature", "preload")
#: Roles of columns that every operating point fills, and of columns that may be filled once for several.
_OF_POINTS, _LEVELS = {role for pair in PAIRS for role in pair}, ("frequency", "amplitude", *CONDITIONS)
#: Role that another column can take, factor and power that convert its numbers, and the reason in a note, by its role.
CONVERSIONS = {
    role: (into, float(factor), int(power), why) for role, (into, factor, power, why) in WORDS["converted"].items()
}
#: SI unit, or the attribute of a motion that is the SI unit, by role; all other roles are ratios.
_UNITS = {role: unit for unit, roles in WORDS["si_units"].items() for role in roles}


def names_for_motion(names: Mapping[str, Sequence[str]], motion: Motion) -> dict[str, Sequence[str]]:
    """Adapt column names to a kind of motion: in a test of strain, for example, G' names a modulus, not a stiffness.

    Args:
        names: usual column names, by role such as "stiffness".
        motion: kind of motion: translation, rotation or strain.

    Returns:
        Column names by role.
    """
    return {role: _STRAINING.get(role, usual) if motion is STRAINING else usual for role, usual in names.items()}


def si_unit(role: str, motion: Motion) -> str:
    """Return the SI unit of a role such as "force" in a test of a kind of motion; "1" for a ratio."""
    if role == "damping_coefficient":
        return "Pa*s" if motion is STRAINING else motion.stiffness_unit.replace("/", "*s/", 1)
    if role.endswith("compliance"):
        return {"N/m": "m/N", "Pa": "1/Pa"}.get(motion.stiffness_unit, "rad/N/m")
    if role in ("velocity", "acceleration"):
        return f"{motion.displacement_unit}/s{'^2' * (role == 'acceleration')}"
    if role == "energy":  # per cycle, in a test of strain per volume
        return "Pa" if motion is STRAINING else "J"
    unit = _UNITS.get(role, "1")
    return str(getattr(motion, unit, unit))


def is_unit_alone(header: str, vocabulary: Vocabulary) -> bool:
    """Return True if a header has a unit in brackets but no known name."""
    name, unit = units.split_header(split_convention(header)[0]) if header[-1:] in ("]", ")") else ("", None)
    return bool(name and unit) and unit != "-" and vocabulary.heading(header) is None and units.is_unit(unit or "")


def is_test(roles: set[str]) -> bool:
    """Return True if columns of these roles are those of a loop or sweep; a force may be read as its amplitude."""
    # with the roles that others are converted to, such as the loss factor of a damping ratio
    roles = roles | {CONVERSIONS[role][0] for role in roles & CONVERSIONS.keys()}
    is_loop = "displacement" in roles and not roles.isdisjoint(("force", "force_amplitude"))
    return is_loop or (not roles.isdisjoint(_LEVELS[:2]) and any(set(pair) <= roles for pair in PAIRS))


def stated_once(headers: Sequence[str], rows: Iterable[Sequence[str]], vocabulary: Vocabulary) -> frozenset[int]:
    """Find the columns, such as an amplitude, whose cells are filled only where their value changes.

    Args:
        headers: header cells of the table.
        rows: cells of its first rows, as texts; rows without a stiffness or loss, such as those of waveforms, are
            ignored.
        vocabulary: known column names, by which a header has a role such as "force".

    Returns:
        Indices of the columns.
    """
    roles = [heading.role if header and (heading := vocabulary.heading(header)) else "" for header in headers]
    columns = [index for index, role in enumerate(roles) if role in _LEVELS]
    if not columns or _OF_POINTS.isdisjoint(roles):
        return frozenset()
    points = [row for row in rows if any(cell and role in _OF_POINTS for cell, role in zip(row, roles, strict=False))]
    filled = {n: sum(len(row) > n and row[n] != "" for row in points) for n in columns}
    return frozenset(n for n in columns if points and 2 * filled[n] <= len(points))
