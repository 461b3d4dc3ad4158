"""Derivatives of a model's response with respect to its parameters.

Analytic where every effect brings its own (the paper's three branches); else central differences, all of
them in one call with the values laid along a leading axis.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import cast

import numpy as np

from bushfit.effects import Branch, Parameter
from bushfit.effects.contract import Array, Value, Values
from bushfit.effects.history import History
from bushfit.geometry import Direction
from bushfit.model import Kind, Model

#: Step of the differences, relative to the value (log parameters) or to the typical size (linear ones).
_STEP = 1e-6


def stiffness_jacobian(
    model: Model, direction: Direction, frequency: Array, amplitude: Array, names: Sequence[str], kind: Kind = "sweep"
) -> Array:
    """dK/dp of the complex dynamic stiffness, (len(names), n)."""
    branches = [effect for effect in model.records if isinstance(effect, Branch)]
    if len(branches) == len(model.records) and all(branch.modulus_sensitivities for branch in branches):
        omega = 2.0 * np.pi * frequency
        strain = amplitude * model.bushing.unit_strain(direction)
        slopes: dict[str, Array] = {}
        for branch in branches:
            slopes |= branch.modulus_sensitivities(model.values, omega, strain)  # type: ignore[misc]
        factor = model.bushing.stiffness_per_modulus(direction)
        return _stack(slopes, names, factor, frequency)
    return differences(
        model, names, lambda values: model.stiffness(direction, frequency, amplitude, kind=kind, values=values)
    )


def force_jacobian(
    model: Model, direction: Direction, displacement: History, names: Sequence[str], kind: Kind = "loop"
) -> Array:
    """dF/dp along a displacement history, (len(names), n)."""
    branches = [effect for effect in model.records if isinstance(effect, Branch)]
    analytic = all(branch.stress_sensitivities for branch in branches) and displacement.periodic
    if analytic and len(branches) == len(model.records):
        per_displacement = model.bushing.unit_strain(direction)
        strain = displacement.scaled(per_displacement)
        slopes: dict[str, Array] = {}
        for branch in branches:
            slopes |= branch.stress_sensitivities(model.values, strain)  # type: ignore[misc]
        factor = model.bushing.stiffness_per_modulus(direction) / (2.0 * per_displacement)
        return _stack(slopes, names, factor, displacement.value)
    return differences(model, names, lambda values: model.force(direction, displacement, kind=kind, values=values))


def _stack(slopes: Mapping[str, Array], names: Sequence[str], factor: float, like: Array) -> Array:
    return factor * np.stack([np.broadcast_to(slopes[name], like.shape) for name in names])


def differences(model: Model, names: Sequence[str], respond: Callable[[Values], Array]) -> Array:
    """Central differences of any response, one-sided at a bound, from one broadcast call: (len(names), ...)."""
    count = len(names)
    stacked: dict[str, Value] = dict(model.values)
    widths = np.empty(count)
    for i, name in enumerate(names):
        low, high = _around(model.parameters[name], model.values[name])
        column = np.full((2 * count, 1), model.values[name])
        column[i], column[count + i] = high, low
        stacked[name] = column
        widths[i] = high - low
    both = respond(cast(Values, stacked))
    widths = widths.reshape(count, *([1] * (both.ndim - 1)))
    return (both[:count] - both[count:]) / widths


def _around(parameter: Parameter, value: float) -> tuple[float, float]:
    step = _STEP * (abs(value) if parameter.log and value else parameter.typical)
    low, high = parameter.bounds
    return max(value - step, min(low, value)), min(value + step, max(high, value))
