"""Fifth-power stiffening: the elastic stress turns up late and steeply at large strain."""

from __future__ import annotations

import numpy as np

from bushfit.effects.contract import Array, Branch, History, Parameter, Values


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """mu^ = 5/8 c5 mu e0^4 [Pa]: the first harmonic of cos^5 is 5/8."""
    return 0.625 * p["c5"] * p["mu"] * np.asarray(strain) ** 4


def stress(p: Values, history: History) -> Array:
    """s = 2 mu c5 e^5 [Pa]."""
    return 2.0 * p["mu"] * p["c5"] * history.value**5


EFFECT = Branch(
    name="fifth_power_stiffening",
    sentence="The rubber stiffens steeply at large strain: storage stiffness rises with the fourth power of amplitude.",
    equation="5/8 c5 mu e0^4",
    parameters=(Parameter("c5", "1", (0.0, 1e8), 0.0, 2e3, meaning="fifth-power stress coefficient over mu"),),
    source="third term of O. H. Yeoh, Rubber Chem. Technol. 66 (1993) 754, in simple shear",
    confirmed_by="sweep or loop at one and a half times the largest amplitude: the rise must be five times as large, "
    "where strain_stiffening makes it 2.25 times as large and a stop about three times",
    uses=("mu",),
    never_with=("strain_stiffening",),
    modulus=modulus,
    stress=stress,
)
