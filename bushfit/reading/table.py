"""A table of a test: its columns recognised by their headers, with units, and its numbers in SI."""

import csv
import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path

from bushfit import units
from bushfit.errors import MeasurementError, NoColumnError, UnitError, error_location
from bushfit.geometry import STRAINING, TRANSLATION, Motion
from bushfit.reading.columns import Columns, Rows
from bushfit.reading.files import sha256, to_utf8, view_bytes
from bushfit.reading.headers import (
    LOOP_COLUMNS,
    OF_MOTION,
    SWEEP_COLUMNS,
    Column,
    Heading,
    Vocabulary,
    is_angular,
    of_motion,
    plain,
    split_convention,
)
from bushfit.reading.layout import DELIMITERS, FileFormat, Layout, find_layout
from bushfit.reading.numerals import is_like_number
from bushfit.reading.parts import open_part
from bushfit.reading.source import RowSource, Sheet, Text
from bushfit.reading.wide import as_long

_EXPECTED_HEADER = 'a header row such as "time [s],displacement [mm],force [N]"'
#: Likeness, from 0 to 1, from which a header is suggested for one that is not there; chosen: one word of two suffices.
_ALIKE = 0.4


@dataclass(frozen=True, eq=False)
class Table(Columns):
    """A table that was read from a file and understood.

    Args:
        checksum: SHA-256 of the file, perhaps still under way.
        names, motion: for each role the headers it usually goes by, whatever the motion, and that of what was tested.
    """

    checksum: Future[str]
    names: Mapping[str, Sequence[str]]
    motion: Motion

    @classmethod
    def open(
        cls,
        file: Path,
        names: Mapping[str, Sequence[str]],
        columns: Mapping[str, str] | None = None,
        stated_units: Mapping[str, str] | None = None,
        stated: FileFormat | None = None,
        motion: Motion = TRANSLATION,
        rows: Rows | None = None,
    ) -> "Table":
        """Read a file and understand its header.

        Args:
            file: a text in any dialect, a workbook or a recording. Lines of other content may stand above the header,
                and a row of units below it. A sweep's may be a wide table.
            names: for each role the headers it usually goes by, LOOP_COLUMNS or SWEEP_COLUMNS.
            columns, stated_units: header and unit of roles, where it is no usual one, or the file does not tell it.
            stated: what the file does not tell of its format.
            motion: of what was tested, by which a test of strain and modulus goes by other headers.
            rows: that make the test; all of them where none are stated.

        Raises:
            MeasurementError: no such file, no text, no header, a header that does not settle which column is which, or
                no such rows.
            UnitError: two different units for one column.
        """
        stated = stated or FileFormat()
        data = view_bytes(file, MeasurementError)
        checksum = sha256(data)
        vocabulary = Vocabulary(of_motion(names, motion), columns or {})

        def lay_out(source: RowSource) -> tuple[RowSource, Layout, Vocabulary]:
            delimiter = "" if isinstance(source, Sheet) else DELIMITERS[stated.delimiter] if stated.delimiter else None
            layout = source.layout or find_layout(
                source.head(), vocabulary, delimiter=delimiter, header_line=stated.header_line
            )
            if (
                "amplitude" in names
                and stated.header_line is None
                and (wide := as_long(source, file, vocabulary, layout, delimiter))
            ):
                return *wide, Vocabulary({role: (role,) for role in names}, {})
            return source, layout, vocabulary

        try:
            part = open_part(
                data, file, stated.sheet, lambda part: len(vocabulary.roles(lay_out(part)[1].headers) - {"time"}) > 1
            )
            source, layout, understood = lay_out(part or Text(*to_utf8(data, file, stated.encoding)))
        except csv.Error as error:
            raise MeasurementError("the table cannot be read", file=file, found=str(error)) from error
        if stated.header_line not in (None, layout.header_line):
            found = f"header_line = {stated.header_line}"
            raise MeasurementError("there is no header on this line", file=file, found=found, hint="lines count from 1")
        table = cls(file, source, layout, stated, {}, checksum, names, motion)
        if len(table.headers) < 2:
            found = table.headers[0] if table.headers else "nothing"
            expected = f"{_EXPECTED_HEADER}, separated by comma, semicolon, tab, | or blanks"
            raise table.header_error("there is only one column", found=found, expected=expected)
        if all(is_like_number(cell) for cell in table.headers):
            raise table.header_error("there is no header", expected=_EXPECTED_HEADER)
        named = columns or {} if understood is vocabulary else {}
        table = replace(table, roles=table._recognise(understood, named, stated_units or {}))
        return table if rows is None else table.taking(rows)

    @property
    def sha256(self) -> str:
        """SHA-256 of the file."""
        return self.checksum.result()

    def column(self, role: str, expected: str, hint: str | None = None) -> Column:
        """The column of a role, with the factor from its unit to the SI unit `expected`; a ratio needs no unit.

        Raises:
            MeasurementError: no such column.
            UnitError: no unit, an unknown one, or one of another dimension.
        """
        if role not in self.roles:
            raise self.missing(role, expected, hint)
        column = self.roles[role]
        if column.unit is None and (expected != "1" or role in OF_MOTION):
            example = units.example_unit(expected)
            raise UnitError(
                f"the {_label(role)} has no unit",
                file=self.file,
                place=self.place(self.layout.header_line, column),
                found=f'"{column.header}"',
                expected=units.describe_unit(expected),
                hint=f'write "{column.header} [{example}]" in the header, '
                f'or units = {{ {role} = "{example}" }} in the campaign',
            )
        unit = column.unit or "1"
        others = ("m", "rad", "N/m", "N*m/rad") if self.motion is STRAINING else ("1", "Pa")
        if role in OF_MOTION and role != "force" and any(units.is_compatible(unit, other) for other in others):
            self.refuse_other_motion(role, [column.header])
        with error_location(self.file, self.place(self.layout.header_line, column)):
            if expected == "Hz" and is_angular(column.header, unit):
                per_second = "rad/s" if units.is_compatible(unit, "rad/s") else "Hz"
                return replace(column, scale=units.si_factor(unit, per_second) / (2.0 * math.pi))
            return replace(column, scale=units.si_factor(unit, expected))

    def agrees(self, role: str, expected: str) -> bool:
        """Whether a role has a column with a unit of the dimension of `expected`."""
        column = self.roles.get(role)
        return column is not None and column.unit is not None and units.is_compatible(column.unit, expected)

    def missing(self, role: str, expected: str, hint: str | None = None) -> MeasurementError:
        """The error for a role that has no column; `expected` is its SI unit."""
        self.refuse_other_motion(role)
        return self.header_error(
            f"there is no column for the {_label(role)}",
            expected=f'a header such as "{_label(role)} [{units.example_unit(expected)}]"',
            hint=f"name the column in the campaign: {self.columns_key(role, expected)}" + (f", {hint}" if hint else ""),
        )

    def columns_key(self, role: str, unit: str) -> str:
        """The key that names the column of a role, with the one header that names none and has a unit that fits."""
        usual = Vocabulary({**LOOP_COLUMNS, **SWEEP_COLUMNS}, {})
        free = (header for header in self.headers if usual.heading(header) is None)
        found = [header for header in free if units.is_compatible(units.split_header(header)[1] or "", unit)]
        return f'columns = {{ {role} = "{found[0] if len(found) == 1 else "..."}" }}'

    def refuse_other_motion(self, role: str, headers: Sequence[str] | None = None) -> None:
        """Refuse headers that would name a role in a test of the other kind of motion: strain, or displacement.

        Raises:
            MeasurementError: there is such a header in the table, or one of those that are known to be (`headers`).
        """
        kinds = ("displacement and force or stiffness", "strain and modulus")
        other, (expected, found) = STRAINING, kinds
        hint = 'write [[specimens]] with a name and kind = "modulus" in the campaign, and specimen = "its name" here'
        if self.motion is STRAINING:
            other, (found, expected) = TRANSLATION, kinds
            hint = 'take specimen out of the campaign, or give it kind = "shear" with its area and thickness'
        words = Vocabulary({role: of_motion(self.names, other)[role]} if role in OF_MOTION else {}, {})
        for header in headers or filter(words.heading, self.headers):
            raise self.header_error(
                f"this is a test of {found}", found=f'"{header}" for the {_label(role)}', expected=expected, hint=hint
            )

    def _recognise(
        self, vocabulary: Vocabulary, columns: Mapping[str, str], stated_units: Mapping[str, str]
    ) -> dict[str, Column]:
        """The columns by role, each with its unit; `columns` and `stated_units` as of `open`."""
        roles: dict[str, Column] = {}
        for index, header in sorted(enumerate(self.headers), key=lambda one: _is_k(one[1])):
            heading = vocabulary.heading(header)
            if heading is None:
                continue
            role = heading.role
            column = self._column_of(heading, index, stated_units.get(role))
            if plain(header) == "t" and role == "temperature" and not units.kelvin_scale(column.unit or ""):
                continue  # a time, or another quantity
            if role == "frequency" and role in roles:  # in Hz and in rad/s
                angular = [is_angular(one.header, one.unit or "") for one in (roles[role], column)]
                if angular[0] != angular[1]:
                    roles[role] = roles[role] if angular[1] else column
                    continue
            if _is_k(header) and role not in columns:
                known = role in roles and not _is_k(roles[role].header)  # K* says more than K
                if known or not any(units.is_compatible(column.unit or "", si) for si in ("N/m", "N*m/rad")):
                    continue
            if role in roles and self.texts(index) == self.texts(roles[role].index):
                continue
            if role in roles:
                raise self.header_error(
                    f"more than one column could be the {_label(role)}",
                    found=f"{roles[role].header}, {header}",
                    expected="one",
                    hint="give each a header of its own"
                    if header == roles[role].header
                    else f'choose it in the campaign: columns = {{ {role} = "{header}" }}',
                )
            roles[role] = column
        for role in (role for role in columns if role not in roles):
            near = next(iter(get_close_matches(columns[role], self.headers, n=1, cutoff=_ALIKE)), "")
            raise self.header_error(
                f'there is no column "{columns[role]}"',
                kind=NoColumnError,
                expected=f"the header that was named for the {_label(role)}",
                hint=(f'did you mean "{near}"? ' if near else "name one of this file: ")
                + f'columns = {{ {role} = "{near or "..."}" }} in the campaign',
            )
        if "amplitude_reached" in roles and "amplitude" not in roles:
            roles["amplitude"] = replace(roles.pop("amplitude_reached"), role="amplitude")
        return roles

    def _column_of(self, heading: Heading, index: int, stated_unit: str | None) -> Column:
        """The column under a heading, with the unit that header, units row and user agree on."""
        parts = [split_convention(unit) for unit in (heading.unit, self.layout.units[index], stated_unit) if unit]
        conventions = {said for said in (heading.convention, *(part[1] for part in parts)) if said}
        stated = {unit for unit, _ in parts if unit}
        unit, convention = next(iter(stated), None), next(iter(conventions), None)
        column = Column(heading.role, self.headers[index], index, unit, 1.0, convention)
        if len(stated) > 1 or len(conventions) > 1:
            raise UnitError(
                f"two units for the {_label(heading.role)}",
                file=self.file,
                place=self.place(self.layout.header_line, column),
                found=" and ".join(sorted(stated) if len(stated) > 1 else sorted(conventions)),
                expected="one unit, from the header, the units row or the campaign",
            )
        return column


def _is_k(header: str) -> bool:
    """Whether a header is the symbol K alone, with or without a unit."""
    return plain(units.split_header(header)[0]) == "k"


def _label(role: str) -> str:
    """A role in words."""
    return role.replace("_", " ")
