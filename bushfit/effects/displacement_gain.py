"""Displacement gain: the transducer of one direction, or of one specimen's rig, reads another gain than the others'.

One transducer for all tests would be no effect that tests can show: mu, m and eps_half absorb it exactly.
"""

from bushfit.effects import strain_scale
from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Values


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """Complex stiffness with a wrong gain of the displacement transducer.

    Args:
        p: values of scale [1].
        below, omega, amplitude, setting: see `contract.Layer`.

    Returns:
        (..., n) [N/m or N m/rad].

    Notes:
        scale K(scale X): the force of the true motion, over the motion that was read.

    >>> stiffness({"scale": 1.02}, spring, 1.0, 1e-4, sweep)
    510000.0
    """
    return p["scale"] * strain_scale.stiffness(p, below, omega, amplitude, setting)


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """Force with a wrong gain of the displacement transducer.

    Args:
        p: values of scale [1].
        below, history, setting: see `contract.Layer`.

    Returns:
        (..., n) [N or N m].

    Notes:
        F of scale times the motion that was read.
    """
    return below(history.with_value(p["scale"] * history.value))
