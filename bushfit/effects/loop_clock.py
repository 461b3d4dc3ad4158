"""Loop clock: the time of the loops runs at another rate than the time of the sweeps."""

import numpy as np

from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Values


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """Complex stiffness with a wrong clock in the loops.

    Args:
        p: parameter values by name: rate [1], natural log of the true over the stated rate of the loops.
        below: complex stiffness K without this effect, as a function of omega and amplitude.
        omega, amplitude: angular frequency [rad/s] and displacement amplitude X [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Complex stiffness with the effect [N/m or N m/rad], (..., n).

    Notes:
        K at the true angular frequency omega exp(rate) in loops, K in sweeps: error of a time base.

    >>> omega = stiffness({"rate": np.log(10.0)}, lambda omega, amplitude: omega, 1.0, 1e-3, loop)
    >>> round(float(omega), 6)
    10.0
    """
    return below(omega * np.exp(p["rate"]) if setting.kind == "loop" else omega, amplitude)


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """Force with a wrong clock in the loops.

    Args:
        p: parameter values by name: rate [1], natural log of the true over the stated rate of the loops.
        below: force F without this effect, as a function of the displacement history.
        history: displacement over time [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Force with the effect at each sample [N or N m], (..., n).

    Notes:
        F of the same motion at exp(rate) times the speed in loops, F in sweeps.
    """
    return below(history.faster(np.exp(p["rate"])) if setting.kind == "loop" else history)
