"""Closest fit of a model that misses its tests, and the remaining error that intervals and bands include.

No rubber follows the model exactly, so the best parameters are those whose model is closest to the tests. If the tests
show a lack of fit, the estimate is therefore a least-squares fit with the noise plus a model error that is independent
from operating point to operating point and has one relative size. In fact the discrepancy is smooth. A Gaussian process
describes it in the covariance of the estimate and in the bands of predictions, but not in the weights of the fit, where
it could imitate the parameters.

Notes:
    The estimate is that of L2 calibration (R. Tuo, C. F. J. Wu, Ann. Statist. 43 (2015) 2331-2352) on the operating
    points of the tests; a process in the weights would have to be orthogonal to the parameters (M. Plumlee, J. Am.
    Stat. Assoc. 112 (2017) 1274-1285; M. Gu, L. Wang, SIAM/ASA J. Uncertain. Quantif. 6 (2018) 1555-1583). Its
    covariance is the sandwich J^+ V J^+^T (H. White, Econometrica 50 (1982) 1-25), V the covariance of noise and
    process. Sizes and lengths maximise the restricted likelihood (H. D. Patterson, R. Thompson, Biometrika 58 (1971)
    545-554).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from bushfit.campaign.schema import UNSTATED, RigSettings
from bushfit.caveat import Caveat
from bushfit.effects import BASE
from bushfit.effects.unnamed import SmoothCorrection
from bushfit.errors import FitError, ModelError
from bushfit.fitting.assess import excess_chi_square
from bushfit.fitting.coordinates import ROUNDING, Bounds, Coordinates, prior_covariance
from bushfit.fitting.descent import TOLERANCE, Descent, repeat_fit
from bushfit.fitting.discrepancy import (
    COMPOUND_LENGTHS,
    OVER_FREQUENCY,
    OVER_STRAIN,
    SIZES,
    Discrepancy,
    FittedTests,
    average_processes,
    candidate_processes,
)
from bushfit.fitting.levels import LevelErrors, level_error_columns, level_errors
from bushfit.fitting.noise import SweepNoise
from bushfit.fitting.preparation import MeasuredLoop, MeasuredTest, residual_slices, split_by_kind, with_sweep_noise
from bushfit.fitting.problem import FitProblem, FitResult, SmoothError
from bushfit.fitting.rig_class import UNSTATED_LEVEL, class_errors, format_class_errors, largest_error
from bushfit.fitting.shared_errors import SharedErrors
from bushfit.fitting.starts import start_values
from bushfit.gaussian_process import MAXIMUM_NODES, RestrictedLikelihood
from bushfit.model.model import Model
from bushfit.units import number

#: Smallest and largest size of the process relative to the size of the independent model error; above 1, because fitted
#: parameters absorb a part of a smooth error.
_SMOOTH_RATIO = (1.0, 3.0)
#: Largest number of points of a sweep that represent a process; chosen for time.
_ENOUGH = 600
#: Number of points above which short lengths in frequency (ripples) are also tried.
_DENSE = 300
#: Relative error and reduced chi-square up to which a model agrees with its tests, as in `diagnose` and `batch`.
_SLIGHT_ERROR, BEYOND_NOISE = 0.01, 2.0
#: Prior odds of a smooth error of the model against none, as in `diagnose`.
_ODDS = 0.2
#: Screening process: lengths in ln frequency and ln strain; increase of the log likelihood up to which no other process
#: is tried (chosen: three in four campaigns without model error stay below); and number of nodes, few because it only
#: decides whether to continue.
_SCREENING_LENGTHS, _SCREENING_GAIN, _SCREENING_NODES = (0.9, 2.0), 0.5, 16
#: Largest number of alternating estimates of size and parameters, and relative change of the size at which they have
#: converged: far below the uncertainty of the size.
_MAXIMUM_ROUNDS, _SETTLED = 12, 0.02


def with_excess_errors(
    plain_fit: FitResult, bounds: Bounds, rig: RigSettings, refit: Callable[[Model, LevelErrors], FitResult]
) -> tuple[FitResult, SmoothCorrection | None, list[Caveat]]:
    """Repeat a fit with errors beyond the noise that its tests show: of the model, or shared by the runs of a level.

    A level is one constant amplitude or frequency. If levels disagree by more than chance explains, the rig or the
    model may be the cause, so the fit includes errors of both. A misfit that a wrong prior causes is no error, so the
    errors are those of a fit with weak priors.

    Args:
        plain_fit: least-squares fit with the noise alone.
        bounds: limits of parameters [SI], inside their default limits.
        rig: accuracy class of the rig (stated gain and phase errors).
        refit: function that repeats the fit from the given model with the given errors of levels in the noise.

    Returns:
        The fit; the error of the model as a correction of the stiffness, or None; and a warning if the model misses its
        tests.
    """
    model, constraints = plain_fit.model, plain_fit.model.constraints
    if constraints.priors:
        alone = repeat_fit(plain_fit, replace(model, constraints=constraints.weaken(*constraints.priors)))
        found, error, notes = _with_excess_errors(alone, bounds, rig, refit)
        return (plain_fit if found is alone else repeat_fit(found, model)), error, notes
    return _with_excess_errors(plain_fit, bounds, rig, refit)


def _with_excess_errors(
    plain_fit: FitResult, bounds: Bounds, rig: RigSettings, refit: Callable[[Model, LevelErrors], FitResult]
) -> tuple[FitResult, SmoothCorrection | None, list[Caveat]]:
    """Repeat a fit with the errors that its tests show, see `with_excess_errors`; its priors are taken as right."""
    found, error = with_model_error(plain_fit, bounds, rig)
    if error:
        size = max(error.rms, *(test.model_error for test in found.problem.tests))
        sentence = (
            f"the tests deviate from the model by {number(100.0 * size, 2)} % beyond noise: "
            "parameters are the closest fit, and their intervals include this deviation"
        )
        is_slight = size <= _SLIGHT_ERROR and plain_fit.reduced_chi_square < BEYOND_NOISE
        return found, error, [Caveat("slight_model_error" if is_slight else "model_error", sentence)]
    if not found.names:
        return found, None, []
    errors = level_errors(found.problem.tests, found.residual, found.jacobian, largest_error(rig))
    if errors.freedom and any(errors.error):
        found = refit(found.model, errors)
    if errors.significant:
        found, error = with_model_error(found, bounds, certain=True)
    text = (
        f"levels disagree by more than their repeats, as if each had an error of {format_class_errors(errors.error)}: "
        "parameters are the closest fit, and their intervals include this error"
    )
    return found, error, [Caveat("levels_disagree", text)] if error else []


def with_model_error(
    plain_fit: FitResult, bounds: Bounds, rig: RigSettings = UNSTATED, *, certain: bool = False
) -> tuple[FitResult, SmoothCorrection | None]:
    """Refit a model that misses its tests, with an error of the model added to the noise; otherwise keep the fit.

    Args:
        plain_fit: least-squares fit with the noise alone.
        bounds: limits of parameters [SI], inside their default limits.
        rig: accuracy class of the rig (stated gain and phase errors), which may explain a misfit.
        certain: True if it is known already that the tests differ from the model by more than noise.

    Returns:
        The fit, and the discrepancy as a correction of the stiffness; `plain_fit` and None if the model fits, or if the
        misfit is too large to be an error of this model.
    """
    if not plain_fit.names:
        return plain_fit, None
    if not (certain or _exceeds_noise(_with_rig_errors(plain_fit, rig)) or _is_smooth(plain_fit, rig)):
        return plain_fit, None
    closest, size = closest_fit(plain_fit, bounds)
    if size >= SIZES[-1]:  # too large to be an error of this model
        return plain_fit, None
    with_levels = _with_unseen_level_errors(plain_fit.problem.tests, rig)
    tests = FittedTests(closest.reevaluate(closest.model, _thin_sweeps(with_levels, size)))
    sizes = np.geomspace(_SMOOTH_RATIO[0] * size, _SMOOTH_RATIO[1] * size, 9)
    processes = [replace(process, sizes=sizes) for process in candidate_processes(tests)]
    likeliest = max(processes, key=lambda process: process.maximum[0])
    error = average_processes(processes)
    if error.rms >= SIZES[-1]:
        return plain_fit, None
    weighed = [test.with_model_error(size) for test in plain_fit.covariance_tests or with_levels]
    shape, likeliest_size = (likeliest.groups, likeliest.lengths), likeliest.maximum[1]
    freedom = likeliest.likelihood.freedom(likeliest_size)
    del tests, processes, likeliest  # their residuals take as much memory as those of the next step
    process = Discrepancy.over_tests(FittedTests(closest.reevaluate(closest.model, weighed)), *shape, MAXIMUM_NODES)
    smooth_error = SmoothError(likeliest_size * process.columns, process.tests.project, freedom)
    closest = replace(closest, noise_weighted=plain_fit.data_sets, outliers=plain_fit.outliers)
    return replace(closest, covariance_tests=weighed, smooth_error=smooth_error), error


def closest_fit(plain_fit: FitResult, bounds: Bounds) -> tuple[FitResult, float]:
    """Fit by least squares with the noise and an independent model error of a size that is estimated as well.

    Size (by restricted likelihood) and parameters are estimated in turn until the size converges.

    Args:
        plain_fit: least-squares fit with the noise alone.
        bounds: limits of parameters [SI], inside their default limits.

    Returns:
        The fit, and the standard deviation of the model error relative to the stiffness.
    """
    tests, names, starts = plain_fit.problem.tests, plain_fit.names, [plain_fit.model]
    fixed = {name: value for name, value in plain_fit.model.values.items() if name not in names}
    with suppress(FitError):  # start values beyond the bounds: moduli that no rubber has
        # a second start from values estimated from the tests, because the fit may have reduced a branch to zero
        paper = Model.with_defaults(plain_fit.model.bushing, BASE, start_values(plain_fit.model.bushing, tests, fixed))
        of_effects = [paper.start_values_for(effect)[0] for effect in plain_fit.model.records]
        values = {**paper.values, **{name: value for start in of_effects for name, value in start.items()}}
        starts.append(plain_fit.model.with_values({name: values[name] for name in names if name in values}))
    size = np.inf
    for start in starts:
        size = np.fmin(size, likeliest_model_error(start, tests, names))
    for _ in range(_MAXIMUM_ROUNDS):
        weighted, ends = [test.with_model_error(size) for test in tests], list[FitResult]()
        for start in starts:
            with suppress(FitError, ModelError):  # the model has no response at these start values
                ends.append(Descent.start(FitProblem(start, weighted, names, bounds), TOLERANCE).run().solution)
        solution = min(ends, key=lambda end: end.chi_square)
        starts, before = [solution.model], size
        size = likeliest_model_error(solution.model, tests, [names[i] for i in solution.inner_indices])
        if abs(np.log(size / before)) < _SETTLED or size >= SIZES[-1]:
            break
    return solution, size


def likeliest_model_error(model: Model, data_sets: Sequence[MeasuredTest], names: Sequence[str]) -> float:
    """Size of the independent model error, relative to the stiffness, by maximum restricted likelihood.

    Args:
        model: model near the minimum, at which the residuals are linearised.
        data_sets: tests.
        names: names of the k fitted parameters.

    Returns:
        Standard deviation of the model error relative to the stiffness.

    Notes:
        The log likelihood is -(ln|S| + r^T P r + ln|J S^-1 J^T|)/2 with the covariance S of noise and model error, the
        Jacobian J, (k, n), the residuals r, and P = S^-1 - S^-1 J^T (J S^-1 J^T)^-1 J S^-1.
    """
    from scipy.optimize import minimize_scalar  # slow to import, and rarely needed

    problem = FitProblem(model, [test.with_independent_noise() for test in data_sets], names)
    rows = np.vstack(problem.linearise(model))
    errors = [(test.unit_model_error, block) for test, block in zip(data_sets, residual_slices(data_sets), strict=True)]
    products = rows @ rows.T
    components = np.hstack([error.components(rows[:, block]) * error.deviations for error, block in errors])
    variance = np.concatenate([np.square(error.deviations) for error, _ in errors])

    def cost(log_size: float) -> float:
        """Minus twice the log of the restricted likelihood, given the natural log of the model error's size.

        Returns:
            The value, up to a constant.
        """
        square = float(np.exp(2.0 * log_size))
        grown = 1.0 + square * variance
        both = products - components * (square / grown) @ components.T
        units = np.sqrt(np.maximum(np.diag(both)[1:], np.finfo(float).tiny))
        size, vectors = np.linalg.eigh(both[1:, 1:] / np.outer(units, units))
        significant = size > ROUNDING * size.max(initial=0.0)
        absorbed = np.square(both[0, 1:] / units @ vectors[:, significant]) / size[significant]
        information = np.sum(np.log(size[significant])) + 2.0 * np.sum(np.log(units))
        return float(np.sum(np.log(grown)) + both[0, 0] - absorbed.sum() + information)

    low, high = np.log(SIZES[[0, -1]]).tolist()
    found = minimize_scalar(cost, bounds=(low, high), method="bounded", options={"xatol": _SETTLED / 2.0})
    return float(np.exp(found.x))


def log_likelihood(solution: FitResult, prior_precision: Mapping[str, float]) -> float:
    """Natural log of the evidence of a fit: its likelihood, integrated over the parameters that are not at a bound.

    The integral is by Laplace's method. If the model misses the tests, the errors include a Gaussian process, and the
    likelihood is averaged over the process's sizes and lengths.

    Args:
        solution: result of the fit.
        prior_precision: precision (inverse variance) of the prior of each parameter, in its dimensionless coordinate; 0
            for the other parameters.

    Returns:
        Natural log of the likelihood, up to a constant that is the same for all models.
    """
    size = max(test.model_error for test in solution.problem.tests)
    tests = FittedTests(solution.reevaluate(solution.model, _thin_sweeps(solution.problem.tests, size)))
    rows, residual = tests.free_jacobian, tests.solution.residual
    information, gain = rows @ rows.T, 0.0
    if size:
        components, processes = tests.project(residual), candidate_processes(tests)
        columns = [process.columns for process in processes]
        likelihoods = [
            RestrictedLikelihood.from_columns(rows, components, np.empty((0, components.size))) for rows in columns
        ]
        evidence = np.array([likelihood.log_evidence(SIZES) for likelihood in likelihoods])
        gain = float(np.logaddexp.reduce(evidence)) - np.log(evidence.size)
        best = int(evidence.argmax())
        shares = columns[best] * SIZES[likelihoods[best].gains(SIZES).argmax()]
        across = shares @ tests.project(tests.free_jacobian).T
        information = information - across.T @ np.linalg.solve(shares @ shares.T + np.eye(len(shares)), across)
    precision = np.array([prior_precision.get(solution.names[i], 0.0) for i in solution.inner_indices])
    information = information + np.diag(precision)
    log_size = sum(np.log1p(np.square(x.shared_errors.deviations)).sum() for x in split_by_kind(tests.data_sets)[0])
    log_size += float(np.linalg.slogdet(information)[1] - np.log(precision[precision > 0.0]).sum())
    for prior in solution.model.constraints.priors:
        names = [name for name in prior.names if name in solution.names]
        covariance = prior_covariance(prior, Coordinates.of_parameters(solution.model, names))
        log_size += float(np.linalg.slogdet(covariance)[1])
    return gain - 0.5 * (float(residual @ residual) + log_size)


def _exceeds_noise(tests: FittedTests) -> bool:
    """True if chi-square, of all tests or of one, exceeds its expectation by 5 standard deviations."""
    solution, counts = tests.solution, [test.residual_count for test in tests.data_sets]
    squares = [float(np.sum(np.square(solution.residual[rows]))) for rows in residual_slices(tests.data_sets)]
    freedom = max(sum(counts) - len(solution.names), 1)
    pairs = [(sum(squares), freedom), *zip(squares, counts, strict=True)]
    return any(excess_chi_square(square / count, count) is not None for square, count in pairs if count)


def _is_smooth(plain_fit: FitResult, rig: RigSettings) -> bool:
    """True if the misfit is more probable with a smooth error of the model than with errors of noise and rig alone."""
    tests = _with_rig_errors(plain_fit.reevaluate(plain_fit.model, _thin_sweeps(plain_fit.problem.tests)), rig)
    names = tuple(dict.fromkeys(tests.directions.tolist()))
    compound = Discrepancy.over_tests(tests, (names,), COMPOUND_LENGTHS, _SCREENING_NODES)
    # the prior odds of an error with the lengths of the compound are 1
    if compound.maximum[0] > _SCREENING_GAIN and compound.likelihood.log_evidence(SIZES) > 0.0:
        return True
    quick = [Discrepancy.over_tests(tests, (names,), _SCREENING_LENGTHS, _SCREENING_NODES)]
    if tests.directions.size > _DENSE:
        quick.append(Discrepancy.over_tests(tests, (names,), (OVER_FREQUENCY[0], OVER_STRAIN[-1]), MAXIMUM_NODES))
    if max(process.maximum[0] for process in quick) <= _SCREENING_GAIN:
        return False
    evidence = [process.likelihood.log_evidence(SIZES) for process in candidate_processes(tests)]
    return float(np.logaddexp.reduce(evidence)) - np.log(len(evidence)) + np.log(_ODDS) >= 0.0


def _with_unseen_level_errors(tests: Sequence[MeasuredTest], rig: RigSettings) -> list[MeasuredTest]:
    """Add errors that all runs of a level share to the noise of sweeps, if the noise was estimated from repeats alone.

    Repeats cannot reveal such errors, and without them a smooth error of the model would follow the errors of the
    levels.
    """

    def with_level(noise: SweepNoise) -> SweepNoise:
        """Raise the errors shared by a level to the size that [rig] states or bushfit assumes, if noise has repeats."""
        if noise.origin != "repeats":
            return noise
        gain, phase = np.maximum(class_errors(rig, UNSTATED_LEVEL), noise.level).tolist()
        return replace(noise, level=(gain, phase))

    return with_sweep_noise(tests, with_level)


def _with_rig_errors(solution: FitResult, rig: RigSettings) -> FittedTests:
    """Whiten the residuals of a fit by errors of the rig that the estimated noise does not contain.

    These errors are the gain error of a loop, or a gain and a phase error at each constant amplitude or frequency of a
    sweep, of the size that [rig] states or bushfit assumes.
    """
    tests, residual, jacobian = solution.problem.tests, solution.residual.copy(), solution.jacobian.copy()
    rig_errors = list[SharedErrors]()
    for test, rows in zip(tests, residual_slices(tests), strict=True):
        if isinstance(test, MeasuredLoop):
            columns = test.gain_and_offset()[: not test.gain_weighs] * test.gain_error
        else:
            uncounted = np.sqrt(np.maximum(np.square(class_errors(rig)) - np.square(test.noise.level), 0.0))
            columns = level_error_columns(test)
            columns *= np.tile(uncounted, len(columns) // 2)[:, None]
        rig_errors.append(errors := SharedErrors.from_columns(columns))
        residual[rows], jacobian[:, rows] = errors.whiten(residual[rows]), errors.whiten(jacobian[:, rows])
    return FittedTests(replace(solution, residual=residual, jacobian=jacobian), rig_errors)


def _thin_sweeps(tests: Sequence[MeasuredTest], error: float = 0.0) -> list[MeasuredTest]:
    """Reduce dense sweeps, without a model error, to at most 600 evenly chosen points, enough for a smooth error.

    Args:
        tests: tests.
        error: independent model error of the loops, which applies to the harmonics from the second up; the first
            harmonic changes with the stiffness.
    """
    thinned = list[MeasuredTest]()
    for test in tests:
        if isinstance(test, MeasuredLoop):
            thinned.append(test.with_model_error(error, first_harmonic_errs=False) if error else test)
        else:
            bare, step = replace(test, model_error=0.0) if test.model_error else test, -(-test.order.size // _ENOUGH)
            thinned.append(bare if step == 1 else bare.select(np.arange(test.order.size) % step == 0))
    return thinned
