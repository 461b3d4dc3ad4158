"""Preload: a static deformation changes the slope of the elastic law, the friction and the springpot."""

import numpy as np

from bushfit.effects.contract import Array, Condition, History, Setting, Value, Values, scaled_values
from bushfit.geometry import stiffness_per_modulus, unit_strain

#: Names of the stresses and moduli of friction, by whatever law.
_FRICTION = ("sigma_fmax", "sigma", "delta")
#: Smallest tangent of the elastic law over that without preload: a law that falls has no unique static strain.
_SMALLEST_TANGENT = 0.05
#: Newton steps for the static strain of a force; chosen: a tangent of 0.3 to 3 needs six.
_STEPS = 12


def adjust(p: Values, condition: Condition) -> dict[str, Value]:
    """Change the moduli and stresses of rubber that moves about a static preload.

    Args:
        p: parameter values by name: all moduli and stresses [Pa]; quadratic and cubic coefficients c2, c3 [1] of the
            elastic stress over mu; and coefficients [1] of the static strain and its square in the logarithm of
            friction (friction, friction_square) and of rate-dependent moduli (rate, rate_square).
        condition: operating condition, with the preload as a displacement or force, and the strain amplitude e0.

    Returns:
        The changed values by name: mu times the slope of the elastic law, stresses and moduli of friction times
        exp(friction e + friction_square e^2), rate-dependent ones times exp(rate e + rate_square e^2), with the static
        strain e. The cubic term of `strain_stiffening`, which is relative to mu, keeps its value in Pa. Empty if the
        preload is unknown.

    Notes:
        The elastic law s = 2 mu (e + c2 e^2 + c3 e^3) has the slope 2 mu (1 + 2 c2 e + 3 c3 e^2) at the static strain
        e; a strain amplitude e0 about it adds 2 mu 3/4 c3 e0^2 to the first harmonic (small motion on a large one:
        K. N. Morman, J. C. Nagtegaal, Int. J. Numer. Meth. Eng. 19 (1983) 1079).
    """
    if condition.setting.conditions.preload is None:
        return {}
    strain = static_strain(p, condition.setting)
    slope = np.maximum(tangent(p, strain) + 0.75 * p["c3"] * np.square(condition.strain), _SMALLEST_TANGENT)
    friction = tuple(name for name in condition.moduli if name.rpartition(".")[2] in _FRICTION)
    rate = tuple(name for name in condition.moduli if name not in ("mu", *friction))
    return {
        **scaled_values(p, ("mu",), slope),
        **scaled_values(p, ("strain_stiffening.c3",), 1.0 / slope),
        **scaled_values(p, friction, np.exp(p["friction"] * strain + p["friction_square"] * np.square(strain))),
        **scaled_values(p, rate, np.exp(p["rate"] * strain + p["rate_square"] * np.square(strain))),
    }


def stress(p: Values, history: History, setting: Setting) -> Array:
    """Stress due to the curvature of the elastic law about a preload, in addition to the linear part of `adjust`.

    Args:
        p: parameter values by name: static shear modulus mu [Pa], coefficients c2, c3 [1] of the elastic law.
        history: tensor shear strain e about the preload over time [1], (..., n).
        setting: the test, with its preload.

    Returns:
        Stress to add at each sample [Pa], (..., n); zero if the preload is unknown.

    Notes:
        2 mu ((c2 + 3 c3 es) e^2 + c3 (e^3 - 3/4 e0^2 e)) about the static strain es, with the amplitude e0.
    """
    strain = history.value
    if setting.conditions.preload is None:
        return np.zeros_like(strain)
    square = np.square(strain)
    cubic = p["c3"] * (square - 0.75 * np.square(history.amplitude)) * strain
    return np.asarray(2.0 * p["mu"] * ((p["c2"] + 3.0 * p["c3"] * static_strain(p, setting)) * square + cubic))


def tangent(p: Values, strain: Value) -> Array:
    """Slope [1] of the elastic law at a static strain over that at zero strain: 1 + 2 c2 e + 3 c3 e^2, at least 0.05.

    Args:
        p: parameter values by name: coefficients c2, c3 [1] of the elastic law.
        strain: static strain e [1], any shape.

    >>> tangent({"c2": 0.0, "c3": 20.0}, 0.1).round(6)
    np.float64(1.6)
    """
    return np.maximum(1.0 + 2.0 * p["c2"] * strain + 3.0 * p["c3"] * np.square(strain), _SMALLEST_TANGENT)


def static_strain(p: Values, setting: Setting) -> Value:
    """Static strain of the rubber under the preload of a test, by Newton's method if the preload is a force.

    Args:
        p: parameter values by name: static shear modulus mu [Pa], coefficients c2, c3 [1] of the elastic law.
        setting: test with a known preload.

    Returns:
        Equivalent strain [1]: a number, or an array of the shape of the parameter values.
    """
    preload, place = setting.conditions.preload, setting.direction
    assert preload is not None
    per_displacement = unit_strain(setting.bushing, place)
    if preload.unit == place.motion.displacement_unit:
        return per_displacement * preload.value
    strain = linear = preload.value * per_displacement / (stiffness_per_modulus(setting.bushing, place) * p["mu"])
    for _ in range(_STEPS):
        excess = strain + p["c2"] * np.square(strain) + p["c3"] * strain**3 - linear
        strain = np.clip(strain - excess / tangent(p, strain), -5.0 * abs(linear), 5.0 * abs(linear))
    return strain
