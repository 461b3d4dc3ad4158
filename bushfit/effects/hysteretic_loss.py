"""Hysteretic loss: a loss that is the same at every rate and every amplitude."""

from __future__ import annotations

from functools import partial

from bushfit.effects.contract import Array, Branch, Parameter, Values, harmonic_stress


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """mu^ = i eta mu [Pa]."""
    return 1j * p["eta"] * p["mu"]


EFFECT = Branch(
    name="hysteretic_loss",
    sentence="A constant loss: the loss stiffness is higher by the same at every frequency and every amplitude.",
    equation="i eta mu",
    parameters=(Parameter("eta", "1", (0.0, 1.0), 0.0, 0.02, meaning="constant loss modulus over mu"),),
    source="structural damping: R. E. D. Bishop, J. R. Aeronaut. Soc. 59 (1955) 738; of no causal law in time: "
    "S. H. Crandall, J. Sound Vib. 11 (1970) 3",
    confirmed_by="sweep from 0.05 to 5 Hz at the smallest amplitude: this loss falls neither with the rate, as that "
    "of a springpot or dashpot, nor with the amplitude, as that of friction",
    harmonic_only=True,
    uses=("mu",),
    modulus=modulus,
    stress=partial(harmonic_stress, modulus),
)
