"""Force offset: the load cell does not read zero at zero force."""

from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Values


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """K [N/m]: a constant has no first harmonic."""
    return below(omega, amplitude)


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """F + offset [N]; the torque cell is another one, so not in torsion.

    >>> motion = History.steady(np.array([1e-3, -1e-3]), 1.0)
    >>> force({"offset": 5.0}, lambda history: 5e5 * history.value, motion, loop)
    array([ 505., -495.])
    """
    return below(history) + p["offset"]
