"""Refit the model with each candidate effect, all parameters together."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from bushfit.diagnosis.evidence import EVALUATIONS, Evidence
from bushfit.effects import qualified_name
from bushfit.effects.contract import Array
from bushfit.errors import FitError, ModelError
from bushfit.fitting.coordinates import Bounds
from bushfit.fitting.descent import Descent
from bushfit.fitting.design import shape_start_values
from bushfit.fitting.preparation import MeasuredTest
from bushfit.fitting.problem import FitProblem
from bushfit.fitting.shared_errors import SharedErrors
from bushfit.model.model import Model
from bushfit.progress import track

#: Chi-square above that of the best refit at which a refit is abandoned before it has converged.
_FAR = 60.0
#: Further decrease of chi-square that a fit may make, relative to the decrease that a linear model expects.
_MOST_FALL = 4.0
#: Number of model evaluations before which no refit is abandoned: parameters that the gap has distorted recover slowly.
_FIRST = 16


def refitted(
    evidence: Evidence,
    models: Mapping[str, Model],
    start: Mapping[str, float],
    fixed: Sequence[str],
    bounds: Bounds,
    columns: Array | None = None,
) -> dict[str, Evidence]:
    """Fit models with proposed effects; all parameters of each model are fitted together.

    Args:
        evidence: fit with the tests.
        models: models at their starting values, by the name of the effect.
        start: further starting values, by parameter.
        fixed: names of parameters that are not fitted.
        bounds: limits of parameters inside their general limits.
        columns: common errors of all tests, as residuals per standard deviation, (c, n); None without such errors.

    Returns:
        Fits by the name of the effect; fits far behind the best, and effects without a response, are left out.
    """
    fits, tests = dict[str, Descent](), evidence.data_sets
    shared_error = None if columns is None else SharedErrors.from_columns(columns)
    for name, model in models.items():
        model = model.with_values({key: value for key, value in start.items() if key in model.values})
        limits = {**within_reach(model, tests), **bounds}  # at the start, because the gap has distorted the fit before
        with suppress(FitError, ModelError):  # no response with this effect: no candidate
            problem = FitProblem.with_fixed(model, tests, fixed, limits)
            fits[name] = Descent.start(replace(problem, shared_error=shared_error))
    running, best = list(fits), 0.0
    for _ in track("evaluations of effects", range(1, EVALUATIONS)):
        for name in running:
            fits[name] = fits[name].run(fits[name].evaluations + 1)
        best = min((fit.chi_square for fit in fits.values()), default=0.0)
        for name in list(running):
            fit = fits[name]
            behind = fit.evaluations >= _FIRST and fit.chi_square - _MOST_FALL * fit.expected_fall >= best + _FAR
            if fit.converged or behind:
                running.remove(name)
        if not running:
            break
    near = {
        name: fit.solution
        for name, fit in fits.items()
        if fit.converged or fit.evaluations >= EVALUATIONS or fit.chi_square <= best + _FAR
    }
    if columns is None:
        return {name: Evidence(solution) for name, solution in near.items()}
    plain = {name: solution.reevaluate(solution.model, tests) for name, solution in near.items()}
    return {name: Evidence(plain[name], solution) for name, solution in near.items()}


def within_reach(model: Model, data_sets: Sequence[MeasuredTest]) -> Bounds:
    """Limits of the shape parameters of effects to the range that the tests can show.

    For example, a stop that is always in contact is a spring, and a resonance far above all frequencies is a mass.

    Args:
        model: model with the effects.
        data_sets: the tests.

    Returns:
        Lower and upper limit by parameter name.
    """
    shapes = [
        (qualified_name(effect, parameter), parameter)
        for effect in model.records
        for parameter in effect.parameters
        if parameter.scale
    ]
    tried = {name: shape_start_values(data_sets, model, parameter) for name, parameter in shapes}
    return {name: (float(values.min()), float(values.max())) for name, values in tried.items() if np.ptp(values) > 0.0}
