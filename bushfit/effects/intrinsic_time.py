"""Intrinsic time: the springpot's clock runs faster the larger the strain."""

from __future__ import annotations

import numpy as np

from bushfit.effects.contract import Condition, Modifier, Parameter, Value, Values, scaled_values

#: Strain amplitude at which d is what the clock gains [1]: within the range of most tests.
REFERENCE_STRAIN = 0.01


def adjust(p: Values, condition: Condition) -> dict[str, Value]:
    """m (1 + d e0/0.01)^(-alpha): the rate counts per intrinsic time z, dz/dt = 1 + d e0/0.01 [Pa s^alpha]."""
    pace = 1.0 + np.asarray(p["d"]) * condition.strain / REFERENCE_STRAIN
    return scaled_values(p, ("m",), np.power(pace, -np.asarray(p.get("alpha", 0.0))))


EFFECT = Modifier(
    name="intrinsic_time",
    sentence="The rubber's clock runs faster at large strain: rate and amplitude do not separate, the slope over "
    "frequency stays.",
    equation="m (1 + d e0/0.01)^(-alpha)",
    parameters=(Parameter("d", "1", (0.0, 1e3), 0.0, 1.0, meaning="what the clock gains at 1 % strain amplitude"),),
    source="process-dependent viscosity on intrinsic time, steady state: A. Lion, C. Kardelky, Int. J. Plasticity 20 "
    "(2004) 1313; M. Rendek, A. Lion, Int. J. Solids Struct. 47 (2010) 2918",
    confirmed_by="sweep from 0.05 to 5 Hz at the smallest and the largest amplitude: their rise must be in one ratio",
    variant_of="springpot",
    adjust=adjust,
)
