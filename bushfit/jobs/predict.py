"""predict: stiffness tables of one fitted model."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import PredictSettings
from bushfit.campaign.session import measured_session
from bushfit.effects import Level
from bushfit.effects.contract import Circumstances
from bushfit.effects.temperature import REFERENCE
from bushfit.errors import ModelError
from bushfit.fitting.agreement import met_within, misfits
from bushfit.fitting.data_sets import SweepData, sweep_data
from bushfit.geometry import Direction, Place, Specimen, place_named
from bushfit.jobs.grid import asked_or, default_grid, grid_settings
from bushfit.model.arms import Arms, model_arms
from bushfit.model.model import Model
from bushfit.model.result import Misfit, Result, Usable
from bushfit.prediction.caveats import warnings_of
from bushfit.prediction.stiffness import PredictedResonance, Prediction, predict, predict_resonance
from bushfit.reading.measurement import SAME_TEMPERATURE
from bushfit.report.artifacts import (
    arms_contents,
    measured_contents,
    more_contents,
    names_of_more,
    place_names,
    prediction_contents,
)
from bushfit.report.contents import Contents, Kinds
from bushfit.report.tables import prediction_table, shaken_table, wide_table
from bushfit.units import CELSIUS

#: Tables by place, the columns of each by header, null where a cell is empty; and "warnings".
PredictionDocument = dict[str, dict[str, list[float | None]] | list[str]]
#: Directions that are predicted where none is asked for: those of the paper.
_DIRECTIONS = (Direction.AXIAL, Direction.RADIAL)


@dataclass(frozen=True, eq=False, repr=False)
class Predicted:
    """The outcome of a prediction: one table a place, and a resonance, where a mass was asked for.

    `measured` are the sweeps of places that the model can predict, `beside` those at the temperature predicted;
    `notes`, what else a user must know; `wide`, whether the tables are written with amplitudes across, too.
    """

    result: Result
    predictions: Sequence[Prediction]
    measured: Sequence[SweepData]
    beside: Sequence[SweepData] = ()
    notes: tuple[str, ...] = ()
    resonances: Sequence[PredictedResonance] = ()
    wide: bool = False
    arms: Sequence[Arms] = ()

    def __repr__(self) -> str:
        return f"Prediction of {self.result.name}: {', '.join(str(found.direction) for found in self.predictions)}"

    @property
    def document(self) -> Mapping[str, Any]:
        tables = {str(p.direction): columns_of(prediction_table(p)) for p in self.predictions}
        shaken = {f"{found.place}_resonance": shaken_table(found).to_dict(orient="list") for found in self.resonances}
        arms = [
            {
                "in_place_of": part.stands_for,
                "shear_modulus_Pa": part.modulus.tolist(),
                "relaxation_time_s": part.time.tolist(),
                "band_Hz": part.band,
                "largest_relative_error": part.error,
            }
            for part in self.arms
        ]
        return {**tables, **shaken, **({"arms": arms} if arms else {}), "warnings": self.warnings}

    @property
    def warnings(self) -> list[str]:
        """Of the carried model, of the fit, of each place, its resonance, then of all; each once."""
        of_each = [found.warnings for found in self.predictions] + [found.warnings for found in self.resonances]
        return warnings_of(self.result, of_each, self.notes)

    @cached_property
    def tests(self) -> tuple[Misfit, ...]:
        """How well the model meets each of the sweeps."""
        return misfits(self.result.model, *self._fitted_and_other_sweeps)

    @cached_property
    def usable(self) -> tuple[Usable, ...]:
        """Within what it meets them, by place."""
        return met_within(self.result.model, *self._fitted_and_other_sweeps)

    @property
    def _fitted_and_other_sweeps(self) -> tuple[list[SweepData], list[SweepData]]:
        """The sweeps whose files the model was fitted to, and the others."""
        files = {source.sha256 for source in self.result.inputs}
        known = [bool(sweep.source and sweep.source.sha256 in files) for sweep in self.measured]
        pairs = list(zip(self.measured, known, strict=True))
        return [sweep for sweep, old in pairs if old], [sweep for sweep, old in pairs if not old]

    @property
    def contents(self) -> Contents:
        places = [prediction.direction for prediction in self.predictions]
        found = prediction_contents(self.result, self.predictions, self.beside, self.notes)
        if self.wide:
            found |= more_contents("wide", wide_table, places, self.predictions)
        found |= arms_contents(self.result.model, self.arms, places, self.result.name)
        shaken = [resonance.place for resonance in self.resonances]
        return found | more_contents("resonance", shaken_table, shaken, self.resonances)

    @property
    def contents_beside(self) -> Contents:
        """The same, and the measured points beside the model's as a table."""
        return self.contents | measured_contents(self.result, *self._fitted_and_other_sweeps)


