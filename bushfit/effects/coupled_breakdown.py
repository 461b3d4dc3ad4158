"""Coupled breakdown: the rate effect shrinks as the filler structure breaks down with amplitude."""

import numpy as np

from bushfit.effects.contract import REFERENCE_STRAIN, Condition, Value, Values, scaled_values


def adjust(p: Values, condition: Condition) -> dict[str, Value]:
    """Springpot coefficient m (e0/0.01)^(-q) [Pa s^alpha] at the strain amplitude e0.

    Args:
        p: parameter values by name, with m [Pa s^alpha], q [1].
        condition: operating condition, with the strain amplitude.

    Returns:
        The changed value of m by its name.

    >>> model = paper.with_effect("coupled_breakdown", {"coupled_breakdown.q": 0.1})
    >>> [round(model.values_at("axial", 25.0, x)["m"]) for x in (1e-4, 1e-3)]
    [209921, 166746]
    """
    ratio = np.maximum(condition.strain, 1e-9) / REFERENCE_STRAIN  # below, less than any test reaches, m grows no more
    return scaled_values(p, ("m",), np.power(ratio, -np.asarray(p["q"], dtype=float)))
