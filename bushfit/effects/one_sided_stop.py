"""One-sided stop: a spring that is met beyond a gap, one way only."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bushfit.effects import bump_stop
from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Values
from bushfit.effects.dead_zone import first_harmonic

_GAP, _STIFFNESS = bump_stop.EFFECT.parameters


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """K + k N(gap/X)/2 [N/m], half of what a stop both ways does."""
    return below(omega, amplitude) + 0.5 * p["stiffness"] * first_harmonic(amplitude, p["gap"])


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """F + k (x - gap) above the gap [N]: overtones, even ones too, and a mean force."""
    return below(history) + p["stiffness"] * np.maximum(history.value - p["gap"], 0.0)


EFFECT = replace(
    bump_stop.EFFECT,
    name="one_sided_stop",
    sentence="A stop is met beyond a gap in the positive sense only: stiffness jumps up and loops turn lopsided.",
    equation="K + stiffness N(gap/X)/2",
    parameters=(replace(_GAP, meaning="travel until the stop is met, in the positive sense"), _STIFFNESS),
    confirmed_by="loop slowly to the largest amplitude: the force must bend up at one end only, where bump_stop bends "
    "it at both; sweeps alone cannot part the two",
    stiffness=stiffness,
    force=force,
)
