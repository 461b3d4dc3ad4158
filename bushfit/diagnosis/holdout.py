"""Hold-out validation: predict each part of the tests from the other parts, with and without the added effects.

A level (all points of the sweeps at one constant amplitude, or at one constant frequency), the top third of the stepped
values, a direction and a loop are held out in turn.

Notes:
    Refitting without a part is one Gauss-Newton step from the full fit, which is exact where the model is linear over
    that step; where the step is long, the model is fitted to the rest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bushfit.diagnosis.fits import fit_model
from bushfit.effects import effect_name_of
from bushfit.effects.contract import Array
from bushfit.errors import FitError, ModelError
from bushfit.fitting.agreement import LeaveOut
from bushfit.fitting.coordinates import Bounds
from bushfit.fitting.preparation import MeasuredTest, split_by_kind
from bushfit.fitting.problem import FitResult
from bushfit.progress import track
from bushfit.reading.measurement import Stepped

#: Fraction of all sweep points, those with the highest stepped values (frequencies or amplitudes), that forms one part.
_TOP = 1.0 / 3.0
#: Names of the constant axis and of the stepped values of a sweep, by its stepped axis.
_NAMES: dict[Stepped | None, tuple[str, str]] = {
    "frequency": ("amplitude level", "frequencies"),
    "amplitude": ("frequency", "amplitudes"),
    None: ("run", ""),
}


@dataclass(frozen=True, eq=False)
class HoldOutPart:
    """Points of the tests that are left out of a fit together and predicted from the rest.

    Args:
        name: name of the part, for reports.
        points: mask of the held-out points of each test, (n,); loops are held out as a whole.
    """

    name: str
    points: Sequence[Array]

    @classmethod
    def of_tests(cls, name: str, chosen: Mapping[MeasuredTest, Array], tests: Sequence[MeasuredTest]) -> HoldOutPart:
        """Build a part from the held-out points of some tests.

        Args:
            name: name of the part.
            chosen: mask of the held-out points, (n,), of each test that has such points.
            tests: all tests.
        """
        points = (chosen.get(test, np.zeros(test.size // test.residuals_per_point, dtype=bool)) for test in tests)
        return cls(name, list(points))

    def rows(self, data_sets: Sequence[MeasuredTest]) -> Array:
        """Mask of the residuals of this part among the n residuals of all tests, (n,)."""
        return np.concatenate(
            [np.tile(mask, data.residuals_per_point) for data, mask in zip(data_sets, self.points, strict=True)]
        )

    def remaining_tests(self, data_sets: Sequence[MeasuredTest]) -> list[MeasuredTest]:
        """Tests without the held-out points, with unchanged noise; tests held out entirely are omitted."""
        remaining = [(data, mask) for data, mask in zip(data_sets, self.points, strict=True) if not mask.all()]
        return [data.without(np.flatnonzero(mask)).with_weight() if mask.any() else data for data, mask in remaining]


@dataclass(frozen=True)
class HeldOut:
    """Root mean square residual of one part of the tests, predicted from the other parts by two models.

    Args:
        part: description of the part.
        before: value without the added effects, in units of noise.
        after: value with the added effects, in units of noise.
    """

    part: str
    before: float
    after: float


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
    """Errors of two models on held-out parts of the tests, each predicted by a fit to the other parts.

    Args:
        parts: results of the parts that were held out.
        skipped: parts that could not be held out.
        before: root mean square residual without the added effects, in units of noise; None if nothing can be held out.
        after: root mean square residual with the added effects, in units of noise; None if nothing can be held out.
    """

    parts: tuple[HeldOut, ...] = ()
    skipped: tuple[Skipped, ...] = ()
    before: float | None = None
    after: float | None = None

    @classmethod
    def from_residuals(cls, residuals: Mapping[str, Array], skipped: Sequence[Skipped] = ()) -> HoldOut:
        """Compute the root mean square residuals by part and over all parts.

        Args:
            residuals: by name of the part, residuals of the models before and after, in units of noise, (2, n).
            skipped: parts that could not be held out.
        """
        residuals = {name: pair for name, pair in residuals.items() if pair.size}  # one frequency has no top third
        if not residuals:
            return cls((), tuple(skipped))
        parts = tuple(HeldOut(name, *_rms_values(pair)) for name, pair in residuals.items())
        return cls(parts, tuple(skipped), *_rms_values(np.concatenate(list(residuals.values()), axis=-1)))


def hold_out(before: FitResult, after: FitResult, bounds: Bounds) -> HoldOut:
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


def predicted_parts(before: FitResult, after: FitResult, bounds: Bounds) -> tuple[dict[str, Predicted], list[Skipped]]:
    """Predict each part of the tests from the other parts, by a model without and a model with added effects.

    Args:
        before: fit without the added effects.
        after: fit with the added effects.
        bounds: limits of parameters, for a fit to the remaining tests.

    Returns:
        Predictions by the name of the part, and the parts that at least one model cannot predict.
    """
    fits = dict.fromkeys((before, after))
    models = [(fit, LeaveOut.from_fit(fit.jacobian[fit.inner_indices], fit.residual)) for fit in fits]
    predictions, skipped = dict[str, Predicted](), list[Skipped]()
    for part in track("parts held out", hold_out_parts(after.data_sets)):
        attempts = [_predict(*model, part, bounds) for model in models]
        failures = [attempt for attempt in attempts if isinstance(attempt, Skipped)]
        pairs = [attempt for attempt in attempts if not isinstance(attempt, Skipped)]
        if failures:
            skipped.append(failures[0])
            continue
        residuals, noise_gradients = zip(pairs[0], pairs[-1], strict=True)
        predictions[part.name] = Predicted(np.array(residuals), np.array(noise_gradients))
    return predictions, skipped


def _rms_values(pair: Array) -> tuple[float, float]:
    """Root mean square of n residuals, for each of two models, from the residuals of both, (2, n)."""
    before, after = np.sqrt(np.mean(np.square(pair), axis=-1)).tolist()
    return before, after


class Predicted(NamedTuple):
    """Residuals of a held-out part, predicted by two models from the other parts of the tests.

    Args:
        residuals: for each model, the n residuals in units of noise, (2, n).
        noise_gradients: for each model, the derivatives of half the sum of squares of the residuals (in units of noise)
            with respect to the noise of each of the m residuals of all tests, (2, m); for the standard error of a
            comparison.
    """

    residuals: Array
    noise_gradients: Array


def _predict(fit: FitResult, leave_out: LeaveOut, part: HoldOutPart, bounds: Bounds) -> tuple[Array, Array] | Skipped:
    """Predict a part of the tests from the other parts by one model, with a refit if a Gauss-Newton step is too long.

    Args:
        fit: fit to all tests.
        leave_out: linearisation of this fit, which predicts residuals without some rows.
        part: part that is held out.
        bounds: limits of parameters, for a fit to the remaining tests.

    Returns:
        Residuals in units of noise, (n,), and derivatives of half their sum of squares with respect to the noise of
        each of the m residuals of all tests, (m,); or the part with the reason why it is skipped.
    """
    names, data_sets = fit.names, fit.data_sets
    of_tests = part.rows(data_sets)
    rows = np.pad(of_tests, (0, fit.residual.size - of_tests.size))  # priors are not held out
    if undetermined := [names[fit.inner_indices[i]] for i in np.flatnonzero(leave_out.undetermined(rows))]:
        reason = f"the other tests do not determine {', '.join(undetermined)}"
        return Skipped(part.name, reason, tuple(dict.fromkeys(map(effect_name_of, undetermined))))
    is_step = leave_out.parameter_step(rows) is not None
    if not is_step:
        failed = Skipped(part.name, "no fit to the other tests converges")
        try:
            rest = fit_model(fit.model, part.remaining_tests(data_sets), fit.fixed_names, bounds)
        except (FitError, ModelError):
            return failed
        rest = rest.reevaluate(rest.model, data_sets)
        leave_out = LeaveOut.from_fit(rest.jacobian[rest.inner_indices], rest.residual)
        if rest.stopped or leave_out.undetermined(rows).any():
            return failed
    residuals = leave_out.predicted_residual(rows, stepped=is_step)
    return residuals, leave_out.noise_gradient(rows, residuals)[: of_tests.size]


def hold_out_parts(data_sets: Sequence[MeasuredTest]) -> list[HoldOutPart]:
    """List the parts of the tests to hold out, which may overlap.

    Args:
        data_sets: the tests.

    Returns:
        Levels of sweeps, the top third of the stepped values, directions, and loops.
    """
    chosen = dict[str, Mapping[MeasuredTest, Array]]()
    loops, sweeps = split_by_kind(data_sets)
    for stepped, (level_name, top) in _NAMES.items():
        members = [sweep for sweep in sweeps if sweep.test.stepped == stepped]
        ranks = {sweep: np.unique(sweep.run_level, return_inverse=True)[1] for sweep in members}
        for rank in range(max((int(r.max()) + 1 for r in ranks.values()), default=0)):
            chosen[f"{level_name} {rank + 1}"] = {sweep: r == rank for sweep, r in ranks.items()}
        if members and top:
            limit = np.quantile(np.concatenate([sweep.step for sweep in members]), 1.0 - _TOP)
            chosen[f"top third of the {top}"] = {sweep: sweep.step > limit for sweep in members}
    wholes = {data: np.ones(data.size // data.residuals_per_point, dtype=bool) for data in data_sets}
    for direction in dict.fromkeys(data.direction for data in data_sets):
        in_direction = {data: whole for data, whole in wholes.items() if data.direction == direction}
        if len(in_direction) < len(wholes):
            chosen[f"{direction} direction"] = in_direction
    chosen |= {f"loop {loop.name}": {loop: wholes[loop]} for loop in loops if len(loops) > 1}
    return [HoldOutPart.of_tests(name, points, data_sets) for name, points in chosen.items()]
