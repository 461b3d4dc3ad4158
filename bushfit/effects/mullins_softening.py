"""Mullins softening: rubber that has rested is stiffer in its first cycles than later on."""

import numpy as np

from bushfit.effects.contract import Array, History, Values


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """Complex modulus of the additional stiffness in the first cycles of rested rubber; it is zero.

    Args:
        p: parameter values by name: share [1], extra modulus of the first cycle over mu; number of cycles [1] in which
            it falls to 37 %; and static shear modulus mu [Pa].
        omega, strain: angular frequency [rad/s] and amplitude e0 of the tensor shear strain e = gamma/2 [1], (..., n).

    Returns:
        Complex modulus of the first harmonic [Pa], (..., n).

    Notes:
        mu^ = 0, because the stiffening vanishes in the steady state.
    """
    return np.zeros(1)


def stress(p: Values, history: History) -> Array:
    """Additional stress in the first cycles of rested rubber (Mullins effect).

    Args:
        p: parameter values by name: share [1], extra modulus of the first cycle over mu; number of cycles [1] in which
            it falls to 37 %; and static shear modulus mu [Pa].
        history: tensor shear strain e = gamma/2 over time [1], (..., n).

    Returns:
        Stress at each sample [Pa], (..., n).

    Notes:
        s = 2 mu share exp(-N/cycles) e, with N = f t cycles since the start (L. Mullins, Rubber Chem. Technol. 42
        (1969) 339).

        A single steady cycle has no such stress.

    >>> strain = History.steady(np.full(4, 0.01), 1.0, cycles=2)
    >>> stress({"mu": 1e6, "share": 0.05, "cycles": 2.0}, strain).round()
    array([1000.,  779.,  607.,  472.])
    """
    if history.periodic and history.cycles == 1:
        return np.zeros(history.value.shape)
    elapsed = history.frequency * history.step * np.arange(history.value.shape[-1])
    return 2.0 * p["mu"] * p["share"] * np.exp(-elapsed / p["cycles"]) * history.value
