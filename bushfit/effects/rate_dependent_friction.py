"""Rate-dependent friction: the filler friction grows with the rate of motion."""

from __future__ import annotations

import numpy as np

from bushfit.effects.contract import Condition, Modifier, Parameter, Value, Values, scaled_values

#: Frequency at which sigma_fmax is unchanged [Hz]: within the range of most sweeps.
REFERENCE_FREQUENCY = 25.0


def adjust(p: Values, condition: Condition) -> dict[str, Value]:
    """sigma_fmax (f/25 Hz)^n [Pa]."""
    ratio = np.asarray(condition.omega) / (2.0 * np.pi * REFERENCE_FREQUENCY)
    return scaled_values(p, ("sigma_fmax",), np.power(ratio, p["n"]))


EFFECT = Modifier(
    name="rate_dependent_friction",
    sentence="Filler friction grows with frequency, most where friction is most of the stiffness: small amplitudes.",
    equation="sigma_fmax (f/25 Hz)^n",
    parameters=(Parameter("n", "1", (0.0, 1.0), 0.0, 0.05, meaning="power of the rate"),),
    source="power law of rate on the friction stress of Garcia Tarrago et al. 2007, Eq. 5",
    confirmed_by="loop at 0.01, 0.1 and 1 Hz: the width must change with the rate",
    adjust=adjust,
)
