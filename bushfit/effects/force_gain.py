"""Force gain: the force channels of loops and sweeps disagree; loops are 1 + gain times stiffer."""

from bushfit.effects.contract import Setting, Value, Values


def response_factor(p: Values, setting: Setting) -> Value:
    """Ratio of recorded to true force: 1 + gain in loops, 1 in sweeps.

    Args:
        p: parameter values by name: gain [1].
        setting: the test: bushing, direction and kind (sweep or loop).

    Notes: sensitivity error of a force transducer, ISO 376:2011.

    >>> response_factor({"gain": 0.02}, loop), response_factor({"gain": 0.02}, sweep)
    (1.02, 1.0)
    """
    return 1.0 + p["gain"] if setting.kind == "loop" else 1.0
