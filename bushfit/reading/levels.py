"""Temperatures and preloads in the columns of loops and sweeps: each level belongs to a test of its own."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bushfit.errors import UnitError
from bushfit.geometry import Direction, Motion, Place
from bushfit.reading.headers import ERRORS, Column
from bushfit.reading.labelled import column_texts
from bushfit.reading.measurement import FEWEST_LOOP_ROWS, SAME_TEMPERATURE, Floats
from bushfit.reading.numerals import Numerals
from bushfit.reading.preload import parse_preload
from bushfit.reading.roles import CONDITIONS
from bushfit.reading.runs import group_rows
from bushfit.reading.si_columns import si_column
from bushfit.reading.stated import TestFile
from bushfit.reading.table import Table
from bushfit.units import CELSIUS, is_compatible, kelvin_scale, number, parse_temperature, si_factor

#: Largest range of temperatures in one test [K]; chosen: rubber warms up by as much during a test.
ONE_TEST = 5.0
#: Smallest step between preloads of different tests, relative to the largest one; chosen: rubber relaxes by less.
_PRELOAD_STEP = 0.1
#: Smallest number of rows at a level that the user states.
_FEWEST_POINTS = 3


@dataclass(frozen=True)
class ConditionColumn:
    """Temperature or preload of each row of a loop or sweep.

    Args:
        table: table of the test.
        column: column of the file.
        unit: degC, or the unit of the preload in the file.
        values: temperature or preload of each row of data in this unit, (n,).
        step: smallest step between two levels in this unit.
        tolerance: largest difference of a row from the stated temperature or preload in this unit.
    """

    table: Table
    column: Column
    unit: str
    values: Floats
    step: float
    tolerance: float

    @property
    def is_loop(self) -> bool:
        """True for a loop, False for a sweep."""
        return "displacement" in self.table.names

    def stated_value(self, text: str) -> float | None:
        """Convert a stated temperature or preload, such as "500 N", to the unit of the condition.

        Returns:
            The value; 0 for no preload, NaN for a preload in another unit, None for a text that is no preload.
        """
        if self.unit == "degC":
            return parse_temperature(text) - CELSIUS
        turns = any(is_compatible(self.unit, si) for si in ("rad", "N*m"))
        if (preload := parse_preload(text, Direction.TORSION if turns else Direction.AXIAL)) is None:
            return None
        if not preload.value:
            return 0.0
        return preload.value / si_factor(self.unit, preload.unit) if is_compatible(self.unit, preload.unit) else np.nan

    def is_near(self, value: float) -> NDArray[np.bool_]:
        """Mask of the rows, (n,), that belong to a stated temperature or preload, in the unit of the condition."""
        return np.abs(self.values - value) <= self.tolerance

    def text(self, rows: NDArray[np.intp]) -> str:
        """Return the mean of some rows as a text, such as "23.0 degC" or "500 N"; `rows` are their indices."""
        mean = float(self.values[rows].mean())
        return f"{mean:.1f} degC" if self.unit == "degC" else f"{number(mean, 4)} {self.unit}"

    def groups(self, rows: NDArray[np.intp]) -> list[NDArray[np.intp]]:
        """Divide row indices, (n,), where their sorted values have a step; groups are in ascending order of value."""
        ordered = rows[np.argsort(self.values[rows], kind="stable")]
        groups = np.split(ordered, np.flatnonzero(np.diff(self.values[ordered]) > self.step) + 1)
        return [np.sort(group) for group in groups]

    def levels(self, rows: NDArray[np.intp], points: Iterable[Floats] = ()) -> list[NDArray[np.intp]]:
        """Divide rows into tests of one temperature or preload.

        Args:
            rows: indices of the rows to divide, (n,).
            points: quantities that determine an operating point of a sweep, such as the frequency, of all rows.

        Returns:
            Indices of the rows of each test; all rows if temperatures vary by at most 5 K, if a level of a loop has too
            few rows, or if no operating point is measured at two preloads.

        Raises:
            UnitError: several preloads without a unit.
        """
        groups, keys = self.groups(rows), [numbers[rows] for numbers in points]
        if self.is_loop and min(group.size for group in groups) < FEWEST_LOOP_ROWS:
            return [rows]
        if self.unit == "degC":
            return groups if np.ptp(self.values[rows]) > ONE_TEST else [rows]
        level = np.empty(self.values.size)
        for index, group in enumerate(groups):
            level[group] = index
        keys = keys or [np.zeros(rows.size)]
        if not any(np.ptp(level[rows][point]) > 0 for point in group_rows(*keys)):
            return [rows]
        if not self.unit:
            found, error = ", ".join(self.text(group).strip() for group in groups), ERRORS["preload_without_unit"]
            raise self.table.header_error(**error, kind=UnitError, column=self.column, found=found)
        return groups

    def select(self, rows: NDArray[np.intp], points: Iterable[Floats], stated: float | None) -> NDArray[np.intp]:
        """Select the rows of a test at a stated temperature or preload.

        Args:
            rows: indices of the rows to select from, (n,).
            points: quantities that determine an operating point of a sweep, such as the frequency, of all rows.
            stated: value in the unit of the condition; None if the user states none.

        Returns:
            Indices of the rows.

        Raises:
            MeasurementError: several levels, of which none is stated, or too few rows near the stated one.
        """
        name, levels = self.column.role, self.levels(rows, points)
        if len(levels) == 1 and (stated is None or self.is_loop):
            return levels[0]
        problem, expected, nearest = f"this file contains tests at several {name}s", f"one {name}", levels[0]
        if stated is not None:
            is_near = self.is_near(stated)
            near = [level if self.is_loop else level[is_near[level]] for level in levels if is_near[level].any()]
            selected = np.sort(np.concatenate([rows[:0], *near]))
            if selected.size >= _FEWEST_POINTS:
                return selected
            problem = f"too few rows are near the stated {name}"
            unit = "K" if self.unit == "degC" else self.unit
            expected = f"{_FEWEST_POINTS} rows or more within {self.tolerance:g} {unit} of {stated:.4g} {self.unit}"
            if np.isnan(stated):
                expected = f"a {name} in {self.unit}, as in the file"
            levels = self.groups(rows)
            nearest = min(levels, key=lambda level: abs(self.values[level].mean() - stated))
        raise self.table.error(
            problem,
            column=self.column,
            found=", ".join(self.text(level).removesuffix(f" {self.unit}") for level in levels) + f" {self.unit}",
            expected=expected,
            hint=f'state {name} = "{self.text(nearest)}" in the campaign; several tests may name one file',
        )


def read_condition(table: Table, role: str, motion: Motion) -> ConditionColumn | None:
    """Read the temperature or preload of each row of a loop or sweep.

    Args:
        table: table of the test.
        role: "temperature" or "preload".
        motion: kind of motion, which determines the unit of a preload.

    Returns:
        The values; None without a column, with a cell that is not a number, for one temperature without a unit, and for
        a preload in a unit that does not fit.

    Raises:
        MeasurementError: temperatures in an unknown unit, several temperatures without a unit, or blocks of which only
            some have a label with the condition.
    """
    if (column := table.roles.get(role)) is None:
        return None
    kelvin, units = kelvin_scale(column.unit or ""), (motion.displacement_unit, motion.force_unit)
    if role == "preload" and column.unit and not any(is_compatible(column.unit, si) for si in units):
        return None
    values = _numbers(table, column)
    if np.isnan(values).any() and "block" in table.headers:
        blocks, *_ = column_texts(table, table.headers.index("block"))
        without = blocks.distinct[blocks.codes[np.isnan(values)][0]]
        raise table.header_error(
            f"only some blocks of this file have a {role}",
            found=f"none above block {without}",
            expected=f"the {role} above each block",
            hint=f'write it above each block, or select one block: rows = {{ block = "{without}" }} in the campaign',
        )
    if np.isnan(values).any() or (role == "temperature" and not column.unit and np.ptp(values) <= ONE_TEST):
        return None
    if role == "temperature" and not kelvin:
        si_column(table, role, Direction.AXIAL)  # raises the error, whatever the direction
    if kelvin:
        degrees = kelvin[0] * values + kelvin[1] - CELSIUS
        return ConditionColumn(table, column, "degC", degrees, SAME_TEMPERATURE, SAME_TEMPERATURE)
    step = _PRELOAD_STEP * float(np.abs(values).max(initial=0.0))
    return ConditionColumn(table, column, column.unit or "", values, step, step / 2.0)


def _numbers(table: Table, column: Column) -> Floats:
    """Numbers in a column, (n,), in the unit of the file; an empty cell repeats the number above, NaN for a text."""
    chunks = [table.parse(chunk, table.needed | {column.index}) for chunk in table.chunks()]
    if chunks and all(chunks):
        return np.concatenate([chunk[column.index] for chunk in chunks if chunk])
    (texts,) = column_texts(table, column.index)
    notations = (table.numerals, Numerals())  # the second for numbers of a workbook
    found = ([way.value(text) for way in notations] for text in texts.distinct)
    distinct = [next((value for value in pair if value is not None), np.nan) for pair in found]
    return np.array(distinct, dtype=float)[texts.codes]


def rows_of_test(
    table: Table, test: TestFile, place: Place, count: int, points: Sequence[Floats] = ()
) -> tuple[NDArray[np.intp], Floats | None]:
    """Select the rows of a loop or sweep at the temperature and the preload of the test.

    Args:
        table: table of the test.
        test: table of the test in the campaign.
        place: direction of the bushing, or the specimen.
        count: number of rows of the table.
        points: frequency and amplitude of all rows of a sweep; empty for a loop.

    Returns:
        Indices of the selected rows, and their temperatures [degC]; None without such a column.

    Raises:
        MeasurementError: the file has several temperatures or preloads, and none is stated, or too few rows are near
            the stated one.
    """
    rows, degrees = np.arange(count), None
    if temperatures := read_condition(table, "temperature", place.motion):
        stated = None if test.temperature is None else test.temperature - CELSIUS
        rows = temperatures.select(rows, points, stated)
        degrees = temperatures.values
    if preloads := read_condition(table, "preload", place.motion):
        several = test.preload and len(preloads.levels(rows, points)) > 1
        rows = preloads.select(rows, points, preloads.stated_value(test.preload) if several and test.preload else None)
    return rows, None if degrees is None else degrees[rows]


def split_conditions(table: Table, rows: NDArray[np.intp], stated: Mapping[str, Any]) -> list[dict[str, str]]:
    """Find the temperatures and preloads of the tests in a file.

    Args:
        table: table of the test.
        rows: indices of rows of the table, (n,).
        stated: keys of the test that the user states; of several levels, only the stated one belongs to the test.

    Returns:
        Texts of each test by key, such as {"temperature": "23.0 degC", "preload": "500 N"}; a key is missing if the
        user states it, or if all rows of the file have one level.
    """
    tests: list[tuple[dict[str, str], NDArray[np.intp]]] = [({}, rows)]
    points = {role: table.roles[role] for role in ("frequency", "amplitude") if role in table.roles}
    values, _ = table.read(points, fewest_rows=1) if points else ({}, ())
    for role in CONDITIONS:
        condition = read_condition(table, role, table.motion)
        if condition is None or len(condition.levels(np.arange(condition.values.size), values.values())) == 1:
            continue
        text = stated.get(role)
        value = condition.stated_value(text) if text else None
        tests = [
            (keys if text else keys | {role: condition.text(level)}, level)
            for keys, part in tests
            for level in condition.levels(part, values.values())
            if value is None or condition.is_near(value)[level].any()
        ]
    return [keys for keys, _ in tests]
