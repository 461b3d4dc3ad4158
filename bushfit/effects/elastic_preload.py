"""Elastic preload: a preload of one direction or specimen increases the elastic stiffness there, but not the loss."""

from bushfit.effects.contract import Condition, Value, Values, scaled_values


def adjust(p: Values, condition: Condition) -> dict[str, Value]:
    """Multiply the static shear modulus by the factor of a preload that only one direction or specimen has.

    Args:
        p: parameter values by name: static shear modulus mu [Pa], and factor [1], mu with preload over mu without.
        condition: not used.

    Returns:
        The changed value by name: factor mu [Pa].

    Notes: small motion about a static stretch, L. R. G. Treloar, The Physics of Rubber Elasticity, 1975, ch. 11.

    >>> adjust({"mu": 1e6, "m": 2e5, "factor": 1.1}, None)
    {'mu': 1100000.0}
    """
    return scaled_values(p, ("mu",), p["factor"])
