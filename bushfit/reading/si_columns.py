"""Columns of a table with their factors to SI, and errors for missing columns and units."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bushfit import units
from bushfit.errors import UnitError, error_location
from bushfit.geometry import STRAINING, TRANSLATION, Place, strain_factor_of_files
from bushfit.reading.headers import (
    LOOP_COLUMNS,
    SWEEP_COLUMNS,
    WORDS,
    Column,
    Heading,
    Vocabulary,
    parse_unit,
    plain,
    split_unit,
    units_in_header,
)
from bushfit.reading.names import named_direction, named_quantities
from bushfit.reading.numerals import plainest_value
from bushfit.reading.roles import OF_MOTION, names_for_motion, si_unit

if TYPE_CHECKING:
    from bushfit.reading.table import Table

#: Number above zero of a stated multiple of a unit, such as 200 N for the force of 1 V.
_MULTIPLE = re.compile(r"^(?=[\d.]*[1-9])\d+\.?\d*(?=\s+[^\W\d_])")
#: Letter of an axis in the name of a force: "Fx", "F_z 1", "Load Y".
_AXIS = re.compile(r"(?:^|[\W_])[a-z]?_?([xyz])(?![^\W\d_])")
#: Word for a processed value: "Force filtered" is the same force as "Force raw", and no second load cell. An upper and
#: a lower force may be two cells.
_PROCESSED = re.compile(rf"(?<![^\W_])(?!upper|lower)(?:{'|'.join(WORDS['qualifiers']['processed'])})(?![^\W_])")
#: Starts of the names of an angular frequency.
_ANGULAR = ("angular", "angfreq", "omega", "ω", "kreisfrequenz", "pulsa", "角频率")
#: Start of the name of a logarithm, in the spelling that `plain` returns.
_LOGARITHM = re.compile("log10|log|lg|ln")


def is_angular(header: str, unit: str) -> bool:
    """Return True if a frequency column is angular (rad/s), by its unit, or by its header if the unit is 1/s."""
    name = _LOGARITHM.sub("", plain(header))
    return units.is_compatible(unit, "rad/s") or (
        "hz" not in unit.lower()
        and any(name.startswith(plain(word)) for word in _ANGULAR)
        and units.is_compatible(unit, "Hz")
    )


def si_column(table: Table, role: str, tested: Place, hint: str | None = None) -> Column:
    """Return the column of a role with its factor to SI, after checking its unit; a ratio needs no unit.

    Args:
        role: role of the column, such as "force".
        tested: direction of the bushing, or the specimen; it determines the unit.
        hint: next step to suggest if there is no such column.

    Returns:
        Column whose `scale` converts its numbers to SI.

    Raises:
        MeasurementError: there is no such column.
        UnitError: the unit is missing, unknown, or of another dimension.
    """
    column = table.roles.get(role)
    name = column.role if column else role
    if role == "amplitude" and column and tested.motion is not STRAINING:
        rates = (rate for rate in ("velocity", "acceleration") if table.agrees(role, si_unit(rate, tested.motion)))
        name = next(rates, name)
    label, expected = name.replace("_", " "), si_unit(name, tested.motion)
    quantity, example = units.common_unit(expected)
    if expected == "Hz" and column and is_angular(column.header, "1/s"):
        quantity, example = "an angular frequency", "rad/s"
    if column is None:
        refuse_other_motion(table, role)
        ways = ", ".join(filter(None, (columns_key(table, role, expected), hint)))
        below = (f"; line {n} begins another table, which header_line = {n} reads" for n, _ in table.other_tables)
        raise table.header_error(
            f"there is no column for the {label}",
            expected=f'a header such as "{label} [{example}]"',
            hint=f"state in the campaign {ways}{''.join(below)}",
        )
    column = replace(column, role=name)
    if column.index in table.clocks:
        return column
    place, unit, problem = table.place(table.layout.header_line, column), column.unit or "1", ""
    wanted = f"{quantity}, such as {example}"
    if math.isnan(column.logarithm):
        problem, wanted = f"the base of the logarithm of the {label} is not known", "log10 or ln in the header"
        forms = (f'units = {{ {role} = "{kind}({column.unit or example})" }}' for kind in ("log10", "ln"))
        hint = " in the campaign, or ".join(forms)
    elif column.unit is None and column.logarithm:
        problem = f"the logarithms of the {label} have no unit"
        wanted = "the reference of decibels, such as dB re 1 N/mm, or the unit, as in log10(N/mm)"
        hint = f'if the value 0 means 1 {example}, write units = {{ {role} = "{example}" }} in the campaign'
    elif column.unit is None and (expected != "1" or role in OF_MOTION):
        problem, size = f"the {label} has no unit", quantity_above(table, expected)
        second = "Hz" if example == "rad/s" else WORDS["second_units"].get(expected)
        hint = f'write "{column.header} [{example}]" in the header, or '
        hint += f'units = {{ {role} = "{size or example}" }} in the campaign'
        hint += f', or units = {{ {role} = "{second}" }}' if second and not size else ""
    elif not units.is_compatible(unit, expected) and units.is_compatible(unit, "V"):  # pint is slow to import
        problem = f"the {label} is in volts"
        hint = f"state the {label} of one volt: "
        hint += f'units = {{ {role} = "{quantity_above(table, expected) or f"... {example}"}" }} in the campaign'
    if problem:
        raise UnitError(problem, file=table.file, place=place, found=f'"{column.header}"', expected=wanted, hint=hint)
    foreign_units = ("m", "rad", "N/m", "N*m/rad") if table.motion is STRAINING else ("1", "Pa")
    is_foreign = any(units.is_compatible(unit, foreign_unit) for foreign_unit in foreign_units)
    if is_foreign and role in OF_MOTION and "force" not in role:
        refuse_other_motion(table, role, [column.header])
    next_step = None
    if not units.is_unit(unit) or "count" in unit.lower():
        size = unit if _MULTIPLE.match(unit) and units.is_unit(_MULTIPLE.sub("", unit).strip()) else f"... {example}"
        next_step = f'state the size of one "{unit}": units = {{ {role} = "{size}" }} in the campaign'
    with error_location(table.file, place, next_step):
        if expected == "Hz" and is_angular(column.header, unit):
            per_second = "rad/s" if units.is_compatible(unit, "rad/s") else "Hz"
            return replace(column, scale=units.si_factor(unit, per_second) / (2.0 * math.pi))
        is_strain = role in ("displacement", "amplitude", "amplitude_reached")
        strain_factor = strain_factor_of_files(tested) if is_strain else 1.0
        return replace(column, scale=strain_factor * units.si_factor(unit, expected))


def columns_key(table: Table, role: str, unit: str) -> str:
    """Suggest campaign keys for a missing column, such as 'columns = { force = "F1" }', for the hint of an error.

    Args:
        role: role of the missing column, such as "force".
        unit: its SI unit.

    Returns:
        Keys for up to three unused headers with a unit of this dimension.
    """
    names = {**LOOP_COLUMNS, **SWEEP_COLUMNS}
    usual, with_unit = Vocabulary(names), Vocabulary({role: names.get(role, ())}, {}, {role: unit})
    own_names, example = [(role, role), ("amplitude", "displacement")], units.common_unit(unit)[1]
    unused = [
        (header, parse_unit(in_row)[0] or split_unit(header)[1] or "1")
        for header, in_row in zip(table.headers, table.layout.units, strict=True)
        if header and (not (heading := usual.heading(header)) or (role, heading.role) in own_names)
    ]
    fitting, volts = ([text for text, one in unused if units.is_compatible(one, si)] for si in (unit, "V"))
    fitting, volts = [] if unit == "1" else fitting, volts if role in LOOP_COLUMNS else []
    key = choose_column(role, fitting or volts or ["..."])
    if fitting or volts:
        return key if fitting else f'{key}, and the size of one volt: units = {{ {role} = "... {example}" }}'
    is_named = any(with_unit.heading(header) for header, _ in unused)
    return f'units = {{ {role} = "{example}" }}' if is_named else key


def choose_column(role: str, headers: Sequence[str]) -> str:
    """Suggest campaign keys that choose one of several columns or, for forces in one direction and unit, their sum.

    Args:
        role: role of the columns, such as "force".
        headers: their headers, or their numbers; up to three are listed.

    Returns:
        Keys such as 'columns = { force = "F1" } or columns = { force = "F2" }'.
    """
    groups = dict[tuple[str | None, ...], list[str]]()
    for header in headers if role == "force" else ():
        marks = (*_AXIS.findall(header.lower()), *_PROCESSED.findall(header.lower()))
        alike = named_direction([header]), split_unit(header)[1], *marks
        groups.setdefault(alike, []).append(header)
    choices = headers[:3], [" + ".join(group) for group in groups.values() if len(group) > 1]
    alone, sums = (" or ".join(f'columns = {{ {role} = "{text}" }}' for text in texts) for texts in choices)
    return f"{alone} if this cell carries the load alone, or {sums} if these cells share the load" if sums else alone


def refuse_other_motion(table: Table, role: str, headers: Sequence[str] | None = None) -> None:
    """Refuse strain or modulus columns in a test of displacement and force, or the reverse.

    Args:
        role: role of the column that the test lacks, such as "amplitude".
        headers: headers known to belong to the other kind of test; by default those of the table are checked.

    Raises:
        MeasurementError: a header has this role in the other kind of test.
    """
    other_motion = TRANSLATION if table.motion is STRAINING else STRAINING
    kinds = ["displacement and force or stiffness", "strain and modulus"]
    expected, found = kinds[:: -1 if table.motion is STRAINING else 1]
    hint = 'write [[specimens]] with a name and kind = "modulus" in the campaign, and specimen = "its name" here'
    if table.motion is STRAINING:
        hint = 'take specimen out of the campaign, or give it kind = "shear" with its area and thickness'
    names = names_for_motion(table.names, other_motion)
    differs = role in names and names[role] is not names_for_motion(table.names, table.motion)[role]
    words = Vocabulary({role: names[role]} if differs else {}, {})
    for header in headers or filter(words.heading, table.headers):
        label = role.replace("_", " ")
        problem = f"this is a test of {found}"
        raise table.header_error(problem, found=f'"{header}" for the {label}', expected=expected, hint=hint)


def quantity_above(table: Table, unit: str) -> str | None:
    """Find a quantity such as "0.2 mm" behind "=" or ":" in the lines above the table.

    Returns:
        Number and unit as text; None if no quantity, or several, have the dimension of the SI unit `unit`.
    """
    found = (quantity for line in table.lines_above for quantity in named_quantities(line).values())
    texts = dict.fromkeys(" ".join(quantity) for quantity in found if units.is_compatible(quantity[1], unit))
    return next(iter(texts)) if len(texts) == 1 else None


def column_of(
    table: Table, heading: Heading, index: int, stated_unit: str | None = None, added: Sequence[int] = ()
) -> Column:
    """Make the column of a header, with the unit that the user states, or else the unit in the header or units row.

    Args:
        table: header and rows of the table.
        heading: meaning of the header: role (quantity, such as "force"), unit and convention.
        index: index of the column.
        stated_unit: unit that the user states; None without one.
        added: indices of columns whose numbers are added to those of the column.

    Returns:
        Column with its unit and convention; its numbers are not converted.

    Raises:
        UnitError: two units for the column.
        MeasurementError: columns in different units are to be added.
    """
    multiple = _MULTIPLE.sub(r"x \g<0>", stated_unit or "")
    from_user, in_row = (parse_unit(text) for text in (multiple, table.layout.units[index]))
    in_header = parse_unit(heading.unit or "")
    texts = [from_user[0]] if stated_unit else sorted({in_header[0], in_row[0]} - {""})
    texts = [text for text in texts if len(texts) < 2 or units.is_unit(text)] or texts  # "Force (front)" above "kN"
    conventions = {from_user[1] or part for part in (heading.convention, in_header[1], in_row[1], from_user[1]) if part}
    logarithm = from_user[2] or in_row[2] or in_header[2] or heading.logarithm
    unit, convention = next(iter(texts), None), next(iter(conventions), None)
    column = Column(heading.role, unit, convention, logarithm, header=table.headers[index], index=index)
    if len(texts) > 1 or len(conventions) > 1:
        raise _two_units(table, column, texts if len(texts) > 1 else sorted(conventions))
    terms = [column_of(table, replace(heading, unit=split_unit(table.headers[n])[1]), n, stated_unit) for n in added]
    if {term.unit for term in terms} - {unit}:
        headers = " + ".join(term.header for term in (column, *terms))
        raise table.header_error("columns in different units cannot be added", found=headers, expected="one unit")
    return replace(column, terms=tuple((term.index, 1.0) for term in terms))


def refuse_second_unit(table: Table, column: Column) -> None:
    """Refuse a header with two units of different size, such as "Force (kN) [N]" or "Kdyn_N_mm [kN/mm]"."""
    unit = column.unit or ""
    for other in units_in_header(column.header):
        is_same_kind = units.is_compatible(other, unit) and other.lower() not in ("in", "strain")  # "Weg in [mm]"
        are_both = all(any(units.is_compatible(one, si) for si in ("Hz", "rad/s")) for one in (other, unit))
        is_angular_second = are_both and "Hz" in (other, unit) and "1/s" not in (other, unit) and not is_same_kind
        if is_angular_second or (is_same_kind and units.si_factor(other, unit) != units.si_factor(unit, unit)):
            raise _two_units(table, column, [unit, other])


def _two_units(table: Table, column: Column, texts: Sequence[str]) -> UnitError:
    """Error for a column with two different units or conventions."""
    return UnitError(
        f"two units for the {column.role.replace('_', ' ')}",
        file=table.file,
        place=table.place(table.layout.header_line, column),
        found=" and ".join(texts),
        expected="one unit, from the header or the units row",
        hint="state the right one in the campaign: "
        + " or ".join(f'units = {{ {column.role} = "{text}" }}' for text in texts),
    )


def first_numbers(table: Table, columns: Sequence[Column]) -> NDArray[np.float64]:
    """Return the numbers in the first rows of columns, (rows, columns), in file units; no rows with other cells."""
    rows = [[plainest_value(str(row[column.index])) for column in columns] for row in table.first_rows]
    return np.empty((0, len(columns))) if np.isnan(rows).any() else np.array(rows)
