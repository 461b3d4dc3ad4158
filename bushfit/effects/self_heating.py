"""Self-heating: what the bushing dissipates warms it, and warm rubber is softer."""

from __future__ import annotations

import numpy as np

from bushfit.effects.contract import Condition, Modifier, Parameter, Value, Values, scaled_values


def adjust(p: Values, condition: Condition) -> dict[str, Value]:
    """mu, m and sigma_fmax divided by 1 + beta P, P = pi f X^2 K'' of the unheated bushing [W].

    In torsion X is the rotation [rad] and K'' the loss stiffness [N m/rad].
    """
    loss = np.imag(condition.stiffness(p))
    power = 0.5 * np.asarray(condition.omega) * np.asarray(condition.amplitude) ** 2 * loss
    return scaled_values(p, ("mu", "m", "sigma_fmax"), 1.0 / (1.0 + p["beta"] * power))


EFFECT = Modifier(
    name="self_heating",
    sentence="The bushing warms itself and softens: stiffness falls where amplitude and frequency are both high.",
    equation="mu, m, sigma_fmax over 1 + beta P, P = pi f X^2 K''",
    parameters=(Parameter("beta", "1/W", (0.0, 10.0), 0.0, 1e-3, meaning="softening per watt dissipated"),),
    source="steady heat balance (rise in proportion to the power) and a modulus that falls with temperature",
    confirmed_by="hold one point for 30 s and for 10 min: heating shows as drift",
    adjust=adjust,
)
