"""Intrinsic time: the springpot's clock runs faster the larger the strain."""

import numpy as np

from bushfit.effects.contract import REFERENCE_STRAIN, Condition, Value, Values, scaled_values


def adjust(p: Values, condition: Condition) -> dict[str, Value]:
    """Springpot coefficient m (1 + d e0/0.01)^(-alpha) [Pa s^alpha] at the strain amplitude e0.

    Args:
        p: parameter values by name, with m [Pa s^alpha], alpha [1], d [1].
        condition: operating condition, with the strain amplitude.

    Returns:
        The changed values by parameter name.

    Notes: the rate is relative to an intrinsic time z with dz/dt = 1 + d e0/0.01.

    >>> model = paper.with_effect("intrinsic_time", {"intrinsic_time.d": 1.0})
    >>> [round(model.values_at("axial", 25.0, x)["m"]) for x in (1e-4, 1e-3)]
    [178233, 124685]
    """
    pace = 1.0 + np.asarray(p["d"]) * condition.strain / REFERENCE_STRAIN
    return scaled_values(p, ("m",), np.power(pace, -np.asarray(p.get("alpha", 0.0))))
