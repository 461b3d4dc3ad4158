"""Asymmetry: the elastic stress differs between the two senses of motion."""

from __future__ import annotations

import numpy as np

from bushfit.effects.contract import Array, Branch, History, Parameter, Values


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """mu^ = 0 [Pa]: an even stress has a mean and even harmonics, and no first one."""
    return np.zeros(1)


def stress(p: Values, history: History) -> Array:
    """s = 2 mu c2 e^2 [Pa]."""
    return 2.0 * p["mu"] * p["c2"] * history.value**2


EFFECT = Branch(
    name="asymmetry",
    sentence="The bushing is stiffer one way than the other: mean force and even harmonics in loops, none in sweeps.",
    equation="0",
    parameters=(Parameter("c2", "1", (-1e3, 1e3), 0.0, 1.0, meaning="quadratic stress coefficient over mu"),),
    source="quadratic term of a power series of the stress; A. H. Nayfeh, D. T. Mook, Nonlinear Oscillations, 1979",
    confirmed_by="repeat the loop with a static offset to either side",
    uses=("mu",),
    modulus=modulus,
    stress=stress,
)
