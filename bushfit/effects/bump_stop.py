"""Bump stop: a spring that is met beyond a gap, both ways."""

from __future__ import annotations

from bushfit.effects.contract import Array, ForceBelow, Layer, Level, Parameter, Setting, StiffnessBelow, Values
from bushfit.effects.dead_zone import dead_zone, first_harmonic
from bushfit.effects.history import History


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """K + k N(gap/X) [N/m], N of `dead_zone.first_harmonic`; exactly K up to the gap, and in torsion."""
    return below(omega, amplitude) + p["stiffness"] * first_harmonic(amplitude, p["gap"])


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """F + k (x - gap) above the gap, k (x + gap) below -gap [N]."""
    return below(history) + p["stiffness"] * dead_zone(history.value, p["gap"])


EFFECT = Layer(
    name="bump_stop",
    sentence="A stop is met beyond a gap: stiffness jumps up at the amplitudes that cross it, and only there.",
    equation="K + stiffness N(gap/X)",
    level=Level.COMPONENT,
    parameters=(
        Parameter(
            "gap",
            "m",
            (1e-6, 0.1),
            None,
            3e-4,
            log=True,
            meaning="travel until the stop is met, both ways",
            scale="displacement",
        ),
        Parameter("stiffness", "N/m", (0.0, 1e10), 0.0, 1e5, meaning="stiffness of the stop"),
    ),
    source="A. Gelb, W. E. Vander Velde, Multiple-Input Describing Functions, 1968, app. B",
    confirmed_by="loop slowly to the largest amplitude: the force must bend up at the gap",
    turns=False,
    stiffness=stiffness,
    force=force,
)
