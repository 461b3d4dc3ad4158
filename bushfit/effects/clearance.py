"""Clearance: play between the bushing and what moves it."""

from __future__ import annotations

import numpy as np

from bushfit.effects.contract import Array, ForceBelow, Layer, Level, Parameter, Setting, StiffnessBelow, Values
from bushfit.effects.dead_zone import dead_zone, first_harmonic
from bushfit.effects.history import History
from bushfit.geometry import Direction


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """K(omega, X - delta) N(delta/X) [N/m], N of `dead_zone.first_harmonic`; 0 within the play.

    The bushing sees a dead-zoned sine: its first harmonic is X N, its peak X - delta. Taking K at the peak
    is exact for linear branches.
    """
    if setting.direction is Direction.TORSION:
        return below(omega, amplitude)
    reach = np.maximum(amplitude - p["delta"], 0.0)
    return below(omega, reach) * first_harmonic(amplitude, p["delta"])


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """The force of the bushing moved by what exceeds +-delta [N]."""
    if setting.direction is Direction.TORSION:
        return below(history)
    return below(history.with_value(dead_zone(history.value, p["delta"])))


EFFECT = Layer(
    name="clearance",
    sentence="Play in the mounting: the bushing is moved less than it seems, most so at the smallest amplitude.",
    equation="K(X - delta) N(delta/X)",
    level=Level.COMPONENT,
    parameters=(Parameter("delta", "m", (0.0, 1e-2), 0.0, 1e-5, log=False, meaning="play, each way"),),
    source="A. Gelb, W. E. Vander Velde, Multiple-Input Describing Functions, 1968, app. B",
    harmonic_error=0.02,
    stiffness=stiffness,
    force=force,
)
