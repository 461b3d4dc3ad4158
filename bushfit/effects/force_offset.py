"""Force offset: the load cell does not read zero at zero force."""

from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Values


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """Complex stiffness with an offset of the load cell.

    Args:
        p: values of offset [N].
        below, omega, amplitude, setting: see `contract.Layer`.

    Returns:
        (..., n) [N/m or N m/rad].

    Notes:
        K: a constant has no first harmonic.
    """
    return below(omega, amplitude)


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """Force with an offset of the load cell.

    Args:
        p: values of offset [N].
        below, history, setting: see `contract.Layer`.

    Returns:
        (..., n) [N or N m].

    Notes:
        F + offset; the torque cell is another one, so not in torsion.

    >>> motion = History.steady(np.array([1e-3, -1e-3]), 1.0)
    >>> force({"offset": 5.0}, lambda history: 5e5 * history.value, motion, loop)
    array([ 505., -495.])
    """
    return below(history) + p["offset"]
