"""Temperature: warm rubber is softer, and responds as cold rubber responds to a slower motion."""

import numpy as np

from bushfit.effects.contract import Array, Condition, RubberConditions, Value, Values, scaled_values
from bushfit.units import CELSIUS

#: Temperature at which all values are unchanged [K]: that of laboratories, ISO 23529, so that a model stands by itself.
REFERENCE = 23.0 + CELSIUS
#: c1 and c2 [K] of a_T above the glass transition, the same for most polymers (Williams, Landel, Ferry, 1955).
_C1, _C2 = 17.44, 51.6


def adjust(p: Values, condition: Condition) -> dict[str, Value]:
    """Change the moduli and stresses from the reference temperature of 23 degC to the temperature of the test.

    Args:
        p: parameter values by name: all moduli and stresses [Pa]; and softening [1/K], the relative decrease per kelvin
            of all of them except the static shear modulus mu.
        condition: operating condition, with the temperature T [K].

    Returns:
        The changed values by name: mu times T/T0 (entropy elasticity), all other moduli and stresses times
        exp(-softening (T - T0)), T0 = 296 K; empty if the temperature is unknown.
    """
    temperature = condition.setting.conditions.temperature
    if temperature is None:
        return {}
    warmer, ratio = np.asarray(temperature) - REFERENCE, np.asarray(temperature) / REFERENCE
    softened = tuple(name for name in condition.moduli if name != "mu")
    spring = scaled_values(p, ("mu",), ratio)
    return {**spring, **scaled_values(p, softened, np.exp(-p["softening"] * warmer))}


def shift_factor(p: Values, conditions: RubberConditions) -> Value:
    """Time-temperature shift factor a_T: rubber at angular frequency w responds as at 23 degC and w a_T.

    Args:
        p: parameter values by name: shift [1/K], relative decrease of the relaxation times per kelvin at 23 degC.
        conditions: conditions of the test, with the temperature [K], a number or (n,).

    Returns:
        a_T [1], a number or (n,); 1 if the temperature is unknown.

    >>> shift_factor({"shift": 0.03}, RubberConditions(temperature=np.array([286.15, 296.15, 306.15]))).round(3)
    array([1.366, 1.   , 0.749])
    """
    return 1.0 if conditions.temperature is None else np.exp(log_shift(p["shift"], np.asarray(conditions.temperature)))


def log_shift(shift: Value, temperature: Array) -> Array:
    """Logarithm of the shift factor by the law of Williams, Landel and Ferry: ln a_T = -shift dT c2/(c2 + dT).

    Args:
        shift: decrease of ln a_T per kelvin at T0 = 23 degC [1/K].
        temperature: temperature of the rubber [K].

    Notes:
        The universal constants at the glass transition Tg relate c2 to the shift: c2 = 51.6 K + T0 - Tg and
        shift = ln 10 * 17.44 * 51.6 K/c2^2. Smaller shifts than that of c2 = T0, Arrhenius' law, use c2 = T0.
        Below Tg, ln a_T is extrapolated in proportion to dT.
    """
    slope = np.maximum(np.asarray(shift, dtype=float), np.log(10.0) * _C1 * _C2 / REFERENCE**2)
    c2, warmer = np.sqrt(np.log(10.0) * _C1 * _C2 / slope), temperature - REFERENCE
    return -shift * warmer * c2 / np.maximum(c2 + warmer, _C2)
