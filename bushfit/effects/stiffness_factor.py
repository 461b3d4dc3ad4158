"""Stiffness factor: one direction of the bushing, or one specimen, is off the others by one factor."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any

from bushfit.effects.contract import Array, Layer, Level, Parameter, Values
from bushfit.geometry import Direction

#: The name of this kind of effect; of an effect, the place that it belongs to follows after a dot.
FAMILY = "stiffness_factor"


def response(place: str, p: Values, below: Callable[..., Array], *motion_and_setting: Any) -> Array:
    """The factor times the response below at the place, that response elsewhere; K [N/m] and F [N] alike."""
    *motion, setting = motion_and_setting
    return (p["factor"] if str(setting.direction) == place else 1.0) * below(*motion)


@lru_cache
def stiffness_factor(place: str) -> Layer:
    """The effect of one place: a direction of the bushing, or a specimen by its name."""
    is_radial = place == Direction.RADIAL
    sentence = "Radial stiffness is off the formula for this shape by one factor, loss factor and all else being right."
    if not is_radial:
        sentence = f"The stiffness of {place} is off what its dimensions say by one factor, all else being right."
    return Layer(
        name=f"{FAMILY}.{place}",
        sentence=sentence,
        equation=f"factor K, {place} only",
        level=Level.COMPONENT,
        parameters=(
            Parameter(
                "factor", "1", (0.6, 1.4), 1.0, 0.05, meaning=f"stiffness of {place} over what its dimensions say"
            ),
        ),
        source="Eqs. 11, 12 against finite elements: -6 to +20 % by shape, within 1 % where shape is calibrated"
        if is_radial
        else "specimens of one compound differ by some per cent, and dimensions are known to some per cent",
        confirmed_by="a finite element solution of this shape, or the radial rig's load cell against a known weight"
        if is_radial
        else "the load cell against a known weight, the dimensions measured again, and a second specimen",
        corrects=place,
        stiffness=partial(response, place),
        force=partial(response, place),
    )


EFFECT = stiffness_factor(Direction.RADIAL.value)
