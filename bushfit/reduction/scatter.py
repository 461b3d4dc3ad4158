"""Median and standard deviation of values, neither of which a few outliers move by much."""

import numpy as np

from bushfit.reading.measurement import Floats

#: Standard deviation of normal scatter over the median of its absolute values, 1/Phi^-1(3/4).
MEDIAN_TO_SIGMA = 1.482602218505602


def scatter(values: Floats) -> tuple[float, float]:
    """Median of values, (n,), and their standard deviation by the median absolute deviation."""
    middle = float(np.median(values))
    return middle, MEDIAN_TO_SIGMA * float(np.median(np.abs(values - middle)))


def median(values: Floats, axis: int = 0) -> Floats:
    """Median along an axis of values none of which is NaN: that of NumPy takes ten times as long over few."""
    ordered = np.sort(values, axis=axis)
    middle = ordered.shape[axis] // 2
    low = middle - 1 + ordered.shape[axis] % 2
    return np.asarray((ordered.take(low, axis) + ordered.take(middle, axis)) / 2.0)
