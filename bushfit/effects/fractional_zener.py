"""Fractional Zener: a spring in series with the springpot, which levels off at high frequency."""

import numpy as np
from scipy.fft import next_fast_len

from bushfit.effects.contract import Array, History, Values, linear_stress
from bushfit.effects.springpot import power_of_rate

#: Frequency at which c compares springpot and spring [Hz]: within the range of most sweeps.
REFERENCE_FREQUENCY = 25.0
#: Size of the last sample's echo in the kernel, relative: between the rounding and the wrapping of its transform.
_ECHO = 1e-8


def _scaled(p: Values) -> Array:
    """c over (2 pi 25 Hz)^alpha, which is tau^alpha [s^alpha]."""
    return np.asarray(p["c"]) / np.power(2.0 * np.pi * REFERENCE_FREQUENCY, p["alpha"])


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """What the spring takes off the springpot: -m/2 w z/(1 + z), w = (i omega)^alpha, z = tau^alpha w [Pa]."""
    rate = power_of_rate(p["alpha"], omega)
    turn = _scaled(p) * rate
    return -0.5 * p["m"] * rate * turn / (1.0 + turn)


def _kernel(alpha: float, scaled: float, count: int, step: float) -> Array:
    """Weights of the strains that went before, as those of Eq. (3): the series of -k v^2/(1 + k v) over step^alpha in
    powers of z, v = (1 - z)^alpha, k = tau^alpha/step^alpha, (count,).

    Notes: by its values on a circle inside that of convergence (C. Lubich, Numer. Math. 52 (1988) 129).
    """
    length = next_fast_len(2 * count)
    radius = _ECHO ** (1.0 / length)
    value = (1.0 - radius * np.exp(-2.0j * np.pi * np.arange(length) / length)) ** alpha
    ratio = scaled / step**alpha
    series = np.fft.ifft(-ratio * value**2 / (1.0 + ratio * value)).real / step**alpha
    return series[:count] * radius ** -np.arange(count)


def _from_rest(alpha: float, scaled: float, strain: Array, step: float) -> Array:
    """The kernel's sum over a strain history from rest, (n,)."""
    length = next_fast_len(2 * strain.size, real=True)
    kernel = _kernel(alpha, scaled, strain.size, step)
    return np.fft.irfft(np.fft.rfft(strain, length) * np.fft.rfft(kernel, length), length)[: strain.size]


def stress(p: Values, history: History) -> Array:
    """s + tau^alpha D^alpha s = m D^alpha e, less the springpot's own m D^alpha e (Eqs. 1, 3) [Pa]."""
    if history.periodic:
        return linear_stress(modulus, p, history)
    row_by_row = np.vectorize(_from_rest, signature="(),(),(n),()->(n)")
    alpha, scaled, step = (np.atleast_1d(value)[..., 0] for value in (p["alpha"], _scaled(p), history.step))
    return p["m"] * row_by_row(alpha, scaled, history.value, step)
