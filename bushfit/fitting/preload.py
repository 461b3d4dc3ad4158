"""Preload as a variable of the model, which is added if the tests of a direction show an influence of the preload.

A direction with tests at three preloads or more determines the six parameters of the effect `preload`; two preloads
determine three of them. An F-test decides between the models with and without these parameters. They are added if
noise, errors of levels and gain errors of loops do not explain the difference.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from scipy.special import fdtrc

from bushfit.campaign.schema import ParameterSetting
from bushfit.caveat import Caveat
from bushfit.fitting.assess import covariance, preload_ranges
from bushfit.fitting.levels import level_errors
from bushfit.fitting.preparation import MeasuredTest, split_by_kind, with_gain_weighting, with_level_errors
from bushfit.fitting.problem import FitProblem, FitResult
from bushfit.fitting.rig_class import largest_error
from bushfit.fitting.robust import solve_problem
from bushfit.geometry import STRAINING, get_place
from bushfit.model.result import Alternative
from bushfit.reading.preload import SAME_PRELOAD
from bushfit.units import number

if TYPE_CHECKING:
    from bushfit.fitting.prepared_campaign import PreparedCampaign

#: Name of the effect.
PRELOAD = "preload"
#: Parameters of the influence that changes its sign with the preload, which a symmetric bushing does not have.
_ODD = ("preload.c2", "preload.friction", "preload.rate")
#: Parameters of the influence that is the same for both senses of the preload.
_EVEN = ("preload.c3", "preload.friction_square", "preload.rate_square")
#: Largest p-value at which an influence is reported; chosen: one false report in a hundred campaigns.
_CHANCE = 0.01
#: 95 % quantile of chi-square with one degree of freedom.
_CHI_SQUARE_95 = 3.84


def with_preload(data: PreparedCampaign) -> PreparedCampaign:
    """Add the effect of preload to the model of a campaign if an F-test (p < 0.01) shows an influence of preload.

    Args:
        data: campaign with prepared tests.

    Returns:
        The campaign, with the effect in its [fit], or with a warning that the tests show no influence; unchanged if
        [fit] has the effect, or if all tests of each direction have one preload.
    """
    ranges = preload_ranges(data.data_sets)
    if PRELOAD in data.effects or not ranges:
        return data
    fit, notes, has_influence = data.campaign.fit, list[Caveat](), False
    fixed: Sequence[str] = ()
    line = "square of the preload, because the bushing is symmetric"
    places = [get_place(tested.place, data.campaign.specimens) for tested in ranges]
    if max(tested.count for tested in ranges) == 2:
        fixed = _ODD
        # a tube and rubber in shear are symmetric, unlike bars in tension; opposite preloads would cancel
        opposite = any(math.isclose(-tested.low, tested.high, rel_tol=SAME_PRELOAD) for tested in ranges)
        if opposite or any(place.motion is STRAINING for place in places):
            fixed, line = _EVEN, "preload"
    for tested, place in zip(ranges, places, strict=True):
        tests = [test for test in data.data_sets if test.direction == place and test.conditions.preload]
        chance = _probability_of_chance(data, tests, fixed)
        listed = f"{tested.place}: {tested.count} preloads, {tested.text(place)}"
        if chance > _CHANCE / len(ranges):
            sentence = f"{listed}: stiffness and loss do not change beyond noise (p = {number(chance, 2)})"
            notes.append(Caveat("no_preload_influence", sentence))
            continue
        has_influence = True
        if tested.count == 2:
            sentence = f"{listed}: the model follows a straight line over the {line}, which two preloads cannot confirm"
            notes.append(Caveat("two_preloads", sentence))
    if not has_influence:
        return replace(data, preload_notes=tuple(notes))
    absent = {name: ParameterSetting(value=0.0, vary=False) for name in fixed}
    fit = replace(fit, effects=(*fit.effects, PRELOAD), parameters={**absent, **fit.parameters})
    return replace(data, campaign=replace(data.campaign, fit=fit), preload_notes=tuple(notes))


def alternative_preload_law(fit: FitResult) -> tuple[Alternative, ...]:
    """Refit the effect of preload with the other law: linear in the preload instead of in its square, or the reverse.

    Two preloads do not decide between these laws of friction and springpot.

    Args:
        fit: fit with the effect of preload.

    Returns:
        The refitted model as an alternative, if the tests have only two preloads and its chi-square exceeds that of
        `fit` by less than 3.84 (95 % of chance); else nothing.

    Notes:
        By symmetry, friction is the same for both senses of a preload, but two preloads do not determine how friction
        grows between them. A line over the preload and a line over its square are the two extreme cases.
    """
    other = dict(zip((*_ODD[1:], *_EVEN[1:]), (*_EVEN[1:], *_ODD[1:]), strict=True))
    free = {name for name in fit.names if name in other}
    if not free or free & {other[name] for name in free}:
        return ()
    names = [other.get(name, name) for name in fit.names]
    model = fit.model.with_values(dict.fromkeys(free, 0.0))
    fitted = solve_problem(replace(fit.problem, model=model, names=names))
    if fitted.chi_square > fit.chi_square + _CHI_SQUARE_95:
        return ()
    return (Alternative(fitted.model, 0.5, covariance(fitted.model, [fitted.stage()], None, fitted.smooth_error)),)


def _probability_of_chance(data: PreparedCampaign, tests: Sequence[MeasuredTest], fixed: Sequence[str]) -> float:
    """p-value of an F-test: probability that chance alone lowers chi-square as much as the effect of preload does.

    Args:
        data: campaign with prepared tests.
        tests: tests to fit.
        fixed: names of parameters that stay fixed.
    """
    tests = with_gain_weighting(tests, weigh=True)
    plain, full = _fit_both(data, data.problem(data.starting_model(data.effects, tests), tests), fixed)
    errors = level_errors(full.problem.tests, full.residual, full.jacobian, largest_error(data.campaign.rig))
    if errors.significant:
        tests = with_level_errors(tests, errors.error, errors.freedom)
        plain, full = _fit_both(data, replace(plain.problem, model=plain.model, tests=tests), fixed)
    # few repeats determine the errors that a run shares, so their degrees of freedom limit those of the test
    estimated = [sweep.noise.freedom for sweep in split_by_kind(tests)[1] if sweep.noise.freedom]
    added, freedom = len(full.names) - len(plain.names), min([full.residual.size - len(full.names), *estimated])
    variance = max(full.chi_square / (full.residual.size - len(full.names)), 1.0)
    return float(fdtrc(added, freedom, max(plain.chi_square - full.chi_square, 0.0) / (added * variance)))


def _fit_both(data: PreparedCampaign, problem: FitProblem, fixed: Sequence[str]) -> tuple[FitResult, FitResult]:
    """Fit the tests of a problem twice: without and with the effect of preload.

    Args:
        data: campaign with prepared tests.
        problem: problem of the model without the effect.
        fixed: names of parameters that stay fixed.

    Returns:
        The fit without the effect, and the fit with it.
    """
    plain = solve_problem(problem, robust=data.robust)
    model = plain.model.with_effect(PRELOAD)
    added = [name for name in model.parameters if name.startswith(f"{PRELOAD}.") and name not in fixed]
    return plain, solve_problem(replace(problem, model=model, names=[*problem.names, *added]), robust=data.robust)
