"""Least-squares fits of a model's parameters to data sets, within bounds, by lmfit.

A fit moves the logarithm of strictly positive parameters and the others in units of their typical size, so
that every coordinate is of order one and two decades are a step like any other.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from bushfit.effects import BASE, Parameter
from bushfit.effects.contract import Array
from bushfit.errors import FitError
from bushfit.fitting.data_sets import DataSet
from bushfit.model.covariance import Z95
from bushfit.model.model import Model
from bushfit.model.result import End

if TYPE_CHECKING:
    import lmfit

Bounds = Mapping[str, tuple[float | None, float | None]]

#: Smallest singular value of the derivatives that counts, relative to the largest: below it is their rounding.
_LEAST_SINGULAR_VALUE = 1e-10
#: A parameter this close to a bound rests on it, in coordinates, which are of order one however wide the bounds.
_AT_BOUND = 1e-3
#: How far inside the bounds a fit starts, relative to the room between them: the trust-region method needs some.
_START_INSIDE = 1e-6


@dataclass(frozen=True)
class Coordinates:
    """The map between parameter values and the coordinates in which a fit moves."""

    names: tuple[str, ...]
    parameters: tuple[Parameter, ...]

    @classmethod
    def of(cls, model: Model, names: Sequence[str]) -> Coordinates:
        return cls(tuple(names), tuple(model.parameters[name] for name in names))

    def forward(self, name: str, value: float) -> float:
        parameter = self.parameters[self.names.index(name)]
        return float(np.log(value)) if parameter.log else value / parameter.typical

    def point(self, values: Mapping[str, float]) -> Array:
        """Where those values lie, (k,)."""
        return np.array([self.forward(name, values[name]) for name in self.names])

    def values(self, point: Sequence[float] | Array) -> dict[str, float]:
        """Parameter values at a point."""
        return {
            name: float(np.exp(u)) if parameter.log else float(u) * parameter.typical
            for name, parameter, u in zip(self.names, self.parameters, point, strict=True)
        }

    def slopes(self, values: Mapping[str, float]) -> Array:
        """d value / d coordinate, (k,)."""
        pairs = zip(self.names, self.parameters, strict=True)
        return np.array([values[name] if parameter.log else parameter.typical for name, parameter in pairs])


@dataclass(frozen=True, eq=False)
class Solution:
    """Where a fit ended.

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

    def gain(self, beside: Collection[str]) -> float:
        """By how much one Gauss-Newton step would lower chi-square, the parameters `beside` held."""
        free = [i for i, name in enumerate(self.coordinates.names) if name not in beside]
        left, values, _ = np.linalg.svd(self.jacobian[free].T, full_matrices=False)
        seen = values > _LEAST_SINGULAR_VALUE * values.max(initial=0.0)
        return float(np.sum(np.square(left[:, seen].T @ self.residual)))

    @property
    def flat(self) -> bool:
        """Whether the next step would lower chi-square, in units of the misfit's variance, no more than chance does."""
        return self.gain(self.at_bound) <= Z95**2 * max(self.chi_square / self.residual.size, 1.0)


def residual(model: Model, data_sets: Sequence[DataSet]) -> Array:
    """Whitened residuals of all data sets, (n,)."""
    return np.concatenate([data_set.residual(model) for data_set in data_sets])


def jacobian(model: Model, data_sets: Sequence[DataSet], names: Sequence[str]) -> Array:
    """Derivatives of `residual` by parameter coordinate, (len(names), n)."""
    slopes = Coordinates.of(model, names).slopes(model.values)
    by_value = np.concatenate([data_set.jacobian(model, names) for data_set in data_sets], axis=-1)
    return by_value * slopes[:, None]


def solve(
    model: Model,
    data_sets: Sequence[DataSet],
    names: Sequence[str],
    bounds: Bounds | None = None,
    *,
    evaluations: int = 400,
    tolerance: float = 1e-9,
    strict: bool = True,
) -> Solution:
    """Fit the named parameters by least squares, from the model's own values, the others held; without names all are.

    Args:
        bounds: limits inside the parameters' own; a parameter may come to rest on one.
        evaluations: of the model at most; chosen: ten to forty are the rule.
        tolerance: relative change of chi-square and of the point at which the fit stops; far below what noise lets
            one see.
        strict: whether a fit that has used up its evaluations is an error, unless chi-square is flat where it is.

    Raises:
        FitError: fewer data than parameters, no finite response, or no convergence.

    Notes:
        The paper's branches alone have one minimum and seldom meet a bound: they are fitted by MINPACK's
        Levenberg-Marquardt, the shorter way, which knows no bounds. Where a step leaves the bounds, and for every
        other model, the trust-region reflective method starts from the model's own values.
    """
    if not names:
        left = residual(model, data_sets)
        return Solution(model, Coordinates((), ()), left, np.empty((0, left.size)), 1, {}, stopped=False)
    limits = {"max_nfev": evaluations, "ftol": tolerance, "xtol": tolerance, "calc_covar": False}
    try:
        with np.errstate(invalid="ignore", divide="ignore"):  # lmfit takes roots of a covariance nobody asked for
            found = _fitted(model, data_sets, names, bounds or {}, limits)
    except ValueError as error:  # lmfit's word for a residual that is not finite
        raise no_finite_response(model) from error
    if found.stopped and strict and not found.flat:
        raise FitError(
            "the fit did not converge",
            found=f"no end after {found.evaluations} evaluations of the model",
            hint="hold a parameter with vary = false, or give bounds, in [fit] of the campaign",
        )
    return found


