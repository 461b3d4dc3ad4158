"""Filler recovery: after a larger amplitude the filler network is still broken, and builds up again with time."""

from __future__ import annotations

import numpy as np

from bushfit.effects.contract import Condition, Modifier, Parameter, Value, Values, scaled_values


def adjust(p: Values, condition: Condition) -> dict[str, Value]:
    """sigma_fmax times 1 - share (1 - (e0/e_l)^2) exp(-t/tau), t since the last strain amplitude e_l larger than e0.

    Where it is not known what went before, no larger one did, and nothing changes.

    Notes: the solution of lambda' = (lambda_inf(e0) - lambda)/tau for the intact share lambda of the network, where the
    amplitude is held at e0 and was held at e_l long enough before.
    """
    left, rested = condition.setting.under.left, condition.setting.under.rested
    if left is None or rested is None:
        return {}
    larger = np.maximum(condition.strain, left)
    ratio = np.divide(condition.strain, larger, out=np.ones(np.shape(larger)), where=larger > 0.0)
    broken = p["share"] * (1.0 - np.square(ratio)) * np.exp(-np.asarray(rested) / p["tau"])
    return scaled_values(p, ("sigma_fmax",), 1.0 - broken)


EFFECT = Modifier(
    name="filler_recovery",
    sentence="After a larger amplitude the filler's friction is still low, and recovers while smaller ones are tested.",
    equation="sigma_fmax times 1 - share (1 - (e0/e_l)^2) exp(-t/tau), t since a larger strain amplitude e_l",
    parameters=(
        Parameter("share", "1", (0.0, 0.95), 0.0, 0.2, meaning="share of the friction lost at first"),
        Parameter("tau", "1", (1e-3, 2.0), None, 0.05, log=True, meaning="time of recovery, over that of the session"),
    ),
    source="kinetics lambda' = (lambda_inf - lambda)/tau of the filler structure: A. Lion, J. Mech. Phys. Solids 46 "
    "(1998) 895; measured recovery: L. Chazeau et al., Polym. Compos. 21 (2000) 202",
    confirmed_by="repeat the smallest level at once after the largest, and again an hour later: it must have recovered",
    under=("left", "rested"),
    taken="predicted as fully recovered from larger strains: right after one friction is lower, see filler_recovery",
    adjust=adjust,
)
