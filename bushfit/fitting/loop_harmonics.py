"""Harmonics of a loop: the displacement without noise, the noise of the force, and outliers of both.

Harmonics are fitted by least squares at the recorded rows, without outliers.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bushfit.effects.contract import Array
from bushfit.effects.history import History
from bushfit.fitting.outliers import NEIGHBOURS, are_outliers, are_stuck, outlier_limit
from bushfit.fitting.repeats import FLOOR
from bushfit.reading.measurement import Loop
from bushfit.reduction.arrays import MEDIAN_TO_SIGMA
from bushfit.reduction.harmonics import as_complex, basis, least_squares, resolved_order, series, spread_rows

#: Largest range of a mean cycle, relative to that of its record; chosen: the ends of a Fourier series overshoot less.
_LARGEST_OVERSHOOT = 1.3
#: Number of samples per cycle at which a Fourier series and the model are evaluated; chosen: linear interpolation
#: between two samples then has an error of 5e-6 of the amplitude.
GRID = 1024
#: Largest number of rows to which harmonics are fitted; rows of longer loops are averaged in this number of phase bins.
MOST_ROWS = 4 * GRID
#: Rows of a loop up to which every row is compared with the harmonics; rows of a longer loop are compared only if the
#: fitted rows have outliers, to save time.
_MOST_ROWS_CHECKED = 200_000
#: Largest number of fitted harmonics; chosen: those of a triangle have then fallen to 3e-4 of the first.
_MOST_HARMONICS = 60
#: Number of harmonics that represent smooth misfit of a loop: beyond the fifth, physics contributes next to nothing.
SMOOTH_HARMONICS = 5
#: Number of harmonics of one cycle that represent slow change from cycle to cycle: settling or drift, not noise.
_SLOW_HARMONICS = 3
#: Largest residual of a triangle, relative to that of free harmonics, at which a motion is represented by a triangle.
_TRIANGLE_RATIO = 1.02
#: Largest misfit at a corner of the motion, in units of the amplitude divided by the number of harmonics.
_CORNER = 0.5
#: Accuracy of solutions of equations over a loop's motion, relative to the motion: 1e-4 of the noise of the best rigs.
#: Derivatives are more accurate.
_ACCURACY = 1e-8


class OutlierRows(NamedTuple):
    """Outliers of displacement or force: row indices, and distances from the harmonics in units of noise, (k,) each."""

    rows: Array
    distances: Array


_NO_OUTLIERS = OutlierRows(np.empty(0, dtype=np.intp), np.empty(0))


class LoopHarmonics(NamedTuple):
    """Harmonics, noise and outliers of a loop.

    Args:
        motion: complex harmonics of the displacement that exceed its noise, mean first [m or rad].
        motion_scatter: standard deviation of the rows' displacement from its harmonics [m or rad].
        force: complex harmonics of the force, mean first [N or N m].
        force_noise: standard deviation of one row's force [N or N m].
        outliers: outliers of the columns "displacement" and "force", by name.
    """

    motion: Array
    motion_scatter: float
    force: Array
    force_noise: float
    outliers: Mapping[str, OutlierRows]


def driving_motion(coefficients: Array, frequency: float, cycles: float, *, from_rest: bool) -> History:
    """Displacement without noise that drives the model of a loop, with 1024 samples per cycle.

    Args:
        coefficients: complex harmonics of the displacement, mean first [m or rad].
        frequency: frequency [Hz].
        cycles: number of cycles; whole unless the motion starts from rest.
        from_rest: True for a motion that starts from rest at zero, False for a settled one.

    Returns:
        The motion over time [m or rad].
    """
    motion = np.fft.irfft(0.5 * GRID * np.append(0.0, coefficients[1:]), GRID)
    if from_rest:
        motion = np.resize(motion - motion[0], int(np.ceil(cycles * GRID)) + 2)
        history = History(motion, 1.0 / (frequency * GRID), periodic=False, frequency=frequency)
    else:
        history = History.steady(np.tile(motion, int(cycles)), frequency, cycles=int(cycles))
    return replace(history, accuracy=_ACCURACY)


def loop_harmonics(loop: Loop, frequency: float, cycles: float, *, from_rest: bool = False) -> LoopHarmonics:
    """Determine harmonics of displacement and force, the noise of the force, and outliers of both.

    Noise is the part of the force that does not repeat from cycle to cycle, or is too fast for rubber. Slow changes
    from one cycle to the next are settling or drift, and are not part of the noise.

    Args:
        loop: steady cycles of a loop.
        frequency: frequency of the motion [Hz].
        cycles: number of cycles, including fractions.
        from_rest: True if the record begins at rest. The force of its first cycle is not that of the later ones; it
            then counts towards harmonics and noise only if no whole cycle follows, and is compared with its neighbours
            to find outliers.

    Returns:
        Harmonics, noise and outliers.
    """
    from scipy.ndimage import median_filter

    chosen = spread_rows(loop.time.size, MOST_ROWS)
    phase = (loop.time[chosen] - loop.time[0]) * frequency
    order = resolved_order(loop.time.size / max(cycles, 1.0), _MOST_HARMONICS)
    columns = basis(phase, order)
    grid = np.arange(GRID + 1) / GRID
    cycle = basis(grid, order)
    recorded = {"displacement": loop.displacement, "force": loop.force}
    values = np.column_stack([column[chosen] for column in recorded.values()])
    transient = (1.0 if cycles >= 2.0 else np.inf) if from_rest else 0.0
    settled = int(np.searchsorted(phase, transient)) if phase[-1] >= transient else 0
    solution, inliers, outliers = np.empty((columns.shape[1], 2)), np.zeros(values.shape, dtype=bool), {}
    both = least_squares(columns, values)
    for i, (name, column) in enumerate(recorded.items()):
        used = slice(settled if name == "force" else 0, None)
        start = both[:, i] if used.start == 0 else least_squares(columns[used], values[used, i])
        solution[:, i], inliers[used, i] = _fit_without_outliers(columns[used], values[used, i], start)
        outliers[name] = _NO_OUTLIERS
        if column.size <= _MOST_ROWS_CHECKED or not inliers[used, i].all():
            residual = (values[:, i] - columns @ solution[:, i])[used]
            turn = (loop.time - loop.time[0]) * frequency
            distance = column - np.interp(turn % 1.0, grid, cycle @ solution[:, i])
            if from_rest and name == "force":
                first = turn < transient
                distance[first] -= median_filter(distance[first], NEIGHBOURS, mode="nearest")
            limit = outlier_distance(solution[:, i], residual, column.size)
            rows = np.flatnonzero(are_outliers(distance, column, limit) | are_stuck(column))
            outliers[name] = OutlierRows(rows, np.abs(distance[rows]) / _noise(solution[:, i], residual))
    remainder = values - columns @ solution
    of_motion, of_force = inliers.T
    freedom = np.maximum(np.count_nonzero(inliers, axis=0) - 2 * order - 1, 1)
    motion_noise = float(np.sqrt(np.sum(np.square(remainder[of_motion, 0])) / freedom[0]))
    motion = _remove_noise(as_complex(solution[:, 0]), motion_noise, phase, values[:, 0], of_motion)
    scatter, unknowns = remove_slow_changes(phase[of_force], remainder[of_force, 1])
    force_noise = float(np.sqrt(np.sum(np.square(scatter)) / max(freedom[1] - unknowns, 1)))
    return LoopHarmonics(motion, motion_noise, as_complex(solution[:, 1]), force_noise, outliers)


def _remove_noise(coefficients: Array, noise: float, phase: Array, displacement: Array, inliers: Array) -> Array:
    """Remove noise from the harmonics of a displacement: keep those above the noise, or those of an ideal triangle.

    Args:
        coefficients: complex harmonics of the displacement, mean first [m or rad].
        noise: standard deviation of one row's displacement [m or rad].
        phase: position of each row [cycles], (n,).
        displacement: measured displacement of each row [m or rad], (n,).
        inliers: mask of the rows that are no outliers, (n,).

    Returns:
        Complex harmonics without noise, mean first [m or rad]: up to the last that is kept, or 512 of a triangle.
    """
    order, fundamental = np.arange(1, GRID // 2, 2), coefficients[1]
    turn, triangle = 1j * fundamental / abs(fundamental), np.zeros(GRID // 2, dtype=complex)
    triangle[0] = coefficients[0]
    triangle[order] = -1j * abs(fundamental) * (-1.0) ** (order // 2) / order**2 * turn**order
    different = coefficients.size > 3 and abs(coefficients[3] - triangle[3]) >= 3.0 * noise
    if not different and np.std((displacement - series(triangle, phase))[inliers]) < _TRIANGLE_RATIO * noise:
        return triangle
    threshold = 4.0 * noise * np.sqrt(2.0 / phase.size)  # standard errors
    keep = (np.abs(coefficients) > threshold) | (np.arange(coefficients.size) < 2)
    return np.where(keep, coefficients, 0.0)[: int(np.flatnonzero(keep)[-1]) + 1]


def remove_slow_changes(phase: Array, residual: Array) -> tuple[Array, int]:
    """Remove settling and drift from force residuals: the mean and three harmonics of each cycle, fitted to its rows.

    Args:
        phase: position of each row [cycles], (n,).
        residual: force without its harmonics [N or N m], (n,).

    Returns:
        Remaining residuals, (n,), and number of fitted unknowns.
    """
    number = np.floor(phase).astype(np.intp)
    size, unknowns = 2 * _SLOW_HARMONICS + 1, 0
    remainder = residual.copy()
    for cycle in np.unique(number):
        rows = np.flatnonzero(number == cycle)
        if rows.size > 4 * size:  # fewer leave a cycle as it is
            slow = basis(phase[rows], _SLOW_HARMONICS)
            remainder[rows] -= slow @ np.linalg.lstsq(slow, remainder[rows], rcond=None)[0]
            unknowns += size
    return remainder, unknowns


def outlier_distance(solution: Array, residual: Array, rows: int) -> float:
    """Distance of a displacement or force from its fitted harmonics beyond which a row is an outlier, in its unit.

    The limit allows for the noise and for corners of a triangle, which the harmonics round off.

    Args:
        solution: mean, cosines and sines of the displacement or force, (2 order + 1,).
        residual: residuals of the fitted rows, (n,).
        rows: number of rows of the record.
    """
    corner = _CORNER / (solution.size // 2) * abs(as_complex(solution)[1])
    return outlier_limit(rows, 1, np.inf) * (MEDIAN_TO_SIGMA * float(np.median(np.abs(residual)))) + corner


def _fit_without_outliers(columns: Array, values: Array, solution: Array) -> tuple[Array, Array]:
    """Fit harmonics to a displacement or force without its outliers.

    Least squares may follow a cluster of outliers. Rows are therefore first weighted down by their distance; then
    outliers are found and left out repeatedly until the set of outliers no longer changes.

    Args:
        columns: basis of mean, cosines and sines at the rows, (n, 2 order + 1).
        values: displacement or force of the rows, (n,).
        solution: harmonics by least squares over all rows, (2 order + 1,).

    Returns:
        Harmonics, (2 order + 1,), and the mask of the rows that are no outliers, (n,).
    """
    inliers, stuck = np.ones(values.size, dtype=bool), are_stuck(values)
    if _inliers(columns, values, solution, stuck).all():
        return solution, inliers
    for _ in range(10):  # of weighting down; chosen
        residual = values - columns @ solution
        weight = ~stuck / np.sqrt(1.0 + np.square(residual / _noise(solution, residual[~stuck])))
        solution = least_squares(columns, values, weight)
    for _ in range(10):  # of leaving out; chosen: nearly all records settle in two
        found = _inliers(columns, values, solution, stuck)
        if np.array_equal(found, inliers) or np.count_nonzero(found) < 2 * solution.size:
            break
        inliers, solution = found, least_squares(columns, values, found)
    if np.ptp(columns @ solution) > _LARGEST_OVERSHOOT * np.ptp(values):  # rows at rest, which are not stuck
        return least_squares(columns, values), np.ones(values.size, dtype=bool)
    return solution, inliers


def _inliers(columns: Array, values: Array, solution: Array, stuck: Array) -> Array:
    """Mask of the rows whose displacement or force is neither stuck nor far from its harmonics, (n,).

    Args:
        columns: basis of mean, cosines and sines at the rows, (n, 2 order + 1).
        values: displacement or force of the rows, (n,).
        solution: fitted mean, cosines and sines, (2 order + 1,).
        stuck: mask of the rows that repeat the value of the row before, (n,).
    """
    residual = values - columns @ solution
    return ~(stuck | are_outliers(residual, values, outlier_distance(solution, residual, values.size)))


def _noise(solution: Array, residual: Array) -> float:
    """Robust standard deviation of residuals, (n,) [m, rad, N or N m], at least 1e-4 of the first harmonic's amplitude.

    Args:
        solution: fitted mean, cosines and sines, (2 order + 1,), whose first harmonic sets the smallest noise.
        residual: displacement or force of the rows without the fitted harmonics, (n,).
    """
    return max(MEDIAN_TO_SIGMA * float(np.median(np.abs(residual))), FLOOR * abs(as_complex(solution)[1]))


def phase_bins(
    time: Array, force: Array, frequency: float, cycles: float, *, each_cycle: bool
) -> tuple[Array, Array, Array]:
    """Average the rows of a long loop in bins of phase, each 1/1024 of a cycle wide.

    Each of the first few cycles has separate bins; later cycles share bins in ever larger groups.

    Args:
        time: time of each row since the first [s], ascending, (n,).
        force: force of each row [N or N m], (n,).
        frequency: frequency of the motion [Hz].
        cycles: number of cycles.
        each_cycle: True for separate bins in every cycle.

    Returns:
        Mean phase [cycles], mean force and number of rows of each bin, (k,) each.
    """
    number = np.arange(int(cycles) + 2)
    separate, growth = 4, 1.5  # a loop settles in its first cycles, and then ever more slowly
    later = separate * growth ** np.arange(np.log(number.size / separate) / np.log(growth))
    starts = number if each_cycle else np.union1d(np.arange(separate), later.astype(np.intp))
    group = np.searchsorted(starts, number, side="right") - 1
    middle = np.round(np.bincount(group, weights=number) / np.bincount(group))
    first = np.searchsorted(time, np.arange(int(cycles * GRID) + 1) / (frequency * GRID))
    bins = np.flatnonzero(np.diff(first, append=time.size))
    first = first[bins]
    count = np.diff(first, append=time.size)
    in_bins = np.add.reduceat(time, first) * (frequency * GRID) - count * bins
    filled, place = np.unique(GRID * group[bins // GRID] + bins % GRID, return_inverse=True)
    parts = count, in_bins, np.add.reduceat(force, first)
    rows, inside, total = (np.bincount(place, weights=part) for part in parts)
    return middle[filled // GRID] + (filled % GRID + inside / rows) / GRID, total / rows, rows
