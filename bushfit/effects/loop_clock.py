"""Loop clock: the time of the loops runs at another rate than that of the sweeps."""

import numpy as np

from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Values


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """Complex stiffness with a wrong clock in the loops.

    Args:
        p: values of rate [1].
        below, omega, amplitude, setting: see `contract.Layer`.

    Returns:
        (..., n) [N/m or N m/rad].

    Notes:
        K at f exp(rate) in loops, K in sweeps.

    >>> omega = stiffness({"rate": np.log(10.0)}, lambda omega, amplitude: omega, 1.0, 1e-3, loop)
    >>> round(float(omega), 6)
    10.0
    """
    return below(omega * np.exp(p["rate"]) if setting.kind == "loop" else omega, amplitude)


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """Force with a wrong clock in the loops.

    Args:
        p: values of rate [1].
        below, history, setting: see `contract.Layer`.

    Returns:
        (..., n) [N or N m].

    Notes:
        The force of the same motion exp(rate) times as fast in loops.
    """
    return below(history.faster(np.exp(p["rate"])) if setting.kind == "loop" else history)
