"""The fits a user asks for: static, dynamic, the two in turn, and all parameters together."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from bushfit.effects import BASE, get_effect
from bushfit.effects.contract import Array
from bushfit.errors import FitError
from bushfit.fitting.agreement import misfits, usable
from bushfit.fitting.assess import (
    FitStage,
    apart_in_temperature,
    covariance,
    implausible,
    lack_of_fit,
    measured_range,
    misfit,
    quality,
    unfitted,
)
from bushfit.fitting.coordinates import Bounds, Coordinates, Solution, anderson
from bushfit.fitting.identify import left_open
from bushfit.fitting.levels import level_errors
from bushfit.fitting.model_error import model_error_warning, with_model_error
from bushfit.fitting.preparation import MeasuredLoop, MeasuredTest, sources, split_by_kind, with_level_errors
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.profile import limit95, profile95
from bushfit.fitting.rig_class import largest_error, words_of
from bushfit.fitting.robust import WeightedFit, estimate, outlier_warnings
from bushfit.fitting.solve import solve, solve_with_lmfit
from bushfit.geometry import get_place
from bushfit.model.covariance import Covariance
from bushfit.model.model import Model
from bushfit.model.result import End, Result
from bushfit.units import display_unit, number

STATIC = ("mu", "sigma_fmax", "eps_half")
DYNAMIC = ("m", "alpha")

#: Share of the largest error of a level from which on a fit takes it for a gap of the model: rounding aside, all.
_AT_LIMIT = 0.99
#: Passes of the two-step procedure agree when no parameter moves by more than this, relative.
_AGREED = 1e-5
_MOST_PASSES = 50
#: A filled natural rubber, to say what leaving the springpot out may do: m/mu [s^alpha] and alpha.
_TYPICAL_SPRINGPOT = (0.18, 0.24)
#: What is said of a fit that was stopped.
_STOPPED = (
    "the fit was stopped after {} evaluations of the model, where chi-square is flat: undetermined "
    "parameters could change further without effect"
)
#: What is said of levels that disagree by more than their repeats do.
_LEVELS = "levels disagree by more than their repeats: an error of {} for each level is included in the noise"
#: What to do about a model that does not fit, until it is done.
NEXT = "; bushfit diagnose looks for what is missing"


@dataclass(frozen=True, eq=False)
class TwoStep:
    """The paper's procedure, repeated: the values after each pass, and the result of the last."""

    passes: tuple[Mapping[str, float], ...]
    result: Result


def fit_joint(
    data: PreparedCampaign,
    *,
    effects: Sequence[str] | None = None,
    directions: Sequence[str] | None = None,
    profile: bool = False,
) -> Result:
    """All parameters of a model together, from loops and sweeps.

    Args:
        effects: the model; the paper's three branches, and what [fit] adds to them, unless told.
        directions: and specimens whose tests to use; see `PreparedCampaign.select_tests`.
        profile: whether to add 95 % intervals by profile likelihood.

    Returns:
        The fitted model with its uncertainty and quality.

    Raises:
        FitError: no test in those directions, or data that cannot support the fit.
    """
    for effect in map(get_effect, effects or ()):
        if effect.corrects:
            get_place(effect.corrects, data.campaign.specimens)
    data_sets = data.select_tests(directions)
    unused = [data_set for data_set in data.data_sets if data_set not in data_sets]
    effects = data.effects if effects is None else effects
    found = _solve(data, data_sets, effects, {}, solver=solve)
    largest = largest_error(data.campaign.rig)
    errors = level_errors(found.minimised, found.solution.residual, found.solution.jacobian, largest)
    at_limit = any(error >= _AT_LIMIT * limit for error, limit in zip(errors.error, largest, strict=True))
    counts = errors.freedom and any(errors.error) and not at_limit  # an error that would have to be larger is a gap
    found, error = with_model_error(found, data.bounds, data.campaign.rig)
    if counts and not error:
        loops, sweeps = split_by_kind(data_sets)
        data_sets = [*loops, *with_level_errors(sweeps, errors.error, errors.freedom)]
        found = _solve(data, data_sets, effects, {}, found.solution.model, solve)
    notes = [_LEVELS.format(words_of(errors.error))] if errors.matters and not at_limit and not error else []
    notes += [*([model_error_warning(error) + NEXT] if error else []), *unfitted(found.solution.model, unused, NEXT)]
    result = _result(data, [found], notes=notes, unused=unused)
    result = replace(result, usable=usable(found.solution, found.minimised, unused), model_error=error)
    if not profile:
        return result
    return replace(result, profile=profile95(found.solution, found.minimised, result.covariance, data.bounds))


