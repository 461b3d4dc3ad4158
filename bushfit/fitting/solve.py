"""The least-squares problem and its solution by lmfit's Levenberg-Marquardt.

A fit moves the logarithm of strictly positive parameters and the others in units of their typical size, so
that every coordinate is of order one and two decades are a step like any other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bushfit.effects import Parameter
from bushfit.effects.contract import Array
from bushfit.errors import FitError
from bushfit.fitting.terms import Term
from bushfit.model import Model

if TYPE_CHECKING:
    import lmfit

Bounds = Mapping[str, tuple[float | None, float | None]]

_TOLERANCE = 1e-9
_MOST_EVALUATIONS = 400
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
    model evaluations, and the names of parameters that ended at a bound."""

    model: Model
    coordinates: Coordinates
    residual: Array
    jacobian: Array
    evaluations: int
    at_bound: tuple[str, ...]

    @property
    def chi_square(self) -> float:
        return float(self.residual @ self.residual)


def residual(model: Model, terms: Sequence[Term]) -> Array:
    """Whitened residuals of all terms, (n,)."""
    return np.concatenate([term.residual(model) for term in terms])


def jacobian(model: Model, terms: Sequence[Term], names: Sequence[str]) -> Array:
    """Derivatives of `residual` by parameter coordinate, (len(names), n)."""
    slopes = Coordinates.of(model, names).slopes(model.values)
    by_value = np.concatenate([term.jacobian(model, names) for term in terms], axis=-1)
    return by_value * slopes[:, None]


def solve(
    model: Model,
    terms: Sequence[Term],
    names: Sequence[str],
    bounds: Bounds | None = None,
    *,
    evaluations: int = _MOST_EVALUATIONS,
    tolerance: float = _TOLERANCE,
    strict: bool = True,
) -> Solution:
    """Least squares over the named parameters, the others held, from the model's own values.

    Trust-region reflective Levenberg-Marquardt by way of lmfit: bounds are walls, not a transformation, so a
    parameter may come to rest on one.

    Args:
        model: where to start.
        terms: the data.
        names: parameters to move.
        bounds: limits inside the parameters' own.
        evaluations: most evaluations of the model.
        tolerance: relative change of chi-square and of the point at which the fit stops.
        strict: False takes the best point reached as it is when those are used up.

    Raises:
        FitError: fewer data than parameters, or no convergence.
    """
    import lmfit

    points = sum(term.size for term in terms)
    if points <= len(names):
        raise FitError("too few points for the fit", found=f"{points} points for {len(names)} parameters")
    coordinates = Coordinates.of(model, names)
    start = _lmfit_parameters(model, coordinates, bounds or {})

    def at(parameters: lmfit.Parameters) -> Model:
        return model.with_values(coordinates.values([parameters[_key(name)].value for name in coordinates.names]))

    try:
        with np.errstate(invalid="ignore", divide="ignore"):  # lmfit takes roots of a covariance nobody asked for
            fit = lmfit.minimize(
                lambda parameters: residual(at(parameters), terms),
                start,
                method="least_squares",
                max_nfev=evaluations,
                jac=lambda parameters: jacobian(at(parameters), terms, coordinates.names).T,
                x_scale="jac",
                ftol=tolerance,
                xtol=tolerance,
                gtol=None,
                calc_covar=False,
            )
    except ValueError as error:  # lmfit's word for a residual that is not finite
        raise FitError(
            "the model has no finite response to these tests",
            found=", ".join(f"{name} = {value:.4g}" for name, value in model.values.items()),
            hint="give start values or bounds in [fit] of the campaign",
        ) from error
    best = at(fit.params)
    if fit.aborted and strict:
        raise FitError(
            "the fit did not converge",
            found=str(fit.message),
            hint="hold a parameter with vary = false, or give bounds, in [fit] of the campaign",
        )
    return Solution(
        best,
        coordinates,
        residual(best, terms),
        jacobian(best, terms, coordinates.names),
        int(fit.nfev),
        tuple(name for name in coordinates.names if _at_bound(fit.params[_key(name)])),
    )


def _key(name: str) -> str:
    """lmfit wants Python names."""
    return name.replace(".", "__")


def _lmfit_parameters(model: Model, coordinates: Coordinates, bounds: Bounds) -> Any:
    import lmfit

    parameters = lmfit.Parameters()
    for name, parameter in zip(coordinates.names, coordinates.parameters, strict=True):
        low, high = (
            limit if wanted is None else wanted
            for limit, wanted in zip(parameter.bounds, bounds.get(name, (None, None)), strict=True)
        )
        ends = sorted(coordinates.forward(name, limit) for limit in (low, high))
        inside = 1e-6 * (ends[1] - ends[0])
        value = np.clip(coordinates.forward(name, model.values[name] or low), ends[0] + inside, ends[1] - inside)
        parameters.add(_key(name), value=float(value), min=ends[0], max=ends[1])
    return parameters


def _at_bound(parameter: lmfit.Parameter) -> bool:
    near = _AT_BOUND * min(parameter.max - parameter.min, 1.0)
    return bool(parameter.value - parameter.min < near or parameter.max - parameter.value < near)
