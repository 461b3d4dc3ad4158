"""Fits of models to all tests of a campaign: one model, rival effects side by side, and the result for model.json."""

from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from bushfit.campaign.schema import UNSTATED, RigSettings
from bushfit.caveat import Caveat
from bushfit.effects import qualified_name
from bushfit.effects.contract import Array
from bushfit.errors import FitError, ModelError
from bushfit.fitting.agreement import expected_errors
from bushfit.fitting.assess import temperature_warning
from bushfit.fitting.coordinates import Bounds
from bushfit.fitting.descent import Descent
from bushfit.fitting.design import shape_start_values
from bushfit.fitting.levels import LevelErrors
from bushfit.fitting.model_error import with_excess_errors
from bushfit.fitting.preparation import MeasuredTest, with_level_errors
from bushfit.fitting.problem import FitProblem, FitResult
from bushfit.fitting.procedures import build_result
from bushfit.fitting.shared_errors import SharedErrors
from bushfit.model.covariance import Covariance
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.progress import track

#: Maximum number of model evaluations in one fit; a model that fits badly is used unconverged.
EVALUATIONS = 40
#: Chi-square above that of the best refit at which a refit is abandoned before it has converged.
_FAR = 60.0
#: Further decrease of chi-square that a fit may make, relative to the decrease that a linear model expects.
_MOST_FALL = 4.0
#: Number of model evaluations before which no refit is abandoned: parameters that the gap has distorted recover slowly.
_FIRST = 16
#: Warning for a model with a smooth correction.
_CORRECTED = Caveat(
    "gap_in_parameters",
    "a smooth correction closes a gap whose cause is not certain: "
    "the parameters and their intervals contain a part of this gap",
)


def fit_model(model: Model, data_sets: Sequence[MeasuredTest], fixed: Sequence[str], bounds: Bounds) -> FitResult:
    """Fit the parameters of a model to tests, starting from the model's values.

    Args:
        model: the model at its starting values.
        data_sets: the tests.
        fixed: names of parameters that are not fitted.
        bounds: limits of parameters inside their general limits.

    Returns:
        The fitted model with its tests.

    Raises:
        FitError: fewer data than parameters, or no finite response.
        ModelError: no response.
    """
    return Descent.start(FitProblem.with_fixed(model, data_sets, fixed, bounds)).run(EVALUATIONS).solution


def start_rivals(
    models: Mapping[str, Model],
    data_sets: Sequence[MeasuredTest],
    start: Mapping[str, float],
    fixed: Sequence[str],
    bounds: Bounds,
) -> dict[str, Descent]:
    """Start the fits of several models with proposed effects, for `fit_rivals`.

    Args:
        models: models at their starting values, by the name of the effect.
        data_sets: the tests.
        start: further starting values, by parameter.
        fixed: names of parameters that are not fitted.
        bounds: limits of parameters inside their general limits.

    Returns:
        Fits before their first step, by the name of the effect; effects without a response are left out.
    """
    fits = dict[str, Descent]()
    for name, model in models.items():
        model = model.with_values({key: value for key, value in start.items() if key in model.values})
        limits = {**within_reach(model, data_sets), **bounds}  # at the start: the gap has distorted the fit before
        with suppress(FitError, ModelError):  # no response with this effect: no candidate
            fits[name] = Descent.start(FitProblem.with_fixed(model, data_sets, fixed, limits))
    return fits


def fit_rivals(starts: Mapping[str, Descent], columns: Array | None = None) -> dict[str, FitResult]:
    """Fit several models with proposed effects one step each in turn, and abandon those far behind the best.

    Args:
        starts: fits before their first step, by the name of the effect, from `start_rivals`.
        columns: errors that the tests have in common: change of the whitened residuals per standard deviation of each
            of c errors, (c, n); None without such errors.

    Returns:
        Fits by the name of the effect; fits far behind the best are left out.
    """
    fits = dict(starts)
    if columns is not None:
        error = SharedErrors.from_columns(columns)
        fits = {name: replace(fit, best=fit.best.with_shared_error(error)) for name, fit in fits.items()}
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
    return {
        name: fit.solution
        for name, fit in fits.items()
        if fit.converged or fit.evaluations >= EVALUATIONS or fit.chi_square <= best + _FAR
    }


