"""Filler recovery: after a larger amplitude the filler network is still broken, and builds up again with time."""

import numpy as np

from bushfit.effects.contract import Condition, Value, Values, scaled_values


def adjust(p: Values, condition: Condition) -> dict[str, Value]:
    """sigma_fmax times 1 - share (1 - (e0/e_l)^2) exp(-t/tau), t since the last strain amplitude e_l larger than e0.

    Returns:
        The changed sigma_fmax; nothing if the history of the test is unknown.

    Notes:
        The solution of lambda' = (lambda_inf(e0) - lambda)/tau for the intact share lambda of the network, where the
    amplitude is held at e0 and was held at e_l long enough before.

    >>> from bushfit.effects.contract import Circumstances
    >>> model = paper.with_effect("filler_recovery", {"filler_recovery.share": 0.2})
    >>> model.values_at("axial", 25.0, 0.0, Circumstances(left=0.1, rested=0.0))["sigma_fmax"]
    11680.0
    """
    previous, rested = condition.setting.under.left, condition.setting.under.rested
    if previous is None or rested is None:
        return {}
    larger = np.maximum(condition.strain, previous)
    ratio = np.divide(condition.strain, larger, out=np.ones(np.shape(larger)), where=larger > 0.0)
    broken = p["share"] * (1.0 - np.square(ratio)) * np.exp(-np.asarray(rested) / p["tau"])
    return scaled_values(p, ("sigma_fmax",), 1.0 - broken)
