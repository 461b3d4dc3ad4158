"""Kraus: the filler network as contacts that break and form again, in place of the friction branch."""

from functools import partial

import numpy as np

from bushfit.effects.contract import Array, Values, harmonic_stress


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """Complex modulus of the filler network by Kraus: contacts break with the strain amplitude and form again.

    Args:
        p: parameter values by name: modulus delta [Pa] of the network at rest, largest loss modulus r [1] over delta,
            strain amplitude e_c [1] of this loss, and exponent n [1] of the strain amplitude.
        omega, strain: angular frequency [rad/s] and amplitude e0 of the tensor shear strain e = gamma/2 [1], (..., n).

    Returns:
        Complex modulus of the first harmonic [Pa], (..., n).

    Notes:
        mu^ = delta (1 + 2 i r x^n)/(1 + x^2n), x = e0/e_c (G. Kraus, Appl. Polym. Symp. 39 (1984) 75).

    >>> modulus({"delta": 5e5, "r": 0.2, "e_c": 0.01, "n": 0.6}, 1.0, np.array([1e-4, 0.01, 1.0])).round(-3)
    array([498000. +13000.j, 250000.+100000.j,   2000. +13000.j])
    """
    ratio = np.power(np.maximum(strain / p["e_c"], 1e-12), p["n"])  # of more than 0
    return p["delta"] * (1.0 + 2.0j * p["r"] * ratio) / (1.0 + ratio**2)


def in_place_of(p: Values) -> list[dict[str, float]]:
    """Derive start values of a fit from the friction branch: equal modulus at zero strain, halved at the same strain.

    Args:
        p: parameter values by name, with sigma_fmax [Pa] and eps_half [1] of the friction branch.

    Returns:
        List of one start: delta [Pa], r [1], e_c [1] and n [1] by name, as in `modulus`.
    """
    at_rest = p["sigma_fmax"] / (2.0 * p["eps_half"])
    return [{"delta": at_rest, "r": 0.2, "e_c": p["eps_half"], "n": 0.6}]


stress = partial(harmonic_stress, modulus)