def fit_static(data: PreparedCampaign, springpot: Result | None = None) -> Result:
    """mu, sigma_fmax and eps_half from the loops, the springpot held (paper, section 4.1).

    m and alpha come from the result given, or else from the campaign's [fit] where both have values; failing that the
    springpot is left out, and a warning says what this does.

    Raises:
        FitError: no loop, or data that cannot support the fit.
    """
    data_sets = data.static_loops()
    fixed, fixed_covariance = _springpot(data, springpot)
    found = _solve(data, data_sets, BASE if fixed else ("elastic", "friction"), fixed)
    notes = [] if fixed else [_without_springpot(data, found.solution, data_sets)]
    return _result(data, [found], fixed_covariance, notes)


def fit_dynamic(data: PreparedCampaign, static: Result) -> Result:
    """m and alpha from the smallest-amplitude sweep, the rest held at the static result (paper, section 4.2).

    The static parameters' own errors are carried into those of m and alpha.
    """
    data_sets: list[MeasuredTest] = [data.smallest_sweep]
    fixed = {name: static.model.values[name] for name in STATIC}
    return _result(data, [_solve(data, data_sets, BASE, fixed)], static.covariance.restricted(STATIC))


def given_static(data: PreparedCampaign) -> Result | None:
    """mu, sigma_fmax and eps_half as the campaign's [fit] holds them; None where it does not hold all three."""
    fixed = {
        name: data.given_values[name] for name in STATIC if name in data.given_values and name not in data.free(STATIC)
    }
    if len(fixed) < len(STATIC):
        return None
    return Result(Model.with_defaults(data.campaign.bushing, ("elastic", "friction"), fixed))


@lru_cache(maxsize=1)  # `run` asks for it, and so does what its static fit says of the springpot
def fit_two_step(data: PreparedCampaign) -> TwoStep:
    """Static and dynamic fit in turn, each holding what the other found, until they agree.

    Returns:
        Values after each pass, and the last result.

    Raises:
        FitError: a test is missing, or the passes do not settle.
    """
    loops, sweep = data.static_loops(), data.smallest_sweep
    springpot, passes = dict[str, float](), list[Mapping[str, float]]()
    inputs, outputs = list[Array](), list[Array]()
    for _ in range(_MOST_PASSES):
        static = _solve(data, loops, BASE if springpot else ("elastic", "friction"), springpot)
        found = static.solution.model.values
        dynamic = _solve(data, [sweep], BASE, {name: found[name] for name in STATIC})
        model = dynamic.solution.model
        before = passes[-1] if passes else {}
        passes.append(dict(model.values))
        if all(abs(before.get(name, np.inf) - value) <= _AGREED * abs(value) for name, value in passes[-1].items()):
            return TwoStep(tuple(passes), _result(data, [static, dynamic]))
        coordinates = Coordinates.of_parameters(model, DYNAMIC)
        if springpot:
            inputs.append(coordinates.point(springpot))
            outputs.append(coordinates.point(model.values))
            springpot = coordinates.possible(anderson(inputs, outputs))
        else:
            springpot = {name: model.values[name] for name in DYNAMIC}
    raise FitError(
        "the static and the dynamic fit do not converge in turn",
        file=data.campaign.path,
        found=f"{_MOST_PASSES} passes",
        hint="bushfit fit fits all five parameters together",
    )


def _springpot(data: PreparedCampaign, springpot: Result | None) -> tuple[dict[str, float], Covariance | None]:
    if springpot is not None:
        return {name: springpot.model.values[name] for name in DYNAMIC}, springpot.covariance.restricted(DYNAMIC)
    values = {name: data.given_values[name] for name in DYNAMIC if name in data.given_values}
    return (values if len(values) == len(DYNAMIC) else {}), None


def _without_springpot(data: PreparedCampaign, solution: Solution, loops: Sequence[MeasuredLoop]) -> str:
    """Sentence on how leaving the springpot out changed the static parameters, in per cent."""
    found = solution.model.values
    try:
        better, source = fit_two_step(data).result.model.values, "with m and alpha from this campaign's sweep"
    except FitError:  # no sweep, or none that goes with the loops: a typical rubber tells as much as can be told
        ratio, alpha = _TYPICAL_SPRINGPOT
        fixed = {"m": ratio * found["mu"], "alpha": alpha}
        better = _solve(data, loops, BASE, fixed).solution.model.values
        source = f"with the springpot of a typical filled rubber (m = {ratio} mu s^alpha, alpha = {alpha})"
    changes = ", ".join(f"{name} by {100 * (better[name] / found[name] - 1):+.1f} %" for name in STATIC)
    return (
        "m and alpha are not known yet, so the springpot was left out, and the other parameters include its "
        f"stiffness and loss at the rate of the loop; {source} they change: {changes}. bushfit run alternates the "
        "two fits, and bushfit fit fits all parameters together"
    )


