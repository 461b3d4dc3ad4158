"""Radial factor: the radial stiffness of this shape is off the formula by one factor."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from bushfit.effects.contract import Array, Layer, Level, Parameter, Values
from bushfit.geometry import Direction


def response(p: Values, below: Callable[..., Array], *motion_and_setting: Any) -> Array:
    """(1 + excess) times the response below radially, that response in other directions; K [N/m] and F [N] alike."""
    *motion, setting = motion_and_setting
    return (1.0 + p["excess"] if setting.direction is Direction.RADIAL else 1.0) * below(*motion)


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
    stiffness=response,
    force=response,
)
