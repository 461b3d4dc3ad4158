"""Hysteretic loss: a loss that is the same at every rate and every amplitude."""

from functools import partial

from bushfit.effects.contract import Array, Values, harmonic_stress


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """mu^ = i eta mu [Pa].

    >>> modulus({"mu": 1e6, "eta": 0.02}, 100.0, 0.01)
    20000j
    """
    return 1j * p["eta"] * p["mu"]


stress = partial(harmonic_stress, modulus)
