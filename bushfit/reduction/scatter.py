"""Scatter that a few wild values hardly move: the median, and the median absolute deviation."""

from __future__ import annotations

import numpy as np

from bushfit.reading.measurement import Floats

#: Standard deviation of normal scatter over the median of its absolute values, 1/Phi^-1(3/4).
MEDIAN_TO_SIGMA = 1.482602218505602


def scatter(values: Floats) -> tuple[float, float]:
    """Median, and standard deviation by the median absolute deviation: outliers hardly move either."""
    middle = float(np.median(values))
    return middle, MEDIAN_TO_SIGMA * float(np.median(np.abs(values - middle)))
