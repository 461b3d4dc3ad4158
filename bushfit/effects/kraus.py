"""Kraus: the filler network as contacts that break and form again, in place of the friction branch."""

from __future__ import annotations

from functools import partial

import numpy as np

from bushfit.effects.contract import Array, Branch, Parameter, Values, harmonic_stress

#: Least strain over e_c at which the powers are taken: less than any test reaches, and more than 0.
_LEAST = 1e-12


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """delta (1 + 2 i r x^n)/(1 + x^2n), x = e0/e_c [Pa]."""
    ratio = np.power(np.maximum(strain / p["e_c"], _LEAST), p["n"])
    return p["delta"] * (1.0 + 2.0j * p["r"] * ratio) / (1.0 + ratio**2)


def in_place_of(p: Values) -> dict[str, float]:
    """Where a fit begins that had friction before: the same stiffness at rest, the same strain at half of it."""
    at_rest = p["sigma_fmax"] / (2.0 * p["eps_half"])
    return {"delta": at_rest, "r": 0.2, "e_c": p["eps_half"], "n": 0.6}


EFFECT = Branch(
    name="kraus",
    sentence="Contacts of the filler break and form again: over strain G' falls and G'' peaks, each by its own law.",
    equation="delta (1 + 2 i r x^n)/(1 + x^2n), x = e0/e_c",
    parameters=(
        Parameter("delta", "Pa", (0.0, 1e9), 0.0, 5e5, meaning="modulus of the filler network at rest"),
        Parameter("r", "1", (1e-3, 1.0), None, 0.2, log=True, meaning="largest loss modulus over delta"),
        Parameter("e_c", "1", (1e-5, 10.0), None, 1e-2, log=True, meaning="strain amplitude of the largest loss"),
        Parameter("n", "1", (0.1, 2.0), None, 0.6, log=True, meaning="power of the strain amplitude"),
    ),
    source="G. Kraus, Appl. Polym. Symp. 39 (1984) 75; J. D. Ulmer, Rubber Chem. Technol. 69 (1996) 15",
    confirmed_by="sweep the amplitude over three decades at one frequency: friction and Kraus part at both ends",
    replaces="friction",
    harmonic_only=True,
    in_place_of=in_place_of,
    modulus=modulus,
    stress=partial(harmonic_stress, modulus),
)
