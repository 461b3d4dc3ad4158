"""Outliers of a loop: rows that stand out from the harmonics of their column and from their neighbours."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.fourier import GRID, basis, first_amplitude, least_squares
from bushfit.fitting.noise import FLOOR
from bushfit.fitting.outliers import are_outliers, are_stuck, outlier_limit
from bushfit.reading.measurement import Loop
from bushfit.reduction.scatter import MEDIAN_TO_SIGMA

#: Share of the amplitude, over the number of harmonics, by which these may miss a corner of the motion.
_CORNER = 0.5
#: Rounds in which rows are weighted down by their distance; chosen.
_REWEIGHTINGS = 10
#: Rounds of leaving outliers out at most; chosen: nearly all records settle in two.
_MOST_ROUNDS = 10


class OutlierRows(NamedTuple):
    """Outliers of one column: their rows, (k,), and how far each lies off the harmonics, in units of noise, (k,)."""

    rows: Array
    off: Array


NO_OUTLIERS = OutlierRows(np.empty(0, dtype=np.intp), np.empty(0))


def residual_limit(solution: Array, residual: Array, rows: int) -> float:
    """Distance from its harmonics within which a row is no outlier, in units of the column.

    Noise takes part of it, and the corners of a triangle, which these harmonics, (2 order + 1,), round off, the rest.
    The residuals are of rows that stand for all `rows` of the column.
    """
    corner = _CORNER / (solution.size // 2) * first_amplitude(solution)
    return outlier_limit(rows, 1, np.inf) * _spread(residual) + corner


def fit_without_outliers(columns: Array, values: Array, solution: Array) -> tuple[Array, Array]:
    """Harmonics of a column fitted without its outliers, and which rows are none, (n,).

    Squares let so many harmonics follow a cluster of outliers, as `solution` does. So rows are weighted down by their
    distance first; then outliers are found and left out in turn until both agree.
    """
    inliers, stuck = np.ones(values.size, dtype=bool), are_stuck(values)
    if _inliers(columns, values, solution, stuck).all():
        return solution, inliers
    for _ in range(_REWEIGHTINGS):
        residual = values - columns @ solution
        weight = ~stuck / np.sqrt(1.0 + np.square(residual / _noise(solution, residual[~stuck])))
        solution = least_squares(columns, values, weight)
    for _ in range(_MOST_ROUNDS):
        found = _inliers(columns, values, solution, stuck)
        if np.array_equal(found, inliers) or np.count_nonzero(found) < 2 * solution.size:
            break
        inliers, solution = found, least_squares(columns, values, found)
    return solution, inliers


def column_outliers(loop: Loop, frequency: float, column: Array, solution: Array, residual: Array) -> OutlierRows:
    """Outliers among all rows of a column, whose harmonics and residual are of rows that stand for all."""
    grid = np.arange(GRID + 1) / GRID
    cycle = basis(grid, solution.size // 2) @ solution
    off = column - np.interp((loop.time - loop.time[0]) * frequency % 1.0, grid, cycle)
    limit = residual_limit(solution, residual, column.size)
    rows = np.flatnonzero(are_outliers(off, column, limit) | are_stuck(column))
    return OutlierRows(rows, np.abs(off[rows]) / _noise(solution, residual))


def _inliers(columns: Array, values: Array, solution: Array, stuck: Array) -> Array:
    """Rows that are neither stuck nor far off these harmonics, (n,)."""
    residual = values - columns @ solution
    return ~(stuck | are_outliers(residual, values, residual_limit(solution, residual, values.size)))


def _noise(solution: Array, residual: Array) -> float:
    """Noise of one row: the spread of the residuals, and no less than any rig has."""
    return max(_spread(residual), FLOOR * first_amplitude(solution))


def _spread(residual: Array) -> float:
    """Standard deviation of residuals about zero, which outliers hardly move."""
    return MEDIAN_TO_SIGMA * float(np.median(np.abs(residual)))
