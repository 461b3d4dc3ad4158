"""Interface slip: dry friction at the bonded or pressed face of the bushing, and over the play if the model has one."""

import numpy as np

from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Value, Values
from bushfit.geometry import bushing_at


def _force(p: Values, setting: Setting) -> Value:
    """Friction force Fc at the sleeve [N], or in torsion its moment [N m] about the axis, at the outer radius."""
    bushing = bushing_at(setting.bushing, setting.direction)
    return p["force"] * (bushing.outer_radius if bushing and setting.direction.is_rotation else 1.0)


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """Complex stiffness with dry friction at the sleeve.

    Args:
        p: parameter values by name: force Fc [N], Coulomb friction at the sleeve.
        below: complex stiffness K without this effect, as a function of omega and amplitude.
        omega, amplitude: angular frequency [rad/s] and displacement amplitude X [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Complex stiffness with the effect [N/m or N m/rad], (..., n).

    Notes:
        K + i 4 Fc/(pi X), in torsion with the moment of Fc: describing function of Coulomb friction (A. Gelb, W. E.
        Vander Velde, Multiple-Input Describing Functions, 1968, app. B).

    >>> stiffness({"force": np.pi}, spring, 1.0, np.array([1e-4, 1e-3]), sweep).round()
    array([500000.+40000.j, 500000. +4000.j])
    """
    reached = np.maximum(amplitude, 1e-12)  # less than any test, and more than 0
    return below(omega, amplitude) + 4j * _force(p, setting) / (np.pi * reached)


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """Force with dry friction at the sleeve.

    Args:
        p: parameter values by name: force Fc [N], Coulomb friction at the sleeve.
        below: force F without this effect, as a function of the displacement history.
        history: displacement over time [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Force with the effect at each sample [N or N m], (..., n).

    Notes:
        F + Fc sgn(dx/dt), x the displacement; in torsion with the moment of Fc at the outer radius.
    """
    return below(history) + _force(p, setting) * history.sense
