"""Filler recovery: after a larger amplitude the filler network is broken, and recovers with time."""

import numpy as np

from bushfit.effects.contract import Condition, Value, Values, scaled_values


def adjust(p: Values, condition: Condition) -> dict[str, Value]:
    """Reduce the friction stress after a larger strain amplitude, from which the filler network recovers with time.

    Args:
        p: parameter values by name: largest friction stress sigma_fmax [Pa]; share [1] of it that is lost right after
            a much larger amplitude; and recovery time tau [1] over the duration of the session.
        condition: operating condition, with the strain amplitude e0 and the strain history of the test.

    Returns:
        The changed value by name: sigma_fmax (1 - share (1 - (e0/e_l)^2) exp(-t/tau)) [Pa], with the time t [1] since
        the last strain amplitude e_l larger than e0; empty if the history is unknown.

    Notes:
        Solution of lambda' = (lambda_inf(e0) - lambda)/tau for the intact share lambda of the network at the constant
        amplitude e0, after equilibrium at e_l (A. Lion, J. Mech. Phys. Solids 46 (1998) 895).

    >>> from bushfit.effects.contract import RubberConditions
    >>> model = paper.with_effect("filler_recovery", {"filler_recovery.share": 0.2})
    >>> model.values_at("axial", 25.0, 0.0, RubberConditions(previous_strain=0.1, rest_time=0.0))["sigma_fmax"]
    11680.0
    """
    previous, rest_time = condition.setting.conditions.previous_strain, condition.setting.conditions.rest_time
    if previous is None or rest_time is None:
        return {}
    larger = np.maximum(condition.strain, previous)
    ratio = np.divide(condition.strain, larger, out=np.ones(np.shape(larger)), where=larger > 0.0)
    broken = p["share"] * (1.0 - np.square(ratio)) * np.exp(-np.asarray(rest_time) / p["tau"])
    return scaled_values(p, ("sigma_fmax",), 1.0 - broken)
