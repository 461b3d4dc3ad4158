"""Temperature: warm rubber is softer, and answers as cold rubber does to slower motion."""

from __future__ import annotations

import numpy as np

from bushfit.effects.contract import Condition, Modifier, Parameter, Value, Values, scaled_values
from bushfit.units import CELSIUS

#: Temperature at which all values are unchanged [K]: that of laboratories, ISO 23529, so that a model stands by itself.
REFERENCE = 23.0 + CELSIUS
#: Distance from the reference up to which the law holds [K]; rubber measured from -10 to 53 degC keeps no single alpha.
REACH = 15.0


def adjust(p: Values, condition: Condition) -> dict[str, Value]:
    """mu, m, sigma_fmax times exp(-softening dT), m also a_T^alpha = exp(-alpha shift dT), dT from 23 degC."""
    temperature = condition.setting.under.temperature
    if temperature is None:
        return {}
    above = np.asarray(temperature) - REFERENCE
    changed = scaled_values(p, ("mu", "m", "sigma_fmax"), np.exp(-p["softening"] * above))
    return {**changed, **scaled_values(changed, ("m",), np.exp(-p["alpha"] * p["shift"] * above))}


EFFECT = Modifier(
    name="temperature",
    sentence="Warm rubber is softer and relaxes faster: tests at several temperatures differ, fast ones most.",
    equation="mu, m, sigma_fmax times exp(-softening dT), m also exp(-alpha shift dT), dT = T - 23 degC, within 15 K",
    parameters=(
        Parameter("softening", "1/K", (-0.05, 0.05), 0.0, 3e-3, meaning="share of the moduli lost per kelvin"),
        Parameter("shift", "1/K", (-0.5, 0.5), 0.0, 0.03, meaning="share of its relaxation times lost per kelvin"),
    ),
    source="time-temperature shift, M. L. Williams, R. F. Landel, J. D. Ferry, J. Am. Chem. Soc. 77 (1955) 3701, "
    "the first term of ln a_T about 23 degC",
    confirmed_by="repeat one sweep 10 K warmer, an hour in the chamber before it",
    under=("temperature",),
    taken="predicted at 23 degC; --temperature asks for another",
    adjust=adjust,
)
