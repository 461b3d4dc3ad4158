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
        """Comparison of the measured and the predicted force in numbers.

        Returns:
            Entry of diagnosis.json: NRMSE, gaps of peak force and work, and share of the points inside the band.
        """
        force, history, measured = self.response.force, self.response.history, self.measured
        error = force.value - measured
        return {
            "test": self.record.name,
            "direction": str(self.record.direction),
            "nrmse": float(2.0 * np.sqrt(np.mean(np.square(error))) / np.ptp(measured)),
            "nrmse_before": self.nrmse_before,
            "peak_gap": float(1.0 - self.response.peak / np.abs(measured).max()),
            "energy_gap": 1.0 - work(history, force.value) / work(history, measured),
            "share_inside": float(np.mean((force.low <= measured) & (measured <= force.high))),
        }


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