def _solve(
    data: PreparedCampaign,
    data_sets: Sequence[MeasuredTest],
    effects: Sequence[str],
    fixed: Mapping[str, float],
    model: Model | None = None,
    solver: Callable[..., Solution] = solve_with_lmfit,
) -> WeightedFit:
    """Fit what the campaign leaves free of a model, from its values or else from start values taken from the data."""
    model = model or data.starting_model(effects, data_sets, fixed)
    names = [name for name in data.free(tuple(model.parameters)) if name not in fixed]
    return estimate(model, data_sets, names, data.bounds, robust=data.robust, solver=solver)


def _result(
    data: PreparedCampaign,
    steps: Sequence[WeightedFit],
    fixed: Covariance | None = None,
    notes: Sequence[str] = (),
    unused: Sequence[MeasuredTest] = (),
) -> Result:
    """Collect the result of the steps of a procedure: the last model, with the uncertainty of all of them."""
    model, data_sets = steps[-1].solution.model, [data_set for step in steps for data_set in step.data_sets]
    stages = [FitStage(_moving(step), step.weighed, step.process) for step in steps]
    fitted = tuple(name for step in steps for name in step.solution.coordinates.names)
    cov = covariance(model, stages, fixed)
    outliers = tuple(outlier for step in steps for outlier in step.outliers)
    of_tests = (*implausible(data.campaign.bushing, data_sets), *apart_in_temperature(model, data_sets))
    doubts = [*of_tests, *data.assumed]
    odd = [note for step in steps for note in cautions(model, step, data.bounds, cov, NEXT)]
    return Result(
        model,
        fitted,
        cov,
        quality(model, data_sets, len(fitted)),
        measured_range(model, data_sets),
        (*notes, *doubts, *outlier_warnings(outliers, robust=data.robust), *odd),
        sources(data_sets),
        outliers,
        at_bound={name: end for step in steps for name, end in step.solution.at_bound.items()},
        specimens=data.campaign.specimens,
        tests=misfits(model, data_sets, unused),
    )


def _moving(step: WeightedFit) -> tuple[str, ...]:
    """Parameters with standard errors; in a fit with a model error, a parameter at a bound is fixed."""
    fixed = step.solution.at_bound if step.process else {}
    return tuple(name for name in step.solution.coordinates.names if name not in fixed)


def cautions(model: Model, step: WeightedFit, bounds: Bounds, covariance: Covariance, advice: str = "") -> list[str]:
    """Warnings on the loops of a fit, and on what its data do not determine: bounds met, what stays open, a misfit.

    Args:
        model: fitted model.
        step: fit of one stage.
        bounds: limits that the campaign gives [SI].
        covariance: of the fitted parameters.
        advice: end of the sentence on a misfit.

    Returns:
        Sentences for the user.
    """
    solution, data_sets = step.solution, step.data_sets
    names, at_bound = solution.coordinates.names, solution.at_bound
    notes = [f"{data_set.name}: {note}" for data_set in data_sets for note in data_set.notes]
    if not names:
        return [*notes, _checked(model, data_sets)]
    return [
        *filter(None, [covariance.restricted(names).left_open(model.values)]),
        *notes,
        *([_STOPPED.format(solution.evaluations)] if solution.stopped else []),
        *(_at_edge(name, end, solution, step.minimised, bounds) for name, end in at_bound.items()),
        *left_open(model, step.minimised, [name for name in names if name not in at_bound], covariance),
        *([] if step.process else misfit(model, data_sets, len(names), advice)),
    ]


def _checked(model: Model, data_sets: Sequence[MeasuredTest]) -> str:
    """How well a model that was given in full meets the data, in words."""
    found = quality(model, data_sets, 0)
    missed = lack_of_fit(model, data_sets, 0)
    how = "meet" if missed is None else "miss"
    extent = "within their noise" if missed is None else f"by {number(np.sqrt(missed), 2)} times their noise"
    return (
        f"nothing was fitted, because every parameter is fixed; the given values {how} the tests {extent} "
        f"(NRMSE {number(100.0 * found.nrmse, 2)} %, reduced chi-square {number(found.reduced_chi_square, 3)})"
    )


def _at_edge(name: str, end: End, solution: Solution, data_sets: Sequence[MeasuredTest], bounds: Bounds) -> str:
    """Sentence on a parameter that rests on a bound: how far from there the tests let it be."""
    if bounds.get(name, (None, None))[end == "max"] is not None:
        return f"{name} is at the {end} given in [fit]"
    limit = limit95(solution, data_sets, name, bounds)
    if limit is None:
        return f"{name} ended at a limit of the model: the data do not determine it"
    parameter = solution.model.parameters[name]
    unit, factor = display_unit(parameter.unit, 1.0, limit)
    how = f"at {'most' if end == 'min' else 'least'} {number(factor * limit, 2)} {unit}".rstrip(" -")
    return f"{name} ended at a limit of the model: the tests only show that it is {how} (95 %)"
