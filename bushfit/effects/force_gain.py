"""Force gain: the loop's force chain and the sweep's do not agree."""

from __future__ import annotations

from bushfit.effects.contract import Array, ForceBelow, Layer, Level, Parameter, Setting, StiffnessBelow, Value, Values
from bushfit.effects.history import History


def _factor(p: Values, setting: Setting) -> Value:
    """1 + gain in loops, 1 in sweeps."""
    return 1.0 + p["gain"] if setting.kind == "loop" else 1.0


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """(1 + gain) K in loops, K in sweeps [N/m]."""
    return _factor(p, setting) * below(omega, amplitude)


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """(1 + gain) F in loops, F in sweeps [N]."""
    return _factor(p, setting) * below(history)


EFFECT = Layer(
    name="force_gain",
    sentence="The loop's load cell reads another gain than the sweep's: the two tests disagree by one factor.",
    equation="(1 + gain) K in loops",
    level=Level.INSTRUMENT,
    parameters=(
        Parameter("gain", "1", (-0.5, 0.5), 0.0, 0.01, log=False, meaning="gain of the loop's chain over the sweep's"),
    ),
    source="sensitivity error of a force transducer, ISO 376:2011",
    confirmed_by="hang a known weight on the load cell in both chains",
    stiffness=stiffness,
    force=force,
)
