"""Targets: expected widths of 95 % intervals, and the reason why a target cannot be met."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.preparation import planned_sweep
from bushfit.model.covariance import Z95, Covariance
from bushfit.model.result import Result
from bushfit.planning.contract import Knowledge, Points, Target
from bushfit.planning.information import relative_slopes
from bushfit.prediction.stiffness import predict
from bushfit.reading.measurement import loss_factor
from bushfit.units import format_range, number

#: Number of runs of each test that represents unlimited repeats; chosen: years of the rig.
UNLIMITED_RUNS = 1000
#: Accepted half width over that of unlimited tests if these miss a target, too; chosen.
_NEARLY = 1.1


@dataclass(frozen=True, eq=False)
class PointSensitivity:
    """Sensitivity of the stiffness at n operating points of a direction, and the errors that no further test lowers.

    Args:
        points: operating points of the request in one direction.
        loss_factor: loss factor at each point, (n,).
        slopes: derivatives of ln|K| and of the phase [rad] by the relative change of each parameter, (2, n, k).
        model_error: standard error due to the model error, of |K| (relative) and of the loss factor (absolute), (2, n).
        undecided: half width that explanations which the tests cannot distinguish add to the 95 % intervals of |K|
            (relative) and of the loss factor (absolute), (2, n).
    """

    points: Points
    loss_factor: Array
    slopes: Array
    model_error: Array
    undecided: Array

    @classmethod
    def from_knowledge(cls, knowledge: Knowledge, points: Points) -> PointSensitivity:
        """Compute the sensitivities and errors from the model and covariance before the planned tests.

        Args:
            knowledge: model, covariance and noise before the planned tests.
            points: operating points of one direction.

        Returns:
            Sensitivities and errors, in the order of the points.
        """
        place, frequency, amplitude = points.place, points.frequency, points.amplitude
        sweep = planned_sweep(knowledge.model, place, frequency, amplitude, (1.0, 1.0), (0.0, 0.0))
        slopes = np.stack(np.split(relative_slopes(knowledge, [sweep]).T, 2))
        exact = replace(knowledge.result or Result(knowledge.model), covariance=Covariance())
        prediction = predict(exact, place, frequency, amplitude)  # over the grid of all pairs
        frequencies, amplitudes = np.unique(frequency), np.unique(amplitude)
        index = np.searchsorted(amplitudes, amplitude) * frequencies.size + np.searchsorted(frequencies, frequency)
        model_error, undecided = [], []
        for band, unit in ((prediction.stiffness, prediction.stiffness.value), (prediction.loss_factor, 1.0)):
            half, error = np.maximum(band.high - band.value, band.value - band.low), np.linalg.norm(band.root, axis=0)
            model_error.append((error / unit)[index])
            undecided.append((np.maximum(half - Z95 * error, 0.0) / unit)[index])
        loss = loss_factor(knowledge.model.stiffness(place, frequency, amplitude))
        return cls(points, loss, slopes, np.array(model_error), np.array(undecided))


@dataclass(frozen=True, eq=False)
class TargetSensitivity:
    """Target with the data from which its 95 % interval follows for any covariance of the parameters.

    The target has n operating points (one for a parameter); the k parameters include the parameters at a bound.

    Args:
        target: quantity and half width that the user asks for.
        rows: derivative of the relative change of the quantity by the relative change of each parameter, (n, k).
        model_error: relative standard error due to the model error, which no test lowers, (n,).
        undecided: relative half width due to explanations that the tests cannot distinguish, (n,).
        points: operating points of a predicted quantity; None for a parameter.
    """

    target: Target
    rows: Array
    model_error: Array
    undecided: Array
    points: Points | None = None

    @classmethod
    def from_target(cls, target: Target, names: Sequence[str], wanted: PointSensitivity | None) -> TargetSensitivity:
        """Compute the derivatives of a target's quantity by the parameters, and the errors that no test lowers.

        Args:
            target: a parameter, or the stiffness or loss factor of a direction.
            names: names of the k parameters.
            wanted: sensitivities at the operating points of the direction; None for a parameter.

        Returns:
            The target with these data at all operating points of the direction.
        """
        if wanted is None:
            row = np.array([[float(name == target.quantity) for name in names]])
            return cls(target, row, np.zeros(1), np.zeros(1))
        (gain, phase), loss = wanted.slopes, wanted.loss_factor
        if target.quantity == "stiffness":
            return cls(target, gain, wanted.model_error[0], wanted.undecided[0], wanted.points)
        rows = phase * ((1.0 + loss**2) / loss)[:, None]
        return cls(target, rows, wanted.model_error[1] / loss, wanted.undecided[1] / loss, wanted.points)

    def variances(self, error_covariance: Array) -> Array:
        """Relative variance of the target's quantity at each point, (n,), from the parameters' covariance, (k, k)."""
        return np.asarray(np.einsum("nk,kl,nl->n", self.rows, error_covariance, self.rows))

    def half_widths(self, error_covariance: Array) -> Array:
        """Relative half width of the 95 % interval at each point, (n,), from the parameters' covariance, (k, k)."""
        return self.undecided + Z95 * np.sqrt(self.variances(error_covariance) + self.model_error**2)

    def half_width(self, error_covariance: Array) -> float:
        """Relative half width of the target's widest 95 % interval, from the parameters' covariance, (k, k)."""
        return float(self.half_widths(error_covariance).max())

    def met(self, error_covariance: Array) -> bool:
        """True if this covariance of the parameters, (k, k), makes all intervals as narrow as the target."""
        return self.half_width(error_covariance) <= self.target.half_width * (1.0 + 1e-9)

    def reached(self, error_covariance: Array, limit: Array) -> bool:
        """True if tests meet the target, or miss it by nearly as little as unlimited tests would.

        Args:
            error_covariance: covariance of the parameters with the tests, (k, k).
            limit: covariance of the parameters with unlimited tests, (k, k).
        """
        nearly = self.half_width(error_covariance) <= _NEARLY * self.half_width(limit)
        return self.met(error_covariance) or (not self.met(limit) and nearly)

    def weight(self, limit: Array) -> Array:
        """Compute the weight matrix of the search criterion for this target.

        Args:
            limit: covariance of the parameters with unlimited tests, (k, k).

        Returns:
            Matrix W, (k, k): trace(W covariance) is the variance of the quantity over the variance that the target
            allows, averaged over points. If unlimited tests miss the target, the allowed variance is slightly above
            theirs.
        """
        if self.met(limit):
            allowed = np.square(np.maximum(self.target.half_width - self.undecided, 0.0) / Z95) - self.model_error**2
        else:
            nearly = np.square(_NEARLY * self.half_widths(limit) / Z95)
            allowed = nearly - self.model_error**2 - np.square(self.undecided / Z95)
        return np.asarray((self.rows / allowed[:, None]).T @ self.rows / len(self.rows))

    def explain_limit(self, knowledge: Knowledge, limit: Array) -> str:
        """Write a sentence on the largest error that remains with unlimited tests, at the point of the widest interval.

        Args:
            knowledge: model, covariance and noise before the planned tests.
            limit: covariance of the parameters with unlimited tests, (k, k).

        Returns:
            Sentence such as "+/-1.2 % at 5 Hz and 0.1 mm is the model error: ...".
        """
        worst, variance = int(np.argmax(self.half_widths(limit))), self.variances(limit)
        contributions = np.abs(self.rows[worst]) * np.sqrt(np.diag(limit))
        name = (*knowledge.names, *knowledge.bounded)[int(np.argmax(contributions))]
        gain, phase = knowledge.noise.level
        remaining = (
            f"the class of the rig, {number(100.0 * gain, 2)} % of gain and {number(1e3 * phase, 2)} mrad of phase "
            f"that all repeats of a test share, in {name}"
        )
        if variance[worst] > 0.25 * self.variances(knowledge.covariance)[worst]:
            remaining = f"{name}, which no available test determines well enough"
        size, cause = max(
            (Z95 * float(self.model_error[worst]), "the model error: no test reduces it; diagnose may name its cause"),
            (
                float(self.undecided[worst]),
                "explanations that the tests cannot distinguish: bushfit diagnose states the next test",
            ),
            (Z95 * float(np.sqrt(variance[worst])), remaining),
        )
        location = ""
        if self.points:
            unit, factor = self.points.place.display.displacement
            frequency, amplitude = float(self.points.frequency[worst]), float(self.points.amplitude[worst])
            location = f" at {format_range('Hz', frequency)} and {format_range(unit, factor * amplitude)}"
        return f"{format_half_width(size)}{location} is {cause}"


def format_half_width(half_width: float, digits: int = 2) -> str:
    """Format a relative half width as a percentage: 0.015 becomes "+/-1.5 %"."""
    return f"+/-{number(100.0 * half_width, digits)} %"
