"""Roles of the columns of a table, from their names and units together."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from itertools import islice

import numpy as np

from bushfit import units
from bushfit.errors import NoColumnError, UnitError
from bushfit.geometry import STRAINING, Motion
from bushfit.reading.cells import Cells
from bushfit.reading.headers import (
    LOOP_COLUMNS,
    SWEEP_COLUMNS,
    WORDS,
    ZERO_TO_PEAK,
    AmplitudeConvention,
    Column,
    Heading,
    Vocabulary,
    fits,
    is_angular,
    plain,
    split_convention,
)
from bushfit.reading.numerals import is_like_number
from bushfit.reading.times import clock

#: Likeness, from 0 to 1, of a header that is suggested for a missing one; chosen: one word of two suffices.
_ALIKE = 0.4
#: Rows that are compared first; chosen: a long record need not be read whole.
_FIRST = 50
#: Share within which two columns for one amplitude agree; chosen: some are rounded to few digits.
_AGREEMENT = 0.02
#: Roles of which two different columns are ignored and not refused, since other columns can replace them.
_REPLACEABLE = ("force_amplitude", "damping_coefficient", "damping_ratio", "relative_error", "temperature")
#: SI units by which a column without a known name has a role.
_UNITS_OF_LOOP = {"time": ("s",), "displacement": ("m", "rad"), "force": ("N", "N*m")}
#: Roles that state the loss of a sweep.
_LOSSES = ("phase", "loss_factor", "loss_stiffness", "damping_coefficient", "damping_ratio")
_NOT_MEASURED = frozenset(map(plain, WORDS["channels"]["not_measured"]))


def classify(
    cells: Cells,
    names: Mapping[str, Sequence[str]],
    motion: Motion,
    vocabulary: Vocabulary,
    columns: Mapping[str, str],
    stated_units: Mapping[str, str],
) -> tuple[dict[str, Column], tuple[str, ...], frozenset[int]]:
    """Find the roles of columns.

    Args:
        cells: header and rows.
        names: usual names by role.
        motion: of what was tested.
        vocabulary: meaning of the headers.
        columns: header or number that the user states, by role.
        stated_units: units that the user states, by role.

    Returns:
        Columns by role, sentences on columns that were recognised by their unit, and the indices of columns that hold
        times as texts.

    Raises:
        MeasurementError: a header that does not settle which column is which.
        UnitError: two different units for one column.
    """
    roles: dict[str, Column] = {}
    rejected: set[str] = set()
    role_by_index = _stated_indices(cells, vocabulary, columns)
    for index, header in sorted(enumerate(cells.headers), key=lambda column: is_symbol_k(column[1])):
        heading = vocabulary.heading(header) if header else None
        if index in role_by_index:
            heading = Heading(role_by_index[index], *_meaning(header))
        elif heading and heading.role in role_by_index.values():
            heading = None
        if heading is None or heading.role in rejected:
            continue
        role = heading.role
        column = _column_of(cells, heading, index, stated_units.get(role))
        bare = plain(units.split_header(split_convention(header)[0])[0])
        if role not in columns and role not in stated_units and not fits(bare, role, column.unit):
            continue
        if role in ("damping_coefficient", "force_amplitude") and column.unit is None:
            continue  # another damping, or no force of a sweep
        if plain(header) == "t" and role == "temperature" and not units.kelvin_scale(column.unit or ""):
            continue  # a time, or another quantity
        if is_symbol_k(header) and role not in columns:
            is_taken_up = role in roles and not is_symbol_k(roles[role].header)  # K* is more specific than K
            if is_taken_up or not any(units.is_compatible(column.unit or "", si) for si in ("N/m", "N*m/rad")):
                continue
        if role not in roles:
            roles[role] = column
        elif role in _REPLACEABLE:
            rejected.add(role)
            del roles[role]
        else:
            roles[role] = _preferred(cells, roles[role], column)
    if "amplitude_reached" in roles and "amplitude" not in roles:
        roles["amplitude"] = replace(roles.pop("amplitude_reached"), role="amplitude")
    notes: list[str] = []
    if "displacement" in names and motion is not STRAINING:
        notes += _by_unit(cells, roles)
    if {"force_amplitude", "stiffness"} & set(roles) and "amplitude" not in roles:
        notes += _motion_as_amplitude(cells, roles, motion, stated_units)
    if "amplitude" in roles:
        notes += _angle_as_phase(cells, roles)
    first = next(cells.rows(), (0, ()))[1]
    clocks = {
        column.index
        for role, column in roles.items()
        if role == "time" and column.index < len(first) and clock(str(first[column.index])) is not None
    }
    return roles, tuple(notes), frozenset(clocks)


def is_symbol_k(header: str) -> bool:
    """Return True if a header is the symbol K alone, with or without a unit."""
    return plain(units.split_header(header)[0]) == "k"


def _meaning(header: str) -> tuple[str | None, AmplitudeConvention | None, float]:
    """Unit, convention and logarithm of the header of a column whose role is stated by its number."""
    heading = Vocabulary({"": [units.split_header(header)[0]]}, {"": header}).heading(header)
    return (heading.unit, heading.convention, heading.logarithm) if heading else (None, None, 0.0)


def _stated_indices(cells: Cells, vocabulary: Vocabulary, columns: Mapping[str, str]) -> dict[int, str]:
    """Role by index of each column that the user states by its number.

    Raises:
        NoColumnError: a stated header or number that the file does not have.
        MeasurementError: one header for two roles.
    """
    for role, text in columns.items():
        same_columns = [
            second_role
            for second_role, header in columns.items()
            if second_role != role and plain(header) == plain(text)
        ]
        if same_columns:
            raise cells.header_error(
                "one column is named for two roles",
                found=f'"{text}" for the {role.replace("_", " ")} and the {same_columns[0].replace("_", " ")}',
                expected="a column for each",
                hint=f'name another column for one of them: columns = {{ {role} = "..." }} in the campaign',
            )
    named_roles = {heading.role for header in cells.headers if header and (heading := vocabulary.heading(header))}
    indices = {}
    for role, text in columns.items():
        number = int(text) if text.isdecimal() and len(text) < 5 else 0
        if 1 <= number <= len(cells.headers):
            indices[number - 1] = role
        elif role not in named_roles:
            headers = cells.headers if cells.is_table else ()
            near = next(iter(get_close_matches(text, headers, n=1, cutoff=_ALIKE)), "")
            raise cells.header_error(
                f'there is no column "{text}"',
                kind=NoColumnError,
                expected=f"the header that was named for the {role.replace('_', ' ')}, or its number",
                hint=(f'did you mean "{near}"? ' if near else "name one of this file: ")
                + f'columns = {{ {role} = "{near or "..."}" }} in the campaign',
            )
    return indices


def _column_of(cells: Cells, heading: Heading, index: int, stated_unit: str | None) -> Column:
    """Column under a heading, with the unit on which header, units row and user agree."""
    texts = [text for text in (heading.unit, cells.layout.units[index], stated_unit) if text]
    logarithm = heading.logarithm
    for number, text in enumerate(texts):
        for word, base in (("log10", 10.0), ("ln", float(np.e))):
            if text.startswith(f"{word}(") and text.endswith(")"):
                texts[number], logarithm = text[len(word) + 1 : -1], base
    parts = [split_convention(text) for text in texts]
    conventions = {convention for convention in (heading.convention, *(part[1] for part in parts)) if convention}
    stated_texts = {unit for unit, _ in parts if unit}
    unit, counting = next(iter(stated_texts), None), next(iter(conventions), None)
    column = Column(heading.role, cells.headers[index], index, unit, 1.0, counting, logarithm)
    if len(stated_texts) > 1 or len(conventions) > 1:
        raise UnitError(
            f"two units for the {heading.role.replace('_', ' ')}",
            file=cells.file,
            place=cells.place(cells.layout.header_line, column),
            found=" and ".join(sorted(stated_texts) if len(stated_texts) > 1 else sorted(conventions)),
            expected="one unit, from the header, the units row or the campaign",
        )
    return column


def _preferred(cells: Cells, first: Column, second: Column) -> Column:
    """The one of two columns for one role that is read: frequency in Hz before rad/s, else the first of two equal ones.

    Raises:
        MeasurementError: columns that differ.
    """
    role = first.role
    if role == "frequency":
        angular = [is_angular(column.header, column.unit or "") for column in (first, second)]
        if angular[0] != angular[1]:
            return first if angular[1] else second
    if role == "time" and (first.unit is None) != (second.unit is None):
        return first if first.unit else second
    rows = [row for _, row in islice(cells.rows(), _FIRST)]
    texts = [[str(row[column.index]) for row in rows] for column in (first, second)]
    numbers = [
        np.array([float(t) for t in column_texts]) if all(map(units.is_number, column_texts)) else None
        for column_texts in texts
    ]
    factors = [ZERO_TO_PEAK[column.convention or "zero-to-peak"] for column in (first, second)]
    same_unit = first.unit == second.unit and numbers[0] is not None and numbers[1] is not None and len(rows) > 0
    if factors[0] != factors[1] and same_unit:
        sizes = [factor * values for factor, values in zip(factors, numbers, strict=True) if values is not None]
        if np.all(np.abs(sizes[0] - sizes[1]) <= _AGREEMENT * np.abs(sizes[0])):
            return first
        if texts[0] == texts[1]:
            raise cells.header_error(
                "two columns contradict each other",
                found=f'equal numbers for "{first.header}" and "{second.header}"',
                expected=f'"{second.header}" to be {factors[0] / factors[1]:.3g} times "{first.header}"',
                hint=f'choose the right one in the campaign: columns = {{ {role} = "{first.header}" }} or '
                f'columns = {{ {role} = "{second.header}" }}',
            )
    if texts[0] == texts[1] and cells.texts(first.index) == cells.texts(second.index):
        return first
    numbered = first.header == second.header
    choices = [str(column.index + 1) if numbered else column.header for column in (first, second)]
    raise cells.header_error(
        f"more than one column could be the {role.replace('_', ' ')}",
        found=f"{first.header}, {second.header}",
        expected="one",
        hint=("give each a header of its own, or " if numbered else "")
        + "choose it in the campaign: "
        + " or ".join(f'columns = {{ {role} = "{choice}" }}' for choice in choices),
    )


def _unnamed(cells: Cells) -> list[Column]:
    """Columns whose name has no known meaning, with the unit of header or units row, without set points and means."""
    usual = Vocabulary({**LOOP_COLUMNS, **SWEEP_COLUMNS}, {})
    columns = []
    for index, header in enumerate(cells.headers):
        text, convention = split_convention(header)
        name, unit = units.split_header(text)
        words = {plain(word) for word in name.replace("_", " ").split()}
        if header and usual.heading(header) is None and not words & _NOT_MEASURED:
            columns.append(Column("", header, index, unit or cells.layout.units[index] or None, 1.0, convention))
    return columns


def _by_unit(cells: Cells, roles: dict[str, Column]) -> list[str]:
    """Add the columns of a loop that are recognised by their unit alone; return a sentence for each."""
    if len(roles) + len(cells.headers) < 3 or cells.layout.written:
        return []
    notes, first = [], next(cells.rows(), (0, ()))[1]
    free = [column for column in _unnamed(cells) if column.unit]
    for role, expected in _UNITS_OF_LOOP.items():
        fitting = [column for column in free if any(units.is_compatible(column.unit or "", unit) for unit in expected)]
        fitting = [
            column for column in fitting if column.index < len(first) and is_like_number(str(first[column.index]))
        ]
        if role not in roles and len(fitting) == 1:
            roles[role] = replace(fitting[0], role=role)
            notes.append(f'"{fitting[0].header}" is read as the {role} by its unit')
    if "time" not in roles:
        stamps = [
            column for column in _unnamed(cells) if clock(str((*first, *cells.headers)[column.index])) is not None
        ]
        if len(stamps) == 1 and len(first) == len(cells.headers):
            roles["time"] = replace(stamps[0], role="time")
    return notes


def _angle_as_phase(cells: Cells, roles: dict[str, Column]) -> list[str]:
    """Add the phase of a sweep if one column is an angle and no other column states the loss."""
    if not {"stiffness", "storage_stiffness", "force_amplitude"} & set(roles) or set(roles) & set(_LOSSES):
        return []
    angles = [column for column in _unnamed(cells) if column.unit and units.is_compatible(column.unit, "rad")]
    if len(angles) != 1:
        return []
    roles["phase"] = replace(angles[0], role="phase")
    return [f'"{angles[0].header}" is read as the phase by its unit']


def _motion_as_amplitude(
    cells: Cells, roles: dict[str, Column], motion: Motion, stated_units: Mapping[str, str]
) -> list[str]:
    """Add the amplitude of a sweep that is named like a displacement: with a force and a phase it can be nothing else.

    If the file has a stiffness too, it must agree with force over displacement.
    """
    motions = Vocabulary({"amplitude": [*LOOP_COLUMNS["displacement"], "x", "u", "s", "w"]}, {})
    candidates = [
        _column_of(cells, heading, index, stated_units.get("amplitude"))
        for index, header in enumerate(cells.headers)
        if header and (heading := motions.heading(header)) and not heading.logarithm
    ]
    fitting = [
        column for column in candidates if any(units.is_compatible(column.unit or "", si) for si in ("m", "rad"))
    ]
    if len(fitting) != 1 or "force_amplitude" not in roles:
        return []
    if "stiffness" in roles:
        force, stiffness = roles["force_amplitude"], roles["stiffness"]
        numbers = [
            [float(str(row[column.index])) for column in (fitting[0], force, stiffness)]
            for _, row in islice(cells.rows(), _FIRST)
            if all(units.is_number(str(row[column.index])) for column in (fitting[0], force, stiffness))
        ]
        try:
            si = [motion.displacement_unit, motion.force_unit, motion.stiffness_unit]
            scales = [
                units.si_factor(c.unit or "", unit) for c, unit in zip((fitting[0], force, stiffness), si, strict=True)
            ]
        except UnitError:
            return []
        x, f, k = (np.array(numbers).reshape(-1, 3) * scales).T
        if x.size == 0 or not np.all(np.abs(np.abs(k * x) - np.abs(f)) <= 0.1 * np.abs(f)):
            return []
    roles["amplitude"] = replace(fitting[0], role="amplitude")
    return [f'"{fitting[0].header}" is read as the amplitude, because the file has the amplitude of the force, too']