def columns_of(table: pd.DataFrame) -> dict[str, list[Any]]:
    """The columns of a table, None where a cell is empty."""
    return {str(name): [None if x != x else x for x in column.tolist()] for name, column in table.items()}


@dataclass(frozen=True)
class Predict:
    """Dynamic stiffness over a grid: the one asked for, else the campaign's [predict], else that of its sweeps.

    With a mass [kg] and the acceleration of its base [m/s^2], its resonance at each place, too. All at a temperature
    [K], where the model has an effect of it. `wide` tables have amplitudes across. With a relative error, Maxwell arms
    that keep within it over the frequencies predicted.
    """

    asked: PredictSettings = field(default_factory=PredictSettings)
    mass: float | None = None
    base_acceleration: float | None = None
    temperature: float | None = None
    wide: bool = False
    arms: float | None = None

    def places(self, result: Result | None, campaign: Campaign | None) -> list[Place]:
        """Those asked for, else the paper's directions where there is a bushing, and all specimens.

        There is no result where it is still to be fitted to the campaign, and no campaign of a model alone.

        Raises:
            ModelError: a name that is neither a direction nor a specimen.
        """
        bodies = [(result.model.bushing, result.specimens)] if result else []
        bodies += [(campaign.bushing, campaign.specimens)] if campaign else []
        specimens = {specimen.name: specimen for _, some in bodies for specimen in some}
        if names := grid_settings(self.asked, campaign).directions:
            return [place_named(name, specimens.values()) for name in names]
        return [*(_DIRECTIONS if bodies[0][0] or not specimens else ()), *specimens.values()]

    def kinds(self, result: Result | None, campaign: Campaign | None) -> Kinds:
        """The tables and pictures of each place, and the further tables asked for."""
        places = self.places(result, campaign)
        more = [what for what, wanted in (("wide", self.wide), ("resonance", self.mass)) if wanted]
        tables = tuple(name for what in more for name in names_of_more(places, what))
        return Kinds.shown([*place_names(places), *(["arms"] if self.arms else [])]) + Kinds(tables=tables)

    def run(self, result: Result, campaign: Campaign | None, notes: tuple[str, ...] = ()) -> Predicted:
        """One prediction a place.

        Raises:
            ModelError: a frequency or amplitude that is not positive, a direction where there is no bushing, or a
                temperature of which the model has no effect.
        """
        if self.temperature is not None and not result.model.knows_temperature:
            raise ModelError(
                "the model knows no temperature",
                found=f"{self.temperature - CELSIUS:.4g} degC asked for",
                expected="a model with the effect of temperature",
                hint="fit tests at several temperatures with --effect temperature",
            )
        settings, sweeps = grid_settings(self.asked, campaign), campaign.sweeps if campaign else ()
        under = measured_session(result.model.bushing, (*campaign.loops, *sweeps) if campaign else ())
        known = [
            replace(each, under=own)
            for each, own in zip(sweep_data(sweeps), under[len(under) - len(sweeps) :], strict=True)
            if result.model.bushing or isinstance(each.direction, Specimen)
        ]
        beside = [sweep for sweep in known if self._at_temperature(result.model, sweep)]
        notes = (*notes, *(f"{sweep.name}: {note}" for sweep in known for note in sweep.notes))
        shown, places = beside if campaign else None, self.places(result, campaign)
        grids = [asked_or(default_grid(result, place, sweeps), settings, place) for place in places]
        predictions = [
            predict(result, place, *grid, sweeps=shown, temperature=self.temperature)
            for place, grid in zip(places, grids, strict=True)
        ]
        resonances = [
            predict_resonance(
                result, place, self.mass, self.base_acceleration, settings.frequencies, temperature=self.temperature
            )
            for place in places
            if self.mass and self.base_acceleration
        ]
        arms = self._arms(result.model, predictions) if self.arms else ()
        return Predicted(result, predictions, known, beside, notes, resonances, self.wide, arms)

    def _at_temperature(self, model: Model, sweep: SweepData) -> bool:
        """Whether a sweep was made at the temperature predicted, as far as model and sweep know of temperatures."""
        tested, asked = sweep.circumstances.temperature, self.temperature or REFERENCE
        if tested is None or not model.knows_temperature:
            return True
        return bool(abs(np.mean(tested) - asked) <= SAME_TEMPERATURE)

    def _arms(self, model: Model, predictions: Sequence[Prediction]) -> tuple[Arms, ...]:
        """Maxwell arms over the frequencies of all predictions."""
        assert self.arms
        frequencies = [prediction.frequency for prediction in predictions]
        band = float(min(map(min, frequencies))), float(max(map(max, frequencies)))
        found = model_arms(model.without(Level.INSTRUMENT), band, self.arms, Circumstances(self.temperature))
        if not found:
            raise ModelError(
                "there is nothing that Maxwell arms could stand for",
                place="--arms",
                expected="a model whose stiffness depends on frequency, as by a springpot",
            )
        return found
