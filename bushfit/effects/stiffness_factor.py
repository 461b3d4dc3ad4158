"""Stiffness factor: one direction of the bushing, or one specimen, is off the others by one factor.

The law of all that scales the response of one place; `transducer_gain` and `preload_stiffening` have it, too.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any

from bushfit.effects.contract import Array, Family, Layer, Level, Parameter, Values, only_at
from bushfit.geometry import Direction


def scaled(p: Values, below: Callable[..., Array], *motion: Any) -> Array:
    """The factor times the response below; K [N/m] and F [N] alike. `motion` ends with the setting."""
    return p["factor"] * below(*motion[:-1])


@lru_cache
def of_place(place: str) -> Layer:
    """The effect of one place: a direction of the bushing, or a specimen by its name."""
    is_radial = place == Direction.RADIAL
    sentence = "Radial stiffness is off the formula for this shape by one factor, loss factor and all else being right."
    if not is_radial:
        sentence = f"The stiffness of {place} is off what its dimensions say by one factor, all else being right."
    return Layer(
        name=f"stiffness_factor.{place}",
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
        confirmed_by="swap the load cell, or hang a known weight on it, and repeat the first test last"
        + (
            "; a finite element solution of this shape"
            if is_radial
            else "; measure the dimensions, test a second specimen"
        ),
        corrects=place,
        twins=(f"transducer_gain.{place}", f"preload_stiffening.{place}"),
        stiffness=partial(only_at, place, scaled),
        force=partial(only_at, place, scaled),
    )


FAMILY = Family("stiffness_factor", of_place)
EFFECT = of_place(Direction.RADIAL.value)
