"""Hold-out: prediction of each part of the tests from the rest, with and without the added effects.

A line (an amplitude level, or a frequency where amplitudes are stepped), the top third of the steps, a direction and a
loop are held out in turn.

Notes:
    Refitting without a part is one Gauss-Newton step from the full fit, which is exact where the model is linear over
    that step; where the step is long, the model is fitted to the rest.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bushfit.diagnosis.evidence import Evidence, fit
from bushfit.effects import effect_name_of
from bushfit.effects.contract import Array
from bushfit.errors import FitError, ModelError
from bushfit.fitting.agreement import LeaveOut
from bushfit.fitting.coordinates import Bounds
from bushfit.fitting.preparation import MeasuredSweep, MeasuredTest, split_by_kind
from bushfit.fitting.problem import FitResult
from bushfit.progress import track
from bushfit.reading.measurement import Stepped

#: Share of all sweep points, with the highest stepped values (frequencies or amplitudes), that forms one part.
_TOP = 1.0 / 3.0
#: Names of the constant axis and of the stepped values of a sweep, by its stepped axis.
_NAMES: dict[Stepped | None, tuple[str, str]] = {
    "frequency": ("amplitude level", "frequencies"),
    "amplitude": ("frequency", "amplitudes"),
    None: ("run", ""),
}


@dataclass(frozen=True, eq=False)
class HoldOutPart:
    """Points of the tests that are held out together.

    Args:
        name: name of the part, for reports.
        points: mask of the held-out points of each test, (n,); loops are held out as a whole.
    """

    name: str
    points: Sequence[Array]

    def rows(self, data_sets: Sequence[MeasuredTest]) -> Array:
        """Mask of the rows of this part in the residual vector of all tests, (all residuals,)."""
        return np.concatenate(
            [np.tile(mask, data.residuals_per_point) for data, mask in zip(data_sets, self.points, strict=True)]
        )

    def rest(self, data_sets: Sequence[MeasuredTest]) -> list[MeasuredTest]:
        """Tests that remain if this part is held out, with unchanged noise; tests held out entirely are omitted."""
        remaining = [(data, mask) for data, mask in zip(data_sets, self.points, strict=True) if not mask.all()]
        return [data.without(np.flatnonzero(mask)).with_weight() if mask.any() else data for data, mask in remaining]


@dataclass(frozen=True)
class HeldOut:
    """Root mean square residual of one part of the tests, predicted from the other parts by two models.

    Args:
        part: description of the part.
        before: value without the added effects, in units of noise.
        after: value with the added effects, in units of noise.
        whitened: values before and after, in units of noise and prediction error combined.
    """

    part: str
    before: float
    after: float
    whitened: tuple[float, float]


@dataclass(frozen=True)
class Skipped:
    """Part of the tests that could not be predicted from the other parts, with the reason.

    Args:
        part: description of the part.
        reason: why it was not held out.
        effects: effects of the model that the other parts do not determine.
    """

    part: str
    reason: str
    effects: tuple[str, ...] = ()


@dataclass(frozen=True)
class HoldOut:
    """Root mean square residuals of two models on parts of the tests, each predicted by a fit to the other parts.

    Args:
        parts: results of the parts that were held out.
        skipped: parts that could not be held out.
        before: root mean square residual without the added effects, in units of noise; None if nothing can be held out.
        after: root mean square residual with the added effects, in units of noise; None if nothing can be held out.
        whitened: before and after, in units of noise and prediction error combined.
    """

    parts: tuple[HeldOut, ...] = ()
    skipped: tuple[Skipped, ...] = ()
    before: float | None = None
    after: float | None = None
    whitened: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def from_residuals(cls, residuals: Mapping[str, Array], skipped: Sequence[Skipped] = ()) -> HoldOut:
        """Compute the root mean square residuals by part and over all parts.

        Args:
            residuals: by name of the part, predicted residuals of the models before and after (first axis), in units of
                noise, and whitened by noise and prediction error (second axis), (2, 2, n).
            skipped: parts that could not be held out.
        """
        residuals = {name: pair for name, pair in residuals.items() if pair.size}  # one frequency has no top third
        if not residuals:
            return cls((), tuple(skipped))
        figures = {name: _figures(pair) for name, pair in residuals.items()}
        overall = _figures(np.concatenate(list(residuals.values()), axis=-1))
        return cls(tuple(HeldOut(name, *values) for name, values in figures.items()), tuple(skipped), *overall)


def hold_out(before: Evidence, after: Evidence, bounds: Bounds) -> HoldOut:
    """Compare the residuals of two models on each part of the tests, predicted by fits to the other parts.

    Args:
        before: fit without the added effects.
        after: fit with the added effects.
        bounds: limits of parameters, for a fit to the remaining tests.

    Returns:
        Root mean square residuals of both models in units of noise, by part and over all parts.
    """
    predictions, skipped = predicted_parts(before, after, bounds)
    return HoldOut.from_residuals({name: prediction.residuals for name, prediction in predictions.items()}, skipped)


def predicted_parts(before: Evidence, after: Evidence, bounds: Bounds) -> tuple[dict[str, Predicted], list[Skipped]]:
    """Predict each part of the tests from the other parts by two models.

    Args:
        before: fit without the added effects.
        after: fit with the added effects.
        bounds: limits of parameters, for a fit to the remaining tests.

    Returns:
        Predictions by the name of the part, and the parts that at least one model cannot predict.
    """
    models = [(evidence, _leave_out(evidence.solution)) for evidence in dict.fromkeys((before, after))]
    predictions, skipped = dict[str, Predicted](), list[Skipped]()
    for part in track("parts held out", list(parts(after.data_sets))):
        attempts = [_predict(*model, part, bounds) for model in models]
        pairs = [prediction for prediction in attempts if not isinstance(prediction, Skipped)]
        if len(pairs) < len(models):
            skipped.append(next(prediction for prediction in attempts if isinstance(prediction, Skipped)))
            continue
        residuals, noise_gradients = zip(pairs[0], pairs[-1], strict=True)
        predictions[part.name] = Predicted(np.array(residuals), np.array(noise_gradients))
    return predictions, skipped


def _figures(pair: Array) -> tuple[float, float, tuple[float, float]]:
    """Root mean square of predicted residuals, (2 models: before and after, 2 units: noise, whitened, n).

    Returns:
        Values in units of noise before and after; and both whitened, in units of noise and prediction error.
    """
    (before, before_whitened), (after, after_whitened) = np.sqrt(np.mean(np.square(pair), axis=-1)).tolist()
    return before, after, (before_whitened, after_whitened)


class Predicted(NamedTuple):
    """Predictions of a held-out part by two models.

    Args:
        residuals: predicted residuals, in units of noise and whitened by the prediction error as well,
            (2 models, 2, n).
        noise_gradients: derivatives of half the sum of squares of the residuals in units of noise by the noise of each
            row of all tests, (2 models, all rows); for the standard error of a comparison.
    """

    residuals: Array
    noise_gradients: Array


def _leave_out(solution: FitResult) -> LeaveOut:
    """Linearise a fit to predict how it changes without some rows; parameters at a bound are fixed."""
    return LeaveOut.from_fit(solution.jacobian[solution.moving], solution.residual)


def _predict(
    evidence: Evidence, leave_out: LeaveOut, part: HoldOutPart, bounds: Bounds
) -> tuple[Array, Array] | Skipped:
    """Predict a part of the tests from the other parts by one model; refit if one Gauss-Newton step is too long.

    Args:
        evidence: fit to all tests.
        leave_out: linearisation of this fit, which predicts residuals without some rows.
        part: part that is held out.
        bounds: limits of parameters, for a fit to the remaining tests.

    Returns:
        Residuals, plain and whitened by the prediction error, (2, n), with the derivatives of half the plain sum of
        squares by the noise of each row, (all rows,); or the part as skipped, with the reason.
    """
    solution, data_sets = evidence.solution, evidence.data_sets
    names, of_tests = solution.coordinates.names, part.rows(data_sets)
    rows = np.pad(of_tests, (0, solution.residual.size - of_tests.size))  # priors are not held out
    if left_open := [names[solution.moving[i]] for i in np.flatnonzero(leave_out.undetermined(rows))]:
        reason = f"the other tests do not determine {', '.join(left_open)}"
        return Skipped(part.name, reason, tuple(dict.fromkeys(map(effect_name_of, left_open))))
    is_step = leave_out.step(rows) is not None
    if not is_step:
        fixed = [name for name in evidence.model.parameters if name not in names]
        failed = Skipped(part.name, "no fit to the other tests converges")
        try:
            rest = fit(evidence.model, part.rest(data_sets), fixed, bounds).solution
        except (FitError, ModelError):
            return failed
        leave_out = _leave_out(rest.reevaluate(rest.model, data_sets))
        if rest.stopped or leave_out.undetermined(rows).any():
            return failed
    residuals = np.array(leave_out.predicted(rows, _clusters(data_sets, rows.size), stepped=is_step))
    return residuals, leave_out.noise_gradient(rows, residuals[0])[: of_tests.size]


def _clusters(data_sets: Sequence[MeasuredTest], count: int) -> Array:
    """Index of the sweep line or loop that each of `count` residuals belongs to; further ones, of priors, are alone."""
    numbers, first = list[Array](), 0
    for data_set in data_sets:
        line = np.zeros(data_set.size // data_set.residuals_per_point, dtype=int)
        if isinstance(data_set, MeasuredSweep):
            line = np.unique(data_set.held_value, return_inverse=True)[1]
        numbers.append(np.tile(first + line, data_set.residuals_per_point))
        first += int(line.max()) + 1
    of_tests = np.concatenate(numbers)
    return np.concatenate([of_tests, first + np.arange(count - of_tests.size)])


def parts(data_sets: Sequence[MeasuredTest]) -> Iterator[HoldOutPart]:
    """List the parts of the tests to hold out: lines, the top third of the steps, directions, and loops.

    Args:
        data_sets: the tests.

    Yields:
        Parts, which may overlap.

    Returns:
        An iterator of parts.
    """

    def part(name: str, chosen: Mapping[MeasuredTest, Array]) -> HoldOutPart:
        return HoldOutPart(
            name, [chosen.get(data, np.zeros(data.size // data.residuals_per_point, dtype=bool)) for data in data_sets]
        )

    loops, sweeps = split_by_kind(data_sets)
    for stepped, (line_name, top) in _NAMES.items():
        mine = [sweep for sweep in sweeps if sweep.sweep.stepped == stepped]
        ranks = {sweep: np.unique(sweep.held_value, return_inverse=True)[1] for sweep in mine}
        for rank in range(max((int(r.max()) + 1 for r in ranks.values()), default=0)):
            yield part(f"{line_name} {rank + 1}", {sweep: r == rank for sweep, r in ranks.items()})
        if mine and top:
            limit = np.quantile(np.concatenate([sweep.step for sweep in mine]), 1.0 - _TOP)
            yield part(f"top third of the {top}", {sweep: sweep.step > limit for sweep in mine})
    wholes = {data: np.ones(data.size // data.residuals_per_point, dtype=bool) for data in data_sets}
    for direction in dict.fromkeys(data.direction for data in data_sets):
        members = {data: whole for data, whole in wholes.items() if data.direction == direction}
        if len(members) < len(wholes):
            yield part(f"{direction} direction", members)
    for loop in loops if len(loops) > 1 else ():
        yield part(f"loop {loop.name}", {loop: wholes[loop]})
