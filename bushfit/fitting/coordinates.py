"""Coordinates in which a fit moves, and the residuals of tests and their derivatives in these coordinates.

A fit moves the logarithm of strictly positive parameters and the others in units of their typical size, so that every
coordinate is of order one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from operator import methodcaller

import numpy as np

from bushfit.effects import Parameter
from bushfit.effects.contract import Array
from bushfit.fitting.common_error import Joined
from bushfit.fitting.preparation import MeasuredTest
from bushfit.model.model import Model

#: Lower and upper limit of parameters [SI], by name; None where the parameter's own limit counts.
Bounds = Mapping[str, tuple[float | None, float | None]]

#: Smallest singular value of derivatives, or eigenvalue of their squares once scaled, that counts, relative to the
#: largest: below it is their rounding.
ROUNDING = 1e-10


@dataclass(frozen=True)
class Coordinates:
    """The map between parameter values and the coordinates in which a fit moves."""

    names: tuple[str, ...]
    parameters: tuple[Parameter, ...]

    @classmethod
    def of_parameters(cls, model: Model, names: Sequence[str]) -> "Coordinates":
        return cls(tuple(names), tuple(model.parameters[name] for name in names))

    def forward(self, name: str, value: float) -> float:
        """Coordinate of a value of one parameter."""
        parameter = self.parameters[self.names.index(name)]
        return float(np.log(value)) if parameter.log else value / parameter.typical

    def point(self, values: Mapping[str, float]) -> Array:
        """Coordinates of parameter values, (k,)."""
        return np.array([self.forward(name, values[name]) for name in self.names])

    def values(self, point: Sequence[float] | Array) -> dict[str, float]:
        """Parameter values at a point."""
        return {
            name: float(np.exp(u)) if parameter.log else float(u) * parameter.typical
            for name, parameter, u in zip(self.names, self.parameters, point, strict=True)
        }

    def slopes(self, values: Mapping[str, float]) -> Array:
        """Derivatives of parameter values by coordinate, (k,)."""
        pairs = zip(self.names, self.parameters, strict=True)
        return np.array([values[name] if parameter.log else parameter.typical for name, parameter in pairs])


def coordinate_bounds(coordinates: Coordinates, bounds: Bounds) -> tuple[Array, Array]:
    """Lower and upper bound of each coordinate, (k,) each; where `bounds` has none, the parameter's own."""
    ends = []
    for name, parameter in zip(coordinates.names, coordinates.parameters, strict=True):
        limits = zip(bounds.get(name, (None, None)), parameter.bounds, strict=True)
        ends.append(sorted(coordinates.forward(name, end if limit is None else limit) for limit, end in limits))
    low, high = np.array(ends).T
    return low, high


def residual(model: Model, data_sets: Sequence[MeasuredTest]) -> Array:
    """Whitened residuals of all tests, (n,)."""
    return together(data_sets, np.concatenate(list(map(methodcaller("residual", model), data_sets))))


def jacobian(model: Model, data_sets: Sequence[MeasuredTest], names: Sequence[str]) -> Array:
    """Derivatives of `residual` by parameter coordinate, (len(names), n).

    Args:
        model: model at whose values the derivatives are taken.
        data_sets: tests.
        names: k parameters.
    """
    slopes = Coordinates.of_parameters(model, names).slopes(model.values)
    by_value = np.concatenate(list(map(methodcaller("jacobian", model, names), data_sets)), axis=-1)
    return together(data_sets, by_value * slopes[:, None])


def together(data_sets: Sequence[MeasuredTest], rows: Array) -> Array:
    """Whiten residuals of all tests, (..., n), by an error that the tests share, if they share one."""
    return data_sets.error.whiten(rows) if isinstance(data_sets, Joined) else rows
