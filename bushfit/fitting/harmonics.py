"""The harmonics of a loop: the motion cleared of noise, what its force scatters about its own, and which rows are wild.

Everything is found by least squares at the samples as they are; rows that are faults of the record do not bend it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bushfit.effects.contract import Array
from bushfit.fitting.noise import FLOOR
from bushfit.fitting.outliers import limit, outlier_rows, stuck_rows
from bushfit.reading.measurement import Loop
from bushfit.reduction.scatter import MEDIAN_TO_SIGMA

#: Samples of the model's cycle; measured rows lie between them and are reached by linear interpolation.
GRID = 1024
#: Loops with more rows than this are averaged into as many bins of phase.
MOST_ROWS = 4 * GRID
#: Rows that are enough to find the cycles, and up to which every one is held against the harmonics.
ENOUGH_ROWS = 200_000
_GOLDEN = 0.6180339887498949
_HARMONICS = 60
#: Harmonics of one cycle that count as slow, when the scatter between cycles is taken.
_SLOW_HARMONICS = 3
_SIGNIFICANT = 4.0
#: Part of the amplitude, over the number of harmonics, by which these miss a corner; and rounds to find wild rows in.
_CORNER, _MOST_ROUNDS = 0.5, 10
#: A motion is a triangle where that leaves no more than this times what free harmonics leave.
_ALIKE = 1.02
#: A third harmonic so many times the noise off that of a triangle rules it out, before all its corners are drawn.
_FAR = 3.0


class OutlierRows(NamedTuple):
    """Rows that are faults of the record, (k,), and how far each lies off its column's harmonics [noise], (k,)."""

    rows: Array
    off: Array


NO_OUTLIERS = OutlierRows(np.empty(0, dtype=np.intp), np.empty(0))


class Harmonics(NamedTuple):
    """Complex harmonics of the displacement, mean first; mean and scatter of the force; wild rows by column."""

    motion: Array
    force_mean: float
    force_noise: float
    outliers: Mapping[str, OutlierRows]


def series(coefficients: Array, phase: Array) -> Array:
    """Re sum_k c_k exp(2 pi i k phase) at any phase [cycles], (n,)."""
    turn, value = np.exp(2j * np.pi * phase), np.zeros(phase.shape, dtype=complex)
    for coefficient in coefficients[::-1]:
        value = value * turn + coefficient
    return value.real


def harmonics(loop: Loop, frequency: float, cycles: float) -> Harmonics:
    """Significant harmonics of the displacement; the force's mean and scatter about its own harmonics; wild rows.

    The scatter holds what does not repeat from cycle to cycle and what is too fast for the rubber, but not what
    changes slowly from one cycle to the next, which is settling or drift.

    Args:
        loop: one cycle or more of a periodic motion.
        frequency: [Hz].
        cycles: in the loop.
    """
    columns = {"displacement": loop.displacement, "force": loop.force}
    chosen = sample(loop.time.size, MOST_ROWS)
    phase = (loop.time[chosen] - loop.time[0]) * frequency
    values = np.column_stack([column[chosen] for column in columns.values()])
    number = order(loop.time.size / max(cycles, 1.0), _HARMONICS)
    columns_of = basis(phase, number)
    solution = solve(columns_of, values)
    kept, outliers = [], {}
    for which, (name, column) in enumerate(columns.items()):
        solution[:, which], sound = _sound(columns_of, values[:, which], solution[:, which])
        kept.append(sound)
        left = values[:, which] - columns_of @ solution[:, which]
        few = column.size <= ENOUGH_ROWS
        outliers[name] = (
            _outliers_of(loop, frequency, column, solution[:, which], left) if few or not sound.all() else NO_OUTLIERS
        )
    left = values - columns_of @ solution
    of_motion, of_force = kept
    freedom = [max(int(np.count_nonzero(sound)) - 2 * number - 1, 1) for sound in kept]
    motion_noise = np.sqrt(np.sum(np.square(left[of_motion, 0])) / freedom[0])
    force_noise = _scatter(phase[of_force], left[of_force, 1], freedom[1])
    motion = solution[:, 0]
    coefficients = np.concatenate((motion[:1], motion[1 : number + 1] + 1j * motion[number + 1 :]))
    keep = np.abs(coefficients) > _SIGNIFICANT * motion_noise * np.sqrt(2.0 / phase.size)
    keep[:2] = True
    motion = np.where(keep, coefficients, 0.0)[: int(np.flatnonzero(keep)[-1]) + 1]
    triangle = _triangle(motion[0], motion[1])
    third = abs(coefficients[3] - triangle[3]) if coefficients.size > 3 else 0.0
    alike = third < _FAR * motion_noise
    if alike and np.std((values[:, 0] - series(triangle, phase))[of_motion]) < _ALIKE * motion_noise:
        motion = triangle
    return Harmonics(motion, float(solution[0, 1]), force_noise, outliers)


def order(rows_per_cycle: float, most: int) -> int:
    """As many harmonics as the rows of one cycle carry."""
    return int(np.clip(rows_per_cycle / 5, 1, most))


