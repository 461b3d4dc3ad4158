"""Stiffness factor: stiffness and force of one direction, or one specimen, are multiplied by one factor.

Parameter: factor [1], measured over computed stiffness. `transducer_gain` and `preload_stiffening` have the same
equation, for a wrong load cell (ISO 376:2011) and for a preload.

>>> stiffness({"factor": 0.9}, spring, 1.0, 1e-4, sweep)
450000.0
"""

from functools import partial

from bushfit.effects.contract import scaled_response

stiffness = force = partial(scaled_response, lambda p, _: p["factor"])
