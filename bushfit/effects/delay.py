"""Delay: the force is recorded later than the displacement, or the displacement later than the force."""

import numpy as np

from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Values


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """Complex stiffness with a delay between force and displacement.

    Args:
        p: parameter values by name: tau [s], delay of the force (if negative, of the displacement).
        below: complex stiffness K without this effect, as a function of omega and amplitude.
        omega, amplitude: angular frequency [rad/s] and displacement amplitude X [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Complex stiffness with the effect [N/m or N m/rad], (..., n).

    Notes:
        K exp(-i omega tau), by the shift theorem of the Fourier transform.

    >>> float(np.angle(stiffness({"tau": 1e-4}, spring, 1000.0, 1e-4, sweep)).round(6))
    -0.1
    """
    return below(omega, amplitude) * np.exp(-1j * np.asarray(omega) * p["tau"])


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """Force with a delay between force and displacement.

    Args:
        p: parameter values by name: tau [s], delay of the force (if negative, of the displacement).
        below: force F without this effect, as a function of the displacement history.
        history: displacement over time [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Force with the effect at each sample [N or N m], (..., n).

    Notes:
        F(t - tau): by the phase of every harmonic in a steady cycle, by linear interpolation from rest.

        For tau < 0, the force after the last sample is taken from the same phase of the last cycle.
    """
    undelayed = below(history)
    if history.periodic:
        return undelayed + history.with_value(undelayed).response(lambda omega: np.expm1(-1j * omega * p["tau"]))
    place = np.arange(undelayed.shape[-1] + 1.0)
    from_zero = np.concatenate([np.zeros_like(undelayed[..., :1]), undelayed], axis=-1)
    row_by_row = np.vectorize(np.interp, signature="(n),(m),(m)->(n)")
    delayed, cycle = place[1:] - np.asarray(p["tau"]) / history.step, 1.0 / (history.frequency * history.step)
    extra_cycles = np.ceil(np.maximum(delayed - place[-1], 0.0) / cycle)
    return row_by_row(delayed - extra_cycles * cycle, place, from_zero)
