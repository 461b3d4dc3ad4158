"""Outliers: rows that stand out from a smooth curve or a model, and from their own neighbours as well.

Physics that a model lacks misses whole stretches of a test and leaves neighbours alike; only a fault of the record
puts one row far from the rows beside it. So a misfit, however large, makes no outliers.
"""

from collections.abc import Callable

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.special import chdtri, fdtri

from bushfit.effects.contract import Array
from bushfit.reduction.arrays import MEDIAN_TO_SIGMA, median

#: Probability that noise alone makes an outlier among all rows of a test; chosen: one test in a hundred.
_CHANCE = 0.01
#: Rows over which the median of neighbours is taken; chosen: wider than a burst, narrower than a bend of the motion.
NEIGHBOURS = 11
#: Rows of the median that is tried where the motion turns within NEIGHBOURS rows; and points of a block that count as
#: neighbours of one where a model was taken off, since stiffness that the model misses bends with frequency.
_FEW_NEIGHBOURS = 5
#: Equal values in a row from which on a channel may be stuck.
_STUCK = 4
#: Rows of a burst of outliers at most; longer runs far off are a misfit.
_LONGEST_BURST = 8
#: Rows from which the noise of a channel is estimated: enough for a median, whatever the length of the record.
_NOISE_ROWS = 100_000
#: Noise of a channel relative to its range from which on equal values in a row are suspicious.
_LEAST_NOISE = 1e-4
#: Distance of a gross outlier from the median of its neighbours, relative to half the range of these medians.
_GROSS = 0.3
#: Share of all rows up to which rows so far off are outliers; more of them are the motion itself.
_MOST_GROSS = 0.1
#: Degrees of freedom of a noise that is as good as known.
_KNOWN = 1e6
#: Difference of two points from which on they are no repeats, relative to |K|: no noise of a rig goes that far.
_UNLIKE = 0.1
#: Least distance relative to the median distance, so that no point takes all the weight.
_LEAST_DISTANCE = 1e-3


def outlier_limit(rows: int, parts: int, freedom: float) -> float:
    """Distance in units of noise that noise alone exceeds in one of a hundred tests.

    A row has so many `parts`: 1 for a force, 2 for a complex stiffness. Infinite freedom is a noise that is known.

    Args:
        rows: number of rows of the test.
        parts: numbers that make up a row.
        freedom: degrees of freedom behind the noise.
    """
    return float(np.sqrt(parts * fdtri(parts, min(freedom, _KNOWN), 1.0 - _CHANCE / max(rows, 1))))


