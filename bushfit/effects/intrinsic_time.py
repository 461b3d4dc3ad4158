"""Intrinsic time: the springpot's clock runs faster the larger the strain."""

import numpy as np

from bushfit.effects.contract import REFERENCE_STRAIN, Condition, Value, Values, scaled_values


def adjust(p: Values, condition: Condition) -> dict[str, Value]:
    """Reduce the springpot constant, because relaxation is faster at larger strain amplitude.

    Args:
        p: parameter values by name: springpot constant m [Pa s^alpha] and order alpha [1]; and d [1], relative increase
            of the relaxation rate at 1 % strain amplitude.
        condition: operating condition, with the strain amplitude e0.

    Returns:
        The changed value by name: m (1 + d e0/0.01)^(-alpha) [Pa s^alpha].

    Notes: the springpot's time is an intrinsic time z with dz/dt = 1 + d e0/0.01 (A. Lion, C. Kardelky, Int. J.
    Plasticity 20 (2004) 1313, in the steady state).

    >>> model = paper.with_effect("intrinsic_time", {"intrinsic_time.d": 1.0})
    >>> [round(model.values_at("axial", 25.0, x)["m"]) for x in (1e-4, 1e-3)]
    [178233, 124685]
    """
    pace = 1.0 + np.asarray(p["d"]) * condition.strain / REFERENCE_STRAIN
    return scaled_values(p, ("m",), np.power(pace, -np.asarray(p.get("alpha", 0.0))))
