"""Drift: the gain of the force chain drifts over the session, evenly or with the logarithm of time.

Warming up and wear cause an even drift. Settling under a preload (of a clamp, an adhesive or the bushing itself)
follows the logarithm of time.
"""

import numpy as np

from bushfit.effects.contract import Setting, Value, Values


def response_factor(p: Values, setting: Setting) -> Value:
    """Ratio of recorded to true force, which drifts over the session: 1 + gain ln(1 + t/onset)/ln(1 + 1/onset).

    Args:
        p: parameter values by name: gain [1] of the last point relative to the first, and onset [1], the share of the
            session after which the drift follows the logarithm of time; above 1 the drift is even.
        setting: the test, with its time t as a share of the session (0 first, 1 last point); the ratio is 1 without t.

    Notes: sensitivity drift of a force transducer, ISO 376:2011, or of a rig or bushing that warms up.

    >>> from bushfit.effects.contract import RubberConditions
    >>> halfway = Setting(None, "axial", "sweep", RubberConditions(session_time=0.5))
    >>> float(response_factor({"gain": 0.02, "onset": 1e6}, halfway).round(6))
    1.01
    >>> float(response_factor({"gain": 0.02, "onset": 0.01}, halfway).round(6))
    1.017039
    """
    session_time = setting.conditions.session_time
    if session_time is None:
        return 1.0
    return 1.0 + p["gain"] * np.log1p(np.asarray(session_time) / p["onset"]) / np.log1p(1.0 / p["onset"])
