"""Strain scale: the strain of one direction of the bushing, or of one specimen, differs from its formula."""

from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Values


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """Complex stiffness if the strain is `scale` times the strain of the formula.

    Args:
        p: parameter values by name: scale [1], strain over that of the formula.
        below: complex stiffness K without this effect, as a function of omega and amplitude.
        omega, amplitude: angular frequency [rad/s] and displacement amplitude X [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Complex stiffness with the effect [N/m or N m/rad], (..., n).

    Notes:
        K at the amplitude scale X: one strain represents an uneven strain field (Garcia Tarrago et al. 2007, Eq. 8).

    >>> stiffness({"scale": 2.0}, lambda omega, amplitude: amplitude, 1.0, 1e-4, sweep)  # the amplitude counted
    0.0002
    """
    return below(omega, p["scale"] * amplitude)


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """Force if the strain is `scale` times the strain of the formula.

    Args:
        p: parameter values by name: scale [1], strain over that of the formula.
        below: force F without this effect, as a function of the displacement history.
        history: displacement over time [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Force with the effect at each sample [N or N m], (..., n).

    Notes:
        F(scale x)/scale for the displacement x: the strain is scaled, and the stiffness formula is unchanged.
    """
    return below(history.with_value(p["scale"] * history.value)) / p["scale"]
