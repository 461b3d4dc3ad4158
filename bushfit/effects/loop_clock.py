"""Loop clock: the time of the loops runs at another rate than that of the sweeps."""

from __future__ import annotations

import numpy as np

from bushfit.effects.contract import Array, ForceBelow, Layer, Level, Parameter, Setting, StiffnessBelow, Values
from bushfit.effects.history import History


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """K at f exp(rate) in loops, K in sweeps [N/m or N m/rad]."""
    return below(omega * np.exp(p["rate"]) if setting.kind == "loop" else omega, amplitude)


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """The force of the same motion exp(rate) times as fast in loops [N or N m]."""
    return below(history.faster(np.exp(p["rate"])) if setting.kind == "loop" else history)


EFFECT = Layer(
    name="loop_clock",
    sentence="Loops ran at another rate than their time says: what depends on rate is off in loops, sweeps are right.",
    equation="K at f exp(rate) in loops",
    level=Level.INSTRUMENT,
    parameters=(Parameter("rate", "1", (-7.0, 7.0), 0.0, 0.3, meaning="logarithm of the true rate over the stated"),),
    source="error of a time base; scaling theorem of the Fourier transform",
    confirmed_by="time ten cycles of the loop by hand",
    frees=("ten_times_faster", "ten_times_slower", "sixty_times_faster", "sixty_times_slower", "milliseconds"),
    stiffness=stiffness,
    force=force,
)
