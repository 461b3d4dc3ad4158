"""Mullins over the levels: once strained further, rubber is softer at every smaller strain."""

import numpy as np
from scipy.special import erf

from bushfit.effects.contract import Condition, Value, Values, scaled_values


def adjust(p: Values, condition: Condition) -> dict[str, Value]:
    """All moduli and stresses times 1 - share erf(1 - (e0/e_max)^2), e_max the largest strain amplitude so far.

    Where it is not known what went before, no larger one did, and nothing changes.

    >>> from bushfit.effects.contract import Circumstances
    >>> model = paper.with_effect("mullins_levels", {"mullins_levels.share": 0.2})
    >>> round(model.values_at("axial", 25.0, 0.0, Circumstances(strained=0.1))["mu"])
    906291
    """
    before = condition.setting.under.strained
    if before is None:
        return {}
    largest = np.maximum(condition.strain, before)
    ratio = np.divide(condition.strain, largest, out=np.ones(np.shape(largest)), where=largest > 0.0)
    return scaled_values(p, condition.moduli, 1.0 - p["share"] * erf(1.0 - np.square(ratio)))
