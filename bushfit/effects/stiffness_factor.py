"""Stiffness factor: one direction of the bushing, or one specimen, is off the others by one factor.

The law of all that scales the response of one place; `transducer_gain` and `preload_stiffening` have it, too.
"""

from collections.abc import Callable
from typing import Any

from bushfit.effects.contract import Array, Values


def scaled(p: Values, below: Callable[..., Array], *motion: Any) -> Array:
    """The factor times the response below; K [N/m] and F [N] alike. `motion` ends with the setting."""
    return p["factor"] * below(*motion[:-1])


stiffness = force = scaled
