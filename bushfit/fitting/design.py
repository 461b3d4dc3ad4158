"""Fits of added effects from several start values of their shape parameters, to avoid local minima.

The shape parameters of an effect are its times, gaps, orders and frequencies.
"""

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from bushfit.effects import Effect, Parameter, get_effect, qualified_name
from bushfit.effects.contract import Array
from bushfit.errors import FitError, ModelError
from bushfit.fitting.coordinates import Bounds
from bushfit.fitting.descent import TOLERANCE, Descent
from bushfit.fitting.preparation import MeasuredTest, operating_conditions, split_by_kind
from bushfit.fitting.problem import FitProblem, FitResult
from bushfit.model.model import Model

#: Number of start values of a shape parameter (a time, a gap, a frequency), spaced evenly in its logarithm.
_PROBES = 5
#: Smallest and largest start value of the order of a derivative: far below and far above that of filled rubber, 0.2.
_ORDERS = (0.05, 0.9)
#: Smallest and largest start value of the onset of a drift, relative to the duration of the session: from its first
#: points to a drift that is linear in time.
_SESSION = (0.01, 10.0)
#: Factors, in addition to 1, on the start value of a shape parameter that has no scale in the tests; chosen: within the
#: decade that the tests of a bushing span, and far enough apart to reach other local minima.
_FACTORS = (0.25, 4.0)
#: Number of model evaluations of each fit in the first round, with all start values.
_FIRST = 12
#: Number of these fits, those with the lowest chi-square, that are continued until they converge.
_BEST = 2
#: Smallest difference in chi-square between two distinct minima: a tenth of the change by one standard error.
_LOWER = 0.1
#: Largest number of model evaluations in one fit.
_MOST = 200


def start_with_effects(
    model: Model, plain: Model, data_sets: Sequence[MeasuredTest], fixed: Sequence[str], bounds: Bounds
) -> Model:
    """Find start values for a fit with added effects by fits that add one effect after another.

    Args:
        model: model with all effects, at the start values.
        plain: the same model without the added effects, and with the branches that these effects replace.
        data_sets: tests.
        fixed: names of parameters that stay fixed.
        bounds: limits of parameters [SI], inside their default limits.

    Returns:
        The model with the values of these fits if they give a lower chi-square than its start values; else unchanged.
    """
    added = [get_effect(name) for name in model.effects if name not in plain.effects]
    with suppress(FitError, ModelError):  # no response, or too few points: the fit itself reports it
        direct = Descent.start(FitProblem.with_fixed(model, data_sets, fixed, bounds)).run(_MOST)
        problem = FitProblem.with_fixed(plain, data_sets, fixed, bounds)
        solution = Descent.start(problem, TOLERANCE).run(_MOST).solution
        for effect in added:
            solution = with_effect(solution, data_sets, effect, fixed, bounds)
        if solution.chi_square <= direct.chi_square - _LOWER:  # equal minima may exchange two effects of one law
            return model.with_values({name: solution.model.values[name] for name in model.values})
    return model


def with_effect(
    solution: FitResult, data_sets: Sequence[MeasuredTest], effect: Effect, fixed: Sequence[str], bounds: Bounds
) -> FitResult:
    """Add an effect to a fitted model, in which it may replace a branch, and refit all parameters from several starts.

    Args:
        solution: fit without the effect.
        data_sets: tests.
        effect: effect to add.
        fixed: names of parameters that stay fixed.
        bounds: limits of parameters [SI], inside their default limits.

    Returns:
        The fit with the lowest chi-square.

    Raises:
        FitError: the response of the model is not finite at any start.
    """
    # the amount starts at a tenth of its typical value: at its neutral value, shape parameters have no influence
    small_amount = {} if effect.replaces else {qualified_name(effect, effect.amount): effect.amount.value_at_share(0.1)}
    starts = [
        solution.model.with_effect(effect.name, small_amount | start)
        for start in solution.model.start_values_for(effect)
    ]
    first = starts[0]
    for parameter in effect.parameters:
        if parameter.neutral is None:
            name = qualified_name(effect, parameter)
            values = first.values[name] * np.array(_FACTORS)
            if parameter.scale:
                values = shape_start_values(data_sets, first, parameter)
            starts += [first.with_values({name: value}) for value in np.clip(values, *parameter.bounds).tolist()]
    fits = []
    for start in starts:
        with suppress(FitError, ModelError):  # no response from this start
            fits.append(Descent.start(FitProblem.with_fixed(start, data_sets, fixed, bounds)).run(_FIRST))
    if not fits:
        raise FitError("the model has no finite response to these tests", found=effect.name)
    finished = list[Descent]()
    for descent in sorted(fits, key=lambda descent: descent.chi_square)[:_BEST]:
        finished.append(descent.run(_MOST))
    return min(finished, key=lambda descent: descent.chi_square).solution


def shape_start_values(data_sets: Sequence[MeasuredTest], model: Model, parameter: Parameter) -> Array:
    """Start values of a shape parameter (time, gap, order, frequency) over the range that the tests can determine.

    Args:
        data_sets: tests.
        model: fitted model.
        parameter: shape parameter; its `scale` names the quantity of the tests that limits the range.

    Returns:
        Five start values in the parameter's SI unit, (5,); if the parameter has no `scale`, its typical value, (1,).
    """
    frequencies, strains = operating_conditions(model.bushing, data_sets)
    match parameter.scale:
        case "period":
            swept = np.concatenate([sweep.frequency for sweep in split_by_kind(data_sets)[1]] or [frequencies])
            low, high = 0.1 / (2.0 * np.pi * swept.max()), 1.0 / (2.0 * np.pi * swept.min())
        case "frequency":
            low, high = 0.7 * frequencies.max(), 4.0 * frequencies.max()
        case "displacement":
            amplitudes = np.concatenate([data_set.amplitude for data_set in data_sets])
            low, high = 0.8 * amplitudes.min(), 0.95 * amplitudes.max()  # exceeded by all tests, and by one
        case "strain":
            low = 0.03 * strains.min()
            high = max(0.5 * model.values.get("eps_half", strains.max()), low)
        case "force":
            translations = [sweep for sweep in split_by_kind(data_sets)[1] if not sweep.direction.is_rotation]
            high = max((float(np.max(np.abs(sweep.measured) * sweep.amplitude)) for sweep in translations), default=1.0)
            low, high = 0.3 * high, 0.95 * high
        case "order":
            low, high = _ORDERS  # steeper than alpha, which lies between the orders of both terms
            low = min(max(low, model.values.get("alpha", low)), high)
        case "session":
            low, high = _SESSION
        case None:
            return np.array([parameter.typical])
    return np.clip(np.geomspace(low, high, _PROBES), *parameter.bounds)
