"""Coupled breakdown: the effect of rate decreases as the filler structure breaks down with amplitude."""

import numpy as np

from bushfit.effects.contract import REFERENCE_STRAIN, Condition, Value, Values, scaled_values


def adjust(p: Values, condition: Condition) -> dict[str, Value]:
    """Reduce the springpot constant as the filler structure breaks down with the strain amplitude.

    Args:
        p: parameter values by name: springpot constant m [Pa s^alpha], and exponent q [1].
        condition: operating condition, with the strain amplitude e0.

    Returns:
        The changed value by name: m (e0/0.01)^(-q) [Pa s^alpha].

    Notes: coupled dependence on rate and amplitude, after A. Lion, C. Kardelky, Int. J. Plasticity 20 (2004) 1313.

    >>> model = paper.with_effect("coupled_breakdown", {"coupled_breakdown.q": 0.1})
    >>> [round(model.values_at("axial", 25.0, x)["m"]) for x in (1e-4, 1e-3)]
    [209921, 166746]
    """
    ratio = np.maximum(condition.strain, 1e-9) / REFERENCE_STRAIN  # below, less than any test reaches, m grows no more
    return scaled_values(p, ("m",), np.power(ratio, -np.asarray(p["q"], dtype=float)))
