"""Interface slip: dry friction at the bonded or pressed face of the bushing, over its play too if there is any."""

import numpy as np

from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Value, Values


def _force(p: Values, setting: Setting) -> Value:
    """The slip force [N], or its moment about the axis in torsion, at the outer sleeve's face [N m]."""
    arm = setting.bushing.outer_radius if setting.bushing and setting.direction.is_rotation else 1.0
    return p["force"] * arm


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """Complex stiffness with dry friction at the sleeve.

    Args:
        p: values of force [N].
        below, omega, amplitude, setting: see `contract.Layer`.

    Returns:
        (..., n) [N/m or N m/rad].

    Notes:
        K + i 4 Fc/(pi X).

    >>> stiffness({"force": np.pi}, spring, 1.0, np.array([1e-4, 1e-3]), sweep).round()
    array([500000.+40000.j, 500000. +4000.j])
    """
    reached = np.maximum(amplitude, 1e-12)  # less than any test, and more than 0
    return below(omega, amplitude) + 4j * _force(p, setting) / (np.pi * reached)


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """Force with dry friction at the sleeve.

    Args:
        p: values of force [N].
        below, history, setting: see `contract.Layer`.

    Returns:
        (..., n) [N or N m].

    Notes:
        F + Fc sgn(dx/dt).
    """
    return below(history) + _force(p, setting) * history.sense
