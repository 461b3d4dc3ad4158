"""Amplitude roll-off: the rig does not reach the amplitude it was asked for at high frequency."""

import numpy as np

from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Value, Values

#: Frequency at which the amplitude has lost the share c [Hz]: the highest of the paper's sweeps.
_HIGHEST_FREQUENCY = 155.0


def _share(p: Values, omega: Array | float) -> Value:
    """1 - c (f/155 Hz)^2, at least 5 %: the law must not reverse the motion."""
    ratio = np.asarray(omega) / (2.0 * np.pi * _HIGHEST_FREQUENCY)
    return np.maximum(1.0 - p["c"] * ratio**2, 0.05)


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """Complex stiffness with a rig that falls short of the amplitude at high frequency.

    Args:
        p: values of c [1].
        below, omega, amplitude, setting: see `contract.Layer`.

    Returns:
        (..., n) [N/m or N m/rad].

    Notes:
        K at the amplitude X (1 - c (f/155 Hz)^2).

    >>> reached = stiffness({"c": 0.05}, lambda omega, amplitude: amplitude, 2.0 * np.pi * 155.0, 1e-3, sweep)
    >>> float(reached)
    0.00095
    """
    return below(omega, amplitude * _share(p, omega))


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """Force with a rig that falls short of the amplitude at high frequency.

    Args:
        p: values of c [1].
        below, history, setting: see `contract.Layer`.

    Returns:
        (..., n) [N or N m].

    Notes:
        F of the true motion, scaled as the rig's stiffness is: by the motion asked for over the true one.
    """
    share = _share(p, history.omega)
    return below(history.with_value(history.value * share)) / share
