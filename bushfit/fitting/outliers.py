"""Outliers: rows that are far from a smooth curve or a model, and from their neighbours as well.

An effect that a model lacks makes whole stretches of a test differ from the model by similar amounts; only a fault of
the record makes one row differ from the rows next to it. A row far from the model but near its neighbours is therefore
not an outlier.
"""

from collections.abc import Callable

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.special import chdtri, fdtri

from bushfit.effects.contract import Array
from bushfit.reduction.arrays import difference_noise, median

#: Probability that noise alone makes an outlier among all rows of a test; chosen: one test in a hundred.
_CHANCE = 0.01
#: Rows over which the median of neighbours is taken; chosen: wider than a burst, narrower than a bend of the motion.
NEIGHBOURS = 11
#: Rows of the median for motions that turn within NEIGHBOURS rows, and of the median of a sweep's deviations from a
#: model, which may curve over frequency.
_FEW_NEIGHBOURS = 5
#: Equal values in a row from which on a channel may be stuck.
_STUCK = 4
#: Largest number of rows of a burst of outliers; a longer run of distant rows is a misfit.
_LONGEST_BURST = 8
#: Rows from which the noise of a channel is estimated: enough for a median, whatever the length of the record.
_NOISE_ROWS = 100_000
#: Noise of a channel relative to its range from which on equal values in a row are suspicious.
_LEAST_NOISE = 1e-4
#: Distance of a gross outlier from the median of its neighbours, relative to half the range of these medians.
_GROSS = 0.3
#: Largest share of all rows that gross outliers may have; more distant rows belong to the motion itself.
_MOST_GROSS = 0.1
#: Degrees of freedom above which the noise is treated as known.
_KNOWN = 1e6
#: Difference of two repeats, relative to |K|, from which on they contradict each other: more than the noise of any rig.
_UNLIKE = 0.1
#: Smallest distance relative to the median distance, so that no point takes all the weight.
_LEAST_DISTANCE = 1e-3


def outlier_limit(rows: int, parts: int, freedom: float) -> float:
    """Distance, in units of noise, that the farthest row exceeds by noise alone in one of a hundred tests.

    Args:
        rows: number of rows of the test.
        parts: number of components of a row: 1 for a force, 2 for a complex stiffness.
        freedom: degrees of freedom behind the noise; infinite if the noise is known.
    """
    return float(np.sqrt(parts * fdtri(parts, min(freedom, _KNOWN), 1.0 - _CHANCE / max(rows, 1))))


