"""Mullins effect over the levels: after a larger strain, rubber is softer at every smaller strain."""

import numpy as np
from scipy.special import erf

from bushfit.effects.contract import Condition, Value, Values, scaled_values


def adjust(p: Values, condition: Condition) -> dict[str, Value]:
    """Reduce all moduli and stresses of rubber that was strained further in earlier tests (Mullins effect).

    Args:
        p: parameter values by name: all moduli and stresses [Pa]; and share [1]. After a much larger amplitude,
            erf(1) share = 0.84 share of them is lost.
        condition: operating condition, with the strain amplitude e0 and the strain history of the test.

    Returns:
        The changed values by name: those in Pa times 1 - share erf(1 - (e0/e_max)^2), with the largest strain amplitude
        e_max so far; empty if the history is unknown.

    Notes:
        After R. W. Ogden, D. G. Roxburgh, Proc. R. Soc. Lond. A 455 (1999) 2861, with the largest strain amplitude in
        place of the largest strain energy.

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
