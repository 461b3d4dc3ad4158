"""Rate-dependent friction: the filler friction grows with the rate of motion."""

import numpy as np

from bushfit.effects.contract import Condition, Value, Values, scaled_values

#: Frequency at which sigma_fmax is unchanged [Hz]: within the range of most sweeps.
REFERENCE_FREQUENCY = 25.0


def adjust(p: Values, condition: Condition) -> dict[str, Value]:
    """sigma_fmax (f/25 Hz)^n [Pa]."""
    ratio = np.asarray(condition.omega) / (2.0 * np.pi * REFERENCE_FREQUENCY)
    return scaled_values(p, ("sigma_fmax",), np.power(ratio, p["n"]))
