"""Fit procedures: static, dynamic, both in turn (the paper's two steps), and all parameters together."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from bushfit.caveat import Caveat
from bushfit.effects import BASE, effect_name_of, get_effect
from bushfit.effects.contract import Array
from bushfit.errors import FitError
from bushfit.fitting.agreement import expected_errors, misfits, prior_uses, prior_warnings
from bushfit.fitting.assess import (
    covariance,
    implausible_modulus,
    lack_of_fit,
    measured_range,
    misfit_warnings,
    preload_ranges,
    quality,
    temperature_warning,
    unfitted_warnings,
)
from bushfit.fitting.coordinates import Bounds, Coordinates
from bushfit.fitting.identify import undetermined_parameters
from bushfit.fitting.levels import LevelErrors
from bushfit.fitting.model_error import with_excess_errors
from bushfit.fitting.preload import PRELOAD, alternative_preload_law
from bushfit.fitting.preparation import MeasuredTest, sources, with_level_errors
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.problem import FitResult
from bushfit.fitting.profile import find_limit, profile95
from bushfit.fitting.robust import outlier_warnings, solve_problem
from bushfit.geometry import get_places
from bushfit.model.covariance import Covariance
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.units import display_unit, number

STATIC = ("mu", "sigma_fmax", "eps_half")
DYNAMIC = ("m", "alpha")

#: Relative change of each parameter from one pass of the two-step procedure to the next at which it has converged.
_AGREED = 1e-5
_MOST_PASSES = 50
#: Least and largest factor by which an accelerated pass extrapolates the last change.
_STRIDES = (-0.5, 5.0)
#: Springpot of a typical filled natural rubber, m/mu [s^alpha] and alpha, to estimate the effect of leaving it out.
_TYPICAL_SPRINGPOT = (0.18, 0.24)
#: Advice at the end of warnings about a model that does not fit, and the kinds of these warnings.
NEXT = "; bushfit diagnose looks for what is missing"
_ADVISED = ("misfit", "model_error", "levels_disagree", "unfitted_test_missed")


@dataclass(frozen=True, eq=False)
class TwoStep:
    """Result of alternate static and dynamic fits (Garcia Tarrago et al. 2007, section 4), repeated until they agree.

    Args:
        passes: parameter values by name [SI] after each pass.
        result: result of the last pass.
    """

    passes: tuple[Mapping[str, float], ...]
    result: Result


def fit_joint(
    data: PreparedCampaign,
    *,
    effects: Sequence[str] | None = None,
    directions: Sequence[str] | None = None,
    profile: bool = False,
) -> Result:
    """Fit all parameters of a model together, to loops and sweeps.

    Args:
        data: prepared campaign.
        effects: names of the effects of the model; None: elastic, springpot and friction, and the effects of [fit].
        directions: directions and specimens whose tests to use; see `PreparedCampaign.select_tests`.
        profile: True to add 95 % intervals by profile likelihood.

    Returns:
        The fitted model with its uncertainty and quality.

    Raises:
        FitError: there is no test in the given directions, or the data cannot support the fit.
    """
    for effect in map(get_effect, effects or ()):
        if effect.corrects:
            get_places(effect.corrects, data.campaign.specimens)
    tests = data.select_tests(directions)
    effects = data.effects if effects is None else effects
    if not preload_ranges(tests):
        effects = [name for name in effects if name != PRELOAD]
    unused = [test for test in data.data_sets if test not in tests]
    # copies of the tests, so that the values that they cache are released with the fit
    problem = data.problem(data.starting_model(effects, tests), [replace(test) for test in tests])
    found = solve_problem(problem, robust=data.robust)

    def refit(model: Model, errors: LevelErrors) -> FitResult:
        with_errors = with_level_errors(tests, errors.error, errors.freedom)
        return solve_problem(replace(problem, model=model, tests=with_errors), robust=data.robust)

    found, error, notes = with_excess_errors(found, data.bounds, data.campaign.rig, refit)
    result = build_result([found], data.bounds, unused=unused)
    return replace(
        _with_campaign(data, [found], result, [*notes, *unfitted_warnings(found.model, unused)]),
        usable=expected_errors(found.model, found.problem.tests, unused, found),
        model_error=error,
        alternatives=alternative_preload_law(found),
        profile=profile95(found, result.covariance) if profile else {},
    )


def fit_static(data: PreparedCampaign, springpot: Result | None = None) -> Result:
    """Fit mu, sigma_fmax and eps_half to the loops, with m and alpha fixed (Garcia Tarrago et al. 2007, section 4.1).

    m and alpha are taken from `springpot`, or from the campaign's [fit] if it gives both. Otherwise the springpot is
    left out, and a warning states the effect.

    Args:
        data: prepared campaign.
        springpot: result of an earlier fit with m and alpha; None without one.

    Returns:
        The fitted model with its uncertainty and quality.

    Raises:
        FitError: there is no loop, or the data cannot support the fit.
    """
    values = springpot.model.values if springpot else data.given_values
    fixed = {name: values[name] for name in DYNAMIC if name in values}
    if len(fixed) < len(DYNAMIC):
        found = _fit_without_springpot(data)
        return _with_campaign(data, [found], build_result([found], data.bounds), [_springpot_warning(data, found)])
    uncertainty = springpot.covariance.select(DYNAMIC) if springpot else None
    found = _fit_step(data, data.static_loops(), fixed)
    return _with_campaign(data, [found], build_result([found], data.bounds, fixed=uncertainty))


def fit_dynamic(data: PreparedCampaign, static: Result) -> Result:
    """Fit m and alpha to the smallest-amplitude sweep, with mu, sigma_fmax and eps_half fixed.

    The errors of these static parameters are propagated into those of m and alpha (Garcia Tarrago et al. 2007, section
    4.2).

    Args:
        data: prepared campaign.
        static: result of the static fit, with mu, sigma_fmax and eps_half.
    """
    fixed = {name: static.model.values[name] for name in STATIC}
    found = _fit_step(data, [data.smallest_sweep], fixed)
    result = build_result([found], data.bounds, fixed=static.covariance.select(STATIC))
    return _with_campaign(data, [found], result)


def fixed_static_result(data: PreparedCampaign) -> Result | None:
    """Result with the values of mu, sigma_fmax and eps_half that [fit] fixes, without tests; None unless all are."""
    free = data.free_names(STATIC)
    fixed = {name: value for name, value in data.given_values.items() if name in STATIC and name not in free}
    if len(fixed) < len(STATIC):
        return None
    return Result(Model.with_defaults(data.campaign.bushing, ("elastic", "friction"), fixed))


@lru_cache(maxsize=1)  # `run` needs the result, and so does the springpot warning of its static fit
def fit_two_step(data: PreparedCampaign) -> TwoStep:
    """Alternate the static and the dynamic fit, each with the parameters of the other fixed, until they agree.

    Returns:
        Values after each pass, and the last result.

    Raises:
        FitError: a loop or a sweep is missing, or the passes do not converge.

    Notes:
        Plain passes converge slowly or oscillate, so the springpot of the next pass is extrapolated from the last two
        (Anderson, 1965).
    """
    loops, sweep = data.static_loops(), data.smallest_sweep
    springpot, passes = dict[str, float](), list[Mapping[str, float]]()
    points, images, model = list[Array](), list[Array](), None
    while len(passes) < _MOST_PASSES:
        static = _fit_step(data, loops, springpot, model) if springpot else _fit_without_springpot(data)
        dynamic = _fit_step(data, [sweep], {name: static.model.values[name] for name in STATIC}, model)
        model, before = dynamic.model, passes[-1] if passes else {}
        passes.append(dict(model.values))
        if all(abs(before.get(name, np.inf) - value) <= _AGREED * abs(value) for name, value in passes[-1].items()):
            steps = [static, dynamic]
            return TwoStep(tuple(passes), _with_campaign(data, steps, build_result(steps, data.bounds)))
        coordinates = Coordinates.of_parameters(model, DYNAMIC)
        if springpot:
            points.append(coordinates.point(springpot))
            images.append(coordinates.point(model.values))
        springpot = {name: model.values[name] for name in DYNAMIC}
        if len(points) > 1:
            gap = images[-1] - points[-1]
            change = gap - (images[-2] - points[-2])
            stride = np.clip(-(change @ gap) / max(change @ change, np.finfo(float).tiny), *_STRIDES)
            values = coordinates.values(images[-1] + stride * (images[-1] - images[-2]))
            limits = {name: model.parameters[name].bounds for name in DYNAMIC}
            springpot = {name: float(np.clip(value, *limits[name])) for name, value in values.items()}
    raise FitError(
        "the static and the dynamic fit do not converge in turn",
        file=data.campaign.path,
        found=f"{_MOST_PASSES} passes",
        hint="bushfit fit fits all five parameters together",
    )


@lru_cache(maxsize=1)  # needed by the static fit, and by the first pass of the two-step procedure
def _fit_without_springpot(data: PreparedCampaign) -> FitResult:
    """Fit mu, sigma_fmax and eps_half to the loops by a model without the springpot."""
    return _fit_step(data, data.static_loops(), {})


def _springpot_warning(data: PreparedCampaign, static: FitResult) -> Caveat:
    """Warning that states by how many per cent the static parameters changed because the springpot was left out."""
    values, two_step = static.model.values, None
    with suppress(FitError):  # no sweep, or the passes do not converge
        two_step = fit_two_step(data).result
    if two_step and not two_step.at_bound:
        better, source = two_step.model.values, "With m and alpha from this campaign's sweep"
    else:
        ratio, alpha = _TYPICAL_SPRINGPOT
        fixed = {"m": ratio * values["mu"], "alpha": alpha}
        better = _fit_step(data, static.problem.tests, fixed).model.values
        source = f"With the springpot of a typical filled rubber (m = {ratio} mu s^alpha, alpha = {alpha})"
    changes = ", ".join(f"{name} by {100 * (better[name] / values[name] - 1):+z.1f} %" for name in STATIC)
    return Caveat(
        "springpot_left_out",
        "m and alpha are not known yet, so the springpot was left out: the other parameters include its stiffness and "
        f"loss at the rate of the loop. {source}, these parameters change: {changes}",
    )


def _fit_step(
    data: PreparedCampaign, tests: Sequence[MeasuredTest], fixed: Mapping[str, float], start: Model | None = None
) -> FitResult:
    """Fit either the static parameters (mu, sigma_fmax, eps_half) or the dynamic ones (m, alpha) with lmfit.

    Args:
        data: prepared campaign.
        tests: tests to fit.
        fixed: values of parameters that this step keeps fixed, by name [SI]; without any, the model has no springpot.
        start: model of the last pass, from which the fit starts; None to start from values estimated from the tests.
    """
    effects = BASE if fixed else ("elastic", "friction")
    model = start.with_values(fixed) if start else data.starting_model(effects, tests, fixed)
    return solve_problem(data.problem(model, tests, fixed), robust=data.robust, lmfit=True)


def _with_campaign(
    data: PreparedCampaign, steps: Sequence[FitResult], result: Result, notes: Sequence[Caveat] = ()
) -> Result:
    """Add the specimens, the outliers and the warnings on the campaign to the result of a procedure.

    Args:
        data: prepared campaign.
        steps: fits of the procedure, in order.
        result: result of these fits.
        notes: warnings to report first.
    """
    model, tests = result.model, [test for step in steps for test in step.data_sets]
    outliers = tuple(outlier for step in steps for outlier in step.outliers)
    warnings = [
        *notes,
        *implausible_modulus(data.campaign.bushing, tests),
        *temperature_warning(model, tests),
        *data.assumptions,
    ]
    for tie in data.constraints.ties:
        if lacking := ", ".join(name for name in (tie.name, *tie.names) if name not in model.values):
            sentence = f"the tie {tie.name} = {tie.expression} is not used: the model lacks {lacking}"
            warnings.append(Caveat("unused_tie", sentence))
    for prior in data.constraints.priors:
        if model.values.keys().isdisjoint(prior.names):
            sentence = f"the prior {prior.source} is not used: the model lacks {', '.join(prior.names)}"
            warnings.append(Caveat("unused_prior", sentence))
    warnings += [*outlier_warnings(outliers, robust=data.robust), *result.warnings]
    advised = (replace(note, text=note.text + NEXT) if note.kind in _ADVISED else note for note in warnings)
    return replace(result, warnings=tuple(advised), outliers=outliers, specimens=data.campaign.specimens)


def build_result(
    steps: Sequence[FitResult],
    bounds: Bounds,
    *,
    model: Model | None = None,
    fixed: Covariance | None = None,
    notes: Sequence[Caveat] = (),
    unused: Sequence[MeasuredTest] = (),
    bounded_is_fixed: bool = False,
) -> Result:
    """Build a result from one or more fits: the last model, with the covariance and the warnings of all fits.

    Args:
        steps: fits of a procedure, in order.
        bounds: limits of parameters that the campaign gives, by name [SI].
        model: model to report, such as the last fitted model with a smooth correction; None for the last fitted model.
        fixed: covariance of parameters that all fits kept fixed; None if these are exact.
        notes: warnings to report before those of the fits.
        unused: tests that no fit used, to compare the model with.
        bounded_is_fixed: True to treat a parameter at a bound as fixed even if the model meets the tests.

    Returns:
        The model with covariance, quality, measured range, misfit of each test, and warnings.
    """
    last = steps[-1]
    model, tests = model or last.model, [test for step in steps for test in step.data_sets]
    names = tuple(name for step in steps for name in step.names)
    at_bound = {name: end for step in steps for name, end in step.at_bound.items()}
    # a parameter at a bound has no error of its own if a smooth error of the model is included
    fixes_bounded = bounded_is_fixed or last.smooth_error
    stages = [step.stage(step.at_bound if fixes_bounded else ()) for step in steps]
    cov = covariance(last.model, stages, fixed, last.smooth_error)
    priors = prior_uses(steps, fixed)
    warnings = [*notes, *prior_warnings(priors)]
    for step in steps:
        limited, limits = replace(step, problem=replace(step.problem, bounds=bounds)), dict[str, float | None]()
        for name, end in step.at_bound.items():
            if bounds.get(name, (None, None))[end == "max"] is None:
                limits[name] = find_limit(limited, name, "max" if end == "min" else "min")
        warnings += fit_warnings(last.model, step, limits, cov)
    return Result(
        model,
        tuple(name for name in names if not (bounded_is_fixed and name in at_bound)),
        cov,
        quality(model, tests, len(names)),
        measured_range(model, tests),
        tuple(warnings),
        sources(tests),
        at_bound=at_bound,
        tests=misfits(model, tests, unused),
        ties={tie.name: tie.expression for tie in model.constraints.active_ties(model.values)},
        priors=priors,
    )


def fit_warnings(
    model: Model, step: FitResult, limits: Mapping[str, float | None], covariance: Covariance
) -> Iterator[Caveat]:
    """Yield warnings about the tests of a fit, parameters at bounds, parameters not determined, and a misfit.

    Args:
        model: fitted model.
        step: result of the fit, one step of a procedure.
        limits: one-sided 95 % limits [SI] of the parameters that ended at a bound of the model, not of the campaign, by
            name; None for a parameter that the tests do not limit.
        covariance: covariance of the fitted parameters.

    Yields:
        Warnings, in the order of the fit; if nothing was fitted, how well the given values agree with the tests.
    """
    tests, names, at_bound = step.data_sets, step.names, step.at_bound
    if unknown := covariance.select(names).describe_unknown(model.values):
        yield Caveat("parameter_unknown", unknown)
    yield from (note.about(test.name) for test in tests for note in test.notes)
    if not names:
        found, missed = quality(model, tests, 0), lack_of_fit(model, tests, 0)
        kind, agreement = "given_values_meet", "meet the tests within their noise"
        if missed is not None:
            kind, agreement = "given_values_miss", f"miss the tests by {number(np.sqrt(missed), 2)} times their noise"
        figures = f"NRMSE {number(100.0 * found.nrmse, 2)} %, reduced chi-square {number(found.reduced_chi_square, 3)}"
        fixed = f"nothing was fitted, because every parameter is fixed; the given values {agreement} ({figures})"
        yield Caveat(kind, fixed)
        return
    if step.stopped:
        sentence = f"the fit was stopped after {step.evaluations} evaluations of the model"
        yield Caveat("fit_stopped", f"{sentence}, because chi-square hardly fell: some parameters are undetermined")
    for name, end in at_bound.items():
        if name not in limits:
            yield Caveat("given_bound", f"{name} is at the {end} given in [fit]")
            continue
        shown = "the data do not determine it"
        if (limit := limits[name]) is not None:
            unit, factor = display_unit(step.model.parameters[name].unit, 1.0, limit)
            how = f"at {'most' if end == 'min' else 'least'} {number(factor * limit, 2)} {unit}".rstrip(" -")
            shown = f"the tests only show that it is {how} (95 %)"
        yield Caveat("parameter_limit", f"{name} ended at a limit of the model: {shown}")
    judged = [name for name in names if name not in at_bound and effect_name_of(name) != PRELOAD]
    yield from undetermined_parameters(model, step.problem.tests, judged, covariance)
    if not step.smooth_error:
        yield from misfit_warnings(model, tests, len(names))
