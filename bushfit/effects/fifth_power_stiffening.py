"""Fifth-power stiffening: the elastic stress rises late and steeply at large strain."""

import numpy as np

from bushfit.effects.contract import Array, History, Values


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """Complex modulus of the elastic stress that grows with the fifth power of the strain.

    Args:
        p: parameter values by name: c5 [1], fifth-power stress coefficient over mu, and static shear modulus mu [Pa].
        omega, strain: angular frequency [rad/s] and amplitude e0 of the tensor shear strain e = gamma/2 [1], (..., n).

    Returns:
        Complex modulus of the first harmonic [Pa], (..., n).

    Notes:
        mu^ = 5/8 c5 mu e0^4: the first harmonic of cos^5 is 5/8.

    >>> round(modulus({"mu": 1e6, "c5": 2000.0}, 100.0, 0.1))
    125000
    """
    return 0.625 * p["c5"] * p["mu"] * np.asarray(strain) ** 4


def stress(p: Values, history: History) -> Array:
    """Elastic stress that grows with the fifth power of the strain.

    Args:
        p: parameter values by name: c5 [1], fifth-power stress coefficient over mu, and static shear modulus mu [Pa].
        history: tensor shear strain e = gamma/2 over time [1], (..., n).

    Returns:
        Stress at each sample [Pa], (..., n).

    Notes:
        s = 2 mu c5 e^5: third term of O. H. Yeoh, Rubber Chem. Technol. 66 (1993) 754, in simple shear.
    """
    return 2.0 * p["mu"] * p["c5"] * np.square(np.square(history.value)) * history.value
