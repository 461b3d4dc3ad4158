"""Self-heating: the dissipated power warms the bushing, and warm rubber is softer."""

import numpy as np

from bushfit.effects.contract import Condition, Value, Values, scaled_values


def adjust(p: Values, condition: Condition) -> dict[str, Value]:
    """Reduce all moduli and stresses, because the dissipated power warms the bushing.

    Args:
        p: parameter values by name: all moduli and stresses [Pa], and softening beta [1/W] per watt.
        condition: operating condition, with frequency f, amplitude X [m or rad] and the loss stiffness K'' [N/m or
            N m/rad] of the unheated bushing.

    Returns:
        The changed values by name: those in Pa over 1 + beta P, with the dissipated power P = pi f X^2 K'' [W].

    >>> model = paper.with_effect("self_heating", {"self_heating.beta": 0.01})
    >>> [round(model.values_at("axial", 100.0, x)["mu"]) for x in (1e-4, 1e-3)]
    [1086921, 859815]
    """
    loss = np.imag(condition.stiffness(p))
    power = 0.5 * np.asarray(condition.omega) * np.asarray(condition.amplitude) ** 2 * loss
    return scaled_values(p, condition.moduli, 1.0 / (1.0 + p["beta"] * power))
