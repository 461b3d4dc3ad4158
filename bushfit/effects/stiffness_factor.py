"""Stiffness factor: one direction of the bushing, or one specimen, is off the others by one factor.

The law of all that scales the response of one place; `transducer_gain` and `preload_stiffening` have it, too.

>>> stiffness({"factor": 0.9}, spring, 1.0, 1e-4, sweep)
450000.0
"""

from bushfit.effects.contract import scaled_response

stiffness = force = scaled_response(lambda p, _: p["factor"])
