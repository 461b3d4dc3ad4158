"""Robust fits: loss soft_l1, with outliers left out and listed.

Notes:
    A complex point is one observation: an outlier is judged by gain and phase together. The loss acts on the error of
    each point after the error shared by its block is subtracted, so that an outlier does not affect its block. The fit
    is therefore reweighted, with weights on the noise of each point, instead of a loss on single whitened residuals.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from bushfit.caveat import Caveat
from bushfit.effects.contract import Array
from bushfit.errors import FitError
from bushfit.fitting.descent import TOLERANCE, Descent
from bushfit.fitting.outliers import misfit_scale
from bushfit.fitting.preparation import MeasuredTest
from bushfit.fitting.problem import FitProblem, FitResult
from bushfit.fitting.solve import solve_with_lmfit
from bushfit.model.model import Model
from bushfit.model.result import Outlier

#: Distance, in units of noise, around which soft_l1 changes from squares to absolute values; it costs 4 % of efficiency
#: under normal noise.
_SOFT = 2.0
#: Efficiency (E psi')^2/E psi^2 of soft_l1 under normal noise, by the number of residuals of a point: psi is the
#: derivative of the loss by the distance of a point in units of noise, and E the mean over all distances.
_EFFICIENCY = {1: 0.9768665463299635, 2: 0.9892965108936514}
#: Change of the parameters, in standard errors, below which reweighting has converged: far below their uncertainty.
_SETTLED = 0.01
#: Largest number of rounds of reweighting; chosen: most fits need five, and a fit that needs more oscillates.
_MOST_ROUNDS = 30
#: Largest number of rows of a test that a sentence lists.
_MOST_NAMED = 8


def list_outliers(
    model: Model, data_sets: Sequence[MeasuredTest], outlying: Sequence[Array] | None = None
) -> tuple[Outlier, ...]:
    """List the outliers of tests by file and row, for warnings and tables.

    Args:
        model: fitted model.
        data_sets: tests.
        outlying: indices of the outliers of each test, (k,) each; None to find them with the model.
    """
    numbers = outlying or [data_set.outlier_indices(model) for data_set in data_sets]
    pairs = zip(data_sets, numbers, strict=True)
    return tuple(entry for data_set, points in pairs for entry in data_set.outliers(points, model))


def solve_problem(problem: FitProblem, *, robust: bool = False, lmfit: bool = False) -> FitResult:
    """Solve a fit problem by least squares, or robustly by the loss soft_l1 without the outliers of sweeps.

    soft_l1 minimises the sum of 2 C^2 (sqrt(1 + (z/C)^2) - 1), C = 2, over the distances z of points in units of noise.
    The covariance is that of least squares with all weights equal to the efficiency of this loss under normal noise.
    Outliers of loops already have weight 0, see `prepare_loop`.

    Args:
        problem: parameters to fit, tests and bounds.
        robust: True for soft_l1.
        lmfit: True to minimise with lmfit, as in alternate static and dynamic fits.

    Returns:
        Result of the fit, with its outliers.

    Raises:
        FitError: there are fewer data than parameters, the response is not finite, or the fit does not converge.
    """
    current, tests = problem, problem.tests
    for _ in range(_MOST_ROUNDS):
        model = current.model
        if robust:
            outlying = [test.outlier_indices(model) for test in tests]
            retained = [test.without(points) for test, points in zip(tests, outlying, strict=True)]
            softened = []
            for test in retained:
                distance, parts = test.distance(model), test.residuals_per_point
                scale = _SOFT * misfit_scale(distance[distance > 0.0] * np.sqrt(parts), parts)
                softened.append(test.weighted(1.0 / np.sqrt(1.0 + (distance / scale) ** 2)))
            current = replace(problem, model=model, tests=softened)
        found = solve_with_lmfit(current) if lmfit else Descent.start(current, TOLERANCE).run().solution
        if found.stopped and not found.at_minimum:
            raise FitError(
                "the fit did not converge",
                found=f"no convergence after {found.evaluations} evaluations of the model",
                hint="fix a parameter with vary = false, or give bounds, in [fit] of the campaign",
            )
        if not robust:
            return replace(found, outliers=list_outliers(found.model, tests))
        before, after = (found.coordinates.point(fitted.values) for fitted in (model, found.model))
        change, current = (after - before) @ found.jacobian, replace(problem, model=found.model)
        if float(change @ change) < _SETTLED**2:
            model = found.model
            weighed = [test.weighted(np.array(_EFFICIENCY[test.residuals_per_point])) for test in retained]
            outliers = list_outliers(model, retained, outlying)
            return replace(found, covariance_tests=weighed, noise_weighted=retained, outliers=outliers)
    raise FitError(
        "the robust fit does not converge",
        found=f"{_MOST_ROUNDS} rounds of reweighting",
        hint="look at the rows that --loss linear warns of, and remove these rows from the file",
    )


def outlier_warnings(outliers: Sequence[Outlier], *, robust: bool) -> Iterator[Caveat]:
    """Yield warnings about the outliers that the fit includes and those that it leaves out, with the first rows.

    Several tests of one file are named, and their rows are counted from 1. Outliers of the displacement are always left
    out, see `prepare_loop`.

    Args:
        outliers: outliers of all tests.
        robust: True if the fit left the outliers out.

    Yields:
        A warning for included outliers and one for outliers left out, if there are any.
    """
    for is_excluded, kind, decision in (
        (False, "outliers_included", " and the fit includes them: {}; --loss soft_l1 leaves them out"),
        (True, "outliers_excluded", ", left out of the fit: {}"),
    ):
        rows, lists = defaultdict[str, list[str]](list), []
        for outlier in outliers:
            if (robust or outlier.column == "displacement") == is_excluded:
                is_whole = outlier.file and outlier.test in (outlier.file, Path(outlier.file).stem)
                rows[f"{outlier.file if is_whole else outlier.test}, {outlier.column}"].append(str(outlier.row))
        for file, numbers in rows.items():
            more = f" and {len(numbers) - _MOST_NAMED} more" if len(numbers) > _MOST_NAMED else ""
            lists.append(f"{file} row{'s' if len(numbers) > 1 else ''} {', '.join(numbers[:_MOST_NAMED])}{more}")
        if count := sum(map(len, rows.values())):
            points = f"{count} point{'s lie' if count > 1 else ' lies'} farther from the model than noise explains"
            yield Caveat(kind, points + decision.format("; ".join(lists)))
