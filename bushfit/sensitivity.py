"""Derivatives of a model's response with respect to its parameters.

Where branches stand alone their slopes add up: the paper's three bring their own, the others are differenced one by
one. Modifiers and layers mix everything, so there the whole response is differenced: central differences, all of
them in one call with the values laid along a leading axis.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import cast

import numpy as np

from bushfit.effects import Branch, Parameter, qualified
from bushfit.effects.contract import Array, Value, Values
from bushfit.effects.history import History
from bushfit.geometry import Direction
from bushfit.model import Kind, Model, seen_by

#: Step of the differences, relative to the value (log parameters) or to the typical size (linear ones).
_STEP = 1e-6

#: From a branch to its analytic slopes at a test, where it has them, and to its response for any values.
Slopes = Callable[[Branch], dict[str, Array] | None]
Response = Callable[[Branch, Values], Array]


def stiffness_jacobian(
    model: Model, direction: Direction, frequency: Array, amplitude: Array, names: Sequence[str], kind: Kind = "sweep"
) -> Array:
    """dK/dp of the complex dynamic stiffness, (len(names), n)."""
    if not model.only_branches:
        return differences(
            model, names, lambda values: model.stiffness(direction, frequency, amplitude, kind=kind, values=values)
        )
    omega = 2.0 * np.pi * frequency
    strain = amplitude * model.bushing.unit_strain(direction)

    def slopes(branch: Branch) -> dict[str, Array] | None:
        known = branch.modulus_sensitivities
        return known(seen_by(branch, model.values, model.values), omega, strain) if known else None

    def response(branch: Branch, values: Values) -> Array:
        return branch.modulus(seen_by(branch, values, values), omega, strain)

    summed = _summed(model, names, slopes, response, frequency.size, complex)
    return model.bushing.stiffness_per_modulus(direction) * summed


def force_jacobian(
    model: Model, direction: Direction, displacement: History, names: Sequence[str], kind: Kind = "loop"
) -> Array:
    """dF/dp along a displacement history, (len(names), n)."""
    if not model.only_branches:
        return differences(model, names, lambda values: model.force(direction, displacement, kind=kind, values=values))
    per_displacement = model.bushing.unit_strain(direction)
    strain = displacement.scaled(per_displacement)

    def slopes(branch: Branch) -> dict[str, Array] | None:
        known = branch.stress_sensitivities
        return known(seen_by(branch, model.values, model.values), strain) if known else None

    def response(branch: Branch, values: Values) -> Array:
        return branch.stress(seen_by(branch, values, values), strain)

    summed = _summed(model, names, slopes, response, displacement.value.shape[-1], float)
    return model.bushing.stiffness_per_modulus(direction) / (2.0 * per_displacement) * summed


def _summed(
    model: Model, names: Sequence[str], slopes: Slopes, response: Response, size: int, kind: type[float] | type[complex]
) -> Array:
    """Slopes of all branches together, (len(names), size)."""
    total = np.zeros((len(names), size), dtype=kind)
    row = {name: i for i, name in enumerate(names)}
    for branch in model.records:
        assert isinstance(branch, Branch)
        own = {parameter.name: qualified(branch, parameter) for parameter in branch.parameters}
        moved = [name for name in (*own.values(), *branch.uses) if name in row]
        if not moved:
            continue
        known = slopes(branch)
        if known is None:
            for name, slope in zip(moved, differences(model, moved, partial(response, branch)), strict=True):
                total[row[name]] += slope
        else:
            for short, name in own.items():
                if name in row:
                    total[row[name]] += known[short]
    return total


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
    both = np.broadcast_to(both, (2 * count, both.shape[-1]))
    return (both[:count] - both[count:]) / widths[:, None]


def _around(parameter: Parameter, value: float) -> tuple[float, float]:
    step = _STEP * (abs(value) if parameter.log and value else parameter.typical)
    low, high = parameter.bounds
    return max(value - step, min(low, value)), min(value + step, max(high, value))
