"""Dead zone in time and as a describing function, for contact beyond a gap and motion within a play."""

import math

import numpy as np

from bushfit.effects.contract import Array, Value

#: (t - sin t)/t^3 as a power series in t^2, 1/3! - t^2/5! + ...: enough terms for all digits up to t = 2 pi/3.
_SERIES = np.array([(-1.0) ** k / math.factorial(2 * k + 3) for k in range(12)])


def dead_zone(value: Array, half_width: Value) -> Array:
    """Excess of values beyond the interval from -half_width to half_width; 0 inside, the unit of the values.

    >>> dead_zone(np.array([-2.0, 0.5, 3.0]), 1.0)
    array([-1.,  0.,  2.])
    """
    return value - np.clip(value, -np.asarray(half_width), half_width)


def first_harmonic(amplitude: Array, half_width: Value) -> Array:
    """Describing function N of a dead zone: first harmonic of the output over the amplitude of a sine.

    Args:
        amplitude: amplitude of the input, a sine, any unit and shape.
        half_width: half width of the dead zone, in the same unit.

    Returns:
        N [1] between 0 and 1, in the broadcast shape of the two.

    Notes:
        A. Gelb, W. E. Vander Velde, Multiple-Input Describing Functions, 1968, app. B.
        With r = half_width/amplitude, N = 1 - 2/pi (asin r + r sqrt(1 - r^2)) for r < 1, and 0 beyond. With
        cos(t/2) = r the same is (t - sin t)/pi, whose series keeps its digits where N vanishes like (1 - r)^(3/2).

    >>> first_harmonic(1.0, np.array([0.0, 0.5, 1.0])).round(3)
    array([1.   , 0.391, 0.   ])
    """
    reach = np.maximum(np.asarray(amplitude) - half_width, 0.0)
    safe = np.where(reach > 0.0, amplitude, 1.0)
    ratio = np.clip(half_width / safe, 0.0, 1.0)
    wide = 1.0 - 2.0 / np.pi * (np.arcsin(ratio) + ratio * np.sqrt(1.0 - ratio**2))
    angle = 4.0 * np.arcsin(np.sqrt(np.minimum(reach / safe, 0.5) / 2.0))
    narrow = angle**3 * np.polynomial.polynomial.polyval(angle**2, _SERIES) / np.pi
    met = (reach > 0.0) | (np.asarray(half_width) == 0.0)
    return np.where(ratio < 0.5, wide, narrow) * met
