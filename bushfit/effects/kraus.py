"""Kraus: the filler network as contacts that break and form again, in place of the friction branch."""

from functools import partial

import numpy as np

from bushfit.effects.contract import Array, Values, harmonic_stress


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """Complex modulus of the Kraus branch.

    Args:
        p: values of delta [Pa], r [1], e_c [1], n [1].
        omega, strain: see `contract.Branch`.

    Returns:
        (..., n) [Pa].

    Notes:
        delta (1 + 2 i r x^n)/(1 + x^2n), x = e0/e_c.

    >>> modulus({"delta": 5e5, "r": 0.2, "e_c": 0.01, "n": 0.6}, 1.0, np.array([1e-4, 0.01, 1.0])).round(-3)
    array([498000. +13000.j, 250000.+100000.j,   2000. +13000.j])
    """
    ratio = np.power(np.maximum(strain / p["e_c"], 1e-12), p["n"])  # of more than 0
    return p["delta"] * (1.0 + 2.0j * p["r"] * ratio) / (1.0 + ratio**2)


def in_place_of(p: Values) -> list[dict[str, float]]:
    """Start values from those of the friction branch: equal modulus at rest, and half of it at the same strain."""
    at_rest = p["sigma_fmax"] / (2.0 * p["eps_half"])
    return [{"delta": at_rest, "r": 0.2, "e_c": p["eps_half"], "n": 0.6}]


stress = partial(harmonic_stress, modulus)
