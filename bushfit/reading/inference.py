"""Roles of columns without a known name: by their unit, and as amplitudes that other columns determine."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace

import numpy as np

from bushfit import units
from bushfit.caveat import Caveat
from bushfit.geometry import ROTATION, STRAINING, TRANSLATION
from bushfit.reading.headers import (
    LOOP_COLUMNS,
    ROLE_SETS,
    SWEEP_COLUMNS,
    UNITS_OF,
    WORDS,
    Column,
    Extreme,
    Vocabulary,
    parse_unit,
    plain,
    plain_name,
    split_convention,
    split_extreme,
    split_unit,
)
from bushfit.reading.numerals import is_like_number
from bushfit.reading.roles import CONVERSIONS, names_for_motion, si_unit
from bushfit.reading.si_columns import column_of, first_numbers
from bushfit.reading.table import Table
from bushfit.reading.times import parse_clock

#: Relative difference up to which two columns for one amplitude agree; chosen: some are rounded to few digits.
AGREEMENT = 0.02
#: Smallest correlation of two channels that record the same motion; chosen: a force lags too far behind.
_ALONG = 0.999
#: Relative difference up to which force over displacement agrees with a stiffness; chosen: other channels differ more.
_STIFFNESS_AGREEMENT = 0.1
#: Symbols of a displacement.
_SYMBOLS = ("x", "u", "s", "w")
#: Words in a header that mark a set point or mean, a part of a complex number, or an amplitude; by these kinds.
_QUALIFIERS = {kind: frozenset(map(plain, words)) for kind, words in WORDS["qualifiers"].items()}
#: Names of a strain that may be part of a compound, such as Scherdeformation.
_STRAINS = [name for name in map(plain, WORDS["straining"]["displacement"]) if len(name) > 4]
#: Kind of word that the name of a column must contain, if any, for the role that its unit gives.
_BY_UNIT = {role: kind for role, _, kind in (entry.partition(" ") for entry in ROLE_SETS["by_unit"])}


def add_by_unit(table: Table, roles: dict[str, Column]) -> tuple[list[Caveat], list[Column]]:
    """Recognise columns by their unit and words in their name, and add them to the known columns.

    A column is added if no other column has such a unit, apart from set points and means. Frequency, amplitude and
    phase are added only to a table with a stiffness or a force amplitude.

    Args:
        table: header and rows of the table.
        roles: columns found so far, by role such as "force"; changed in place.

    Returns:
        A warning on each added column; and the columns whose role is still unknown.
    """
    if len(roles) + len(table.headers) < 3:
        return [], []
    names, motion = table.names, table.motion
    usual = Vocabulary(names_for_motion({**LOOP_COLUMNS, **SWEEP_COLUMNS}, motion), {}, {})
    free: dict[Column, set[str]] = {}
    for index, header in enumerate(table.headers):
        if not (header or table.layout.units[index]) or usual.heading(header) is not None:
            continue
        name, unit, convention = split_unit(header)  # after the check, because unknown words import pint
        words = {plain(word) for word in name.replace("_", " ").replace("/", " ").split()}
        if not words & _QUALIFIERS["not_measured"]:
            in_row, of_row, _ = parse_unit(table.layout.units[index])
            column = Column("", in_row or unit, convention or of_row, header=header, index=index)
            is_strain = motion is STRAINING and any(strain in plain(name) for strain in _STRAINS)
            free[column] = words | ({"amplitude"} if column.convention or is_strain else set())
    notes, amplitude = [], _QUALIFIERS["amplitude"]
    motions = (STRAINING,) if motion is STRAINING else (TRANSLATION, ROTATION)
    for role, qualifier in _BY_UNIT.items():
        has_loss = role in ("phase", "damping_coefficient") and ROLE_SETS["losses"] & set(roles)
        if role in roles or role not in names or has_loss:
            continue
        is_beside_stiffness = role in ("frequency", "amplitude", "phase", "damping_coefficient")
        if is_beside_stiffness and not {"stiffness", "storage_stiffness", "force_amplitude", "compliance"} & {*roles}:
            continue
        is_certain = qualifier or is_beside_stiffness
        if motion is STRAINING and (role in ("force_amplitude", "damping_coefficient") or not is_certain):
            continue  # a ratio or a pressure may be any quantity
        expected = {si_unit(role, kind) for kind in motions} | ({"rad/s"} if role == "frequency" else set())
        fitting = [
            column
            for column, words in free.items()
            if (words & _QUALIFIERS[qualifier] if qualifier else role not in LOOP_COLUMNS or not words & amplitude)
            and any(units.is_compatible(column.unit or "", si) for si in expected)
            and is_like_number(str(table.first_row[column.index]))
        ]
        if len(fitting) == 1:
            roles[role] = replace(fitting[0], role=role)
            del free[fitting[0]]
            header = f'"{fitting[0].header}"' if fitting[0].header else f"column {fitting[0].index + 1}"
            notes.append(Caveat("column_by_unit", f"{header} is read as the {role.replace('_', ' ')} by its unit"))
    if "time" in names and "time" not in roles:
        stamps = [column for column in free if parse_clock(str(table.first_row[column.index])) is not None]
        roles |= {"time": replace(stamps[0], role="time")} if len(stamps) == 1 else {}
    return notes, list(free)


def add_half_differences(
    table: Table, roles: dict[str, Column], extremes: Mapping[tuple[str, Extreme], Column]
) -> list[Caveat]:
    """Use half the difference of maxima and minima as an amplitude, and add it to the known columns.

    A column of peaks, read as an amplitude, contains maxima if another column of the same name contains valleys.

    Args:
        table: header and rows of the table.
        roles: columns found so far, by role such as "force"; changed in place.
        extremes: columns of maxima and minima, by the role of their amplitude.

    Returns:
        A warning on each pair of columns, with their mean, which is the preload.
    """
    notes = []
    for role in ("amplitude", "force_amplitude"):
        low, high, known = extremes.get((role, "minimum")), extremes.get((role, "maximum")), roles.get(role)
        names = low and known and (split_extreme(low.header)[0], split_convention(known.header)[0])
        if names and not high and plain(names[0]) == plain(names[1]):
            high, known = known, None
        if low is None or high is None or known or low.unit != high.unit:
            continue
        roles[role] = replace(high, terms=((low.index, -1.0),), convention="peak-to-peak")
        numbers = first_numbers(table, (high, low))
        mean, half = float(numbers.mean()), float(np.abs(numbers[:, 0] - numbers[:, 1]).mean()) / 2.0
        note = f'half of "{high.header}" minus "{low.header}" is read as the {role.replace("_", " ")}'
        if abs(mean) > AGREEMENT * half:
            note += (
                f"; their mean is {units.number(mean, 3)} {high.unit or ''}, which is a preload if the zero is right"
            )
        notes.append(Caveat("column_difference", note))
    return notes


def convert_roles(roles: dict[str, Column], certain: Collection[str]) -> Iterator[Caveat]:
    """Give columns such as a damping ratio the role of the quantity that follows from their numbers.

    A force amplitude beside a stiffness takes the role of a missing amplitude, unless its name may mean a static force.
    The columns keep the name of their quantity in `Column.role`.

    Args:
        roles: columns found so far, by role such as "force"; changed in place.
        certain: roles whose column the user states.

    Yields:
        A warning on each column whose name does not say how its numbers are converted.
    """
    for role, (into, _, _, why) in CONVERSIONS.items():
        if role in roles and into not in roles:
            roles[into] = roles.pop(role)
            if why:
                yield Caveat("column_converted", f'"{roles[into].header}" is read as {why}')
    force = roles.get(role := "force_amplitude")
    is_missing = "stiffness" in roles and "amplitude" not in roles
    if force and is_missing and (role in certain or (plain_name(force.header), role) not in UNITS_OF):
        roles["amplitude"] = force


def name_parallel_spring(roles: dict[str, Column]) -> list[Caveat]:
    """Read the stiffness beside a damping coefficient as K' if its name is the bare symbol k or c, else as |K*|.

    k and c, or c and d, are the symbols of a spring and a dashpot in parallel; K is also a symbol of |K*|.

    Returns:
        A warning on the choice, unless the symbol of the stiffness states it.
    """
    stiffness, loss = roles["stiffness"], roles["damping_coefficient"]
    if "*" in stiffness.header or "|" in stiffness.header or {*roles} & ROLE_SETS["losses"] != {"damping_coefficient"}:
        return []
    meaning, alternative = "the magnitude |K*|", "storage_stiffness"
    if units.split_header(stiffness.header)[0].strip() in ("k", "c"):
        roles["storage_stiffness"] = replace(roles.pop("stiffness"), role="storage_stiffness")
        meaning, alternative = "the stiffness K' of a spring in parallel", "stiffness"
    choice = f'columns = {{ {alternative} = "{stiffness.header}" }} in the campaign reads the other'
    sentence = f'"{stiffness.header}" beside the damping "{loss.header}" is read as {meaning}; {choice}'
    return [Caveat("spring_and_dashpot", sentence)]


def moves_along(table: Table, first: Column, second: Column) -> bool:
    """True if a second column records the motion of a displacement at another scale, as an extensometer does.

    Args:
        table: table of the columns.
        first: column of the displacement.
        second: column to compare with the displacement.

    Returns:
        True if the units are compatible, the ranges differ and the values are strongly correlated.
    """
    if not (first.unit and second.unit and units.is_compatible(second.unit, first.unit)):
        return False
    channels = replace(table, roles={"first": first, "second": second})  # whose cells show the decimal mark
    start = channels.parse(next(channels.chunks()), frozenset((first.index, second.index)))  # far beyond the first rows
    numbers = np.array([start[first.index], start[second.index]]).T if start else first_numbers(table, (first, second))
    numbers = numbers * [units.si_factor(unit, first.unit) for unit in (first.unit, second.unit)]
    spans = [float(np.ptp(values)) for values in numbers.T] if len(numbers) else [0.0, 0.0]
    if min(spans) <= 0.0 or abs(spans[1] / spans[0] - 1.0) <= AGREEMENT:
        return False
    return float(np.min(np.corrcoef(numbers.T))) > _ALONG


def add_motion_as_amplitude(table: Table, roles: dict[str, Column], stated_units: Mapping[str, str]) -> list[Caveat]:
    """Use a column that is named like a displacement as the amplitude of a sweep, and add it to the known columns.

    The table must have a force amplitude, or the column must count peak to peak or rms, or its name must be a symbol,
    such as x. A stiffness, if there is one, must agree with force over displacement.

    Args:
        table: header and rows of the table.
        roles: columns found so far, by role such as "force"; changed in place.
        stated_units: units as the user states them, by role.

    Returns:
        A warning on the added column; empty without one.
    """
    motions = Vocabulary({"amplitude": [*LOOP_COLUMNS["displacement"], *_SYMBOLS]}, {})
    candidates = [
        column_of(table, heading, index, stated_units.get("amplitude"))
        for index, header in enumerate(table.headers)
        if header and (heading := motions.heading(header)) and not heading.logarithm
    ]
    fitting = [c for c in candidates if any(units.is_compatible(c.unit or "", si) for si in ("m", "rad"))]
    has_force = "force_amplitude" in roles
    if len(fitting) != 1 or not (has_force or fitting[0].convention or plain_name(fitting[0].header) in _SYMBOLS):
        return []
    if has_force and "stiffness" in roles:
        columns = (fitting[0], roles["force_amplitude"], roles["stiffness"])
        motion = ROTATION if units.is_compatible(fitting[0].unit or "", "rad") else TRANSLATION
        expected = [(column.unit or "", si_unit(column.role, motion)) for column in columns]
        if not all(units.is_compatible(*pair) for pair in expected):
            return []
        x, force, stiffness = np.abs([units.si_factor(*pair) for pair in expected] * first_numbers(table, columns)).T
        if x.size == 0 or not np.all(np.abs(stiffness * x - force) <= _STIFFNESS_AGREEMENT * force):
            return []
    roles["amplitude"] = fitting[0]
    reason = "because the file has the amplitude of the force, too" if has_force else "by its unit"
    return [Caveat("column_as_amplitude", f'"{fitting[0].header}" is read as the amplitude, {reason}')]
