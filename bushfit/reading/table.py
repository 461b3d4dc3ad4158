"""Table of a test: columns classified by name and unit, and their numbers in SI."""

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from bushfit import units
from bushfit.errors import UnitError, error_location
from bushfit.geometry import STRAINING, TRANSLATION, Motion, Place, strain_factor_of_files
from bushfit.reading.blocks import refuse_other_columns
from bushfit.reading.cells import Cells, FaultyRow
from bushfit.reading.headers import LOOP_COLUMNS, SWEEP_COLUMNS, Column, Vocabulary, is_angular, parse_unit, split_unit
from bushfit.reading.labelled import find_labels
from bushfit.reading.layout import Line
from bushfit.reading.measurement import Floats
from bushfit.reading.names import Labels, is_remark, labels_above
from bushfit.reading.numerals import ALL_NUMERALS, is_like_number
from bushfit.reading.roles import OF_MOTION, of_motion, si_unit
from bushfit.reading.source import LARGEST_VALUE, LEAST_VALUE, RowSource, Sheet
from bushfit.reading.times import clock

#: Smallest ratio of nines that mark a missing value to the largest other number; chosen: outliers are rarely nines.
_MARK_RATIO = 3.0
#: Quantity in a line above a table: "1 V = 200 N", "Crosshead speed: 10 mm/min".
_QUANTITY = re.compile(r"[=:]\s*(\d+(?:[.,]\d+)?)\s*([^\s\d,;]+(?:\s*/\s*[^\s\d,;]+)?)")
#: Mark of a footnote in a header, such as "Amplitude¹ [mm]".
_FOOTNOTE_MARK = re.compile("[\u00b9\u00b2\u00b3\u2074\u2020\u2021]")
#: Largest number of characters of a remark that is quoted.
_LONGEST_QUOTE = 100
#: Rows that are converted at a time if pandas cannot read them; chosen: their texts take a few MiB.
_CHUNK_ROWS = 1 << 16


