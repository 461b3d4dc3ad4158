"""Force gain: the loop's force chain and the sweep's do not agree; loops are 1 + gain times what they should be.

>>> stiffness({"gain": 0.02}, spring, 1.0, 1e-4, loop), stiffness({"gain": 0.02}, spring, 1.0, 1e-4, sweep)
(510000.0, 500000.0)
"""

from functools import partial

from bushfit.effects.contract import Setting, Value, Values, scaled_response


def _gain(p: Values, setting: Setting) -> Value:
    return 1.0 + p["gain"] if setting.kind == "loop" else 1.0


stiffness = force = partial(scaled_response, _gain)