def are_outliers(residual: Array, recorded: Array, limit: float) -> Array:
    """Mask of the rows that are far from a curve, and are also far from their neighbours or repeat one value.

    Args:
        residual: distance of each row from the curve, (n,).
        recorded: recorded displacement or force of each row, (n,).
        limit: distance beyond which a row is far, in the unit of the residual.

    Returns:
        Mask of the outliers, (n,).
    """
    far = np.abs(residual) > limit
    if not far.any():
        return far
    rows, near = np.flatnonzero(far), np.flatnonzero(~far)
    repeats = _run_lengths(recorded[1:] == recorded[:-1])
    found = np.maximum(np.append(repeats, 0), np.append(0, repeats)) >= _STUCK - 1
    if near.size:
        after = np.searchsorted(near, np.arange(far.size))
        neighbours = residual[near[np.clip((after - 1, after), 0, near.size - 1)]]
        found |= (_run_lengths(far) <= _LONGEST_BURST) & (np.abs(residual - neighbours).min(axis=0) > limit)
    width = min(NEIGHBOURS, residual.size)
    windows = sliding_window_view(residual, width)[np.clip(rows - width // 2, 0, residual.size - width)]
    found[rows] |= np.abs(residual[rows] - median(windows, axis=1)) > limit
    return far & found


def are_stuck(recorded: Array) -> Array:
    """Mask of the rows that repeat the row before, in a run so long that chance gives it in under 1 % of records.

    Args:
        recorded: displacement or force of each row, (n,).

    Returns:
        Mask of the stuck rows, (n,).

    Notes:
        The probability p that neighbouring values are equal, due to the resolution of the record, is estimated outside
        long runs. A run of r repeats somewhere in n rows then has the probability n p^r.
    """
    equal = recorded[1:] == recorded[:-1]
    runs = _run_lengths(equal)
    by_chance = max(int(np.count_nonzero(equal & (runs < _STUCK - 1))), 1) / recorded.size
    unlikely = (runs >= _STUCK - 1) & (recorded.size * by_chance ** np.minimum(runs, 99) < _CHANCE)
    if unlikely.any():
        noise = float(difference_noise(recorded[:_NOISE_ROWS], 2))
        unlikely &= noise > _LEAST_NOISE * float(np.ptp(recorded))
    return np.append(False, unlikely)


def gross_outliers(values: Array) -> Array:
    """Find rows of a motion farther than 15 % of its range from the median of the 11, else 5, rows around them.

    If 10 % of the rows or more are so far, the motion turns within that width, and no row is returned.

    Returns:
        Row indices, (k,).
    """
    from scipy.ndimage import median_filter

    for width in (NEIGHBOURS, _FEW_NEIGHBOURS):
        level = median_filter(values, width, mode="nearest")
        outlying = np.abs(values - level) > _GROSS / 2.0 * float(np.ptp(level))
        if np.mean(outlying) < _MOST_GROSS:
            return np.flatnonzero(outlying)
    return np.empty(0, dtype=np.intp)


def _run_lengths(mask: Array) -> Array:
    """Length of the run of consecutive true entries around each entry, (n,); 0 for false entries."""
    edges = np.flatnonzero(np.concatenate(([True], mask[1:] != mask[:-1], [True])))
    return np.where(mask, np.repeat(np.diff(edges), np.diff(edges)), 0)


def outlying_points(
    deviation: Array, normalised: Callable[..., Array], starts: Array, points: Array, freedom: float
) -> Array:
    """Find points of a sweep that are farther from the model and from their neighbours than noise explains.

    The limit is the distance that noise alone exceeds in 1 % of tests, times `misfit_scale`. A repeated point must also
    differ from its repeats. If two or more repeats agree and the point differs from them, its neighbours are not
    compared, so that neither adjacent outliers nor a misfit of the model can hide the outlier. If several repeats of
    one operating point qualify, the one farthest from the others is an outlier even if it is near the model.

    Args:
        deviation: deviation of each point from the model, relative gain + i phase [rad], complex (n,).
        normalised: function from deviations to gain and phase in units of noise, (2, n); with `shared=False` the errors
            shared by a run are not subtracted.
        starts: index of the first point of each run.
        points: frequency and amplitude of each point, (2, n); points with equal values are repeats.
        freedom: degrees of freedom behind the noise; inf if the noise is known.

    Returns:
        Indices of the outliers, (k,).
    """
    distance = np.hypot(*normalised(deviation))
    by_noise = outlier_limit(deviation.size, 2, freedom)
    limit = by_noise * misfit_scale(distance, 2)
    far = distance > limit
    local = _difference_from_neighbours(deviation, starts, _FEW_NEIGHBOURS)
    _, point_index = np.unique(points, axis=1, return_inverse=True)
    repeats, from_repeats = _difference_from_repeats(local, point_index)
    against = _difference_from_neighbours(_difference_from_repeats(deviation, point_index)[1], starts, NEIGHBOURS)
    alone, repeated, agreed = (np.hypot(*normalised(part, shared=False)) for part in (local, from_repeats, against))
    alone = np.minimum(alone, np.where(repeats > 0, repeated, np.inf))
    agreed /= np.sqrt(1.0 + np.pi / 2.0 / np.maximum(repeats, 1))  # the median of n repeats: pi/(2 n) of the variance
    farthest = np.zeros(point_index.max() + 1)
    np.maximum.at(farthest, point_index, agreed)
    apart_from_repeats = agreed > by_noise * misfit_scale(agreed[repeats > 1], 2)
    return np.flatnonzero(
        np.where(repeats > 1, apart_from_repeats & (far | (agreed == farthest[point_index])), far & (alone > limit))
    )


def contradictions(stiffness: Array, point_index: Array) -> list[tuple[float, int, int]]:
    """Find operating points whose repeats contradict each other: complex stiffnesses that differ by 10 % or more.

    Args:
        stiffness: stiffness of the points, complex (n,).
        point_index: index of the operating point of each point, (n,).

    Returns:
        For each such operating point, the largest first: magnitude of the complex difference relative to |K|, and
        indices of the two points that differ most.
    """
    value, ends, worst = np.log(stiffness), np.cumsum(np.bincount(point_index)), dict[int, tuple[float, int, int]]()
    for part in (value.real, value.imag):
        order = np.lexsort((part, point_index))
        first, last = order[np.append(0, ends[:-1])], order[ends - 1]
        separation = np.abs(stiffness[last] - stiffness[first]) / np.minimum(*np.abs(stiffness[[first, last]]))
        for location in np.flatnonzero(separation >= _UNLIKE).tolist():
            one, second = sorted((int(first[location]), int(last[location])))
            worst[location] = max(worst.get(location, (0.0, 0, 0)), (float(separation[location]), one, second))
    return sorted(worst.values(), reverse=True)


def misfit_scale(distance: Array, parts: int) -> float:
    """Ratio of the median distance of points from the model to the median that noise alone causes; at least 1.

    Args:
        distance: distance of each point in units of noise, (n,).
        parts: number of components of a point: 1 for a force, 2 for a complex stiffness.
    """
    return max(1.0, float(np.median(distance) / np.sqrt(chdtri(parts, 0.5)))) if distance.size else 1.0


def _difference_from_neighbours(values: Array, starts: Array, window: int) -> Array:
    """Difference of each deviation from the median of its neighbours in the same run, itself included, complex (n,).

    Args:
        values: deviations from a model, gain + i phase [rad], complex (n,).
        starts: index of the first point of each run.
        window: number of values in each median.
    """
    sizes, local = np.diff(starts, append=values.size), np.zeros_like(values)
    for width in np.unique(np.minimum(sizes, window)).tolist():  # mostly one: blocks are longer
        chosen = np.minimum(sizes, window) == width
        first, last = (np.repeat(ends[chosen], sizes[chosen]) for ends in (starts, starts + sizes - width))
        rows = np.flatnonzero(np.repeat(chosen, sizes))
        around = values[np.clip(rows - width // 2, first, last)[:, None] + np.arange(width)]
        local[rows] = values[rows] - median(around.real, axis=1) - 1j * median(around.imag, axis=1)
    return local


def _difference_from_repeats(values: Array, point_index: Array) -> tuple[Array, Array]:
    """Number of other repeats of each point, (n,), and its difference from their median (0 without any), complex (n,).

    Args:
        values: deviations from a model, gain + i phase [rad], complex (n,).
        point_index: index of the operating point of each point, (n,); points with equal indices are repeats.
    """
    counts = np.bincount(point_index)
    repeats, distances = counts[point_index] - 1, []
    for part in (values.real, values.imag):
        order = np.lexsort((part, point_index))
        size, start = counts[point_index[order]], (np.cumsum(counts) - counts)[point_index[order]]
        rank = np.arange(order.size) - start
        # indices of the two middle values of the other repeats, without the point itself
        low, high = (np.minimum(half + (half >= rank), size - 1) for half in ((size - 2) // 2, (size - 1) // 2))
        medians = np.empty_like(part)
        medians[order] = (part[order][start + np.maximum(low, 0)] + part[order][start + high]) / 2.0
        distances.append(part - medians)
    return repeats, np.where(repeats > 0, distances[0] + 1j * distances[1], 0.0)


def least_absolute(basis: Array, values: Array, smallest: float) -> Array:
    """Fit a curve with the least sum of absolute distances, robust against outliers.

    Args:
        basis: values of k independent functions at the points, (n, k).
        values: values to fit, m per point, (n, m).
        smallest: distance, in the unit of `values`, below which points do not gain weight.

    Returns:
        Coefficients of the functions, (k, m).

    Notes:
        Least squares, reweighted by the reciprocal distances, by the normal equations.
    """
    weight = np.ones((len(values), 1))
    for _ in range(25):  # chosen: nine of ten curves are then within a third of the noise of their limit
        weighted = (basis * weight).T
        solution = np.linalg.solve(weighted @ basis, weighted @ values)
        distance = np.sqrt(np.square(values - basis @ solution).sum(axis=1, keepdims=True))
        weight = 1.0 / np.maximum(distance, _LEAST_DISTANCE * median(distance) + smallest)
    return np.asarray(solution)
