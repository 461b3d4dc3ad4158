"""Delay: the force is recorded later than the displacement."""

from __future__ import annotations

import numpy as np

from bushfit.effects.contract import Array, ForceBelow, Layer, Level, Parameter, Setting, StiffnessBelow, Values
from bushfit.effects.history import History


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """K exp(-i omega tau) [N/m]."""
    return below(omega, amplitude) * np.exp(-1j * np.asarray(omega) * p["tau"])


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """F(t - tau) [N]: every harmonic turned back in a steady cycle, straight lines between samples from rest."""
    undelayed = below(history)
    if history.periodic:
        turn = np.expm1(-1j * history.harmonics * p["tau"])
        return undelayed + np.fft.irfft(turn * np.fft.rfft(undelayed), n=undelayed.shape[-1])
    place = np.arange(undelayed.shape[-1] + 1.0)
    from_zero = np.concatenate([np.zeros_like(undelayed[..., :1]), undelayed], axis=-1)
    row_by_row = np.vectorize(np.interp, signature="(n),(m),(m)->(n)")
    return row_by_row(place[1:] - np.asarray(p["tau"]) / history.step, place, from_zero)


EFFECT = Layer(
    name="delay",
    sentence="The force channel lags: the loss factor falls in proportion to frequency, at every amplitude alike.",
    equation="K exp(-i omega tau)",
    level=Level.INSTRUMENT,
    parameters=(Parameter("tau", "s", (0.0, 1e-2), 0.0, 1e-4, meaning="time by which the force is late"),),
    source="shift theorem of the Fourier transform",
    confirmed_by="put a steel dummy in place of the bushing: its loss factor must be zero",
    stiffness=stiffness,
    force=force,
)
