"""Inertia: the mass that moves between the bushing and the load cell."""

import numpy as np

from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Values


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """Complex stiffness with a mass between bushing and load cell.

    Args:
        p: values of mass [kg].
        below, omega, amplitude, setting: see `contract.Layer`.

    Returns:
        (..., n) [N/m or N m/rad].

    Notes:
        K - M omega^2; a mass that is moved, not turned, does not act in torsion.

    >>> round(stiffness({"mass": 0.1}, spring, 1000.0, 1e-4, sweep))
    400000
    """
    return below(omega, amplitude) - p["mass"] * np.asarray(omega) ** 2


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """Force with a mass between bushing and load cell.

    Args:
        p: values of mass [kg].
        below, history, setting: see `contract.Layer`.

    Returns:
        (..., n) [N or N m].

    Notes:
        F + M d2x/dt2; exact in every harmonic of a steady cycle, second differences from rest.
    """
    if history.periodic:
        return below(history) + history.response(lambda omega: -p["mass"] * omega**2)
    return below(history) + p["mass"] * history.acceleration
