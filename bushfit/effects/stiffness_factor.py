"""Stiffness factor: one direction of the bushing, or one specimen, is off the others by one factor.

The law of all that scales the response of one place; `transducer_gain` and `preload_stiffening` have it, too.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from bushfit.effects.contract import Array, Family, Layer, Level, Parameter, Values


def scaled(p: Values, below: Callable[..., Array], *motion: Any) -> Array:
    """The factor times the response below; K [N/m] and F [N] alike. `motion` ends with the setting."""
    return p["factor"] * below(*motion[:-1])


_CHECK = "swap the load cell, or hang a known weight on it, and repeat the first test last; "
FAMILY = Family(
    Layer(
        name="stiffness_factor",
        sentence="The stiffness of {place} is off what its dimensions say by one factor, all else being right.",
        equation="factor K, {place} only",
        level=Level.COMPONENT,
        parameters=(
            Parameter(
                "factor", "1", (0.6, 1.4), 1.0, 0.05, meaning="stiffness of {place} over what its dimensions say"
            ),
        ),
        source="specimens of one compound differ by some per cent, and dimensions are known to some per cent",
        confirmed_by=_CHECK + "measure the dimensions, test a second specimen",
        corrects="{place}",
        twins=("transducer_gain.{place}", "preload_stiffening.{place}"),
        stiffness=scaled,
        force=scaled,
    ),
    radial={
        "sentence": "Radial stiffness is off the formula for this shape by one factor, loss factor and all else being "
        "right.",
        "source": "Eqs. 11, 12 against finite elements: -6 to +20 % by shape, within 1 % where shape is calibrated",
        "confirmed_by": _CHECK + "a finite element solution of this shape",
    },
)
