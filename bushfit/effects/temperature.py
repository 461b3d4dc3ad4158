"""Temperature: warm rubber is softer, and answers as cold rubber does to slower motion."""

import numpy as np

from bushfit.effects.contract import Condition, Value, Values, scaled_values
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
