"""Stiffness factor: one direction of the bushing, or one specimen, is off the others by one factor.

`transducer_gain` and `preload_stiffening` have the same equation.

>>> stiffness({"factor": 0.9}, spring, 1.0, 1e-4, sweep)
450000.0
"""

from functools import partial

from bushfit.effects.contract import scaled_response

stiffness = force = partial(scaled_response, lambda p, _: p["factor"])
