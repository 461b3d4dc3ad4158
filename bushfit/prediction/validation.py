"""Compare measured and predicted force in validation records, which no fit uses."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from typing_extensions import TypedDict

from bushfit.effects.contract import Array
from bushfit.effects.history import History
from bushfit.model.result import Result
from bushfit.prediction.response import TimeResponse, time_response, work
from bushfit.reading.measurement import Loop


class ValidationEntry(TypedDict):
    """Entry of diagnosis.json on one validation record, which no fit used: predicted compared with measured force.

    Args:
        test: name of the record.
        direction: direction of the bushing, or name of a specimen.
        nrmse: rms error of the force with model.json, relative to half the range of the force.
        nrmse_before: the same without the added effects; null if none were added.
        peak_gap: relative gap of the largest force, measured minus predicted.
        energy_gap: relative gap of the work, measured minus predicted.
        share_inside: share of the measured points inside the 95 % band, 0 to 1.
    """

    test: str
    direction: str
    nrmse: float
    nrmse_before: float | None
    peak_gap: float
    energy_gap: float
    share_inside: float


@dataclass(frozen=True, eq=False)
class Validation:
    """Comparison of the measured force of a record with the force that a model predicts for its displacement.

    Args:
        record: record with even times, in SI, (n,).
        response: predicted force at these times, with effects of the rig, as in the test.
        measured: measured force [N, N m or Pa], without the zero error of the force, (n,).
        nrmse_before: NRMSE of the model without the effects that a diagnosis added; None if none were added.
    """

    record: Loop
    response: TimeResponse
    measured: Array
    nrmse_before: float | None = None

    @property
    def entry(self) -> ValidationEntry:
        """Name of the record and numbers of the comparison (NRMSE, gaps of peak and work), as in diagnosis.json."""
        return {
            "test": self.record.name,
            "direction": str(self.record.direction),
            "nrmse": self.nrmse,
            "nrmse_before": self.nrmse_before,
            "peak_gap": self.peak_gap,
            "energy_gap": self.energy_gap,
            "share_inside": self.share_inside,
        }

    @property
    def nrmse(self) -> float:
        """Root mean square of measured minus predicted force, relative to half the range of the measured force."""
        error = self.response.force.value - self.measured
        return float(2.0 * np.sqrt(np.mean(np.square(error))) / np.ptp(self.measured))

    @property
    def peak_gap(self) -> float:
        """Relative difference of the largest magnitude of the force: measured minus predicted, over measured."""
        return float(1.0 - self.response.peak / np.abs(self.measured).max())

    @property
    def energy_gap(self) -> float:
        """Relative difference of the work of the motion on the bushing: measured minus predicted, over measured."""
        history = self.response.history
        return 1.0 - work(history, self.response.force.value) / work(history, self.measured)

    @property
    def share_inside(self) -> float:
        """Share of the measured points inside the 95 % band of the predicted force, 0 to 1."""
        force = self.response.force
        return float(np.mean((force.low <= self.measured) & (self.measured <= force.high)))


def validate(result: Result, records: Sequence[Loop]) -> list[Validation]:
    """Predict the force of validation records with a fitted model, from rest.

    Args:
        result: fitted result.
        records: records of displacement and force under any motion at evenly spaced times, from `prepare_record`.

    Returns:
        Comparison for each record.

    Notes:
        The zero of a load cell is unknown: the mean difference between measured and predicted force is removed.
    """
    validations = []
    for record in records:
        history = History.sampled(record.displacement, float(record.time[1] - record.time[0]))
        response = time_response(result, record.direction, history, temperature=record.temperature, rig=True)
        measured = record.force - np.mean(record.force - response.force.value)
        validations.append(Validation(record, response, measured))
    return validations
