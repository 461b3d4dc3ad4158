"""Asymmetry: the elastic stress differs between the two senses of motion."""

import numpy as np

from bushfit.effects.contract import Array, History, Values


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """Complex modulus of the asymmetric elastic term.

    Args:
        p: values of c2 [1]; and mu.
        omega, strain: see `contract.Branch`.

    Returns:
        (..., n) [Pa].

    Notes:
        mu^ = 0: an even stress has a mean and even harmonics, and no first one.
    """
    return np.zeros(1)


def stress(p: Values, history: History) -> Array:
    """Stress of the asymmetric elastic term.

    Args:
        p: values of c2 [1]; and mu.
        history: see `contract.Branch`.

    Returns:
        (..., n) [Pa].

    Notes:
        s = 2 mu c2 e^2.

    >>> stress({"mu": 1e6, "c2": 1.0}, History.steady(np.array([0.01, -0.01]), 1.0))
    array([200., 200.])
    """
    return 2.0 * p["mu"] * p["c2"] * history.value**2
