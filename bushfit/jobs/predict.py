"""predict: stiffness tables of one fitted model."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from bushfit.campaign.schema import PredictSettings
from bushfit.fitting.data_sets import SweepData, sweep_data
from bushfit.geometry import Direction
from bushfit.prediction import Prediction, caveats, default_grid, predict
from bushfit.report.artifacts import artifact_names, prediction_files
from bushfit.report.tables import prediction_table

if TYPE_CHECKING:
    from bushfit.campaign.campaign import Campaign
    from bushfit.model.result import Result

#: Directions that are predicted where none is asked for: those of the paper.
_DIRECTIONS = (Direction.AXIAL, Direction.RADIAL)


@dataclass(frozen=True, eq=False)
class Predicted:
    """The outcome of a prediction: one table a direction; `measured` is laid over the plots."""

    result: Result
    predictions: Sequence[Prediction]
    measured: Sequence[SweepData]

    @property
    def document(self) -> Mapping[str, Any]:
        tables = {str(p.direction): prediction_table(p).to_dict(orient="list") for p in self.predictions}
        return {**tables, "warnings": self.warnings}

    @property
    def warnings(self) -> list[str]:
        """Of each direction, then of all."""
        return [*(line for p in self.predictions for line in p.warnings), *caveats(self.result)]

    def files(self, formats: Collection[str]) -> dict[str, bytes]:
        return prediction_files(self.result, self.predictions, self.measured, formats)


@dataclass(frozen=True)
class Predict:
    """Dynamic stiffness over a grid: the one asked for, else the campaign's [predict], else that of its sweeps."""

    asked: PredictSettings = field(default_factory=PredictSettings)

    def names(self, campaign: Campaign | None, formats: Collection[str]) -> list[str]:
        directions = self._settings(campaign).directions or _DIRECTIONS
        return artifact_names([str(direction) for direction in directions], formats)

    def run(self, result: Result, campaign: Campaign | None) -> Predicted:
        """One prediction a direction.

        Raises:
            ModelError: a frequency or amplitude that is not positive.
        """
        settings, sweeps = self._settings(campaign), campaign.sweeps if campaign else ()
        predictions = []
        for direction in settings.directions or _DIRECTIONS:
            frequencies, amplitudes = default_grid(result, direction, sweeps)
            asked = settings.torsion_amplitudes if direction.is_rotation else settings.amplitudes
            predictions.append(predict(result, direction, settings.frequencies or frequencies, asked or amplitudes))
        return Predicted(result, predictions, sweep_data(sweeps))

    def _settings(self, campaign: Campaign | None) -> PredictSettings:
        given = {key: value for key, value in vars(self.asked).items() if value is not None}
        return replace(campaign.predict if campaign else PredictSettings(), **given)
