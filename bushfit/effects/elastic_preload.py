"""Elastic preload: a preload at one place, which other tests do not have, stiffens what is elastic, and no loss."""

from bushfit.effects.contract import Condition, Value, Values, scaled_values


def adjust(p: Values, condition: Condition) -> dict[str, Value]:
    """Static shear modulus mu [Pa] times the factor of the preload.

    Args:
        p: parameter values by name, with mu [Pa], factor [1].
        condition: operating condition, not used.

    Returns:
        The changed values by parameter name.

    >>> adjust({"mu": 1e6, "m": 2e5, "factor": 1.1}, None)
    {'mu': 1100000.0}
    """
    return scaled_values(p, ("mu",), p["factor"])
