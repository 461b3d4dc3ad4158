"""Force gain: the force channels of loops and sweeps disagree; stiffness and force in loops are 1 + gain times larger.

Parameter: gain [1]. Source: sensitivity error of a force transducer, ISO 376:2011.

>>> stiffness({"gain": 0.02}, spring, 1.0, 1e-4, loop), stiffness({"gain": 0.02}, spring, 1.0, 1e-4, sweep)
(510000.0, 500000.0)
"""

from functools import partial

from bushfit.effects.contract import scaled_response

stiffness = force = partial(scaled_response, lambda p, setting: 1.0 + p["gain"] if setting.kind == "loop" else 1.0)
