"""Temperatures and preloads in the columns of a sweep: each level belongs to a test of its own."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bushfit.geometry import Direction, Motion
from bushfit.reading.headers import Column
from bushfit.reading.labelled import column_texts
from bushfit.reading.measurement import SAME_TEMPERATURE, Floats
from bushfit.reading.numerals import Numerals
from bushfit.reading.runs import group_rows
from bushfit.reading.si_columns import si_column
from bushfit.reading.table import Table
from bushfit.units import CELSIUS, is_compatible, kelvin_scale, number

#: Largest range of temperatures in one test [K]; chosen: rubber warms up by as much during a test.
ONE_TEST = 5.0
#: Smallest step between preloads of different tests, relative to the largest one; chosen: rubber relaxes by less.
_PRELOAD_STEP = 0.1
#: Roles of columns whose levels belong to different tests.
CONDITIONS = ("temperature", "preload")


@dataclass(frozen=True)
class SweepCondition:
    """Temperature or preload of each row of a sweep.

    Args:
        column: column of the file.
        unit: degC, or the unit of the preload in the file.
        values: temperature or preload of each row of data in this unit, (n,).
        step: smallest step between two levels in this unit.
    """

    column: Column
    unit: str
    values: Floats
    step: float

    def text(self, rows: NDArray[np.intp]) -> str:
        """Return the mean of some rows as a text, such as "23.0 degC" or "500 N"; `rows` are their indices."""
        mean = float(self.values[rows].mean())
        return f"{mean:.1f} degC" if self.unit == "degC" else f"{number(mean, 4)} {self.unit}"

    def groups(self, rows: NDArray[np.intp]) -> list[NDArray[np.intp]]:
        """Divide rows, given by their indices, where the sorted values have a step; groups are in ascending order."""
        ordered = rows[np.argsort(self.values[rows], kind="stable")]
        groups = np.split(ordered, np.flatnonzero(np.diff(self.values[ordered]) > self.step) + 1)
        return [np.sort(group) for group in groups]


def read_condition(table: Table, role: str, motion: Motion) -> SweepCondition | None:
    """Read the temperature or preload of each row of a sweep.

    Args:
        table: table of the sweep.
        role: "temperature" or "preload".
        motion: kind of motion, which determines the unit of a preload.

    Returns:
        The values; None without a column, with a cell that is not a number, for one temperature without a unit, and for
        a preload without a fitting unit.

    Raises:
        MeasurementError: temperatures in an unknown unit, or several temperatures without a unit.
    """
    if (column := table.roles.get(role)) is None:
        return None
    kelvin, units = kelvin_scale(column.unit or ""), (motion.displacement_unit, motion.force_unit)
    if role == "preload" and not any(is_compatible(column.unit or "?", si) for si in units):
        return None
    (texts,) = column_texts(table, column.index)
    notations = (table.numerals, Numerals())  # the second for numbers of a workbook
    found = ([way.value(text) for way in notations] for text in texts.distinct)
    distinct = [next((value for value in pair if value is not None), np.nan) for pair in found]
    values = np.array(distinct, dtype=float)[texts.codes]
    if np.isnan(values).any() or (role == "temperature" and not column.unit and np.ptp(values) <= ONE_TEST):
        return None
    if role == "temperature" and not kelvin:
        si_column(table, role, Direction.AXIAL)  # raises the error, whatever the direction
    if kelvin:
        return SweepCondition(column, "degC", kelvin[0] * values + kelvin[1] - CELSIUS, SAME_TEMPERATURE)
    return SweepCondition(column, column.unit or "", values, _PRELOAD_STEP * float(np.abs(values).max(initial=0.0)))


def find_levels(table: Table, condition: SweepCondition, rows: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """Divide the rows of a sweep into tests of one temperature or preload.

    Args:
        table: table of the sweep.
        condition: temperature or preload of its rows.
        rows: indices of the rows to divide, (n,).

    Returns:
        Indices of the rows of each test; all rows if temperatures vary by at most 5 K, or if no operating point is
        measured at two preloads.
    """
    groups = condition.groups(rows)
    if condition.unit == "degC":
        return groups if np.ptp(condition.values[rows]) > ONE_TEST else [rows]
    points = {role: table.roles[role] for role in ("frequency", "amplitude") if role in table.roles}
    values, _ = table.read(points, fewest_rows=1)
    level = np.empty(condition.values.size)
    for index, group in enumerate(groups):
        level[group] = index
    keys = [numbers[rows] for numbers in values.values()] or [np.zeros(rows.size)]
    return groups if any(np.ptp(level[rows][point]) > 0 for point in group_rows(*keys)) else [rows]


def split_conditions(
    table: Table, rows: NDArray[np.intp], stated: Collection[str], motion: Motion
) -> list[dict[str, str]]:
    """Find the temperatures and preloads of the tests in a file.

    Args:
        table: table of the sweep.
        rows: indices of its rows, (n,).
        stated: conditions that the user states, by which rows need not be divided.
        motion: kind of motion.

    Returns:
        Texts of temperature and preload of each test by key; a key is missing if all its rows have one level.
    """
    tests: list[tuple[dict[str, str], NDArray[np.intp]]] = [({}, rows)]
    for role in CONDITIONS:
        condition = None if role in stated else read_condition(table, role, motion)
        if condition:
            divided = [(keys, find_levels(table, condition, part)) for keys, part in tests]
            tests = [
                (keys | ({role: condition.text(level)} if len(levels) > 1 else {}), level)
                for keys, levels in divided
                for level in levels
            ]
    return [keys for keys, _ in tests]
