"""Least-squares fits of a model's parameters to data sets, within bounds, to the end."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from functools import cache, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from bushfit.effects.contract import Array
from bushfit.errors import FitError
from bushfit.fitting.coordinates import (
    Bounds,
    Coordinates,
    Solution,
    at_bound,
    jacobian,
    residual,
    starting_point,
)
from bushfit.fitting.descent import Descent
from bushfit.fitting.preparation import MeasuredTest
from bushfit.model.model import Model

if TYPE_CHECKING:
    import lmfit

#: Evaluations of the model at most, ten to forty being the rule; and relative change of chi-square, or of the point, at
#: which a fit stops: far below what noise lets one see.
_EVALUATIONS, _TOLERANCE = 400, 1e-9


def solve(
    model: Model,
    data_sets: Sequence[MeasuredTest],
    names: Sequence[str],
    bounds: Bounds | None = None,
    *,
    evaluations: int = _EVALUATIONS,
    tolerance: float = _TOLERANCE,
    strict: bool = True,
) -> Solution:
    """Fit the named parameters by least squares, from the model's own values, the others held; without names all are.

    Args:
        bounds: limits inside the parameters' own; a parameter may come to rest on one.
        evaluations: of the model at most.
        tolerance: relative change of chi-square at which the fit stops.
        strict: whether a fit that has used up its evaluations is an error, unless chi-square is flat where it is.

    Returns:
        End of the fit.

    Raises:
        FitError: fewer data than parameters, no finite response, or no convergence.
    """
    if not names:
        misfit = residual(model, data_sets)
        return Solution(model, Coordinates((), ()), misfit, np.empty((0, misfit.size)), 1, {}, stopped=False)
    found = Descent.start(model, data_sets, names, bounds or {}, tolerance).finished(evaluations).solution
    if found.stopped and strict and not found.flat:
        raise FitError(
            "the fit did not converge",
            found=f"no end after {found.evaluations} evaluations of the model",
            hint="hold a parameter with vary = false, or give bounds, in [fit] of the campaign",
        )
    return found


def solve_with_lmfit(
    model: Model, data_sets: Sequence[MeasuredTest], names: Sequence[str], bounds: Bounds | None = None
) -> Solution:
    """Fit by lmfit's MINPACK, as the paper's procedure, static and dynamic fit in turn, is made.

    Args:
        model: model with the start values.
        data_sets: tests.
        names: parameters to fit.
        bounds: limits inside the parameters' own [SI].

    Raises:
        FitError: as of `solve`, which goes on where a step leaves the bounds or MINPACK comes to no end.

    Notes:
        Two roads to one minimum: on the campaigns in configs/ and data/practice they end 1e-8 apart in the parameters.
        All other fits take `solve`, which needs 0.4 to 0.9 of the time and keeps to bounds.
    """
    if names:
        with suppress(_OutOfBoundsError, ValueError):  # lmfit's word for a residual that is not finite
            found = _by_minpack(model, data_sets, names, bounds or {})
            if not found.stopped:
                return found
    return solve(model, data_sets, names, bounds)


class _OutOfBoundsError(Exception):
    """A step leaves the bounds."""


def _by_minpack(
    model: Model,
    data_sets: Sequence[MeasuredTest],
    names: Sequence[str],
    bounds: Bounds,
) -> Solution:
    import lmfit

    coordinates, start, low, high = starting_point(model, data_sets, names, bounds)

    @lru_cache(maxsize=2)  # data sets know again the model they answered last: the best so far, and the one tried
    def model_at(point: tuple[float, ...]) -> Model:
        if not np.all((low <= point) & (point <= high)):
            raise _OutOfBoundsError
        return model.with_values(coordinates.values(point))

    def model_of(parameters: lmfit.Parameters) -> Model:
        return model_at(tuple(parameter.value for parameter in parameters.values()))

    def misfit(parameters: lmfit.Parameters) -> Array:
        return residual(model_of(parameters), data_sets)

    def slopes(parameters: lmfit.Parameters) -> Array:
        return jacobian(model_of(parameters), data_sets, names)

    free = _blank_parameters(start.size)
    for parameter, value in zip(free.values(), np.clip(start, low, high).tolist(), strict=True):
        parameter.set(value=value)
    with np.errstate(invalid="ignore", divide="ignore"):  # lmfit takes roots of a covariance nobody asked for
        fit = lmfit.minimize(
            misfit,
            list(free.values()),  # which lmfit takes as they are, without a copy
            "leastsq",
            Dfun=slopes,
            col_deriv=True,
            gtol=0.0,
            ftol=_TOLERANCE,
            xtol=_TOLERANCE,
            max_nfev=_EVALUATIONS,
            calc_covar=False,
        )
    end = np.array([parameter.value for parameter in fit.params.values()])
    best, met = model_of(fit.params), at_bound(names, end, low, high)
    residuals, slope = residual(best, data_sets), jacobian(best, data_sets, names)
    return Solution(best, coordinates, residuals, slope, int(fit.nfev), met, bool(fit.aborted))


@cache
def _blank_parameters(count: int) -> lmfit.Parameters:
    """lmfit's parameters, kept for one fit after the other: to make them takes as long as to evaluate a model."""
    import lmfit

    parameters = lmfit.Parameters()
    parameters.add_many(*((f"u{i}",) for i in range(count)))
    return parameters
