"""Amplitude roll-off: the rig does not reach the requested amplitude at high frequency."""

import numpy as np

from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Value, Values

#: Frequency at which the amplitude is reduced by the share c [Hz]: the highest of the paper's sweeps.
_HIGHEST_FREQUENCY = 155.0


def _share(p: Values, omega: Array | float) -> Value:
    """Ratio of the true to the requested amplitude, 1 - c (f/155 Hz)^2, at least 0.05."""
    ratio = np.asarray(omega) / (2.0 * np.pi * _HIGHEST_FREQUENCY)
    return np.maximum(1.0 - p["c"] * ratio**2, 0.05)


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """Complex stiffness with a rig that does not reach the requested amplitude at high frequency.

    Args:
        p: parameter values by name: c [1], share of the amplitude that is lost at 155 Hz.
        below: complex stiffness K without this effect, as a function of omega and amplitude.
        omega, amplitude: angular frequency [rad/s] and displacement amplitude X [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Complex stiffness with the effect [N/m or N m/rad], (..., n).

    Notes:
        K at the true amplitude X (1 - c (f/155 Hz)^2), at least 0.05 X, with f = omega/(2 pi): first term of the series
        of a second-order low-pass, as a servo-hydraulic rig has it.

    >>> reached = stiffness({"c": 0.05}, lambda omega, amplitude: amplitude, 2.0 * np.pi * 155.0, 1e-3, sweep)
    >>> float(reached)
    0.00095
    """
    return below(omega, amplitude * _share(p, omega))


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """Force with a rig that does not reach the requested amplitude at high frequency.

    Args:
        p: parameter values by name: c [1], share of the amplitude that is lost at 155 Hz.
        below: force F without this effect, as a function of the displacement history.
        history: displacement over time [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Force with the effect at each sample [N or N m], (..., n).

    Notes:
        F of the true motion over the ratio of true to requested amplitude, so that force over displacement is K.
    """
    share = _share(p, history.omega)
    return below(history.with_value(history.value * share)) / share
