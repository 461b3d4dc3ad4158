"""Strain stiffening: the elastic stress turns up at large strain."""

from __future__ import annotations

import numpy as np

from bushfit.effects.contract import Array, Branch, History, Parameter, Values


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """mu^ = 3/4 c3 mu e0^2 [Pa]: the first harmonic of cos^3 is 3/4."""
    return 0.75 * p["c3"] * p["mu"] * np.asarray(strain) ** 2


def stress(p: Values, history: History) -> Array:
    """s = 2 mu c3 e^3 [Pa]."""
    return 2.0 * p["mu"] * p["c3"] * history.value**3


EFFECT = Branch(
    name="strain_stiffening",
    sentence="The rubber stiffens at large strain: storage stiffness rises with the square of amplitude.",
    equation="3/4 c3 mu e0^2",
    parameters=(Parameter("c3", "1", (0.0, 1e5), 0.0, 20.0, meaning="cubic stress coefficient over mu"),),
    source="second term of O. H. Yeoh, Rubber Chem. Technol. 66 (1993) 754, in simple shear",
    confirmed_by="sweep or loop at one and a half times the largest amplitude: the rise must go on with its square",
    uses=("mu",),
    modulus=modulus,
    stress=stress,
)