@dataclass(frozen=True, eq=False)
class Table(Cells):
    """Table of a test whose columns have roles, such as "force", and can be read in SI.

    Args:
        names: usual column names by role, before adaptation to the motion.
        motion: kind of motion: translation, rotation or strain.
        notes: sentences on columns that were recognised only by their unit.
    """

    names: Mapping[str, Sequence[str]]
    motion: Motion
    notes: tuple[str, ...] = field(default=(), kw_only=True)

    @cached_property
    def lines_above(self) -> list[Line]:
        """Non-empty lines above the table, and footnotes below it, each behind the header that refers to it."""
        above = [line for line in self.source.head() if line.number < self.layout.header_line]
        marks = {mark: header for header in self.headers for mark in _FOOTNOTE_MARK.findall(header)}
        below = (line for line in self.source.lines(self.layout.header_line) if line.text[:1] in marks) if marks else ()
        return above + [Line(line.number, f"{marks[line.text[0]]}: {line.text[1:]}") for line in below]

    @cached_property
    def labels_above(self) -> Labels:
        """Labels in the lines above the table, such as a temperature."""
        return labels_above(self.lines_above)

    @cached_property
    def remarks(self) -> tuple[str, ...]:
        """Sentences on lines above the table, marked rows and hidden rows that may change what the test means."""
        remarks = ((line.number, line.text[:_LONGEST_QUOTE]) for line in self.lines_above if is_remark(line.text))
        sentences = [f'line {number} is not understood: "{text}"' for number, text in remarks]
        rows = [] if all(is_like_number(str(cell)) for cell in self.first_row) else self.first_rows
        texts = Counter(cell for row in rows for cell in row if isinstance(cell, str) and cell[:1].isalpha())
        sentences += [
            f'{count} rows are marked "{cell[:_LONGEST_QUOTE]}"' for cell, count in texts.items() if is_remark(cell)
        ]
        if hidden := [number for number in self.source.hidden if number > self.layout.header_line]:
            sentences.append(f"{len(hidden)} rows from row {hidden[0]} on are hidden in the workbook, and are read too")
        return tuple(sentences)

    def quantity_above(self, unit: str) -> str | None:
        """Find a quantity such as "0.2 mm" in the lines above the table, where it follows = or :.

        Returns:
            Number and unit as text; None if no quantity, or several, have the dimension of the SI unit `unit`.
        """
        matches = (match for line in self.lines_above for match in _QUANTITY.finditer(line.text))
        matches = (match for match in matches if units.is_compatible(match[2], unit))
        texts = dict.fromkeys(f"{match[1].replace(',', '.')} {match[2]}" for match in matches)
        return next(iter(texts)) if len(texts) == 1 else None

    @cached_property
    def sampling_rate(self) -> float | None:
        """Sampling rate [Hz] that a line above the table states clearly, in the notation of its numbers; else None."""
        text, _, unit = (self.labels_above.sampling or "").partition(" ")
        if not text:
            return None
        values = {way.value(text) for way in ALL_NUMERALS} - {None}
        value = values.pop() if len(values) == 1 else self.numerals.value(text)
        if not value:
            return None
        is_rate = units.is_compatible(unit, "Hz")
        return value * units.si_factor(unit, "Hz") if is_rate else 1.0 / (value * units.si_factor(unit, "s"))

    @property
    def note_sampling(self) -> str:
        """Note for the user that the time comes from the sampling rate above the table."""
        return (
            f"the file has no time: its rows are {self.sampling_rate:.6g} a second, as the lines above the table state"
        )

    @property
    def sha256(self) -> str:
        """SHA-256 of the file in hexadecimal digits."""
        return self.opened.checksum.result()

    @cached_property
    def row_labels(self) -> Mapping[str, tuple[int, Sequence[str]]]:
        """Columns that state direction, specimen_number and run of each row: index and texts, (n,), by these keys."""
        return find_labels(self)

    def column(self, role: str, tested: Place, hint: str | None = None) -> Column:
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
        label, expected = role.replace("_", " "), si_unit(role, tested.motion)
        quantity, example = units.common_unit(expected)
        if role not in self.roles:
            self.refuse_other_motion(role)
            ways = ", ".join(filter(None, (self.columns_key(role, expected), hint)))
            raise self.header_error(
                f"there is no column for the {label}",
                expected=f'a header such as "{label} [{example}]"',
                hint=f"name the column in the campaign: {ways}",
            )
        column = self.roles[role]
        if column.index in self.clocks:
            return column
        place = self.place(self.layout.header_line, column)
        unclear = partial(UnitError, file=self.file, place=place, found=f'"{column.header}"')
        if math.isnan(column.logarithm):
            unit = column.unit or example
            raise unclear(
                f"the base of the logarithm of the {label} is not known",
                expected="log10 or ln in the header",
                hint=f'units = {{ {role} = "log10({unit})" }} in the campaign, or units = {{ {role} = "ln({unit})" }}',
            )
        if column.unit is None and column.logarithm:
            raise unclear(
                f"the logarithms of the {label} have no unit",
                expected="the reference, such as dB re 1 N/mm, or the unit, such as log10(N/mm)",
                hint=f'units = {{ {role} = "{example}" }} in the campaign if the logarithm of 1 {example} is 0',
            )
        if column.unit is None and (expected != "1" or role in OF_MOTION):
            angular = expected == "Hz" and is_angular(column.header, "1/s")
            second = "rad/s" if angular else {"phase": "rad", "time": "ms"}.get(role, "")
            alternative = f', or units = {{ {role} = "{second}" }}' if second else ""
            raise unclear(
                f"the {label} has no unit",
                expected=f"{quantity}, such as {example}{', or an angular frequency, such as rad/s' * angular}",
                hint=f'write "{column.header} [{"rad/s" if angular else example}]" in the header, '
                f'or units = {{ {role} = "{self.quantity_above(expected) or example}" }} in the campaign{alternative}',
            )
        unit = column.unit or "1"
        foreign_units = ("m", "rad", "N/m", "N*m/rad") if self.motion is STRAINING else ("1", "Pa")
        is_foreign = any(units.is_compatible(unit, foreign_unit) for foreign_unit in foreign_units)
        if is_foreign and role in OF_MOTION and "force" not in role:
            self.refuse_other_motion(role, [column.header])
        if not units.is_compatible(unit, expected) and units.is_compatible(unit, "V"):  # pint is slow to import
            raise unclear(
                f"the {label} is in volts",
                expected=f"{quantity}, such as {example}",
                hint=f"state the {label} of one volt, such as units = "
                f'{{ {role} = "{self.quantity_above(expected) or f"200 {example}"}" }} in the campaign',
            )
        if role == "amplitude" and units.is_compatible(unit, "m/s^2") and expected == "m":
            return replace(column, role="acceleration", scale=units.si_factor(unit, "m/s^2"))
        with error_location(self.file, place):
            if expected == "Hz" and is_angular(column.header, unit):
                per_second = "rad/s" if units.is_compatible(unit, "rad/s") else "Hz"
                return replace(column, scale=units.si_factor(unit, per_second) / (2.0 * math.pi))
            is_strain = role in ("displacement", "amplitude", "amplitude_reached")
            strain_factor = strain_factor_of_files(tested) if is_strain else 1.0
            return replace(column, scale=strain_factor * units.si_factor(unit, expected))

    def agrees(self, role: str, expected: str) -> bool:
        """True if there is a column for a role such as "force", whose unit has the dimension of the unit `expected`."""
        column = self.roles.get(role)
        return column is not None and units.is_compatible(column.unit or "1", expected)

    def columns_key(self, role: str, unit: str) -> str:
        """Suggest campaign keys for a missing column, such as 'columns = { force = "F1" }', for the hint of an error.

        Args:
            role: role of the missing column, such as "force".
            unit: its SI unit.

        Returns:
            Keys for up to three unused headers with a unit of this dimension.
        """
        usual = Vocabulary({**LOOP_COLUMNS, **SWEEP_COLUMNS})
        fitting = [
            header
            for header, in_row in zip(self.headers, self.layout.units, strict=True)
            if header
            and (not (heading := usual.heading(header)) or (role, heading.role) == ("amplitude", "displacement"))
            and unit != "1"
            and units.is_compatible(split_unit(header)[1] or parse_unit(in_row)[0], unit)
        ]
        return " or ".join(f'columns = {{ {role} = "{header}" }}' for header in fitting[:3] or ["..."])

    def refuse_other_motion(self, role: str, headers: Sequence[str] | None = None) -> None:
        """Refuse strain or modulus columns in a test of displacement and force, or the reverse.

        Args:
            role: role of the column that the test lacks, such as "amplitude".
            headers: headers known to belong to the other kind of test; by default those of the table are checked.

        Raises:
            MeasurementError: a header has this role in the other kind of test.
        """
        other_motion = TRANSLATION if self.motion is STRAINING else STRAINING
        kinds = ["displacement and force or stiffness", "strain and modulus"]
        expected, found = kinds[:: -1 if self.motion is STRAINING else 1]
        hint = 'write [[specimens]] with a name and kind = "modulus" in the campaign, and specimen = "its name" here'
        if self.motion is STRAINING:
            hint = 'take specimen out of the campaign, or give it kind = "shear" with its area and thickness'
        names = of_motion(self.names, other_motion)
        differs = role in names and names[role] is not of_motion(self.names, self.motion)[role]
        words = Vocabulary({role: names[role]} if differs else {}, {})
        for header in headers or filter(words.heading, self.headers):
            label = role.replace("_", " ")
            problem = f"this is a test of {found}"
            raise self.header_error(problem, found=f'"{header}" for the {label}', expected=expected, hint=hint)

    def read(self, wanted: Mapping[str, Column], *, fewest_rows: int) -> tuple[dict[str, Floats], tuple[str, ...]]:
        """Read columns, and list the rows that are left out.

        Args:
            wanted: columns by role such as "force", with their factors to SI.
            fewest_rows: smallest number of rows that is accepted.

        Returns:
            Values in SI by role, (n,) each, and sentences on rows left out and on columns recognised by their unit.

        Raises:
            MeasurementError: ambiguous numbers, too few rows, or so many rows without data that the meaning of the
                table is in doubt.
        """
        table, left_out = self.needing(wanted), list[FaultyRow]()
        parts = [part for block in table.blocks() for part in table._read_block(block, wanted, left_out)]
        if left_out:
            refuse_other_columns(table, left_out, Vocabulary(of_motion(self.names, self.motion)))
        values = {role: np.concatenate([np.empty(0), *(part.pop(role) for part in parts)]) for role in wanted}
        if marks := table._marks_for_missing(wanted, values):
            self.marks.update(marks)
            return self.read(wanted, fewest_rows=fewest_rows)
        count = len(next(iter(values.values())))
        notes = (*self.notes, *self.remarks, *table.note_left_out(left_out, count))
        if count < fewest_rows:
            faulty = ((line, cells) for line, cells, fault in left_out if fault in ("doubtful", "missing"))
            if row := next(faulty, None):
                raise table.bad_row(*row)
            problem, hint = "too few rows", None
            if isinstance(self.source, Sheet) and self.source.lacks_values():
                problem = "the workbook has formulas whose values were not saved"
                hint = "open it in a spreadsheet program and save it again"
            raise self.error(problem, found=f"{count}", expected=f"at least {fewest_rows}", hint=hint)
        for role, column in wanted.items():
            if column.logarithm:
                with np.errstate(over="ignore"):
                    values[role] = column.scale * column.logarithm ** (values[role] / column.scale)
        return values, notes

    def _marks_for_missing(self, wanted: Mapping[str, Column], values: Mapping[str, Floats]) -> dict[int, str | float]:
        """Find numbers that mark missing values: nines beyond all others, or -1 beside positive numbers.

        Args:
            wanted: columns by role, with their factors to SI.
            values: values in SI by role, (n,) each.

        Returns:
            Cell with such a number, as in the file, by index of its column.
        """
        marks: dict[int, str | float] = {}
        for role, column in ((role, column) for role, column in wanted.items() if role != "time"):
            for row in {int(values[role].argmin()), int(values[role].argmax())} if values[role].size else ():
                number = float(values[role][row] / column.scale)
                if number != -1.0 and (abs(number) < 99.0 or not set(f"{abs(number):.9g}") <= set("9.")):
                    continue
                rest = values[role][values[role] != values[role][row]] / column.scale
                is_apart = abs(number) > _MARK_RATIO * np.abs(rest).max(initial=0.0)
                if rest.size > values[role].size / 2 and (rest.min() > 0.0 if number == -1.0 else is_apart):
                    marks[column.index] = next(islice(self.rows(), row, None))[1][column.index]
        return marks

    def needing(self, wanted: Mapping[str, Column]) -> "Table":
        """Copy of the table in which only rows with a number in each wanted column are data."""
        return replace(self, needed=self.needed | {column.index for column in wanted.values()})

    def check_positive(self, roles: Sequence[str], wanted: Mapping[str, Column], values: Mapping[str, Floats]) -> None:
        """Refuse values that are not positive, or positive but smaller than any rig records.

        Args:
            roles: roles such as "frequency" whose values must be positive, if they are among `values`.
            wanted: columns by role.
            values: values in SI by role, (n,) each.

        Raises:
            MeasurementError: a value is not positive or too small.
        """
        for role in roles:
            if role in values:
                problem = f"the {role.replace('_', ' ')} is not positive"
                self.refuse(values[role] <= 0.0, wanted[role], problem, "a number above zero")
                smallest = f"{LEAST_VALUE / abs(wanted[role].scale):.3g} or more"
                self.refuse(values[role] < LEAST_VALUE, wanted[role], "no rig records values this small", smallest)

    def refuse(
        self, bad: NDArray[np.bool_], column: Column, problem: str, expected: str, hint: str | None = None
    ) -> None:
        """Raise an error that names line and cell of the first bad row, if there is one.

        Args:
            bad: mask of the bad rows, (n,).
            column: column with the bad cell.
            problem: description of the problem in one clause.
            expected: expected content of the cell.
            hint: next step to suggest.

        Raises:
            MeasurementError: there is a bad row.
        """
        if bad.any():
            line, cells = next(islice(self.rows(), int(np.argmax(bad)), None))
            found = f'"{cells[column.index]}"'
            raise self.error(problem, line=line, column=column, found=found, expected=expected, hint=hint)

    def _read_block(
        self, block: RowSource, wanted: Mapping[str, Column], left_out: list[FaultyRow]
    ) -> Iterator[dict[str, Floats]]:
        """Read a block of rows as numbers: at once if all its rows are data, else row by row.

        Args:
            block: block of the source.
            wanted: columns by role such as "force", with their factors to SI.
            left_out: list to which rows without data are added.

        Raises:
            MeasurementError: a cell without a finite number, or with one above LARGEST_VALUE.
        """
        if (arrays := self.parse(block, frozenset(column.index for column in wanted.values()))) is not None:
            values = {role: column.scale * arrays[column.index] for role, column in wanted.items()}
            extremes = [(x.min(initial=0.0), x.max(initial=0.0)) for x in values.values()]
            if all(low >= -LARGEST_VALUE and high <= LARGEST_VALUE for low, high in extremes):  # not if NaN
                yield values
                return
        rows = self.rows(block, left_out)
        while chunk := list(islice(rows, _CHUNK_ROWS)):
            yield {role: np.array([self._number(column, *row) for row in chunk]) for role, column in wanted.items()}

    def _number(self, column: Column, line: int, cells: Sequence[str | float]) -> float:
        """Number in the cell of a column, in SI.

        Raises:
            MeasurementError: the cell has no finite number, or one above LARGEST_VALUE.
        """
        cell, value_of = cells[column.index], clock if column.index in self.clocks else self.numerals.value
        value = value_of(cell) if isinstance(cell, str) else cell
        if value is None or not abs(value * column.scale) <= LARGEST_VALUE:
            raise self.bad_row(line, cells, column=column)
        return value * column.scale
