"""Drift: the gain of the force chain moves with time over the session."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from bushfit.effects.contract import Array, Layer, Level, Parameter, Values


def response(p: Values, below: Callable[..., Array], *motion_and_setting: Any) -> Array:
    """(1 + gain t) times the response below, t from 0 at the first point of the session to 1 at the last."""
    *motion, setting = motion_and_setting
    turn = setting.under.turn
    return (1.0 if turn is None else 1.0 + p["gain"] * np.asarray(turn)) * below(*motion)


EFFECT = Layer(
    name="drift",
    sentence="The measured force drifts evenly over the session, in the order in which the tests are listed.",
    equation="(1 + gain t) K, t from 0 at the first point to 1 at the last",
    level=Level.INSTRUMENT,
    parameters=(Parameter("gain", "1", (-0.5, 0.5), 0.0, 0.02, meaning="gain of the last point over the first"),),
    source="sensitivity drift of a force transducer, ISO 376:2011; of a warming rig or bushing likewise",
    confirmed_by="repeat the first test last",
    under=("turn",),
    stiffness=response,
    force=response,
)
