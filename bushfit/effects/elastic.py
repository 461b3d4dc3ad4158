"""Elastic branch: the rubber's static shear modulus."""

import numpy as np

from bushfit.effects.contract import Array, History, Values


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """Complex modulus of the elastic branch.

    Args:
        p: parameter values by name: static shear modulus mu [Pa].
        omega, strain: angular frequency [rad/s] and amplitude e0 of the tensor shear strain e = gamma/2 [1], (..., n).

    Returns:
        Complex modulus of the first harmonic [Pa], (..., n).

    Notes:
        mu^ = mu at all frequencies and amplitudes (Garcia Tarrago et al. 2007, Eq. 1).

    >>> float(modulus({"mu": 1.09e6}, 100.0, 0.01))
    1090000.0
    """
    return np.asarray(p["mu"])


def stress(p: Values, history: History) -> Array:
    """Stress of the elastic branch.

    Args:
        p: parameter values by name: static shear modulus mu [Pa].
        history: tensor shear strain e = gamma/2 over time [1], (..., n).

    Returns:
        Stress at each sample [Pa], (..., n).

    Notes:
        s = 2 mu e (Garcia Tarrago et al. 2007, Eq. 1).
    """
    return 2.0 * p["mu"] * history.value