def basis(phase: Array, order: int) -> Array:
    """Columns 1, cos, -sin of each harmonic, (n, 2 order + 1)."""
    turn = np.exp(2j * np.pi * phase)
    powers = np.empty((order, phase.size), dtype=complex)
    powers[0] = turn
    for k in range(1, order):
        np.multiply(powers[k - 1], turn, out=powers[k])
    rows = np.empty((2 * order + 1, phase.size))
    rows[0], rows[1 : order + 1] = 1.0, powers.real
    np.negative(powers.imag, out=rows[order + 1 :])
    return rows.T


def solve(columns: Array, values: Array, weight: Array | None = None) -> Array:
    """Least squares by normal equations; harmonics over whole cycles are nearly orthogonal."""
    weighed = columns.T if weight is None or np.all(weight == 1.0) else columns.T * weight
    return np.linalg.solve(weighed @ columns, weighed @ values)


def turned(solution: Array) -> Array:
    """Coefficients of the derivative by phase (in radians) of a harmonic series."""
    order = (solution.size - 1) // 2
    number = np.arange(1, order + 1)
    return np.concatenate(([0.0], number * -solution[order + 1 :], number * solution[1 : order + 1]))


def _sound(columns: Array, values: Array, solution: Array) -> tuple[Array, Array]:
    """Harmonics of a column without its wild rows, and which rows are sound, (n,).

    Rows are weighted down by their distance first, because squares let so many harmonics follow a cluster of wild
    rows; then wild ones are found and left out in turn until both agree.
    """
    everything, stuck = np.ones(values.size, dtype=bool), np.zeros(values.size, dtype=bool)
    stuck[stuck_rows(values)] = True
    if np.array_equal(_near(columns, values, solution, stuck), everything):
        return solution, everything
    for _ in range(_MOST_ROUNDS):
        left = values - columns @ solution
        weight = ~stuck / np.sqrt(1.0 + np.square(left / max(_spread(left[~stuck]), FLOOR * _swing(solution))))
        solution = solve(columns, values, weight)
    sound = everything
    for _ in range(_MOST_ROUNDS):
        found = _near(columns, values, solution, stuck)
        if np.array_equal(found, sound) or np.count_nonzero(found) < 2 * solution.size:
            break
        sound, solution = found, solve(columns, values, found)
    return solution, sound


def _near(columns: Array, values: Array, solution: Array, stuck: Array) -> Array:
    """Rows that are neither stuck nor wild by these harmonics, (n,)."""
    left = values - columns @ solution
    found = ~stuck
    found[outlier_rows(left, values, reach(solution, left, values.size))] = False
    return found


def _outliers_of(loop: Loop, frequency: float, column: Array, solution: Array, left: Array) -> OutlierRows:
    """The wild rows of a whole column, of which `left` is what the harmonics leave of some rows."""
    grid = np.arange(GRID + 1) / GRID
    cycle = basis(grid, solution.size // 2) @ solution
    left_of_all = column - np.interp((loop.time - loop.time[0]) * frequency % 1.0, grid, cycle)
    rows = np.union1d(outlier_rows(left_of_all, column, reach(solution, left, column.size)), stuck_rows(column))
    return OutlierRows(rows, np.abs(left_of_all[rows]) / max(_spread(left), FLOOR * _swing(solution)))


def reach(solution: Array, left: Array, rows: int) -> float:
    """How far off its harmonics a row may lie: by noise, and where so many harmonics round a corner off."""
    return limit(rows, 1, np.inf) * _spread(left) + _CORNER / (solution.size // 2) * _swing(solution)


def _spread(left: Array) -> float:
    return MEDIAN_TO_SIGMA * float(np.median(np.abs(left)))


def _swing(solution: Array) -> float:
    """Amplitude of the first harmonic."""
    return float(np.hypot(solution[1], solution[solution.size // 2 + 1]))


def _scatter(phase: Array, left: Array, freedom: int) -> float:
    """Standard deviation of what is left of the force once each cycle has given up its own slow part."""
    number = np.floor(phase).astype(np.intp)
    order = 2 * _SLOW_HARMONICS + 1
    left = left.copy()
    for cycle in np.unique(number):
        rows = np.flatnonzero(number == cycle)
        if rows.size > 4 * order:
            slow = basis(phase[rows], _SLOW_HARMONICS)
            left[rows] -= slow @ np.linalg.lstsq(slow, left[rows], rcond=None)[0]
            freedom -= order
    return float(np.sqrt(np.sum(np.square(left)) / max(freedom, 1)))


def _triangle(mean: complex, fundamental: complex) -> Array:
    """Harmonics of the triangle of that mean and fundamental: c_k falls as 1/k^2, so its corners need them all."""
    order = np.arange(1, GRID // 2, 2)
    turn = 1j * fundamental / abs(fundamental)
    coefficients = np.zeros(GRID // 2, dtype=complex)
    coefficients[0] = mean
    coefficients[order] = -1j * abs(fundamental) * (-1.0) ** (order // 2) / order**2 * turn**order
    return coefficients


def sample(rows: int, most: int) -> NDArray[np.intp]:
    """Rows that stand for all: every one of few, else spread evenly, but in no step that could keep time with the
    cycles."""
    count = min(rows, most)
    number = np.arange(count)
    return (number if count == rows else (number + number * _GOLDEN % 1.0) * (rows / count)).astype(np.intp)
