"""Drift: the gain of the force chain moves with time over the session."""

from functools import partial

import numpy as np

from bushfit.effects.contract import Setting, Value, Values, scaled_response


def _gain(p: Values, setting: Setting) -> Value:
    """1 + gain t, t from 0 at the first point of the session to 1 at the last; 1 where that is not known.

    >>> from bushfit.effects.contract import Circumstances
    >>> float(_gain({"gain": 0.02}, Setting(None, "axial", "sweep", Circumstances(turn=0.5))))
    1.01
    """
    turn = setting.under.turn
    return 1.0 if turn is None else 1.0 + p["gain"] * np.asarray(turn)


stiffness = force = partial(scaled_response, _gain)
