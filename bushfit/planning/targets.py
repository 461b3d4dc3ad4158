"""Targets: expected widths of 95 % intervals, and the reason why a target cannot be met."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from bushfit.effects.contract import Array
from bushfit.geometry import Place
from bushfit.model.covariance import Z95, Covariance
from bushfit.model.result import Range, Result
from bushfit.planning.contract import Knowledge, PlanRequest, Points, Target
from bushfit.prediction.caveats import unfitted
from bushfit.prediction.stiffness import predict
from bushfit.units import format_range, number

#: Number of runs of each test that represents unlimited repeats; chosen: years of the rig.
UNLIMITED_RUNS = 1000
#: Accepted half width over that of unlimited tests if these miss a target, too; chosen.
_NEARLY = 1.1


@dataclass(frozen=True, eq=False)
class Goal:
    """A target as a function of the parameters' covariance, at n points; k includes the parameters at a bound.

    Args:
        target: quantity and wanted half width.
        rows: relative change of the quantity at each point by relative change of the parameters, (n, k).
        model_error: relative standard error by the error of the model, which no test lowers, (n,).
        undecided: relative half width that undecided readings of the tests add, (n,).
        points: operating points of a predicted quantity; None of a parameter.
    """

    target: Target
    rows: Array
    model_error: Array
    undecided: Array
    points: Points | None = None

    def variances(self, error_covariance: Array) -> Array:
        """Relative variance of the quantity by the parameters' errors, (n,), from their covariance, (k, k)."""
        return np.asarray(np.einsum("nk,kl,nl->n", self.rows, error_covariance, self.rows))

    def half_widths(self, error_covariance: Array) -> Array:
        """Half of the 95 % interval over the value at each point, (n,), from the parameters' covariance, (k, k)."""
        return self.undecided + Z95 * np.sqrt(self.variances(error_covariance) + self.model_error**2)

    def half_width(self, error_covariance: Array) -> float:
        """Half of the widest 95 % interval over its value, from the parameters' covariance, (k, k)."""
        return float(self.half_widths(error_covariance).max())

    def met(self, error_covariance: Array) -> bool:
        """True if the interval is as narrow as the target."""
        return self.half_width(error_covariance) <= self.target.half * (1.0 + 1e-9)

    def reached(self, error_covariance: Array, limit: Array) -> bool:
        """True if the target is met, or nearly as well as unlimited tests would.

        Args:
            error_covariance: of the parameters, (k, k).
            limit: covariance with unlimited tests, (k, k).
        """
        nearly = self.half_width(error_covariance) <= _NEARLY * self.half_width(limit)
        return self.met(error_covariance) or (not self.met(limit) and nearly)

    def weight(self, limit: Array) -> Array:
        """Weight of the parameters' covariance in the mean variance over the allowed variance.

        Args:
            limit: covariance with unlimited tests, (k, k). If these miss the target, nearly their variance is allowed.

        Returns:
            Weight, (k, k).
        """
        wanted = np.square(np.maximum(self.target.half - self.undecided, 0.0) / Z95) - self.model_error**2
        nearly = np.square(_NEARLY * self.half_widths(limit) / Z95)
        nearly = nearly - self.model_error**2 - np.square(self.undecided / Z95)
        allowed = np.where(self.met(limit), wanted, nearly)
        return np.asarray((self.rows / allowed[:, None]).T @ self.rows / len(self.rows))

    def explain_limit(self, knowledge: Knowledge, limit: Array) -> str:
        """Sentence on the largest error that remains with unlimited tests at the widest point.

        Args:
            knowledge: before the tests.
            limit: covariance with unlimited tests, (k, k).

        Returns:
            Such as "+/-1.2 % at 5 Hz and 0.1 mm is the model's own error: ...".
        """
        worst, variance = int(np.argmax(self.half_widths(limit))), self.variances(limit)
        contributions = np.abs(self.rows[worst]) * np.sqrt(np.diag(limit))
        name = (*knowledge.names, *knowledge.bounded)[int(np.argmax(contributions))]
        gain, phase = knowledge.noise.level
        rig_class = f"{number(100.0 * gain, 2)} % of gain and {number(1e3 * phase, 2)} mrad of phase"
        if variance[worst] > 0.25 * self.variances(knowledge.covariance)[worst]:
            remaining = f"{name}, which no test on offer determines well enough"
        else:
            remaining = f"the class of the rig, {rig_class} that all repeats of a test share, in {name}"
        size, cause = max(
            (Z95 * float(self.model_error[worst]), "the model's own error: no test lowers it, naming its cause may"),
            (float(self.undecided[worst]), "what the tests leave undecided: bushfit diagnose names the next test"),
            (Z95 * float(np.sqrt(variance[worst])), remaining),
        )
        location = ""
        if self.points:
            unit, factor = self.points.place.display.displacement
            frequency, amplitude = float(self.points.frequency[worst]), float(self.points.amplitude[worst])
            location = f" at {format_range('Hz', frequency)} and {format_range(unit, factor * amplitude)}"
        return f"{percent(size)}{location} is {cause}"


