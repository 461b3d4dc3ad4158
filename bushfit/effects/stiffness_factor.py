"""Stiffness factor: stiffness and force of one direction, or one specimen, are multiplied by one factor.

`transducer_gain` and `preload_stiffening` have the same equation, for a wrong load cell (ISO 376:2011) and for a
preload.
"""

from bushfit.effects.contract import Setting, Value, Values


def response_factor(p: Values, setting: Setting) -> Value:
    """Ratio of measured to computed stiffness: the parameter factor [1].

    >>> response_factor({"factor": 0.9}, sweep)
    0.9
    """
    return p["factor"]
