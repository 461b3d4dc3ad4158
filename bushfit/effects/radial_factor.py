"""Radial factor: the radial stiffness of this shape is off the formula by one factor."""

from __future__ import annotations

from bushfit.effects.contract import Array, ForceBelow, Layer, Level, Parameter, Setting, StiffnessBelow, Value, Values
from bushfit.effects.history import History
from bushfit.geometry import Direction


def _factor(p: Values, setting: Setting) -> Value:
    """1 + excess radially, 1 in the other directions."""
    return 1.0 + p["excess"] if setting.direction is Direction.RADIAL else 1.0


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """(1 + excess) K radially, K in the other directions [N/m]."""
    return _factor(p, setting) * below(omega, amplitude)


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """(1 + excess) F radially, F in the other directions [N]."""
    return _factor(p, setting) * below(history)


EFFECT = Layer(
    name="radial_factor",
    sentence="Radial stiffness is off the formula for this shape by one factor, loss factor and all else being right.",
    equation="(1 + excess) K radially",
    level=Level.COMPONENT,
    parameters=(
        Parameter(
            "excess",
            "1",
            (-0.4, 0.4),
            0.0,
            0.05,
            log=False,
            meaning="radial stiffness over the formula's, less 1",
        ),
    ),
    source="Eqs. 11, 12 against finite elements: -0.7 to +9.7 % over 14 shapes",
    confirmed_by="a finite element solution of this shape, or the radial rig's load cell against a known weight",
    corrects=Direction.RADIAL,
    stiffness=stiffness,
    force=force,
)
