"""Drift: the gain of the force chain moves with time over the session."""

from collections.abc import Callable
from typing import Any

import numpy as np

from bushfit.effects.contract import Array, Values


def response(p: Values, below: Callable[..., Array], *motion_and_setting: Any) -> Array:
    """(1 + gain t) times the response below, t from 0 at the first point of the session to 1 at the last."""
    *motion, setting = motion_and_setting
    turn = setting.under.turn
    return (1.0 if turn is None else 1.0 + p["gain"] * np.asarray(turn)) * below(*motion)


stiffness = force = response
