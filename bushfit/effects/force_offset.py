"""Force offset: the load cell does not read zero at zero force."""

from __future__ import annotations

from bushfit.effects.contract import Array, ForceBelow, Layer, Level, Parameter, Setting, StiffnessBelow, Values
from bushfit.effects.history import History


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """K [N/m]: a constant has no first harmonic."""
    return below(omega, amplitude)


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """F + offset [N]; the torque cell is another one, so not in torsion."""
    return below(history) + p["offset"]


EFFECT = Layer(
    name="force_offset",
    sentence="The load cell's zero is off: loops sit higher or lower, sweeps show nothing of it.",
    equation="K",
    level=Level.INSTRUMENT,
    parameters=(Parameter("offset", "N", (-1e5, 1e5), 0.0, 5.0, meaning="reading at zero force"),),
    source="zero error of a force transducer, ISO 376:2011",
    confirmed_by="read the load cell with no bushing mounted",
    turns=False,
    stiffness=stiffness,
    force=force,
)