def are_outliers(residual: Array, recorded: Array, limit: float) -> Array:
    """Mask of rows that are far from a curve and from their neighbours, or stuck, (n,).

    A short run of such rows has to lie as far off the rows before and after the run.

    Args:
        residual: distance from the curve, (n,).
        recorded: values of the channel, (n,).
        limit: in the unit of the residual.

    Returns:
        Mask, (n,).
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
    """Mask of rows in which a channel that has noise repeats one value, (n,).

    Returns:
        Mask, (n,).

    Notes:
        The chance that two neighbours are equal, by the resolution of the record, is counted outside such runs. A run
        of r repeats somewhere in n rows then has the probability n chance^r.
    """
    equal = recorded[1:] == recorded[:-1]
    runs = _run_lengths(equal)
    by_chance = max(int(np.count_nonzero(equal & (runs < _STUCK - 1))), 1) / recorded.size
    unlikely = (runs >= _STUCK - 1) & (recorded.size * by_chance ** np.minimum(runs, 99) < _CHANCE)
    if unlikely.any():
        bends = np.diff(recorded[:_NOISE_ROWS], 2)  # of white noise they have six times the variance
        noise = MEDIAN_TO_SIGMA * (float(np.median(np.abs(bends))) / np.sqrt(6.0))
        unlikely &= noise > _LEAST_NOISE * float(np.ptp(recorded))
    return np.append(False, unlikely)


def gross_rows(values: Array) -> Array:
    """Rows of a periodic motion, of unknown period, that are far from the median of their neighbours, (k,).

    None where these are many, even with a median over few rows: then the motion turns within so few rows.

    Returns:
        Row numbers, (k,).
    """
    from scipy.ndimage import median_filter

    for width in (NEIGHBOURS, _FEW_NEIGHBOURS):
        level = median_filter(values, width, mode="nearest")
        outlying = np.abs(values - level) > _GROSS / 2.0 * float(np.ptp(level))
        if np.mean(outlying) < _MOST_GROSS:
            return np.flatnonzero(outlying)
    return np.empty(0, dtype=np.intp)


def _run_lengths(mask: Array) -> Array:
    """Length of the run of true entries that each entry belongs to, 0 for false ones, (n,)."""
    edges = np.flatnonzero(np.concatenate(([True], mask[1:] != mask[:-1], [True])))
    return np.where(mask, np.repeat(np.diff(edges), np.diff(edges)), 0)


def outlying_points(
    deviation: Array, distance_of: Callable[..., Array], starts: Array, points: Array, freedom: float
) -> Array:
    """Points of a sweep that are farther from the model than noise explains, and as far from their neighbours, by
    number, (k,).

    A point that was repeated must stand out from its repeats as well: what all of them do is no fault of one row.
    Where two repeats or more agree against it that is enough, so that neither outliers side by side nor a misfit of
    the model hide it; of those repeats, the one farthest out need not be far off the model.

    Args:
        deviation: of each point from the model, gain and phase, complex (n,).
        distance_of: function for the length of deviations in units of noise; `shared=False` keeps the blocks' errors.
        starts: index of the first point of each block.
        points: frequency and amplitude, (2, n); where both agree, points are repeats.
        freedom: degrees of freedom behind the noise; inf where it is known.

    Returns:
        Point numbers, (k,).
    """
    distance = distance_of(deviation)
    by_noise = outlier_limit(deviation.size, 2, freedom)
    limit = by_noise * misfit_scale(distance, 2)
    far = distance > limit
    local = _from_neighbours(deviation, starts, _FEW_NEIGHBOURS)
    _, place = np.unique(points, axis=1, return_inverse=True)
    repeats, from_repeats = _from_repeats(local, place)
    alone = np.minimum(
        distance_of(local, shared=False), np.where(repeats > 0, distance_of(from_repeats, shared=False), np.inf)
    )
    against = _from_neighbours(_from_repeats(deviation, place)[1], starts, NEIGHBOURS)
    # the median of n repeats has pi/(2 n) of the variance of one
    agreed = distance_of(against, shared=False) / np.sqrt(1.0 + np.pi / 2.0 / np.maximum(repeats, 1))
    farthest = np.zeros(place.max() + 1)
    np.maximum.at(farthest, place, agreed)
    apart_from_repeats = agreed > by_noise * misfit_scale(agreed[repeats > 1], 2)
    return np.flatnonzero(
        np.where(repeats > 1, apart_from_repeats & (far | (agreed == farthest[place])), far & (alone > limit))
    )


def contradictions(stiffness: Array, place: Array) -> list[tuple[float, int, int]]:
    """For each operating point, the two repeats that differ most, if they differ by _UNLIKE or more; the worst first.

    Args:
        stiffness: of the points, complex (n,).
        place: number of the operating point of each point, (n,).

    Returns:
        For each contradiction the distance relative to |K| and two point numbers.
    """
    value, ends, worst = np.log(stiffness), np.cumsum(np.bincount(place)), dict[int, tuple[float, int, int]]()
    for part in (value.real, value.imag):
        order = np.lexsort((part, place))
        first, last = order[np.append(0, ends[:-1])], order[ends - 1]
        separation = np.abs(stiffness[last] - stiffness[first]) / np.minimum(*np.abs(stiffness[[first, last]]))
        for location in np.flatnonzero(separation >= _UNLIKE).tolist():
            one, second = sorted((int(first[location]), int(last[location])))
            worst[location] = max(worst.get(location, (0.0, 0, 0)), (float(separation[location]), one, second))
    return sorted(worst.values(), reverse=True)


def misfit_scale(distance: Array, parts: int) -> float:
    """Median distance from the model over that of noise alone; at least 1."""
    if not distance.size:
        return 1.0
    return max(1.0, float(np.median(distance) / np.sqrt(chdtri(parts, 0.5))))


def _from_neighbours(values: Array, starts: Array, window: int) -> Array:
    """Distance of each point from the median of those around it in its block, complex (n,)."""
    sizes, local = np.diff(starts, append=values.size), np.zeros_like(values)
    for width in np.unique(np.minimum(sizes, window)).tolist():  # mostly one: blocks are longer
        chosen = np.minimum(sizes, window) == width
        first, last = (np.repeat(ends[chosen], sizes[chosen]) for ends in (starts, starts + sizes - width))
        rows = np.flatnonzero(np.repeat(chosen, sizes))
        around = values[np.clip(rows - width // 2, first, last)[:, None] + np.arange(width)]
        local[rows] = values[rows] - median(around.real, axis=1) - 1j * median(around.imag, axis=1)
    return local


def _from_repeats(values: Array, place: Array) -> tuple[Array, Array]:
    """Number of other repeats of each point, (n,), and its distance from their median, complex (n,); 0 without repeats.

    Points of one `place`, (n,), are repeats.
    """
    counts = np.bincount(place)
    repeats, distances = counts[place] - 1, []
    for part in (values.real, values.imag):
        order = np.lexsort((part, place))
        size, start = counts[place[order]], (np.cumsum(counts) - counts)[place[order]]
        rank = np.arange(order.size) - start
        # the two in the middle of the others, which step over the point itself
        low, high = (np.minimum(half + (half >= rank), size - 1) for half in ((size - 2) // 2, (size - 1) // 2))
        medians = np.empty_like(part)
        medians[order] = (part[order][start + np.maximum(low, 0)] + part[order][start + high]) / 2.0
        distances.append(part - medians)
    return repeats, np.where(repeats > 0, distances[0] + 1j * distances[1], 0.0)


def least_absolute(basis: Array, values: Array, smallest: float) -> Array:
    """Fit a curve with the least sum of absolute distances, (n, k), (n, m) -> (k, m).

    It hardly follows outliers. Distances of less than the relative one of the median and `smallest` count alike.

    Args:
        basis: functions at the points, (n, k).
        values: points, (n, m).
        smallest: distance below which points count alike.
    """
    root_weight = np.ones((len(values), 1))
    for _ in range(25):  # chosen: nine of ten curves have then come within a third of the noise of where they end
        solution = np.linalg.lstsq(basis * root_weight, values * root_weight, rcond=None)[0]
        distance = np.linalg.norm(values - basis @ solution, axis=1, keepdims=True)
        root_weight = np.sqrt(1.0 / np.maximum(distance, _LEAST_DISTANCE * np.median(distance) + smallest))
    return np.asarray(solution)