def make_goals(knowledge: Knowledge, request: PlanRequest, slopes: Array) -> Iterator[Goal]:
    """Make a goal for each target.

    Args:
        knowledge: before the tests.
        request: targets and wanted points.
        slopes: gain and phase of the stiffness at all wanted points by relative change of the parameters, (k, 2, n).

    Returns:
        Iterator over the goals in the order of the targets.
    """
    names = (*knowledge.names, *knowledge.bounded)
    ends = np.cumsum([points.frequency.size for points in request.points])[:-1]
    parts = zip(request.points, np.split(slopes, ends, axis=-1), strict=True)
    by_place = {points.place: (points, part) for points, part in parts}
    for target in request.targets:
        if target.place is None:
            row = np.array([[float(name == target.quantity) for name in names]])
            yield Goal(target, row, np.zeros(1), np.zeros(1))
            continue
        points, (gain, phase) = by_place[target.place][0], np.swapaxes(by_place[target.place][1], 0, 1)
        stiffness, loss_factor = irreducible_errors(knowledge, points)
        loss = loss_factor[0]
        value, error, undecided = stiffness if target.quantity == "stiffness" else loss_factor
        rows = gain if target.quantity == "stiffness" else phase * (1.0 + loss**2) / loss
        yield Goal(target, rows.T, error / value, undecided / value, points)


def irreducible_errors(knowledge: Knowledge, points: Points) -> tuple[tuple[Array, Array, Array], ...]:
    """Errors of a prediction that no further test lowers: the model's own, and those of undecided readings.

    Args:
        knowledge: before the tests.
        points: operating points of one direction.

    Returns:
        For the stiffness and for the loss factor at each point: value, standard error of the model, and the half width
        that undecided readings add, (n,) each [SI].
    """
    exact = replace(knowledge.result or Result(knowledge.model), covariance=Covariance())
    frequency, amplitude = points.frequency, points.amplitude
    prediction = predict(exact, points.place, frequency, amplitude)
    frequencies, amplitudes = np.unique(frequency), np.unique(amplitude)
    index = np.searchsorted(amplitudes, amplitude) * frequencies.size + np.searchsorted(frequencies, frequency)
    errors = []
    for band in (prediction.stiffness, prediction.loss_factor):
        value, half = band.value[index], np.maximum(band.high - band.value, band.value - band.low)[index]
        error = np.linalg.norm(band.root, axis=0)[index]
        errors.append((value, error, np.maximum(half - Z95 * error, 0.0)))
    return tuple(errors)


def describe_untested(knowledge: Knowledge, place: Place, tested: Iterable[str]) -> str | None:
    """Sentence on the error that intervals of an untested direction lack.

    Args:
        knowledge: before the tests.
        place: direction or specimen.
        tested: directions of the tests so far and of those planned.

    Returns:
        The sentence; None if the intervals lack no error.
    """
    measured = knowledge.result.measured if knowledge.result else None
    directions = dict.fromkeys([*(measured.directions if measured else ()), *tested])
    reached = measured or Range((1.0, 1.0), (1.0, 1.0))
    result = Result(knowledge.model, knowledge.names, measured=replace(reached, directions=tuple(directions)))
    return next(unfitted(result, place), None) if str(place) not in directions else None


def percent(half: float, digits: int = 2) -> str:
    """Format half an interval over its value, such as "+/-1.5 %"."""
    return f"+/-{number(100.0 * half, digits)} %"
