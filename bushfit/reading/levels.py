"""Temperatures and preloads in the columns of a sweep: each level belongs to a test of its own."""

from collections.abc import Collection, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bushfit.errors import UnitError
from bushfit.geometry import Direction, Motion
from bushfit.reading.headers import Column
from bushfit.reading.labelled import column_texts
from bushfit.reading.measurement import SAME_TEMPERATURE, Floats
from bushfit.reading.numerals import Numerals
from bushfit.reading.roles import CONDITIONS
from bushfit.reading.runs import group_rows
from bushfit.reading.si_columns import si_column
from bushfit.reading.table import Table
from bushfit.units import CELSIUS, is_compatible, kelvin_scale, number

#: Largest range of temperatures in one test [K]; chosen: rubber warms up by as much during a test.
ONE_TEST = 5.0
#: Smallest step between preloads of different tests, relative to the largest one; chosen: rubber relaxes by less.
_PRELOAD_STEP = 0.1


@dataclass(frozen=True)
class SweepCondition:
    """Temperature or preload of each row of a sweep.

    Args:
        table: table of the sweep.
        column: column of the file.
        unit: degC, or the unit of the preload in the file.
        values: temperature or preload of each row of data in this unit, (n,).
        step: smallest step between two levels in this unit.
    """

    table: Table
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

    def levels(self, rows: NDArray[np.intp], points: Iterable[Floats] = ()) -> list[NDArray[np.intp]]:
        """Divide rows of a sweep into tests of one temperature or preload.

        Args:
            rows: indices of the rows to divide, (n,).
            points: quantities that determine an operating point, such as the frequency, of all rows.

        Returns:
            Indices of the rows of each test; all rows if temperatures vary by at most 5 K, or if no operating point is
            measured at two preloads.

        Raises:
            UnitError: several preloads without a unit.
        """
        groups = self.groups(rows)
        if self.unit == "degC":
            return groups if np.ptp(self.values[rows]) > ONE_TEST else [rows]
        level = np.empty(self.values.size)
        for index, group in enumerate(groups):
            level[group] = index
        keys = [numbers[rows] for numbers in points] or [np.zeros(rows.size)]
        if not any(np.ptp(level[rows][point]) > 0 for point in group_rows(*keys)):
            return [rows]
        if not self.unit:
            raise self.table.header_error(
                "the preload has no unit",
                kind=UnitError,
                column=self.column,
                found=", ".join(self.text(group).strip() for group in groups),
                expected="a displacement or a force, such as mm or N",
                hint='units = { preload = "N" } in the campaign, or units = { preload = "mm" }',
            )
        return groups


def read_condition(table: Table, role: str, motion: Motion) -> SweepCondition | None:
    """Read the temperature or preload of each row of a sweep.

    Args:
        table: table of the sweep.
        role: "temperature" or "preload".
        motion: kind of motion, which determines the unit of a preload.

    Returns:
        The values; None without a column, with a cell that is not a number, for one temperature without a unit, and for
        a preload in a unit that does not fit.

    Raises:
        MeasurementError: temperatures in an unknown unit, or several temperatures without a unit.
    """
    if (column := table.roles.get(role)) is None:
        return None
    kelvin, units = kelvin_scale(column.unit or ""), (motion.displacement_unit, motion.force_unit)
    if role == "preload" and column.unit and not any(is_compatible(column.unit, si) for si in units):
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
        return SweepCondition(table, column, "degC", kelvin[0] * values + kelvin[1] - CELSIUS, SAME_TEMPERATURE)
    step = _PRELOAD_STEP * float(np.abs(values).max(initial=0.0))
    return SweepCondition(table, column, column.unit or "", values, step)


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
    points = {role: table.roles[role] for role in ("frequency", "amplitude") if role in table.roles}
    values, _ = table.read(points, fewest_rows=1) if points else ({}, ())
    for role in CONDITIONS:
        condition = None if role in stated else read_condition(table, role, motion)
        if condition:
            divided = [(keys, condition.levels(part, values.values())) for keys, part in tests]
            tests = [
                (keys | ({role: condition.text(level)} if len(levels) > 1 else {}), level)
                for keys, levels in divided
                for level in levels
            ]
    return [keys for keys, _ in tests]
