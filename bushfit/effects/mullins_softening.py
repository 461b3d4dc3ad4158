"""Mullins softening: rubber that has rested is stiffer in its first cycles than later on."""

from __future__ import annotations

import numpy as np

from bushfit.effects.contract import Array, Branch, History, Parameter, Values


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """mu^ = 0 [Pa]: nothing is left of it in the steady state."""
    return np.zeros(1)


def stress(p: Values, history: History) -> Array:
    """s = 2 mu share exp(-N/cycles) e [Pa], N = f t the cycles since the record began.

    A single steady cycle has forgotten its beginning, and gets none.
    """
    if history.periodic and history.cycles == 1:
        return np.zeros(history.value.shape)
    elapsed = history.frequency * history.step * np.arange(history.value.shape[-1])
    return 2.0 * p["mu"] * p["share"] * np.exp(-elapsed / p["cycles"]) * history.value


EFFECT = Branch(
    name="mullins_softening",
    sentence="The first cycles of a loop are stiffer than the later ones; a settled sweep shows nothing of it.",
    equation="0 once settled",
    parameters=(
        Parameter("share", "1", (0.0, 5.0), 0.0, 0.05, meaning="extra stiffness at the start over mu"),
        Parameter("cycles", "1", (0.1, 100.0), None, 1.0, log=True, meaning="cycles in which it falls to 37 %"),
    ),
    source="L. Mullins, Rubber Chem. Technol. 42 (1969) 339",
    confirmed_by="repeat the loop at once, without a rest: the first cycles must not stiffen again",
    settles=True,
    uses=("mu",),
    modulus=modulus,
    stress=stress,
)
