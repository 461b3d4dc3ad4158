"""Rate-dependent friction: the filler friction grows with the rate of motion."""

import numpy as np

from bushfit.effects.contract import REFERENCE_FREQUENCY, Condition, Value, Values, scaled_values


def adjust(p: Values, condition: Condition) -> dict[str, Value]:
    """Increase the friction stress with a power of the frequency.

    Args:
        p: parameter values by name: largest friction stress sigma_fmax [Pa], and exponent n [1].
        condition: operating condition, with the frequency f = omega/(2 pi).

    Returns:
        The changed value by name: sigma_fmax (f/25 Hz)^n [Pa].

    >>> model = paper.with_effect("rate_dependent_friction", {"rate_dependent_friction.n": 0.05})
    >>> [round(model.values_at("axial", f, 1e-3)["sigma_fmax"]) for f in (25.0, 155.0)]
    [14600, 15995]
    """
    ratio = np.asarray(condition.omega) / (2.0 * np.pi * REFERENCE_FREQUENCY)
    return scaled_values(p, ("sigma_fmax",), np.power(ratio, p["n"]))
