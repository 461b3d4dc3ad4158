"""Least-squares fits of a model's parameters to tests, within bounds, to the end."""

from __future__ import annotations

from contextlib import suppress
from functools import cache, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from bushfit.errors import FitError
from bushfit.fitting.coordinates import jacobian, residual
from bushfit.fitting.descent import Descent
from bushfit.fitting.problem import FitProblem, FitResult
from bushfit.model.model import Model

if TYPE_CHECKING:
    import lmfit

#: Evaluations of the model at most, ten to forty being the rule; and relative change of chi-square, or of the point, at
#: which a fit stops: far below what noise lets one see.
_EVALUATIONS, _TOLERANCE = 400, 1e-9


def solve(
    problem: FitProblem, *, evaluations: int = _EVALUATIONS, tolerance: float = _TOLERANCE, strict: bool = True
) -> FitResult:
    """Minimise the sum of squares from the start values; a parameter may come to rest on a bound.

    Args:
        problem: parameters to fit, tests and bounds; without parameters the model is evaluated alone.
        evaluations: of the model at most.
        tolerance: relative change of chi-square at which the fit stops.
        strict: True if a fit that has used up its evaluations is an error, unless chi-square is flat where it is.

    Returns:
        The minimum.

    Raises:
        FitError: fewer data than parameters, no finite response, or no convergence.
    """
    if not problem.names:
        misfit = residual(problem.model, problem.tests)
        return FitResult(problem, problem.model, misfit, np.empty((0, misfit.size)))
    found = Descent.start(problem, tolerance).finished(evaluations).solution
    if found.stopped and strict and not found.flat:
        raise FitError(
            "the fit did not converge",
            found=f"no end after {found.evaluations} evaluations of the model",
            hint="fix a parameter with vary = false, or give bounds, in [fit] of the campaign",
        )
    return found


class _OutOfBoundsError(Exception):
    """A step leaves the bounds."""


def solve_with_lmfit(problem: FitProblem) -> FitResult:
    """Minimise by lmfit's MINPACK, as in the paper's procedure of static and dynamic fits in turn.

    Args:
        problem: parameters to fit, tests and bounds.

    Returns:
        The minimum.

    Raises:
        FitError: as of `solve`, which goes on where a step leaves the bounds or MINPACK comes to no end.

    Notes:
        Two roads to one minimum: on the campaigns in configs/ and data/practice they end 1e-8 apart in the parameters.
        All other fits take `solve`, which needs 0.4 to 0.9 of the time and keeps to bounds.
    """
    if not problem.names:
        return solve(problem)
    import lmfit

    start, (low, high), tests = problem.start, problem.limits, problem.tests
    free = _blank_parameters(start.size)
    for parameter, value in zip(free.values(), start.tolist(), strict=True):
        parameter.set(value=value)

    @lru_cache(maxsize=2)  # tests know again the model they answered last: the best so far, and the one tried
    def model_at(*point: float) -> Model:
        if not np.all((low <= point) & (point <= high)):
            raise _OutOfBoundsError
        return problem.model.with_values(problem.coordinates.values(point))

    def model_of(parameters: lmfit.Parameters) -> Model:
        return model_at(*(parameter.value for parameter in parameters.values()))

    # a residual that is not finite is a ValueError of lmfit, which takes roots of a covariance nobody asked for
    with suppress(_OutOfBoundsError, ValueError), np.errstate(invalid="ignore", divide="ignore"):
        fit = lmfit.minimize(
            lambda parameters: residual(model_of(parameters), tests),
            list(free.values()),  # which lmfit takes as they are, without a copy
            "leastsq",
            Dfun=lambda parameters: jacobian(model_of(parameters), tests, problem.names),
            col_deriv=True,
            gtol=0.0,
            ftol=_TOLERANCE,
            xtol=_TOLERANCE,
            max_nfev=_EVALUATIONS,
            calc_covar=False,
        )
        if not fit.aborted:
            best = model_of(fit.params)
            slopes = jacobian(best, tests, problem.names)
            at_bound = problem.at_bound(problem.coordinates.point(best.values))
            return FitResult(problem, best, residual(best, tests), slopes, int(fit.nfev), at_bound)
    return solve(problem)


@cache
def _blank_parameters(count: int) -> lmfit.Parameters:
    """lmfit's parameters, kept for one fit after the other: to make them takes as long as to evaluate a model."""
    import lmfit

    parameters = lmfit.Parameters()
    parameters.add_many(*((f"u{i}",) for i in range(count)))
    return parameters
