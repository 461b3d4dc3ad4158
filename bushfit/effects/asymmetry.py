"""Asymmetry: the elastic stress differs between the two senses of motion."""

import numpy as np

from bushfit.effects.contract import Array, History, Values


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """mu^ = 0 [Pa]: an even stress has a mean and even harmonics, and no first one."""
    return np.zeros(1)


def stress(p: Values, history: History) -> Array:
    """s = 2 mu c2 e^2 [Pa].

    >>> stress({"mu": 1e6, "c2": 1.0}, History.steady(np.array([0.01, -0.01]), 1.0))
    array([200., 200.])
    """
    return 2.0 * p["mu"] * p["c2"] * history.value**2
