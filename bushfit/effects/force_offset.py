"""Force offset: the load cell does not read zero at zero force."""

from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Values


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """K [N/m]: a constant has no first harmonic."""
    return below(omega, amplitude)


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """F + offset [N]; the torque cell is another one, so not in torsion."""
    return below(history) + p["offset"]
