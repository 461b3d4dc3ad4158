"""Inertia: the mass that moves between the bushing and the load cell."""

import numpy as np

from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Values


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """Complex stiffness with a mass between bushing and load cell.

    Args:
        p: parameter values by name: mass M [kg] that moves between bushing and load cell.
        below: complex stiffness K without this effect, as a function of omega and amplitude.
        omega, amplitude: angular frequency [rad/s] and displacement amplitude X [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Complex stiffness with the effect [N/m or N m/rad], (..., n).

    Notes:
        K - M omega^2 (ISO 10846-2:2008); does not act in torsion.

    >>> round(stiffness({"mass": 0.1}, spring, 1000.0, 1e-4, sweep))
    400000
    """
    return below(omega, amplitude) - p["mass"] * np.asarray(omega) ** 2


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """Force with a mass between bushing and load cell.

    Args:
        p: parameter values by name: mass M [kg] that moves between bushing and load cell.
        below: force F without this effect, as a function of the displacement history.
        history: displacement over time [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Force with the effect at each sample [N or N m], (..., n).

    Notes:
        F + M d2x/dt2, x the displacement; exact in every harmonic of a steady cycle, second differences from rest.
    """
    if history.periodic:
        return below(history) + history.response(lambda omega: -p["mass"] * omega**2)
    return below(history) + p["mass"] * history.acceleration
