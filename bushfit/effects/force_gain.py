"""Force gain: the loop's force chain and the sweep's do not agree."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from bushfit.effects.contract import Array, Layer, Level, Parameter, Values


def response(p: Values, below: Callable[..., Array], *motion_and_setting: Any) -> Array:
    """(1 + gain) times the response below in loops, that response in sweeps; K [N/m] and F [N] alike."""
    *motion, setting = motion_and_setting
    return (1.0 + p["gain"] if setting.kind == "loop" else 1.0) * below(*motion)


EFFECT = Layer(
    name="force_gain",
    sentence="The loop's load cell reads another gain than the sweep's: the two tests disagree by one factor.",
    equation="(1 + gain) K in loops",
    level=Level.INSTRUMENT,
    parameters=(Parameter("gain", "1", (-0.5, 0.5), 0.0, 0.01, meaning="gain of the loop's chain over the sweep's"),),
    source="sensitivity error of a force transducer, ISO 376:2011",
    confirmed_by="hang a known weight on the load cell in both chains",
    stiffness=response,
    force=response,
)
