"""Displacement gain: the transducer of one direction, or of one specimen's rig, reads another gain than the others'.

One transducer for all tests would be no effect that tests can show: mu, m and eps_half absorb it exactly.
"""

from bushfit.effects import strain_scale
from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Values


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """scale K(scale X) [N/m]: the force of the true motion, over the motion that was read.

    >>> stiffness({"scale": 1.02}, spring, 1.0, 1e-4, sweep)
    510000.0
    """
    return p["scale"] * strain_scale.stiffness(p, below, omega, amplitude, setting)


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """F of scale times the motion that was read [N]."""
    return below(history.with_value(p["scale"] * history.value))
