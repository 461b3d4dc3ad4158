"""One-sided stop: a spring that is met beyond a gap, one way only."""

import numpy as np

from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Values
from bushfit.effects.dead_zone import first_harmonic


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """Complex stiffness with a stop on one side beyond a gap.

    Args:
        p: values of gap [m], stiffness [N/m].
        below, omega, amplitude, setting: see `contract.Layer`.

    Returns:
        (..., n) [N/m or N m/rad].

    Notes:
        K + k N(gap/X)/2 [N/m], half of what a stop both ways does.

    >>> stiffness({"gap": 1e-3, "stiffness": 1e6}, spring, 1.0, np.array([1e-3, 2e-3, 1.0]), sweep).round()
    array([500000., 695501., 999363.])
    """
    return below(omega, amplitude) + 0.5 * p["stiffness"] * first_harmonic(amplitude, p["gap"])


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """Force with a stop on one side beyond a gap.

    Args:
        p: values of gap [m], stiffness [N/m].
        below, history, setting: see `contract.Layer`.

    Returns:
        (..., n) [N or N m].

    Notes:
        F + k (x - gap) above the gap: overtones, even ones too, and a mean force.
    """
    return below(history) + p["stiffness"] * np.maximum(history.value - p["gap"], 0.0)
