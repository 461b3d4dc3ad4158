"""Force offset: the load cell does not read zero at zero force."""

from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Values


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """Complex stiffness with an offset of the load cell.

    Args:
        p: parameter values by name: offset [N], reading of the load cell at zero force.
        below: complex stiffness K without this effect, as a function of omega and amplitude.
        omega, amplitude: angular frequency [rad/s] and displacement amplitude X [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Complex stiffness with the effect [N/m or N m/rad], (..., n).

    Notes:
        K is unchanged, because a constant has no first harmonic.
    """
    return below(omega, amplitude)


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """Force with an offset of the load cell.

    Args:
        p: parameter values by name: offset [N], reading of the load cell at zero force.
        below: force F without this effect, as a function of the displacement history.
        history: displacement over time [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Force with the effect at each sample [N or N m], (..., n).

    Notes:
        F + offset (zero error of a force transducer, ISO 376:2011); not in torsion, which has a torque cell.

    >>> motion = History.steady(np.array([1e-3, -1e-3]), 1.0)
    >>> force({"offset": 5.0}, lambda history: 5e5 * history.value, motion, loop)
    array([ 505., -495.])
    """
    return below(history) + p["offset"]
