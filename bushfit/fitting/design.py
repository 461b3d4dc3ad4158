"""Fits of effects that are added: from a small design of their shapes, as one start may lie in another valley."""

from collections.abc import Iterator, Sequence
from contextlib import suppress

import numpy as np

from bushfit.effects import Effect, Parameter, get_effect, qualified_name
from bushfit.effects.contract import Array
from bushfit.errors import FitError, ModelError
from bushfit.fitting.coordinates import Bounds, Solution
from bushfit.fitting.descent import Descent
from bushfit.fitting.preparation import MeasuredTest, operating_conditions, split_by_kind
from bushfit.fitting.solve import solve
from bushfit.model.model import Model

#: Values tried of a shape parameter (a time, a gap, a frequency), spread evenly in its logarithm.
_PROBES = 5
#: Least and largest order of a derivative that is tried: one far below and one far above that of filled rubber, 0.2.
_ORDERS = (0.05, 0.9)
#: Least and largest onset of a drift, as a share of the session: from its first points to what is even.
_SESSION = (0.01, 10.0)
#: Factors on a shape parameter of an effect in place of a branch, besides 1, that a fit is started from; chosen: within
#: the decade that the tests of a bushing span, and apart enough to lie in other valleys.
_FACTORS = (0.25, 4.0)
#: Evaluations of the model in the first round of all starts.
_FIRST = 12
#: Starts that are fitted to their end.
_BEST = 2
#: Fall of chi-square by which an end has to lie lower to be another: a tenth of what one standard error makes.
_LOWER = 0.1
#: Evaluations of the model in one fit at most.
_MOST = 200


def designed(
    model: Model, plain: Model, data_sets: Sequence[MeasuredTest], fixed: Sequence[str], bounds: Bounds
) -> Model:
    """A model to start a fit from, effects added in turn to the best fit of those before.

    Args:
        plain: the same without the effects that are to be added, and with the branches that they replace.
        fixed: parameters that do not move.

    Returns:
        The better of the model itself and the one built up effect by effect.
    """
    added = [get_effect(name) for name in model.effects if name not in plain.effects]
    ends = []
    with suppress(FitError, ModelError):  # no response, or too few points; the fit then says what is wrong
        ends.append(fit_from(model, data_sets, fixed, bounds).finished(_MOST).solution)
        solution = solve(plain, data_sets, _free(plain, fixed), bounds, evaluations=_MOST, strict=False)
        for effect in added:
            solution = with_effect(solution, data_sets, effect, fixed, bounds)
        ends.append(solution)
    if len(ends) < 2 or ends[1].chi_square > ends[0].chi_square - _LOWER:  # alike: two of one law may change names
        return model
    return model.with_values({name: ends[1].model.values[name] for name in model.values})


def with_effect(
    solution: Solution, data_sets: Sequence[MeasuredTest], effect: Effect, fixed: Sequence[str], bounds: Bounds
) -> Solution:
    """A fitted model with one effect more, or one in place of a branch: the best fit of several starts.

    Args:
        solution: end of the fit without the effect.
        data_sets: tests.
        effect: effect to add.
        fixed: names of parameters that do not move.
        bounds: limits inside the parameters' own [SI].

    Returns:
        End of the best fit.

    Raises:
        FitError: no start has a finite response.
    """
    fits = []
    for start in _starts(solution.model, data_sets, effect):
        with suppress(FitError, ModelError):  # no response from this start
            fits.append(fit_from(start, data_sets, fixed, bounds).finished(_FIRST))
    if not fits:
        raise FitError("the model has no finite response to these tests", found=effect.name)
    best = sorted(fits, key=lambda descent: descent.chi_square)[:_BEST]
    return min((descent.finished(_MOST) for descent in best), key=lambda descent: descent.chi_square).solution


def fit_from(model: Model, data_sets: Sequence[MeasuredTest], fixed: Sequence[str], bounds: Bounds) -> Descent:
    """A fit of every parameter of a model but the held ones, from its own values, before its first step.

    Args:
        model: model with the start values.
        data_sets: tests.
        fixed: names of parameters that do not move.
        bounds: limits inside the parameters' own [SI].
    """
    return Descent.start(model, data_sets, _free(model, fixed), bounds)


def _free(model: Model, fixed: Sequence[str]) -> list[str]:
    return [name for name in model.parameters if name not in fixed]


def _starts(fitted: Model, data_sets: Sequence[MeasuredTest], effect: Effect) -> Iterator[Model]:
    """Models to start from: each that the fitted one suggests, and the first with each shape parameter elsewhere.

    What has a neutral amount starts at a tenth of its typical one: at its neutral value a fit may not see its shape.
    """
    amount = effect.amount
    small_amount = {} if effect.replaces else {qualified_name(effect, amount): amount.sized(0.1)}
    model, *alternatives = [fitted.with_effect(effect.name, small_amount | start) for start in fitted.starts(effect)]
    yield from (model, *alternatives)
    for parameter in effect.parameters:
        if parameter.neutral is None:
            name = qualified_name(effect, parameter)
            factors = model.values[name] * np.array(_FACTORS)
            values = probes(data_sets, model, parameter) if parameter.scale else factors
            for value in np.clip(values, *parameter.bounds).tolist():
                yield model.with_values({name: value})


def probes(data_sets: Sequence[MeasuredTest], model: Model, parameter: Parameter) -> Array:
    """Values of a shape parameter that these tests could show, by what it is measured against.

    Args:
        data_sets: tests.
        model: fitted model.
        parameter: shape parameter.

    Returns:
        Start values in the parameter's SI unit, (n,).
    """
    frequencies, strains = operating_conditions(model.bushing, data_sets)
    match parameter.scale:
        case "period":
            swept = np.concatenate([sweep.frequency for sweep in split_by_kind(data_sets)[1]] or [frequencies])
            low, high = 0.1 / (2.0 * np.pi * swept.max()), 1.0 / (2.0 * np.pi * swept.min())
        case "frequency":
            low, high = 0.7 * frequencies.max(), 4.0 * frequencies.max()
        case "displacement":
            low, high = stroke(data_sets)
        case "strain":
            low = 0.03 * strains.min()
            high = max(0.5 * model.values.get("eps_half", strains.max()), low)
        case "force":
            translations = [sweep for sweep in split_by_kind(data_sets)[1] if not sweep.direction.is_rotation]
            high = max((float(np.max(np.abs(sweep.measured) * sweep.amplitude)) for sweep in translations), default=1.0)
            low, high = 0.3 * high, 0.95 * high
        case "order":
            low, high = _ORDERS  # steeper than the first, which without it lies between the two
            low = min(max(low, model.values.get("alpha", low)), high)
        case "session":
            low, high = _SESSION
        case None:
            return np.array([parameter.typical])
    return np.clip(np.geomspace(low, high, _PROBES), *parameter.bounds)


def stroke(data_sets: Sequence[MeasuredTest]) -> tuple[float, float]:
    """Displacements that some test reaches and some test just misses [m]."""
    amplitudes = np.concatenate([data_set.amplitude for data_set in data_sets])
    return 0.8 * float(amplitudes.min()), 0.95 * float(amplitudes.max())
