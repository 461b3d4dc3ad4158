"""Roles of the columns of a table, from their names and units together."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches

import numpy as np
from numpy.typing import NDArray

from bushfit import units
from bushfit.errors import NoColumnError, UnitError
from bushfit.geometry import ROTATION, STRAINING, TRANSLATION
from bushfit.reading.headers import (
    LOOP_COLUMNS,
    SWEEP_COLUMNS,
    WORDS,
    ZERO_TO_PEAK,
    Column,
    Extreme,
    Heading,
    Vocabulary,
    is_angular,
    parse_unit,
    plain,
    split_convention,
    split_extreme,
    split_unit,
)
from bushfit.reading.numerals import is_like_number, plainest_value
from bushfit.reading.roles import of_motion, si_unit
from bushfit.reading.table import Table
from bushfit.reading.times import clock

#: Smallest similarity, from 0 to 1, of a header that is suggested for a missing one; chosen: one word of two suffices.
_ALIKE = 0.4
#: Relative difference up to which two columns for one amplitude agree; chosen: some are rounded to few digits.
_AGREEMENT = 0.02
#: Smallest correlation of two channels that record the same motion; chosen: a force lags too far behind.
_ALONG = 0.999
#: Relative difference up to which force over displacement agrees with a stiffness; chosen: other channels differ more.
_STIFFNESS_AGREEMENT = 0.1
#: Number above zero of a stated multiple of a unit, such as 200 N for the force of 1 V.
_MULTIPLE = re.compile(r"^(?=[\d.]*[1-9])\d+\.?\d*(?=\s+[^\W\d_])")
#: Roles that are ignored, without an error, if two different columns have them: other columns can replace them.
_REPLACEABLE = (
    *("force_amplitude", "damping_coefficient", "damping_ratio", "energy", "relative_error", "temperature", "preload"),
)
#: Symbols of a displacement.
_SYMBOLS = ("x", "u", "s", "w")
#: Roles that state the loss of a sweep.
_LOSSES = {"phase", "loss_factor", "loss_stiffness", "damping_coefficient", "damping_ratio", "energy"}
#: Words in a header that mark a set point or mean, a part of a complex number, or an amplitude; by these kinds.
_QUALIFIERS = {kind: frozenset(map(plain, words)) for kind, words in WORDS["qualifiers"].items()}
#: Names of a strain that may be part of a compound, such as Scherdeformation.
_STRAINS = [name for name in map(plain, WORDS["straining"]["displacement"]) if len(name) > 4]
#: Roles of columns without a known name, found by their unit; and the kind of word that the name must contain, if any.
_BY_UNIT: dict[str, str | None] = {
    **dict.fromkeys(("time", "displacement", "force")),
    **{"storage_stiffness": "real", "loss_stiffness": "imaginary", "stiffness": None, "force_amplitude": "amplitude"},
    **{"frequency": None, "amplitude": "amplitude", "phase": None, "damping_coefficient": None},
}


def classify(
    table: Table, vocabulary: Vocabulary, columns: Mapping[str, str], stated_units: Mapping[str, str]
) -> Table:
    """Find the role of each column, such as "displacement", from its header, its unit and the user's statements.

    Args:
        table: header and rows, with the names of the columns of a kind of test.
        vocabulary: known column names, with those that the user states.
        columns: header or number of a column as the user states it, by role.
        stated_units: units as the user states them, by role.

    Returns:
        Table with its columns by role, sentences on columns that were recognised only by their unit, and the indices of
        columns that contain times as texts.

    Raises:
        MeasurementError: it is not clear from the header which column has which role.
        UnitError: two different units for one column.
    """
    roles: dict[str, Column] = {}
    extremes: dict[tuple[str, Extreme], Column] = {}
    rejected: set[str] = set()
    role_by_index = _stated_indices(table, vocabulary, columns)
    for index, header in sorted(enumerate(table.headers), key=lambda column: _name(column[1]) == "k"):  # after K*
        heading = vocabulary.heading(header, table.layout.units[index]) if header else None
        if index in role_by_index:
            meaning = Vocabulary({"": [units.split_header(header)[0]]}, {"": header}).heading(header)
            heading = replace(meaning or Heading(""), role=role_by_index[index])
        elif heading and heading.role in {*role_by_index.values(), *rejected}:
            continue
        if heading is None or (_name(header) == "k" and heading.role in roles):
            continue
        role, column = heading.role, _column_of(table, heading, index, stated_units.get(heading.role))
        if heading.extreme:
            extremes.setdefault((role, heading.extreme), column)
        elif role not in roles:
            roles[role] = column
        elif role in _REPLACEABLE:
            rejected.add(role)
            del roles[role]
        else:
            roles[role] = _preferred(table, roles[role], column)
    notes = _add_half_differences(table, roles, extremes)
    for role in ("amplitude_reached", "acceleration"):
        if role in roles and "amplitude" not in roles:
            roles["amplitude"] = replace(roles.pop(role), role="amplitude")
    by_unit, unused = _add_by_unit(table, roles)
    notes += by_unit
    if {"displacement", "force"} <= {*roles} and "displacement" not in columns:
        for column in (one for one in unused if _moves_along(table, roles["displacement"], one)):
            _preferred(table, roles["displacement"], replace(column, role="displacement"))
    for column in (roles[role] for role in stated_units if role in roles):
        written = parse_unit(split_unit(column.header)[1] or table.layout.units[column.index])[0]
        if written != column.unit and units.is_compatible(written, column.unit or ""):
            notes.append(f'"{column.header}" is read in the stated unit {column.unit}, not in {written} of the header')
    if {"force_amplitude", "stiffness"} & set(roles) and "amplitude" not in roles:
        notes += _add_motion_as_amplitude(table, roles, stated_units)
    if "damping_coefficient" in roles and "stiffness" in roles and "stiffness" not in columns:
        notes += _name_parallel_spring(roles)
    time = roles.get("time")
    is_clock = time is not None and clock(str(table.first_row[time.index])) is not None
    notes = [*table.layout.notes, *notes]
    clocks = frozenset({time.index} if time and is_clock else ())
    return replace(table, roles=roles, notes=tuple(notes), clocks=clocks)


def _name(header: str) -> str:
    """Name in a column header, in plain letters (see `plain`): "force" of "Force p-p [N]"."""
    return plain(units.split_header(split_convention(header)[0])[0])


def _stated_indices(table: Table, vocabulary: Vocabulary, columns: Mapping[str, str]) -> dict[int, str]:
    """Find the columns that the user states by their number; stated headers are only checked.

    Args:
        table: header and rows of the table.
        vocabulary: known column names, with those that the user states.
        columns: header or number of a column as the user states it, by role.

    Returns:
        Role, such as "force", by index of the column.

    Raises:
        NoColumnError: a stated header or number that the file does not have.
        MeasurementError: one header for two roles.
    """
    indices, role_by_text = dict[int, str](), dict[str, str]()
    named_roles = vocabulary.roles([header for header in table.headers if header])
    for role, text in columns.items():
        if (first_role := role_by_text.setdefault(plain(text), role)) != role:
            raise table.header_error(
                "one column is named for two roles",
                found=f'"{text}" for the {first_role.replace("_", " ")} and the {role.replace("_", " ")}',
                expected="a column for each",
                hint=f'name another column for one of them: columns = {{ {role} = "..." }} in the campaign',
            )
    for role, text in columns.items():
        number = int(text) if text.isdecimal() and len(text) < 5 else 0
        if 1 <= number <= len(table.headers):
            indices[number - 1] = role
        elif role not in named_roles:
            near = next(iter(get_close_matches(text, table.headers if table.is_table else (), 1, _ALIKE)), "")
            advice = f'did you mean "{near}"?' if near else "name one of this file:"
            raise table.header_error(
                f'there is no column "{text}"',
                kind=NoColumnError,
                expected=f"the header that was stated for the {role.replace('_', ' ')}, or its number",
                hint=f'{advice} columns = {{ {role} = "{near or "..."}" }} in the campaign',
            )
    return indices


def _column_of(table: Table, heading: Heading, index: int, stated_unit: str | None = None) -> Column:
    """Make the column of a header, with the unit that the user states, or else the unit in the header or units row.

    Args:
        table: header and rows of the table.
        heading: meaning of the header: role (quantity, such as "force"), unit and convention.
        index: index of the column.
        stated_unit: unit that the user states; None without one.
    """
    multiple = _MULTIPLE.sub(r"x \g<0>", stated_unit or "")
    from_user, in_row = (parse_unit(text) for text in (multiple, table.layout.units[index]))
    in_header = parse_unit(heading.unit or "")
    texts = [from_user[0]] if stated_unit else sorted({in_header[0], in_row[0]} - {""})
    conventions = {from_user[1] or part for part in (heading.convention, in_header[1], in_row[1], from_user[1]) if part}
    logarithm = from_user[2] or in_row[2] or in_header[2] or heading.logarithm
    unit, convention = next(iter(texts), None), next(iter(conventions), None)
    column = Column(heading.role, unit, convention, logarithm, header=table.headers[index], index=index)
    if len(texts) > 1 or len(conventions) > 1:
        raise UnitError(
            f"two units for the {heading.role.replace('_', ' ')}",
            file=table.file,
            place=table.place(table.layout.header_line, column),
            found=" and ".join(texts if len(texts) > 1 else sorted(conventions)),
            expected="one unit, from the header or the units row",
            hint=f'state the right one in the campaign: units = {{ {heading.role} = "{texts[0]}" }}',
        )
    return column


def _first_numbers(table: Table, columns: Sequence[Column]) -> NDArray[np.float64]:
    """Numbers in the first rows of columns, (rows, columns), in file units; no rows if a cell is not a number."""
    rows = [[plainest_value(str(row[column.index])) for column in columns] for row in table.first_rows]
    return np.empty((0, len(columns))) if np.isnan(rows).any() else np.array(rows)


def _preferred(table: Table, first: Column, second: Column) -> Column:
    """Choose between two columns for one quantity: frequency in Hz rather than rad/s, else the first of two equal ones.

    Args:
        table: header and rows of the table.
        first, second: the two columns.

    Raises:
        MeasurementError: columns that differ.
    """
    role, both = first.role, (first, second)
    if role == "frequency":
        angular = [is_angular(column.header, column.unit or "") for column in both]
        if angular[0] != angular[1]:
            return first if angular[1] else second
    if role == "time" and (first.unit is None) != (second.unit is None):
        return first if first.unit else second
    numbers = _first_numbers(table, both)
    factors = np.array([ZERO_TO_PEAK[column.convention or "zero-to-peak"] for column in both])
    is_equal = all(row[first.index] == row[second.index] for row in table.first_rows)
    is_numbered = first.header == second.header
    problem, expected = f"more than one column could be the {role.replace('_', ' ')}", "one"
    if factors[0] != factors[1] and first.unit == second.unit and len(numbers):
        sizes = factors * numbers
        if np.all(np.abs(sizes[:, 0] - sizes[:, 1]) <= _AGREEMENT * np.abs(sizes[:, 0])):
            return first
        if is_equal:
            problem = "two columns with equal numbers contradict each other"
            expected = f'"{second.header}" to be {factors[0] / factors[1]:.3g} times "{first.header}"'
    elif is_equal and all(row[first.index] == row[second.index] for _, row in table.rows()):
        return first
    choices = [str(column.index + 1) if is_numbered else column.header for column in both]
    keys = " or ".join(f'columns = {{ {role} = "{choice}" }}' for choice in choices)
    hint = f"{'give each column its own header, or ' if is_numbered else ''}choose it in the campaign: {keys}"
    raise table.header_error(problem, found=f"{first.header}, {second.header}", expected=expected, hint=hint)


def _add_by_unit(table: Table, roles: dict[str, Column]) -> tuple[list[str], list[Column]]:
    """Recognise columns by their unit and words in their name, and add them to the known columns.

    A column is added if no other column has such a unit, apart from set points and means. Frequency, amplitude and
    phase are added only to a table with a stiffness or a force amplitude.

    Args:
        table: header and rows of the table.
        roles: columns found so far, by role such as "force"; changed in place.

    Returns:
        A sentence on each added column, and the columns that are still unknown.
    """
    if len(roles) + len(table.headers) < 3:
        return [], []
    names, motion = table.names, table.motion
    usual = Vocabulary(of_motion({**LOOP_COLUMNS, **SWEEP_COLUMNS}, motion), {}, {})
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
        if role in roles or role not in names or (role in ("phase", "damping_coefficient") and _LOSSES & set(roles)):
            continue
        is_beside_stiffness = role in ("frequency", "amplitude", "phase", "damping_coefficient")
        if is_beside_stiffness and not {"stiffness", "storage_stiffness", "force_amplitude", "compliance"} & set(roles):
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
            notes.append(f"{header} is read as the {role.replace('_', ' ')} by its unit")
    if "time" in names and "time" not in roles:
        stamps = [column for column in free if clock(str(table.first_row[column.index])) is not None]
        roles |= {"time": replace(stamps[0], role="time")} if len(stamps) == 1 else {}
    return notes, list(free)


def _add_half_differences(
    table: Table, roles: dict[str, Column], extremes: Mapping[tuple[str, Extreme], Column]
) -> list[str]:
    """Use half the difference of maxima and minima as an amplitude, and add it to the known columns.

    A column of peaks, read as an amplitude, contains maxima if another column of the same name contains valleys.

    Args:
        table: header and rows of the table.
        roles: columns found so far, by role such as "force"; changed in place.
        extremes: columns of maxima and minima, by the role of their amplitude.

    Returns:
        A sentence on each pair of columns, with their mean, which is the preload.
    """
    notes = []
    for role in ("amplitude", "force_amplitude"):
        low, high, known = extremes.get((role, "minimum")), extremes.get((role, "maximum")), roles.get(role)
        if (
            low
            and known
            and not high
            and plain(split_extreme(low.header)[0]) == plain(split_convention(known.header)[0])
        ):
            high, known = known, None
        if low is None or high is None or known or low.unit != high.unit:
            continue
        roles[role] = replace(high, subtracted=low.index, convention="peak-to-peak")
        numbers = _first_numbers(table, (high, low))
        mean, half = float(numbers.mean()), float(np.abs(numbers[:, 0] - numbers[:, 1]).mean()) / 2.0
        note = f'half of "{high.header}" minus "{low.header}" is read as the {role.replace("_", " ")}'
        if abs(mean) > _AGREEMENT * half:
            note += (
                f"; their mean is {units.number(mean, 3)} {high.unit or ''}, which is a preload if the zero is right"
            )
        notes.append(note)
    return notes


def _name_parallel_spring(roles: dict[str, Column]) -> list[str]:
    """Read the stiffness beside a damping coefficient as K' if its name is the bare symbol k or c, else as |K*|.

    k and c, or c and d, are the symbols of a spring and a dashpot in parallel; K is also a symbol of |K*|.

    Returns:
        A sentence on the choice, unless the symbol of the stiffness states it.
    """
    stiffness, loss = roles["stiffness"], roles["damping_coefficient"]
    if "*" in stiffness.header or "|" in stiffness.header or {*roles} & _LOSSES != {"damping_coefficient"}:
        return []
    meaning, alternative = "the magnitude |K*|", "storage_stiffness"
    if units.split_header(stiffness.header)[0].strip() in ("k", "c"):
        roles["storage_stiffness"] = replace(roles.pop("stiffness"), role="storage_stiffness")
        meaning, alternative = "the stiffness K' of a spring in parallel", "stiffness"
    choice = f'columns = {{ {alternative} = "{stiffness.header}" }} in the campaign reads the other'
    return [f'"{stiffness.header}" beside the damping "{loss.header}" is read as {meaning}; {choice}']


def _moves_along(table: Table, first: Column, second: Column) -> bool:
    """True if a second column records the motion of a displacement at another scale, as an extensometer does."""
    if not (first.unit and second.unit and units.is_compatible(second.unit, first.unit)):
        return False
    channels = replace(table, roles={"first": first, "second": second})  # whose cells show the decimal mark
    start = channels.parse(next(channels.blocks()), frozenset((first.index, second.index)))  # far beyond the first rows
    numbers = np.array([start[first.index], start[second.index]]).T if start else _first_numbers(table, (first, second))
    numbers = numbers * [units.si_factor(unit, first.unit) for unit in (first.unit, second.unit)]
    spans = [float(np.ptp(values)) for values in numbers.T] if len(numbers) else [0.0, 0.0]
    if min(spans) <= 0.0 or abs(spans[1] / spans[0] - 1.0) <= _AGREEMENT:
        return False
    return float(np.min(np.corrcoef(numbers.T))) > _ALONG


def _add_motion_as_amplitude(table: Table, roles: dict[str, Column], stated_units: Mapping[str, str]) -> list[str]:
    """Use a column that is named like a displacement as the amplitude of a sweep, and add it to the known columns.

    The table must have a force amplitude, or the name must be a symbol, such as x. A stiffness, if there is one, must
    agree with force over displacement.

    Args:
        table: header and rows of the table.
        roles: columns found so far, by role such as "force"; changed in place.
        stated_units: units as the user states them, by role.

    Returns:
        A sentence on the added column; empty without one.
    """
    motions = Vocabulary({"amplitude": [*LOOP_COLUMNS["displacement"], *_SYMBOLS]}, {})
    candidates = [
        _column_of(table, heading, index, stated_units.get("amplitude"))
        for index, header in enumerate(table.headers)
        if header and (heading := motions.heading(header)) and not heading.logarithm
    ]
    fitting = [c for c in candidates if any(units.is_compatible(c.unit or "", si) for si in ("m", "rad"))]
    has_force = "force_amplitude" in roles
    if len(fitting) != 1 or not (has_force or _name(fitting[0].header) in _SYMBOLS):
        return []
    if has_force and "stiffness" in roles:
        columns = (fitting[0], roles["force_amplitude"], roles["stiffness"])
        motion = ROTATION if units.is_compatible(fitting[0].unit or "", "rad") else TRANSLATION
        expected = [(column.unit or "", si_unit(column.role, motion)) for column in columns]
        if not all(units.is_compatible(*pair) for pair in expected):
            return []
        x, force, stiffness = np.abs([units.si_factor(*pair) for pair in expected] * _first_numbers(table, columns)).T
        if x.size == 0 or not np.all(np.abs(stiffness * x - force) <= _STIFFNESS_AGREEMENT * force):
            return []
    roles["amplitude"] = fitting[0]
    reason = "because the file has the amplitude of the force, too" if has_force else "by its unit"
    return [f'"{fitting[0].header}" is read as the amplitude, {reason}']
