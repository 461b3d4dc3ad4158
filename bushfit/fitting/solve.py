"""Least-squares fits with lmfit, for the paper's procedure."""

from __future__ import annotations

from contextlib import suppress
from functools import lru_cache

import numpy as np

from bushfit.errors import ModelError
from bushfit.fitting.descent import EVALUATIONS, TOLERANCE, Descent
from bushfit.fitting.problem import FitProblem, FitResult
from bushfit.model.model import Model


def solve_with_lmfit(problem: FitProblem) -> FitResult:
    """Minimise the sum of squared residuals by MINPACK through lmfit, for alternate static and dynamic fits.

    Args:
        problem: parameters to fit, tests and bounds.

    Returns:
        Result at the minimum.

    Raises:
        FitError: there are fewer data than parameters, or the response of the model is not finite.

    Notes:
        If a step leaves the bounds or MINPACK does not converge, `Descent` replaces it. Both methods find the same
        minimum: on the campaigns in configs/ and data/practice parameters differ by 1e-8.
        All other fits use `Descent`, which needs 0.4 to 0.9 of the time and supports bounds.
    """
    if not problem.names:
        return Descent.start(problem).solution
    import lmfit

    low, high = problem.limits
    free = lmfit.Parameters()
    free.add_many(*((f"u{i}", value) for i, value in enumerate(problem.start.tolist())))

    @lru_cache(maxsize=2)  # the best model and the current trial; tests cache the response of the last model object
    def model_at(*point: float) -> Model:
        """Model at a point of the fit, given by the coordinates of its free parameters."""
        if not np.all((low <= point) & (point <= high)):
            raise ModelError("a step of the fit leaves the bounds")
        return problem.model.with_values(problem.coordinates.values(point))

    # lmfit raises a ValueError if a residual is not finite; it also takes roots of its covariance, which is not used
    with suppress(ModelError, ValueError), np.errstate(invalid="ignore", divide="ignore"):
        fit = lmfit.minimize(
            lambda parameters: problem.residual(model_at(*parameters.valuesdict().values())),
            free,
            "leastsq",
            Dfun=lambda parameters: problem.linearise(model_at(*parameters.valuesdict().values()))[1],
            col_deriv=True,
            gtol=0.0,
            ftol=TOLERANCE,
            xtol=TOLERANCE,
            max_nfev=EVALUATIONS,
            calc_covar=False,
        )
        if not fit.aborted:
            best = model_at(*fit.params.valuesdict().values())
            at_bound = problem.at_bound(problem.coordinates.point(best.values))
            return FitResult(problem, best, *problem.linearise(best), int(fit.nfev), at_bound)
    return Descent.start(problem, TOLERANCE).run().solution
