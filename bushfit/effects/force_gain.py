"""Force gain: the loop's force chain and the sweep's do not agree."""

from collections.abc import Callable
from typing import Any

from bushfit.effects.contract import Array, Values


def response(p: Values, below: Callable[..., Array], *motion_and_setting: Any) -> Array:
    """(1 + gain) times the response below in loops, that response in sweeps; K [N/m] and F [N] alike."""
    *motion, setting = motion_and_setting
    return (1.0 + p["gain"] if setting.kind == "loop" else 1.0) * below(*motion)


stiffness = force = response
