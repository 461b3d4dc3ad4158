"""Median and standard deviation of values, neither of which a few outliers move by much."""

import numpy as np

from bushfit.reading.measurement import Floats

#: Standard deviation of normal scatter over the median of its absolute values, 1/Phi^-1(3/4).
MEDIAN_TO_SIGMA = 1.482602218505602


def scatter(values: Floats) -> tuple[float, float]:
    """Median of values, (n,), and their standard deviation by the median absolute deviation."""
    middle = float(np.median(values))
    return middle, MEDIAN_TO_SIGMA * float(np.median(np.abs(values - middle)))
