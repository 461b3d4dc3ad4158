"""Fractional Zener: a spring in series with the springpot, which levels off at high frequency."""

from functools import lru_cache

import numpy as np
from scipy.fft import next_fast_len

from bushfit.effects.contract import REFERENCE_FREQUENCY, Array, History, Values
from bushfit.effects.springpot import power_of_rate

#: Size of the last sample's echo in the kernel, relative: between the rounding and the wrapping of its transform.
_ECHO = 1e-8


def _relaxation_time_power(p: Values) -> Array:
    """Power tau^alpha = c/(2 pi 25 Hz)^alpha [s^alpha] of the relaxation time tau of a springpot and spring in series.

    Args:
        p: parameter values by name: order alpha [1] of the springpot; and c [1], modulus of the springpot over that of
            the spring at 25 Hz, the reference frequency of all effects of rate.
    """
    return np.asarray(p["c"]) / np.power(2.0 * np.pi * REFERENCE_FREQUENCY, p["alpha"])


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """Change of the springpot's complex modulus due to a spring in series, which limits the modulus at high frequency.

    Args:
        p: parameter values by name: c [1], modulus of the springpot over that of the spring at 25 Hz; and of the
            springpot m [Pa s^alpha], alpha [1].
        omega, strain: angular frequency [rad/s] and amplitude e0 of the tensor shear strain e = gamma/2 [1], (..., n).

    Returns:
        Complex modulus of the first harmonic [Pa], (..., n).

    Notes:
        -m/2 w z/(1 + z), w = (i omega)^alpha, z = tau^alpha w, tau^alpha = c/(2 pi 25 Hz)^alpha: the fractional Zener
        model (M. Caputo, F. Mainardi, Riv. Nuovo Cimento 1 (1971) 161) minus the springpot m/2 w.

    >>> modulus({"m": 2.0, "alpha": 0.5, "c": 1.0}, 2.0 * np.pi * np.array([1.0, 25.0]), 0.01).round(1)
    array([-0.1-0.4j, -2.6-6.3j])
    """
    rate = power_of_rate(p["alpha"], omega)
    turn = _relaxation_time_power(p) * rate
    return -0.5 * p["m"] * rate * turn / (1.0 + turn)


@lru_cache(maxsize=64)
def _circle(length: int) -> tuple[Array, Array]:
    """Evaluate ln(1 - z) on a circle |z| = r < 1, from which `stress` computes the coefficients of a power series.

    Returns:
        ln(1 - z) on half of the circle, (length // 2 + 1,), and the powers r^0, r^1, ..., (length,).
    """
    radius = _ECHO ** (1.0 / length)
    turn = np.exp(-2.0j * np.pi * np.arange(length // 2 + 1) / length)
    return np.log(1.0 - radius * turn), radius ** np.arange(length)


def stress(p: Values, history: History) -> Array:
    """Change of the springpot's stress due to a spring in series, from rest.

    Args:
        p: parameter values by name: c [1], modulus of the springpot over that of the spring at 25 Hz; and of the
            springpot m [Pa s^alpha], alpha [1].
        history: tensor shear strain e = gamma/2 over time [1], (..., n).

    Returns:
        Stress at each sample [Pa], (..., n).

    Notes:
        Solution s of s + tau^alpha D^alpha s = m D^alpha e, minus the stress m D^alpha e of the springpot alone, with
        tau^alpha = c/(2 pi 25 Hz)^alpha and the fractional derivative D^alpha (Garcia Tarrago et al. 2007, Eq. 3).

        The weights of past strains are the coefficients of the power series in z of -k v^2/(1 + k v)/step^alpha, with
        v = (1 - z)^alpha and k = tau^alpha/step^alpha, from its values on a circle |z| < 1 (C. Lubich, Numer. Math. 52
        (1988) 129); v (1 + alpha/2 (1 - z)) replaces v in the second order of `springpot.fractional_derivative`.
    """
    count = history.value.shape[-1]
    alpha, scaled, step = (np.atleast_1d(value) for value in (p["alpha"], _relaxation_time_power(p), history.step))
    length = next_fast_len(2 * count, real=True)
    logarithm, powers = _circle(length)
    value = np.exp(alpha * logarithm)
    if history.second_order:
        value *= 1.0 + 0.5 * alpha * np.exp(logarithm)
    unit = step**alpha
    turn = scaled / unit * value
    series = np.fft.irfft(-turn * value / (1.0 + turn), length) / unit
    weights = np.fft.rfft(series[..., :count] / powers[:count], length)
    return p["m"] * np.fft.irfft(np.fft.rfft(history.value, length) * weights, length)[..., :count]
