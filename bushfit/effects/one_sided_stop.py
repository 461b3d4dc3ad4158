"""One-sided stop: a spring that the bushing touches beyond a gap, in one sense of motion only."""

import numpy as np

from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Values
from bushfit.effects.dead_zone import first_harmonic


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """Complex stiffness with a stop on one side beyond a gap.

    Args:
        p: parameter values by name: gap [m], free travel in the positive sense, and stiffness k [N/m] of the stop. The
            effect is not used in torsion.
        below: complex stiffness K without this effect, as a function of omega and amplitude.
        omega, amplitude: angular frequency [rad/s] and displacement amplitude X [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Complex stiffness with the effect [N/m or N m/rad], (..., n).

    Notes:
        K + k N(gap/X)/2, with the describing function N of a dead zone (`dead_zone.first_harmonic`; A. Gelb, W. E.
        Vander Velde, Multiple-Input Describing Functions, 1968, app. B): half the effect of stops on both sides.

    >>> stiffness({"gap": 1e-3, "stiffness": 1e6}, spring, 1.0, np.array([1e-3, 2e-3, 1.0]), sweep).round()
    array([500000., 695501., 999363.])
    """
    return below(omega, amplitude) + 0.5 * p["stiffness"] * first_harmonic(amplitude, p["gap"])


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """Force with a stop on one side beyond a gap.

    Args:
        p: parameter values by name: gap [m], free travel in the positive sense, and stiffness k [N/m] of the stop. The
            effect is not used in torsion.
        below: force F without this effect, as a function of the displacement history.
        history: displacement over time [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Force with the effect at each sample [N or N m], (..., n).

    Notes:
        F + k (x - gap) for displacements x above gap; adds a mean force and overtones.
    """
    return below(history) + p["stiffness"] * np.maximum(history.value - p["gap"], 0.0)
