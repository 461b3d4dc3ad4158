"""Loop clock: the time of the loops runs at another rate than that of the sweeps."""

import numpy as np

from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Values


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """K at f exp(rate) in loops, K in sweeps [N/m or N m/rad].

    >>> omega = stiffness({"rate": np.log(10.0)}, lambda omega, amplitude: omega, 1.0, 1e-3, loop)
    >>> round(float(omega), 6)
    10.0
    """
    return below(omega * np.exp(p["rate"]) if setting.kind == "loop" else omega, amplitude)


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """The force of the same motion exp(rate) times as fast in loops [N or N m]."""
    return below(history.faster(np.exp(p["rate"])) if setting.kind == "loop" else history)
