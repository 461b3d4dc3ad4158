"""Coordinates in which a fit moves, residuals and their derivatives there, and where a fit ended.

A fit moves the logarithm of strictly positive parameters and the others in units of their typical size, so
that every coordinate is of order one and two decades are a step like any other.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bushfit.effects import Parameter
from bushfit.effects.contract import Array
from bushfit.errors import FitError
from bushfit.fitting.common_error import Joined
from bushfit.fitting.preparation import MeasuredTest
from bushfit.model.covariance import Z95
from bushfit.model.model import Model
from bushfit.model.result import End

Bounds = Mapping[str, tuple[float | None, float | None]]

#: Smallest singular value of derivatives, or eigenvalue of their squares once scaled, that counts, relative to the
#: largest: below it is their rounding.
ROUNDING = 1e-10
#: Least and largest factor by which an accelerated pass extrapolates the last change.
_STRIDES = (-0.5, 5.0)
#: A parameter this close to a bound rests on it, in coordinates, which are of order one however wide the bounds.
_AT_BOUND = 1e-3


@dataclass(frozen=True)
class Coordinates:
    """The map between parameter values and the coordinates in which a fit moves."""

    names: tuple[str, ...]
    parameters: tuple[Parameter, ...]

    @classmethod
    def of_parameters(cls, model: Model, names: Sequence[str]) -> Coordinates:
        return cls(tuple(names), tuple(model.parameters[name] for name in names))

    def forward(self, name: str, value: float) -> float:
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

    def possible(self, point: Array) -> dict[str, float]:
        """Parameter values at a point, or the nearest that each may have: one that is extrapolated may lie beyond."""
        pairs = zip(self.values(point).items(), self.parameters, strict=True)
        return {name: float(np.clip(value, *parameter.bounds)) for (name, value), parameter in pairs}

    def slopes(self, values: Mapping[str, float]) -> Array:
        """d value / d coordinate, (k,)."""
        pairs = zip(self.names, self.parameters, strict=True)
        return np.array([values[name] if parameter.log else parameter.typical for name, parameter in pairs])


@dataclass(frozen=True, eq=False)
class Solution:
    """End of a fit.

    Args:
        residual: whitened residuals, model less measured, (n,).
        jacobian: their derivatives by coordinate, (k, n).
        at_bound: the parameters that ended at a bound, and at which.
        stopped: whether it was stopped before it had converged.
    """

    model: Model
    coordinates: Coordinates
    residual: Array
    jacobian: Array
    evaluations: int
    at_bound: Mapping[str, End]
    stopped: bool

    @property
    def chi_square(self) -> float:
        return float(self.residual @ self.residual)

    def gain(self, fixed: Collection[str]) -> float:
        """Fall of chi-square by one Gauss-Newton step, the parameters `beside` held."""
        free = [i for i, name in enumerate(self.coordinates.names) if name not in fixed]
        left_vectors, values, _ = np.linalg.svd(self.jacobian[free].T, full_matrices=False)
        significant = values > ROUNDING * values.max(initial=0.0)
        return float(np.sum(np.square(left_vectors[:, significant].T @ self.residual)))

    def moved_to(self, model: Model, data_sets: Sequence[MeasuredTest]) -> Solution:
        """Move the parameters of the fit to the values of a model, with the residuals of these tests."""
        rows = jacobian(model, data_sets, self.coordinates.names)
        return replace(self, model=model, residual=residual(model, data_sets), jacobian=rows)

    @property
    def moving(self) -> list[int]:
        """Numbers of the parameters that rest on no bound."""
        return [i for i, name in enumerate(self.coordinates.names) if name not in self.at_bound]

    @property
    def flat(self) -> bool:
        """True if the next step would lower chi-square, in units of the misfit's variance, by less than chance does."""
        return self.gain(self.at_bound) <= Z95**2 * max(self.chi_square / self.residual.size, 1.0)