def within_reach(model: Model, data_sets: Sequence[MeasuredTest]) -> Bounds:
    """Bounds of the effects' shape parameters (all but amounts) within which the tests can distinguish their values.

    Beyond these bounds an effect becomes another one: a stop that is always in contact is a spring, and a resonance far
    above all frequencies is a mass.

    Args:
        model: model with the effects.
        data_sets: the tests.

    Returns:
        Lower and upper bound by parameter name.
    """
    tried = {
        qualified_name(effect, parameter): shape_start_values(data_sets, model, parameter)
        for effect in model.records
        for parameter in effect.parameters
        if parameter.scale
    }
    return {
        name: (float(values.min()), float(values.max()))
        for name, values in tried.items()
        if not np.allclose(values, values[0], atol=0.0)
    }


def result_of(
    fit: FitResult,
    bounds: Bounds,
    resolved: Collection[str],
    *,
    lacking: bool = True,
    corrected: FitResult | None = None,
    rig: RigSettings = UNSTATED,
    fixed: Covariance | None = None,
) -> Result:
    """Build the result to report from a fit: model, uncertainty, misfit and warnings.

    Args:
        fit: the fitted model and the tests.
        bounds: limits of parameters inside their general limits.
        resolved: names of effects that are known to be in the bushing. Any other effect with a twin (an effect of the
            rig with the same response) is reported as unresolved.
        lacking: True to estimate an error of the model from the misfit; False if the misfit is due to a recording
            mistake.
        corrected: fit in which a smooth correction of the model is a random error; None if the model has no correction.
        rig: stated accuracy class of the rig (gain and phase errors).
        fixed: covariance of the parameters that the fit kept fixed; None if their values are exact.

    Returns:
        The model with covariance, quality, range, warnings and expected error.
    """

    def with_levels(model: Model, errors: LevelErrors) -> FitResult:
        """Repeat the fit with a further error that all runs at one amplitude or frequency (a level) have in common."""
        tests = with_level_errors(fit.problem.tests, errors.error, errors.freedom)
        return Descent.start(replace(fit.problem, model=model, tests=tests)).run(EVALUATIONS).solution

    closest, error, misses = fit, None, list[Caveat]()
    if corrected:
        closest, misses = replace(corrected, noise_weighted=fit.data_sets), [_CORRECTED]
    elif lacking:
        closest, error, misses = with_excess_errors(fit, bounds, rig, with_levels)
    model = fit.model if corrected else closest.model
    notes = (*misses, *temperature_warning(model, fit.data_sets))
    return replace(
        build_result([closest], bounds, model=model, fixed=fixed, notes=notes, bounded_is_fixed=True),
        # a correction is estimated from every run, so none is held out
        usable=expected_errors(model, fit.data_sets, fit=None if corrected else closest),
        model_error=error,
        unresolved=tuple(effect.name for effect in model.records if effect.twins and effect.name not in resolved),
    )


def misfit_covariance(fit: FitResult) -> Covariance:
    """Covariance of the fitted parameters that are not at a bound, times the reduced chi-square if it exceeds 1."""
    free = fit.jacobian[fit.inner_indices]
    matrix = np.linalg.pinv(free @ free.T, rcond=1e-12, hermitian=True)
    matrix *= max(fit.chi_square / max(fit.residual.size - len(matrix), 1), 1.0)  # scaled by the misfit
    slopes = fit.coordinates.slopes(fit.model.values)[fit.inner_indices]
    return Covariance(tuple(fit.names[i] for i in fit.inner_indices), matrix * np.outer(slopes, slopes))
