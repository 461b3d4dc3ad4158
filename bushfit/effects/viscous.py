"""Viscous branch: a Newtonian dashpot, loss that grows in proportion to frequency."""

import numpy as np

from bushfit.effects.contract import Array, History, Values


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """Complex modulus of a Newtonian dashpot.

    Args:
        p: parameter values by name: viscosity eta [Pa s].
        omega, strain: angular frequency [rad/s] and amplitude e0 of the tensor shear strain e = gamma/2 [1], (..., n).

    Returns:
        Complex modulus of the first harmonic [Pa], (..., n).

    Notes:
        mu^ = i omega eta (J. D. Ferry, Viscoelastic Properties of Polymers, 3rd ed., 1980, ch. 1).

    >>> complex(modulus({"eta": 100.0}, 10.0, 0.01))
    1000j
    """
    return 1j * np.asarray(omega) * p["eta"]


def stress(p: Values, history: History) -> Array:
    """Stress of a Newtonian dashpot from rest.

    Args:
        p: parameter values by name: viscosity eta [Pa s].
        history: tensor shear strain e = gamma/2 over time [1], (..., n).

    Returns:
        Stress at each sample [Pa], (..., n).

    Notes:
        s = 2 eta de/dt, by central differences.
    """
    return 2.0 * p["eta"] * history.rate
