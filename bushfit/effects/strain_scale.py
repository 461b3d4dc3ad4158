"""Strain scale: one direction of the bushing, or one specimen, is strained more or less than its formula says."""

from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Values


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """K at the amplitude scale X [N/m].

    >>> stiffness({"scale": 2.0}, lambda omega, amplitude: amplitude, 1.0, 1e-4, sweep)  # the amplitude counted
    0.0002
    """
    return below(omega, p["scale"] * amplitude)


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """F of scale times the motion, over scale [N]: the stiffness is as it was, at another strain."""
    return below(history.with_value(p["scale"] * history.value)) / p["scale"]
