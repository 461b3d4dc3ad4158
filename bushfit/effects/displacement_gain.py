"""Displacement gain: the transducer of one direction, or of one specimen's rig, reads another gain than the others'.

One transducer for all tests would be no effect that tests can show: mu, m and eps_half absorb it exactly.
"""

from __future__ import annotations

from bushfit.effects import strain_scale
from bushfit.effects.contract import Array, Family, ForceBelow, Layer, Level, Parameter, Setting, StiffnessBelow, Values
from bushfit.effects.history import History


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """scale K(scale X) [N/m]: the force of the true motion, over the motion that was read."""
    return p["scale"] * strain_scale.stiffness(p, below, omega, amplitude, setting)


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """F of scale times the motion that was read [N]."""
    return below(history.with_value(p["scale"] * history.value))


FAMILY = Family(
    Layer(
        name="displacement_gain",
        sentence="The displacement transducer of {place} is off by one factor, and with it amplitude and stiffness; "
        "off alike in all tests it would not show.",
        equation="scale K(scale X), {place} only",
        level=Level.INSTRUMENT,
        parameters=(Parameter("scale", "1", (0.6, 1.4), 1.0, 0.05, meaning="true motion of {place} over that read"),),
        source="sensitivity error of a displacement transducer, ISO 9513:2012",
        confirmed_by="check the transducer with gauge blocks; a stiffness_factor of the same place shifts the "
        "stiffness by as much and leaves the amplitude",
        stiffness=stiffness,
        force=force,
    )
)
