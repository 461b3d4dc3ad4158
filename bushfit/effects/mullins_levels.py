"""Mullins over the levels: once strained further, rubber is softer at every smaller strain."""

from __future__ import annotations

import numpy as np
from scipy.special import erf

from bushfit.effects.contract import Condition, Modifier, Parameter, Value, Values, scaled_values


def adjust(p: Values, condition: Condition) -> dict[str, Value]:
    """mu, m, sigma_fmax times 1 - share erf(1 - (e0/e_max)^2), e_max the largest strain amplitude so far.

    Where it is not known what went before, no larger one did, and nothing changes.
    """
    before = condition.setting.under.strained
    if before is None:
        return {}
    largest = np.maximum(condition.strain, before)
    ratio = np.divide(condition.strain, largest, out=np.ones(np.shape(largest)), where=largest > 0.0)
    return scaled_values(p, ("mu", "m", "sigma_fmax"), 1.0 - p["share"] * erf(1.0 - np.square(ratio)))


EFFECT = Modifier(
    name="mullins_levels",
    sentence="Rubber is softer after a larger amplitude than before it, in the order in which the tests are listed.",
    equation="mu, m, sigma_fmax times 1 - share erf(1 - (e0/e_max)^2), e_max the largest strain amplitude so far",
    parameters=(Parameter("share", "1", (0.0, 0.9), 0.0, 0.05, meaning="share of the moduli lost, over 0.84"),),
    source="softening 1 - erf((W_max - W)/m)/r of R. W. Ogden, D. G. Roxburgh, Proc. R. Soc. Lond. A 455 (1999) 2861, "
    "with the energies of the strain amplitudes and m = W_max",
    confirmed_by="repeat the smallest level after the largest: it must have become softer, and stay so",
    under=("strained",),
    taken="predicted as if no larger strain went before: after one it is softer, see mullins_levels.share",
    adjust=adjust,
)
