"""Stiffness factor: one direction of the bushing, or one specimen, is off the others by one factor.

`transducer_gain` and `preload_stiffening` have the same equation.

>>> stiffness({"factor": 0.9}, spring, 1.0, 1e-4, sweep)
450000.0
"""

from functools import partial

from bushfit.effects.contract import Setting, Value, Values, scaled_response


def _factor(p: Values, setting: Setting) -> Value:
    return p["factor"]


stiffness = force = partial(scaled_response, _factor)
