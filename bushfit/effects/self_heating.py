"""Self-heating: what the bushing dissipates warms it, and warm rubber is softer."""

import numpy as np

from bushfit.effects.contract import Condition, Value, Values, scaled_values


def adjust(p: Values, condition: Condition) -> dict[str, Value]:
    """Moduli and stresses [Pa] divided by 1 + beta P, with the loss P = pi f X^2 K'' [W] of the unheated bushing.

    In torsion X is the rotation [rad] and K'' the loss stiffness [N m/rad].

    Args:
        p: parameter values by name, with all moduli and stresses [Pa], beta [1/W].
        condition: operating condition, with frequency, displacement amplitude and stiffness.

    Returns:
        The changed values by parameter name.

    >>> model = paper.with_effect("self_heating", {"self_heating.beta": 0.01})
    >>> [round(model.values_at("axial", 100.0, x)["mu"]) for x in (1e-4, 1e-3)]
    [1086921, 859815]
    """
    loss = np.imag(condition.stiffness(p))
    power = 0.5 * np.asarray(condition.omega) * np.asarray(condition.amplitude) ** 2 * loss
    return scaled_values(p, condition.moduli, 1.0 / (1.0 + p["beta"] * power))
