"""Asymmetry: the elastic stress differs between the two senses of motion."""

import numpy as np

from bushfit.effects.contract import Array, History, Values


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """Complex modulus of the elastic stress that differs between the two senses of motion; it is zero.

    Args:
        p: parameter values by name: c2 [1], quadratic stress coefficient over mu, and static shear modulus mu [Pa].
        omega, strain: angular frequency [rad/s] and amplitude e0 of the tensor shear strain e = gamma/2 [1], (..., n).

    Returns:
        Complex modulus of the first harmonic [Pa], (..., n).

    Notes:
        mu^ = 0: an even stress has a mean and even harmonics, but no first harmonic.
    """
    return np.zeros(1)


def stress(p: Values, history: History) -> Array:
    """Elastic stress that differs between the two senses of motion.

    Args:
        p: parameter values by name: c2 [1], quadratic stress coefficient over mu, and static shear modulus mu [Pa].
        history: tensor shear strain e = gamma/2 over time [1], (..., n).

    Returns:
        Stress at each sample [Pa], (..., n).

    Notes:
        s = 2 mu c2 e^2, the quadratic term of a power series (A. H. Nayfeh, D. T. Mook, Nonlinear Oscillations, 1979).

    >>> stress({"mu": 1e6, "c2": 1.0}, History.steady(np.array([0.01, -0.01]), 1.0))
    array([200., 200.])
    """
    return 2.0 * p["mu"] * p["c2"] * history.value**2
