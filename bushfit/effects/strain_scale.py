"""Strain scale: one direction of the bushing, or one specimen, is strained more or less than its formula says."""

from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Values


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """Complex stiffness with another strain than that of the formula.

    Args:
        p: values of scale [1].
        below, omega, amplitude, setting: see `contract.Layer`.

    Returns:
        (..., n) [N/m or N m/rad].

    Notes:
        K at the amplitude scale X.

    >>> stiffness({"scale": 2.0}, lambda omega, amplitude: amplitude, 1.0, 1e-4, sweep)  # the amplitude counted
    0.0002
    """
    return below(omega, p["scale"] * amplitude)


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """Force with another strain than that of the formula.

    Args:
        p: values of scale [1].
        below, history, setting: see `contract.Layer`.

    Returns:
        (..., n) [N or N m].

    Notes:
        F of scale times the motion, over scale: the stiffness is as it was, at another strain.
    """
    return below(history.with_value(p["scale"] * history.value)) / p["scale"]
