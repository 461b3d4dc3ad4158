"""Coupled breakdown: the rate effect shrinks as the filler structure breaks down with amplitude."""

import numpy as np

from bushfit.effects.contract import Condition, Value, Values, scaled_values

#: Strain amplitude at which m is unchanged [1]: within the range of most tests.
REFERENCE_STRAIN = 0.01
#: Strain amplitude below which m grows no more [1]: less than any test reaches, and more than 0.
SMALLEST_STRAIN = 1e-9


def adjust(p: Values, condition: Condition) -> dict[str, Value]:
    """m (e0/0.01)^(-q) [Pa s^alpha].

    >>> model = paper.with_effect("coupled_breakdown", {"coupled_breakdown.q": 0.1})
    >>> [round(model.values_at("axial", 25.0, x)["m"]) for x in (1e-4, 1e-3)]
    [209921, 166746]
    """
    ratio = np.maximum(condition.strain, SMALLEST_STRAIN) / REFERENCE_STRAIN
    return scaled_values(p, ("m",), np.power(ratio, -np.asarray(p["q"], dtype=float)))
