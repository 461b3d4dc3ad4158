"""Roles of the columns of a table, from their names and units together."""

import re
from collections.abc import Mapping
from dataclasses import replace
from difflib import get_close_matches

import numpy as np

from bushfit import units
from bushfit.caveat import Caveat
from bushfit.errors import NoColumnError
from bushfit.reading.headers import (
    ERRORS,
    ROLE_SETS,
    ZERO_TO_PEAK,
    Column,
    Extreme,
    Heading,
    Vocabulary,
    parse_unit,
    plain,
    plain_name,
    split_unit,
)
from bushfit.reading.inference import (
    AGREEMENT,
    add_by_unit,
    add_half_differences,
    add_motion_as_amplitude,
    convert_roles,
    moves_along,
    name_parallel_spring,
)
from bushfit.reading.lines import fill_merged
from bushfit.reading.roles import PAIRS
from bushfit.reading.si_columns import choose_column, column_of, first_numbers, is_angular, refuse_second_unit
from bushfit.reading.table import Table
from bushfit.reading.times import parse_clock

#: Smallest similarity, from 0 to 1, of a header that is suggested for a missing one; chosen: one word of two suffices.
_ALIKE = 0.4
#: Factor in a name, outside of the unit: "K*/1000", "Amplitude x10", "2 K*", "1/2 K*".
_FACTOR = re.compile(r"(?:/|\s[x×*])\s?(?!1$)\d+(?:[.,]\d+)?$|^[\d.,/]+\s?[x×*·]?\s?(?=[^\W\d_])")
#: Smallest loss factor that shows that K1 and K2 are hardly storage and loss; chosen: above that of nearly all rubbers.
_LARGE_LOSS = 0.5
#: Number at the end of the name of one of several columns for a quantity: "K1", "Phase_2".
_NUMBERED = re.compile(r"(.*?[^\d\s_])[\s_]?(\d)")


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
        Copy of the table with the attributes `roles` (columns by role), `notes` (warnings on columns recognised only by
        their unit) and `clocks` (indices of columns with times as texts).

    Raises:
        MeasurementError: it is not clear from the header which column has which role.
        UnitError: two different units for one column.
    """
    roles: dict[str, Column] = {}
    extremes: dict[tuple[str, Extreme], Column] = {}
    stated_columns = _stated_columns(table, vocabulary, columns)
    excluded = {role for role, _ in stated_columns.values()}
    vague = {n for n, header in enumerate(table.headers) if plain_name(header) == "k" or header in "fF"}
    for index, header in sorted(enumerate(table.headers), key=lambda column: column[0] in vague):  # after K* and freq
        heading = vocabulary.heading(header, table.layout.units[index]) if header else None
        added = list[int]()
        if index in stated_columns:
            role, added = stated_columns[index]
            heading = Vocabulary({role: [header]}, {role: header}).heading(header) or Heading(role)
        elif heading and heading.role in excluded:
            continue
        if heading is None or (index in vague and heading.role in roles):
            continue
        is_empty = heading.role == "time" and table.first_row[index] == ""
        if is_empty and all(row[index] == "" for row in table.first_rows) and table.labels_above.sampling:
            continue  # the X_Value of LabVIEW, whose step is stated above
        role, column = heading.role, column_of(table, heading, index, stated_units.get(heading.role), added)
        if heading.extreme:
            extremes.setdefault((role, heading.extreme), column)
        elif role not in roles:
            roles[role] = column
        elif role == "preload" and _is_force(column) != _is_force(roles[role]):
            roles[role] = column if _is_force(column) else roles[role]  # the mean displacement states the same
        elif role in ROLE_SETS["replaceable"]:
            excluded.add(role)
            del roles[role]
        else:
            roles[role] = _preferred_column(table, roles[role], column)
    notes = add_half_differences(table, roles, extremes)
    for role in ("amplitude_reached", "velocity", "acceleration"):
        if role in roles and "amplitude" not in roles:
            roles["amplitude"] = replace(roles.pop(role), role="amplitude")
    named = {*roles}
    by_unit, unused = add_by_unit(table, roles)
    notes += by_unit
    for role in roles.keys() & stated_units.keys() - named:
        convention, index = roles[role].convention, roles[role].index
        roles[role] = replace(column_of(table, Heading(role), index, stated_units[role]), convention=convention)
    if {"displacement", "force"} <= {*roles} and "displacement" not in columns:
        for column in (one for one in unused if moves_along(table, roles["displacement"], one)):
            _preferred_column(table, roles["displacement"], replace(column, role="displacement"))
    for column in (column for role, column in roles.items() if role not in stated_units):
        refuse_second_unit(table, column)
    for column in (roles[role] for role in stated_units if role in roles):
        written = parse_unit(split_unit(column.header)[1] or table.layout.units[column.index])[0]
        if written != column.unit and units.is_compatible(written, column.unit or ""):
            sentence = f'"{column.header}" is read in the stated unit {column.unit}, not in {written} of the header'
            notes.append(Caveat("stated_unit", sentence))
    is_first_free = all(column.index for column in roles.values())
    if {"displacement", "force"} <= {*roles} and "time" in table.names and "time" not in roles and is_first_free:
        x = column_of(table, Heading("time"), 0, stated_units.get("time"))  # over which programs write histories
        if plain_name(x.header) == "x" and units.is_compatible(x.unit or "s", "s") and not table.labels_above.sampling:
            roles["time"] = x
    if {"force_amplitude", "stiffness"} & set(roles) and "amplitude" not in roles:
        notes += add_motion_as_amplitude(table, roles, stated_units)
    if "damping_coefficient" in roles and "stiffness" in roles and "stiffness" not in columns:
        notes += name_parallel_spring(roles)
    stated = {*columns, *stated_units}
    _require_plain_names(table, {role: column for role, column in roles.items() if role not in stated})
    notes += convert_roles(roles, certain=columns)
    time = roles.get("time")
    is_clock = time is not None and parse_clock(str(table.first_row[time.index])) is not None
    for index, title in enumerate(fill_merged(table.headers)):
        is_of_role = title in {column.header for column in roles.values()}
        if is_of_role and not table.headers[index] and table.holds_numbers(index):
            sentence = f'column {index + 1} has no name and is left out: it may belong to "{title}" on its left'
            notes.append(Caveat("unnamed_column", sentence))
    notes = [*table.layout.notes, *notes]
    clocks = frozenset({time.index} if time and is_clock else ())
    return replace(table, roles=roles, notes=tuple(notes), clocks=clocks)


def _is_force(column: Column) -> bool:
    """True for a column in a unit of force or moment."""
    return any(units.is_compatible(column.unit or "", si) for si in ("N", "N*m"))


def _require_plain_names(table: Table, roles: Mapping[str, Column]) -> None:
    """Refuse column names with more than one meaning: a factor in the name ("K x 1000"), or a number ("K1").

    Args:
        table: header and rows of the table.
        roles: columns by role, without those that the user states.

    Raises:
        MeasurementError: a name contains a factor, or numbers in names may be those of repeats, of parts, or of storage
            and loss.
    """
    names = {role: split_unit(column.header)[0].strip() for role, column in roles.items()}
    factors = {role: match[0] for role, name in names.items() if (match := _FACTOR.search(name))}
    for role, factor in factors.items():
        if not factor[0].isdigit() or len(factors) == 1:  # several leading numbers count the columns
            raise table.header_error(
                f"the name of the {role.replace('_', ' ')} contains a factor",
                found=f'"{roles[role].header}"',
                expected="numbers in the stated unit",
                hint=f'if they are, name the column: columns = {{ {role} = "{roles[role].header}" }} in the campaign; '
                f'otherwise write the factor into the unit, such as units = {{ {role} = "... {roles[role].unit}" }}',
            )
    stems = {str(number): set[str]() for number in range(10)}
    for header in table.headers:
        if match := _NUMBERED.fullmatch(split_unit(header)[0].strip()):
            stems[match[2]].add(match[1].casefold())
    both = [roles[role] for role in ("storage_stiffness", "loss_stiffness") if role in roles]
    storage, loss = np.abs(first_numbers(table, both)).sum(axis=0) if len(both) > 1 else (1.0, 0.0)
    numbered = stems["1"] & stems["2"]
    is_doubtful = len(numbered) > 1 or (numbered and loss > _LARGE_LOSS * storage)
    if len(both) > 1 and is_doubtful and _NUMBERED.fullmatch(names["storage_stiffness"]):
        header = roles["storage_stiffness"].header
        keys = [f'columns = {{ {pair[0]} = "{header}", {pair[1]} = "..." }}' for pair in PAIRS[1:3]]
        hint = f"name the columns: {keys[0]} in the campaign for each test, or {keys[1]}"
        raise table.header_error(**ERRORS["numbered_columns"], found=", ".join(table.headers), hint=hint)


def _stated_columns(
    table: Table, vocabulary: Vocabulary, columns: Mapping[str, str]
) -> dict[int, tuple[str, list[int]]]:
    """Find the columns that the user states by their number, or as a sum "A + B"; other headers are only checked.

    Args:
        table: header and rows of the table.
        vocabulary: known column names, with those that the user states.
        columns: header or number of a column as the user states it, by role.

    Returns:
        Role, such as "force", and indices of the columns that are added, by index of the column.

    Raises:
        NoColumnError: a stated header or number that the file does not have.
        MeasurementError: one header for two roles.
    """
    roles, role_by_text = dict[int, tuple[str, list[int]]](), dict[str, str]()
    index_of = {header: table.headers.index(header) for header in table.headers if header}
    index_of |= {str(index + 1): index for index in range(len(table.headers))}
    named_roles = vocabulary.roles([header for header in table.headers if header])
    for role, text in columns.items():
        if (first_role := role_by_text.setdefault(plain(text), role)) != role:
            raise table.header_error(
                **ERRORS["two_roles"],
                found=f'"{text}" for the {first_role.replace("_", " ")} and the {role.replace("_", " ")}',
                hint=f'state another column for one of the two: columns = {{ {role} = "..." }} in the campaign',
            )
    for role, text in columns.items():
        parts = [text] if text in index_of else text.split(" + ")
        if set(parts) <= index_of.keys() and (len(parts) > 1 or text.isdecimal()):
            first, *added = (index_of[part] for part in parts)
            roles[first] = role, added
        elif text.isdecimal() or role not in named_roles:
            near = next(iter(get_close_matches(text, table.headers if table.is_table else (), 1, _ALIKE)), "")
            advice = f'did you mean "{near}"?' if near else "name one of this file:"
            expected = f"the header that was stated for the {role.replace('_', ' ')}, or its number"
            hint = f'{advice} columns = {{ {role} = "{near or "..."}" }} in the campaign'
            raise table.header_error(f'there is no column "{text}"', kind=NoColumnError, expected=expected, hint=hint)
    return roles


def _preferred_column(table: Table, first: Column, second: Column) -> Column:
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
    numbers = first_numbers(table, both)
    factors = np.array([ZERO_TO_PEAK[column.convention or "zero-to-peak"] for column in both])
    is_equal = all(row[first.index] == row[second.index] for row in table.first_rows)
    is_numbered = first.header == second.header
    problem, expected = f"more than one column could be the {role.replace('_', ' ')}", "one"
    if factors[0] != factors[1] and first.unit == second.unit and len(numbers):
        sizes = factors * numbers
        if np.all(np.abs(sizes[:, 0] - sizes[:, 1]) <= AGREEMENT * np.abs(sizes[:, 0])):
            return first
        if is_equal:
            problem = "two columns with equal numbers contradict each other"
            expected = f'"{second.header}" to be {factors[0] / factors[1]:.3g} times "{first.header}"'
    elif is_equal and all(row[first.index] == row[second.index] for _, row in table.rows()):
        return first
    choices = [str(column.index + 1) if is_numbered else column.header for column in both]
    keys = f"choose it in the campaign: {choose_column(role, choices)}"
    hint = f"give each column its own header, or {keys}" if is_numbered else keys
    raise table.header_error(problem, found=f"{first.header}, {second.header}", expected=expected, hint=hint)
