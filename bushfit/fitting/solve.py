"""The least-squares problem and its solution by lmfit: Levenberg-Marquardt, with walls where it meets a bound.

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

_TOLERANCE = 1e-9
_MOST_EVALUATIONS = 400
#: A combination of parameters that moves the residuals by less, relative to the most, is the noise of derivatives.
_SEEN = 1e-10
#: A parameter this close to a bound rests on it, in coordinates, which are of order one however wide the bounds.
_AT_BOUND = 1e-3


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
    """Where a fit ended: the model, whitened residuals (n,), their derivatives by coordinate (k, n),
    model evaluations, the parameters that ended at a bound, with the end, and whether it was stopped on the way."""

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
        """How far a Gauss-Newton step of all parameters but those would lower chi-square."""
        free = [i for i, name in enumerate(self.coordinates.names) if name not in beside]
        left, values, _ = np.linalg.svd(self.jacobian[free].T, full_matrices=False)
        seen = values > _SEEN * values.max(initial=0.0)
        return float(np.sum(np.square(left[:, seen].T @ self.residual)))

    @property
    def flat(self) -> bool:
        """Whether no step takes chi-square, in units of the misfit's variance, further down than chance does."""
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
    evaluations: int = _MOST_EVALUATIONS,
    tolerance: float = _TOLERANCE,
    strict: bool = True,
) -> Solution:
    """Least squares over the named parameters, the others held, from the model's own values.

    Bounds are walls, not a transformation, so a parameter may come to rest on one: the trust-region reflective
    method. The paper's branches alone have one minimum and seldom meet a wall; they go MINPACK's shorter way, and
    back to the start and the other method where a step leaves the bounds.

    Args:
        model: where to start.
        data_sets: the data.
        names: parameters to move.
        bounds: limits inside the parameters' own.
        evaluations: most evaluations of the model.
        tolerance: relative change of chi-square and of the point at which the fit stops.
        strict: False takes the best point reached as it is when those are used up. Else chi-square has to be
            flat there.

    Raises:
        FitError: fewer data than parameters, or no convergence.
    """
    import lmfit

    coordinates, start, low, high = opening(model, data_sets, names, bounds or {})
    inside = 1e-6 * (high - low)
    start = np.clip(start, low + inside, high - inside)

    @lru_cache(maxsize=2)  # data sets know again the model they answered last: the best so far, and the one tried
    def model_at(point: tuple[float, ...]) -> Model:
        return model.with_values(coordinates.values(point))

    def at(parameters: lmfit.Parameters) -> Model:
        return model_at(tuple(parameter.value for parameter in parameters.values()))

    def misfit(parameters: lmfit.Parameters) -> Array:
        return residual(at(parameters), data_sets)

    def slopes(parameters: lmfit.Parameters) -> Array:
        return jacobian(at(parameters), data_sets, coordinates.names)

    ends = list(zip(low.tolist(), high.tolist(), strict=True))

    def within(parameters: lmfit.Parameters) -> Array:
        if not all(least <= u.value <= most for u, (least, most) in zip(parameters.values(), ends, strict=True)):
            raise _WallMetError
        return misfit(parameters)

    common: dict[str, Any] = {"max_nfev": evaluations, "ftol": tolerance, "xtol": tolerance, "calc_covar": False}
    fit = None
    try:
        with np.errstate(invalid="ignore", divide="ignore"):  # lmfit takes roots of a covariance nobody asked for
            if set(model.effects) <= set(BASE):
                with suppress(_WallMetError, ValueError):
                    free = list(_lmfit_parameters(start).values())  # which lmfit takes as they are, without a copy
                    fit = lmfit.minimize(within, free, "leastsq", Dfun=slopes, col_deriv=True, gtol=0.0, **common)
            if fit is None or fit.aborted:
                walled = _lmfit_parameters(start, low, high)
                by_point = {"jac": lambda parameters: slopes(parameters).T, "x_scale": "jac", "gtol": None}
                fit = lmfit.minimize(misfit, walled, "least_squares", **by_point, **common)
    except ValueError as error:  # lmfit's word for a residual that is not finite
        raise no_finite_response(model) from error
    end = np.array([parameter.value for parameter in fit.params.values()])
    best = model_at(tuple(end))
    found = Solution(
        best,
        coordinates,
        residual(best, data_sets),
        jacobian(best, data_sets, coordinates.names),
        int(fit.nfev),
        at_bound(coordinates.names, end, low, high),
        bool(fit.aborted),
    )
    if found.stopped and strict and not found.flat:
        raise FitError(
            "the fit did not converge",
            found=f"no end after {fit.nfev} evaluations of the model",
            hint="hold a parameter with vary = false, or give bounds, in [fit] of the campaign",
        )
    return found


class _WallMetError(Exception):
    """A step leaves the bounds."""


def opening(
    model: Model, data_sets: Sequence[DataSet], names: Sequence[str], bounds: Bounds
) -> tuple[Coordinates, Array, Array, Array]:
    """The coordinates of a fit, where in them the model's own values lie, and the walls, (k,) each.

    Raises:
        FitError: fewer data than parameters.
    """
    points = sum(data_set.size for data_set in data_sets)
    if points <= len(names):
        raise FitError("too few points for the fit", found=f"{points} points for {len(names)} parameters")
    coordinates = Coordinates.of(model, names)
    least = {name: parameter.bounds[0] for name, parameter in model.parameters.items() if parameter.log}
    lifted = {name: value or least.get(name, 0.0) for name, value in model.values.items()}
    return coordinates, coordinates.point(lifted), *walls(coordinates, bounds)


def no_finite_response(model: Model) -> FitError:
    """The error of a fit that cannot begin."""
    return FitError(
        "the model has no finite response to these tests",
        found=", ".join(f"{name} = {value:.4g}" for name, value in model.values.items()),
        hint="give start values or bounds in [fit] of the campaign",
    )


def walls(coordinates: Coordinates, bounds: Bounds) -> tuple[Array, Array]:
    """Lower and upper bound of each coordinate, (k,) each."""
    ends = []
    for name, parameter in zip(coordinates.names, coordinates.parameters, strict=True):
        limits = zip(parameter.bounds, bounds.get(name, (None, None)), strict=True)
        ends.append(sorted(coordinates.forward(name, limit if own is None else own) for limit, own in limits))
    low, high = np.array(ends).T
    return low, high


def _lmfit_parameters(start: Array, low: Array | None = None, high: Array | None = None) -> Any:
    parameters = _blank_parameters(start.size)
    lows, highs = (
        np.full(start.shape, end) if wall is None else wall for wall, end in ((low, -np.inf), (high, np.inf))
    )
    for parameter, value, least, most in zip(parameters.values(), start, lows, highs, strict=True):
        parameter.set(value=float(value), min=float(least), max=float(most))
    return parameters


@cache
def _blank_parameters(count: int) -> Any:
    """Parameters for one fit after the other: to make them takes as long as to evaluate a model."""
    import lmfit

    parameters = lmfit.Parameters()
    for i in range(count):
        parameters.add(f"u{i}")
    return parameters


def at_bound(names: Sequence[str], point: Array, low: Array, high: Array) -> dict[str, End]:
    """Coordinates that rest on a wall, and on which."""
    near = _AT_BOUND * np.minimum(high - low, 1.0)
    ends: dict[str, End] = {name: "min" for name, met in zip(names, point - low < near, strict=True) if met}
    return ends | {name: "max" for name, met in zip(names, high - point < near, strict=True) if met}
