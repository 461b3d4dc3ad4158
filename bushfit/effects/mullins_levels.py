"""Mullins over the levels: once strained further, rubber is softer at every smaller strain."""

import numpy as np
from scipy.special import erf

from bushfit.effects.contract import Condition, Value, Values, scaled_values


def adjust(p: Values, condition: Condition) -> dict[str, Value]:
    """Moduli and stresses [Pa] times 1 - share erf(1 - (e0/e_max)^2), with e_max the largest strain amplitude so far.

    Args:
        p: parameter values by name, with all moduli and stresses [Pa], share [1].
        condition: operating condition, with the strain amplitude e0 and the history of the test.

    Returns:
        The changed values by name; empty if the history of the test is unknown.

    >>> from bushfit.effects.contract import RubberConditions
    >>> model = paper.with_effect("mullins_levels", {"mullins_levels.share": 0.2})
    >>> round(model.values_at("axial", 25.0, 0.0, RubberConditions(largest_strain=0.1))["mu"])
    906291
    """
    before = condition.setting.conditions.largest_strain
    if before is None:
        return {}
    largest = np.maximum(condition.strain, before)
    ratio = np.divide(condition.strain, largest, out=np.ones(np.shape(largest)), where=largest > 0.0)
    return scaled_values(p, condition.moduli, 1.0 - p["share"] * erf(1.0 - np.square(ratio)))
