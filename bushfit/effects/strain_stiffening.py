"""Strain stiffening: the elastic stress rises more than linearly at large strain."""

import numpy as np

from bushfit.effects.contract import Array, History, Values


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """Complex modulus of the elastic stress that grows with the cube of the strain.

    Args:
        p: parameter values by name: c3 [1], cubic stress coefficient over mu, and static shear modulus mu [Pa].
        omega, strain: angular frequency [rad/s] and amplitude e0 of the tensor shear strain e = gamma/2 [1], (..., n).

    Returns:
        Complex modulus of the first harmonic [Pa], (..., n).

    Notes:
        mu^ = 3/4 c3 mu e0^2: the first harmonic of cos^3 is 3/4.

    >>> round(modulus({"mu": 1e6, "c3": 20.0}, 100.0, 0.1))
    150000
    """
    return 0.75 * p["c3"] * p["mu"] * np.asarray(strain) ** 2


def stress(p: Values, history: History) -> Array:
    """Elastic stress that grows with the cube of the strain.

    Args:
        p: parameter values by name: c3 [1], cubic stress coefficient over mu, and static shear modulus mu [Pa].
        history: tensor shear strain e = gamma/2 over time [1], (..., n).

    Returns:
        Stress at each sample [Pa], (..., n).

    Notes:
        s = 2 mu c3 e^3: second term of O. H. Yeoh, Rubber Chem. Technol. 66 (1993) 754, in simple shear.
    """
    return 2.0 * p["mu"] * p["c3"] * np.square(history.value) * history.value  # a general power takes 20 times as long