def residual(model: Model, data_sets: Sequence[MeasuredTest]) -> Array:
    """Whitened residuals of all data sets, (n,)."""
    return together(data_sets, np.concatenate([data_set.residual(model) for data_set in data_sets]))


def jacobian(model: Model, data_sets: Sequence[MeasuredTest], names: Sequence[str]) -> Array:
    """Derivatives of `residual` by parameter coordinate, (len(names), n).

    Args:
        model: model at whose values the derivatives are taken.
        data_sets: tests.
        names: k parameters.
    """
    slopes = Coordinates.of_parameters(model, names).slopes(model.values)
    by_value = np.concatenate([data_set.jacobian(model, names) for data_set in data_sets], axis=-1)
    return together(data_sets, by_value * slopes[:, None])


def together(data_sets: Sequence[MeasuredTest], rows: Array) -> Array:
    """Residuals of all data sets, each whitened by itself, (..., n), whitened by an error that they share as well.

    Also what an estimator takes of residuals, (..., n), by what it takes of whitened ones.
    """
    return data_sets.error.whiten(rows) if isinstance(data_sets, Joined) else rows


def starting_point(
    model: Model, data_sets: Sequence[MeasuredTest], names: Sequence[str], bounds: Bounds
) -> tuple[Coordinates, Array, Array, Array]:
    """Coordinates of a fit, the model's own values in them, and the lower and upper bounds, (k,) each.

    Args:
        model: model with the start values.
        data_sets: tests.
        names: k parameters to fit.
        bounds: limits inside the parameters' own [SI].

    Returns:
        Coordinates, the start point, and lower and upper bounds, (k,) each.
    """
    points = sum(data_set.size for data_set in data_sets)
    if points <= len(names):
        raise FitError("too few points for the fit", found=f"{points} points for {len(names)} parameters")
    coordinates = Coordinates.of_parameters(model, names)
    lower = {name: parameter.bounds[0] for name, parameter in model.parameters.items() if parameter.log}
    lifted = {name: value or lower.get(name, 0.0) for name, value in model.values.items()}
    return coordinates, coordinates.point(lifted), *coordinate_bounds(coordinates, bounds)


def coordinate_bounds(coordinates: Coordinates, bounds: Bounds) -> tuple[Array, Array]:
    """Lower and upper bound of each coordinate, (k,) each.

    Returns:
        Lower and upper bounds, (k,) each.
    """
    ends = []
    for name, parameter in zip(coordinates.names, coordinates.parameters, strict=True):
        limits = zip(parameter.bounds, bounds.get(name, (None, None)), strict=True)
        ends.append(
            sorted(
                coordinates.forward(name, limit if limit_given is None else limit_given)
                for limit, limit_given in limits
            )
        )
    low, high = np.array(ends).T
    return low, high


def at_bound(names: Sequence[str], point: Array, low: Array, high: Array) -> dict[str, End]:
    """The parameters that rest on a bound at a point, and on which, "min" or "max".

    Args:
        names: k parameters.
        point: coordinates, (k,).
        low: lower bounds, (k,).
        high: upper bounds, (k,).
    """
    near = _AT_BOUND * np.minimum(high - low, 1.0)
    rooms: dict[End, Array] = {"min": point - low, "max": high - point}
    return {name: end for end, room in rooms.items() for name, met in zip(names, room < near, strict=True) if met}


def anderson(inputs: Sequence[Array], outputs: Sequence[Array]) -> Array:
    """Next point of a fixed-point iteration, from the last two of its points and images (Anderson 1965).

    Plain passes gain little each where what is asked and what answers know little of each other, or swing to and fro.

    Args:
        inputs: points of the iteration so far, (k,) each.
        outputs: their images, (k,) each.

    Returns:
        Next point, (k,).
    """
    points, images = np.array(inputs[-2:]), np.array(outputs[-2:])
    if len(points) < 2:
        return images[-1]
    before, gap = images - points
    change = gap - before
    weight = np.clip(-(change @ gap) / max(change @ change, np.finfo(float).tiny), *_STRIDES)
    return images[-1] + weight * (images[-1] - images[-2])
