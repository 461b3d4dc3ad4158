"""Springpot branch: a fractional derivative, whose stiffness and loss grow slowly with frequency."""

from functools import lru_cache

import numpy as np
from scipy.fft import next_fast_len

from bushfit.effects.contract import Array, History, Value, Values


def power_of_rate(alpha: Array, omega: Array) -> Array:
    """Transfer function (i omega)^alpha of a fractional derivative of order alpha, at omega [rad/s], (..., n)."""
    return np.power(omega, alpha) * np.exp(0.5j * np.pi * alpha)


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """Complex modulus of the springpot.

    Args:
        p: parameter values by name: springpot constant m [Pa s^alpha], order alpha [1].
        omega, strain: angular frequency [rad/s] and amplitude e0 of the tensor shear strain e = gamma/2 [1], (..., n).

    Returns:
        Complex modulus of the first harmonic [Pa], (..., n).

    Notes:
        mu^ = m/2 (i omega)^alpha (Garcia Tarrago et al. 2007, Eqs. 1 to 3).

    >>> abs(modulus({"m": 2e5, "alpha": 0.24}, np.array([1.0, 2.0 * np.pi * 100.0]), 0.01)).round()
    array([100000., 469422.])
    """
    return 0.5 * p["m"] * power_of_rate(p["alpha"], omega)


def fractional_derivative(alpha: Value, history: History) -> Array:
    """Fractional derivative of a motion by the Gruenwald-Letnikov sum with full memory, from rest before its start.

    Args:
        alpha: order of the derivative [1], a number or (..., 1).
        history: motion over time, (..., n).

    Returns:
        D^alpha of the values, (..., n) [unit of the values per s^alpha].

    Notes:
        Eq. 3 of Garcia Tarrago et al. 2007. It is of first order in the step: (1 - z)^alpha, z = exp(-i omega step),
        replaces (i omega step)^alpha, which delays by alpha/2 steps. With `history.second_order`, the factor
        1 + alpha/2 (1 - z) removes the delay (W. Tian, H. Zhou, W. Deng, Math. Comp. 84 (2015) 1703).

    >>> fractional_derivative(1.0, History(np.array([0.5, 2.0, 3.0]), 0.5, False, 1.0)).round(6)
    array([1., 3., 2.])
    """
    values, count = history.value, history.value.shape[-1]
    length = next_fast_len(2 * count, real=True)
    orders, row = np.unique(alpha, return_inverse=True)  # of many models, most have the same order
    weights = np.stack([_weight_spectrum(order, count, length) for order in orders.tolist()])[row]
    spectrum = np.fft.rfft(values, length) * weights.reshape(*np.shape(alpha)[:-1], -1)
    derivative = history.step**-alpha * np.fft.irfft(spectrum, length)[..., :count]
    if history.second_order:
        derivative[..., 1:] += 0.5 * alpha * np.diff(derivative, axis=-1)
        derivative[..., :1] *= 1.0 + 0.5 * alpha
    return derivative


@lru_cache(maxsize=8)
def _weight_spectrum(alpha: float, count: int, length: int) -> Array:
    """Fourier transform (numpy.fft.rfft) of the Gruenwald-Letnikov weights w_0 = 1, w_j = w_{j-1} (j - 1 - alpha)/j.

    Args:
        alpha: order of the derivative.
        count: number of weights.
        length: length to which the weights are padded with zeros.

    Returns:
        Spectrum, (length // 2 + 1,).
    """
    j = np.arange(1, count)
    return np.fft.rfft(np.insert(np.cumprod((j - 1.0 - alpha) / j), 0, 1.0), length)


def stress(p: Values, history: History) -> Array:
    """Stress of the springpot from rest.

    Args:
        p: parameter values by name: springpot constant m [Pa s^alpha], order alpha [1].
        history: tensor shear strain e = gamma/2 over time [1], (..., n).

    Returns:
        Stress at each sample [Pa], (..., n).

    Notes:
        s = m D^alpha e, with the fractional derivative D^alpha (Garcia Tarrago et al. 2007, Eqs. 1 and 3).
    """
    return p["m"] * fractional_derivative(p["alpha"], history)
