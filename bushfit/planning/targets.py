"""Planned quantities: expected widths of their 95 % intervals, and the reason why a target cannot be met."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.preparation import planned_sweep
from bushfit.geometry import Place
from bushfit.model.covariance import Z95, Covariance
from bushfit.planning.contract import Knowledge
from bushfit.planning.information import relative_slopes
from bushfit.prediction.stiffness import Prediction, predict
from bushfit.reading.measurement import loss_factor
from bushfit.units import format_range, number

#: Number of runs of each test that represents unlimited repeats; chosen: years of the rig.
UNLIMITED_RUNS = 1000
#: Accepted half width over that of unlimited tests if these miss a target, too; chosen.
_NEARLY = 1.1


@dataclass(frozen=True, eq=False)
class PlannedQuantity:
    """Parameter, stiffness or loss factor that a plan shall determine; converts parameter errors to errors of it.

    A prediction has n operating points, a parameter one. With the covariance C of the relative errors of the k
    parameters (those at a bound included), the relative variance at a point is scale^2 row C row^T + model_error^2, and
    the half width of its relative 95 % interval is undecided + 1.96 times the root of this variance.

    Args:
        name: "mu", "stiffness.axial" or "loss_factor.axial".
        value: factor from relative errors to the errors that the plan reports: the loss factor at each point, whose
            absolute error is reported, or 1, (n,).
        rows: derivatives of ln|K|, of the phase [rad] for a loss factor, or of the logarithm of a parameter, with
            respect to the relative change of each parameter, (n, k).
        scale: factor from the error of the phase [rad] to the relative error of the loss factor, (1 + loss^2)/loss; 1
            for other quantities, (n,).
        model_error: relative standard error due to the error of the model, which no test lowers, (n,).
        undecided: addition to the half width, because tests cannot distinguish several explanations, (n,).
        prediction: prediction with these operating points; None for a parameter.
        target: largest relative half width of the 95 % interval that the user allows; infinite without a target.
    """

    name: str
    value: Array
    rows: Array
    scale: Array
    model_error: Array
    undecided: Array
    prediction: Prediction | None = None
    target: float = np.inf

    @classmethod
    def parameters(cls, knowledge: Knowledge) -> list[PlannedQuantity]:
        """Parameters that the tests have to determine, as planned quantities without a model error."""
        rows, one, none = np.eye(len(knowledge.names) + len(knowledge.bounded)), np.ones(1), np.zeros(1)
        pairs = zip(knowledge.names, rows, strict=False)
        return [cls(name, one, row[None], one, none, none) for name, row in pairs]

    @classmethod
    def predictions(cls, knowledge: Knowledge, place: Place, *grid: Array) -> list[PlannedQuantity]:
        """Stiffness and loss factor over a grid of operating points.

        Args:
            knowledge: model, covariance and noise before the planned tests.
            place: direction or specimen.
            *grid: frequencies [Hz] and zero-to-peak amplitudes [m, rad or strain].

        Returns:
            Planned stiffness, then planned loss factor.
        """
        exact = replace(knowledge.result, covariance=Covariance(), usable=())
        prediction = predict(exact, place, *grid)
        points = place, prediction.frequency, prediction.amplitude
        sweep = planned_sweep(knowledge.model, *points, (1.0, 1.0), (0.0, 0.0))
        gain, phase = np.split(relative_slopes(knowledge, [sweep]).T, 2)
        loss, one = loss_factor(knowledge.model.stiffness(*points)), np.ones(prediction.frequency.size)
        quantities = []
        for name, value, rows, scale, band, unit in (
            ("stiffness", one, gain, one, prediction.stiffness, prediction.stiffness.value),
            ("loss_factor", loss, phase, (1.0 + loss**2) / loss, prediction.loss_factor, loss),
        ):
            half, error = np.maximum(band.high - band.value, band.value - band.low), np.linalg.norm(band.root, axis=0)
            errors = error / unit, np.maximum(half - Z95 * error, 0.0) / unit
            quantities.append(cls(f"{name}.{place}", value, rows, scale, *errors, prediction))
        return quantities

    @property
    def place(self) -> Place | None:
        """Direction or specimen of a prediction; None for a parameter."""
        return self.prediction.direction if self.prediction else None

    def variances(self, error_covariance: Array) -> Array:
        """Relative variance due to the parameters at each point, (n,), from their covariance, (k, k)."""
        return np.square(self.scale) * np.einsum("nk,kl,nl->n", self.rows, error_covariance, self.rows)

    def rms_error(self, error_covariance: Array) -> float:
        """Root mean square, over the points of the quantity, of its standard error, in the unit of `value`.

        Args:
            error_covariance: covariance of the relative errors of the k parameters after the planned tests, (k, k).
        """
        variances = self.variances(error_covariance) + self.model_error**2
        return float(np.sqrt(np.mean(np.square(self.value) * variances)))

    def half_widths(self, error_covariance: Array) -> Array:
        """Relative half width of the 95 % interval at each point, (n,), from the parameters' covariance, (k, k)."""
        return self.undecided + Z95 * np.sqrt(self.variances(error_covariance) + self.model_error**2)

    def half_width(self, error_covariance: Array) -> float:
        """Relative half width of the widest 95 % interval, from the parameters' covariance, (k, k)."""
        return float(self.half_widths(error_covariance).max())

    def meets_target(self, error_covariance: Array, limit: Array | None = None) -> bool:
        """Check that all 95 % intervals are as narrow as the target.

        Args:
            error_covariance: covariance of the parameters with the tests, (k, k).
            limit: covariance of the parameters with unlimited tests, (k, k). If these miss the target, too, the tests
                meet it with up to 1.1 times the half width of unlimited tests. None to require the target.
        """
        width, target = self.half_width(error_covariance), self.target * (1.0 + 1e-9)
        limit_width = 0.0 if limit is None else self.half_width(limit)
        return width <= target or (target < limit_width and width <= _NEARLY * limit_width)

    def weight(self, limit: Array) -> Array:
        """Compute the matrix W of the search's objective trace(W covariance) for this target.

        Args:
            limit: covariance of the parameters with unlimited tests, (k, k).

        Returns:
            Matrix W, (k, k): trace(W covariance) is the variance of the quantity over the variance that the target
            allows, averaged over points. If unlimited tests miss the target, the allowed variance is slightly above the
            variance with unlimited tests.
        """
        if self.meets_target(limit):
            allowed = np.square(np.maximum(self.target - self.undecided, 0.0) / Z95) - self.model_error**2
        else:
            nearly = np.square(_NEARLY * self.half_widths(limit) / Z95)
            allowed = nearly - self.model_error**2 - np.square(self.undecided / Z95)
        return np.asarray((self.rows * (self.scale**2 / allowed)[:, None]).T @ self.rows / len(self.rows))

    def explain_limit(self, knowledge: Knowledge, limit: Array) -> str:
        """Write a sentence on the largest error that remains with unlimited tests, at the point of the widest interval.

        Args:
            knowledge: model, covariance and noise before the planned tests.
            limit: covariance of the parameters with unlimited tests, (k, k).

        Returns:
            Sentence such as "+/-1.2 % at 5 Hz and 0.1 mm comes from the model error: ...".
        """
        worst, variance = int(np.argmax(self.half_widths(limit))), self.variances(limit)
        contributions = np.abs(self.rows[worst]) * np.sqrt(np.diag(limit))
        name = (*knowledge.names, *knowledge.bounded)[int(np.argmax(contributions))]
        gain, phase = knowledge.noise.level
        undecided = "explanations that the tests cannot distinguish: bushfit diagnose states the next test"
        shared = f"{number(100.0 * gain, 2)} % of gain and {number(1e3 * phase, 2)} mrad of phase"
        remaining = f"the class of the rig, {shared} that all repeats of a test share, in {name}"
        if variance[worst] > 0.25 * self.variances(knowledge.covariance)[worst]:
            remaining = f"{name}, which no available test determines well enough"
        size, cause = max(
            (Z95 * float(self.model_error[worst]), "the model error: no test reduces it; diagnose may name its cause"),
            (float(self.undecided[worst]), undecided),
            (Z95 * float(np.sqrt(variance[worst])), remaining),
        )
        location = ""
        if self.prediction:
            amplitude = self.prediction.direction.display.displacement.text(self.prediction.amplitude[worst])
            location = f" at {format_range('Hz', self.prediction.frequency[worst])} and {amplitude}"
        return f"{format_half_width(size)}{location} comes from {cause}"


def format_half_width(half_width: float, digits: int = 2) -> str:
    """Format a relative half width as a percentage: 0.015 becomes "+/-1.5 %"."""
    return f"+/-{number(100.0 * half_width, digits)} %"
