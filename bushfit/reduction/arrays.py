"""Robust statistics of long arrays."""

from math import comb

import numpy as np

from bushfit.reading.measurement import Floats

#: Standard deviation of normal scatter over the median of its absolute values, 1/Phi^-1(3/4).
MEDIAN_TO_SIGMA = 1.482602218505602
#: Entries of a chunk: 2 MiB of float64, which a core's cache holds.
CHUNK = 1 << 18


def median_and_scatter(values: Floats) -> tuple[float, float]:
    """Median and robust standard deviation (from the median absolute deviation) of values, (n,)."""
    middle = float(np.median(values))
    return middle, MEDIAN_TO_SIGMA * float(np.median(np.abs(values - middle)))


def difference_noise(values: Floats, order: int) -> Floats:
    """Standard deviation of white noise on a smooth series, from the median size of its differences.

    Args:
        values: series, (..., n).
        order: order of the differences; the higher, the less a slow motion contributes.

    Returns:
        Standard deviation of each series, (...).
    """
    size = np.median(np.abs(np.diff(values, order, axis=-1)), axis=-1)
    return np.asarray(size * (MEDIAN_TO_SIGMA / comb(2 * order, order) ** 0.5))  # the sum of the squared weights


def median(values: Floats, axis: int = 0) -> Floats:
    """Median of values without NaN along an axis; ten times as fast as `numpy.median` for a short axis."""
    ordered = np.sort(values, axis=axis)
    middle = ordered.shape[axis] // 2
    low = middle - 1 + ordered.shape[axis] % 2
    return np.asarray((ordered.take(low, axis) + ordered.take(middle, axis)) / 2.0)