class _OutOfBoundsError(Exception):
    """A step leaves the bounds."""


def _fitted(
    model: Model, data_sets: Sequence[DataSet], names: Sequence[str], bounds: Bounds, limits: Mapping[str, Any]
) -> Solution:
    """The fit by MINPACK, without bounds, where this is of use; else, or where a step left them, within its bounds."""
    import lmfit

    coordinates, start, low, high = starting_point(model, data_sets, names, bounds)
    inside = _START_INSIDE * (high - low)
    start = np.clip(start, low + inside, high - inside)
    ends = list(zip(low.tolist(), high.tolist(), strict=True))

    @lru_cache(maxsize=2)  # data sets know again the model they answered last: the best so far, and the one tried
    def model_of(point: tuple[float, ...]) -> Model:
        return model.with_values(coordinates.values(point))

    def model_at(parameters: lmfit.Parameters) -> Model:
        return model_of(tuple(parameter.value for parameter in parameters.values()))

    def misfit(parameters: lmfit.Parameters) -> Array:
        return residual(model_at(parameters), data_sets)

    def misfit_inside(parameters: lmfit.Parameters) -> Array:
        if not all(low <= u.value <= high for u, (low, high) in zip(parameters.values(), ends, strict=True)):
            raise _OutOfBoundsError
        return misfit(parameters)

    def slopes(parameters: lmfit.Parameters) -> Array:
        return jacobian(model_at(parameters), data_sets, names)

    fit = None
    if set(model.effects) <= set(BASE):
        free = list(_lmfit_parameters(start).values())  # which lmfit takes as they are, without a copy
        with suppress(_OutOfBoundsError, ValueError):
            fit = lmfit.minimize(misfit_inside, free, "leastsq", Dfun=slopes, col_deriv=True, gtol=0.0, **limits)
    if fit is None or fit.aborted:
        by_row = {"jac": lambda parameters: slopes(parameters).T, "x_scale": "jac", "gtol": None}
        fit = lmfit.minimize(misfit, _lmfit_parameters(start, low, high), "least_squares", **by_row, **limits)
    end = np.array([parameter.value for parameter in fit.params.values()])
    best, met = model_at(fit.params), at_bound(names, end, low, high)
    left, slope = residual(best, data_sets), jacobian(best, data_sets, names)
    return Solution(best, coordinates, left, slope, int(fit.nfev), met, bool(fit.aborted))


def starting_point(
    model: Model, data_sets: Sequence[DataSet], names: Sequence[str], bounds: Bounds
) -> tuple[Coordinates, Array, Array, Array]:
    """Coordinates of a fit, the model's own values in them, and the lower and upper bounds, (k,) each."""
    points = sum(data_set.size for data_set in data_sets)
    if points <= len(names):
        raise FitError("too few points for the fit", found=f"{points} points for {len(names)} parameters")
    coordinates = Coordinates.of(model, names)
    least = {name: parameter.bounds[0] for name, parameter in model.parameters.items() if parameter.log}
    lifted = {name: value or least.get(name, 0.0) for name, value in model.values.items()}
    return coordinates, coordinates.point(lifted), *coordinate_bounds(coordinates, bounds)


def no_finite_response(model: Model) -> FitError:
    """The error of a fit whose model has no finite response to the tests."""
    return FitError(
        "the model has no finite response to these tests",
        found=", ".join(f"{name} = {value:.4g}" for name, value in model.values.items()),
        hint="give start values or bounds in [fit] of the campaign",
    )


def coordinate_bounds(coordinates: Coordinates, bounds: Bounds) -> tuple[Array, Array]:
    """Lower and upper bound of each coordinate, (k,) each."""
    ends = []
    for name, parameter in zip(coordinates.names, coordinates.parameters, strict=True):
        limits = zip(parameter.bounds, bounds.get(name, (None, None)), strict=True)
        ends.append(sorted(coordinates.forward(name, limit if own is None else own) for limit, own in limits))
    low, high = np.array(ends).T
    return low, high


def _lmfit_parameters(start: Array, low: Array | None = None, high: Array | None = None) -> lmfit.Parameters:
    """lmfit's parameters at a point, within bounds or without."""
    parameters = _blank_parameters(start.size)
    ends = np.broadcast_arrays(start, -np.inf if low is None else low, np.inf if high is None else high)
    for parameter, (value, least, most) in zip(parameters.values(), np.transpose(ends).tolist(), strict=True):
        parameter.set(value=value, min=least, max=most)
    return parameters


@cache
def _blank_parameters(count: int) -> lmfit.Parameters:
    """lmfit's parameters, kept for one fit after the other: to make them takes as long as to evaluate a model."""
    import lmfit

    parameters = lmfit.Parameters()
    parameters.add_many(*((f"u{i}",) for i in range(count)))
    return parameters


def at_bound(names: Sequence[str], point: Array, low: Array, high: Array) -> dict[str, End]:
    """The parameters that rest on a bound at a point, and on which, "min" or "max"."""
    near = _AT_BOUND * np.minimum(high - low, 1.0)
    rooms: dict[End, Array] = {"min": point - low, "max": high - point}
    return {name: end for end, room in rooms.items() for name, met in zip(names, room < near, strict=True) if met}
