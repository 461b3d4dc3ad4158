"""Displacement gain: the displacement transducer of one direction or specimen has another gain than the others.

A wrong gain that all tests share cannot be detected, because mu, m and eps_half absorb it exactly.
"""

from bushfit.effects import strain_scale
from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Values


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """Complex stiffness with a wrong gain of the displacement transducer.

    Args:
        p: parameter values by name: scale [1], true over recorded displacement.
        below: complex stiffness K without this effect, as a function of omega and amplitude.
        omega, amplitude: angular frequency [rad/s] and displacement amplitude X [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Complex stiffness with the effect [N/m or N m/rad], (..., n).

    Notes:
        scale K(scale X): the force at the true amplitude, scale X, over the recorded amplitude X (sensitivity error of
        a displacement transducer, ISO 9513:2012).

    >>> stiffness({"scale": 1.02}, spring, 1.0, 1e-4, sweep)
    510000.0
    """
    return p["scale"] * strain_scale.stiffness(p, below, omega, amplitude, setting)


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """Force with a wrong gain of the displacement transducer.

    Args:
        p: parameter values by name: scale [1], true over recorded displacement.
        below: force F without this effect, as a function of the displacement history.
        history: displacement over time [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Force with the effect at each sample [N or N m], (..., n).

    Notes:
        F of the true motion, which is scale times the recorded motion.
    """
    return below(history.with_value(p["scale"] * history.value))
