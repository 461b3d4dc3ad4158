"""Output of the command predict: predictions with their tables, figures, warnings and comparison with tests."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import groupby
from operator import attrgetter
from typing import TYPE_CHECKING, Any, TypeVar

import pandas as pd
from typing_extensions import TypedDict

from bushfit.caveat import Caveat, to_entries
from bushfit.fitting.agreement import expected_errors, misfits
from bushfit.fitting.preparation import MeasuredSweep
from bushfit.geometry import Direction
from bushfit.model.arms import Arms
from bushfit.model.result import ExpectedError, Misfit, Result
from bushfit.prediction.caveats import warnings_of
from bushfit.prediction.resonance import PredictedResonance
from bushfit.prediction.static_curve import StaticCurve
from bushfit.prediction.stiffness import Prediction
from bushfit.report import plots, tables
from bushfit.report.results import ResultFile, place_names
from bushfit.report.tables import prediction_table, table_columns

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class ArmsEntry(TypedDict):
    """Maxwell arms in `predict --json`.

    Args:
        in_place_of: names of the effects that the arms replace.
        shear_modulus_Pa: shear modulus of each arm, shortest relaxation time first.
        relaxation_time_s: relaxation time of each arm.
        band_Hz: lowest and highest frequency of the replacement.
        largest_relative_error: largest relative error of the modulus in this band.
    """

    in_place_of: str
    shear_modulus_Pa: list[float]
    relaxation_time_s: list[float]
    band_Hz: tuple[float, float]
    largest_relative_error: float


#: Content of `predict --json`: columns of each table by header, null in an empty cell; Maxwell arms under "arms";
#: warnings and their kinds.
PredictionDocument = dict[str, dict[str, list[float | None]] | list[ArmsEntry] | list[str]]
#: A prediction or a static curve.
Part = TypeVar("Part", Prediction, StaticCurve)


@dataclass(frozen=True, eq=False, repr=False)
class PredictionOutput:
    """Predicted stiffness and loss factor of a fitted model, with tables and figures.

    Args:
        result: the model with its uncertainty.
        predictions: stiffness over the grid, of each direction or specimen, and of each preload.
        measured: sweeps of the campaign that the model can predict.
        notes: further warnings.
        resonances: resonance of a mass for each direction or specimen; empty without a mass.
        arms: Maxwell arms of each part of the model; empty unless requested.
        static: static curve of each direction or specimen; empty unless requested.
        wide: True to add tables with one column per amplitude.
    """

    result: Result
    predictions: Sequence[Prediction]
    measured: Sequence[MeasuredSweep] = ()
    notes: Sequence[Caveat] = ()
    resonances: Sequence[PredictedResonance] = ()
    arms: Sequence[Arms] = ()
    static: Sequence[StaticCurve] = ()
    wide: bool = False

    def __repr__(self) -> str:
        places = ", ".join(dict.fromkeys(str(prediction.direction) for prediction in self.predictions))
        return f"Prediction of {self.result.name}: {places}"

    @property
    def document(self) -> Mapping[str, Any]:
        """Content of `predict --json`: tables of predictions, resonances, static curves; Maxwell arms; warnings."""
        document: dict[str, Any] = {
            str(predictions[0].direction): table_columns(joined_table(prediction_table, predictions))
            for predictions in by_direction(self.predictions)
        }
        for resonance in self.resonances:
            document[f"{resonance.direction}_resonance"] = table_columns(tables.predicted_resonance_table(resonance))
        for curves in by_direction(self.static):
            document[f"{curves[0].direction}_static"] = table_columns(joined_table(tables.static_table, curves))
        if self.arms:
            document["arms"] = [
                ArmsEntry(
                    in_place_of=arms.replaced_effects,
                    shear_modulus_Pa=arms.modulus.tolist(),
                    relaxation_time_s=arms.time.tolist(),
                    band_Hz=arms.band,
                    largest_relative_error=arms.error,
                )
                for arms in self.arms
            ]
        return {**document, **to_entries(self.warnings)}

    @property
    def warnings(self) -> list[Caveat]:
        """Warnings of the model, of each prediction, static curve and resonance, without repetition."""
        predicted = [prediction.warnings for prediction in self.predictions]
        predicted += [curve.warnings for curve in self.static]
        predicted += [resonance.warnings for resonance in self.resonances]
        return warnings_of(self.result, predicted, self.notes)

    @cached_property
    def measured_by_fit(self) -> tuple[list[MeasuredSweep], list[MeasuredSweep]]:
        """Two lists: measured sweeps to which the model was fitted (same file and direction), and the other sweeps."""
        digests, measured = self.result.files.values(), self.result.measured
        of_files = [sweep for sweep in self.measured if sweep.source and sweep.source.sha256 in digests]
        fitted = [sweep for sweep in of_files if measured and str(sweep.direction) in measured.directions]
        return fitted, [sweep for sweep in self.measured if sweep not in fitted]

    @cached_property
    def tests(self) -> tuple[Misfit, ...]:
        """Misfit of the model in each measured sweep, and in each of its runs at constant amplitude or frequency."""
        return misfits(self.result.model, *self.measured_by_fit)

    @cached_property
    def usable(self) -> tuple[ExpectedError, ...]:
        """Expected error of |K| (relative) and loss factor (absolute) in each direction, from the measured sweeps."""
        return expected_errors(self.result.model, *self.measured_by_fit)

    @cached_property
    def files(self) -> list[ResultFile]:
        """Tables and figures, each with the function that makes it."""
        result, by_place = self.result, by_direction(self.predictions)
        places = [predictions[0].direction for predictions in by_place]
        names, (fitted, unfitted) = place_names(places), self.measured_by_fit
        tabled = partial(tables.sweeps_table, result.model, [*fitted, *unfitted])
        use = ["yes"] * sum(sweep.frequency.size for sweep in fitted)
        use += ["no"] * sum(sweep.frequency.size for sweep in unfitted)
        measured = ResultFile("measured", "table", lambda: tabled().assign(fitted=use))

        def draw(prediction: Prediction) -> Figure:
            """Draw a prediction with the measured sweeps of its direction, and with the warnings below the figure."""
            place = prediction.direction
            title = prediction.add_conditions(result.name if isinstance(place, Direction) else str(place))
            note = plots.style.warnings_note(warnings_of(result, [], (*prediction.warnings, *self.notes)))
            table = measured.content() if self.measured else None
            return plots.prediction.prediction_figure(result, prediction, table, title, note)

        files = list[ResultFile]()
        for name, predictions in zip(names, by_place, strict=True):
            table = partial(joined_table, prediction_table, predictions)
            files += [ResultFile(name, "table", table), ResultFile(name, "figure", partial(draw, predictions[0]))]
            if len(predictions) > 1:
                over_preload = partial(plots.preload.preload_figure, result, predictions, result.name)
                files.append(ResultFile(f"{name}_preload", "figure", over_preload))
        if self.arms:
            files.append(ResultFile("arms", "table", partial(tables.arms_table, result.model, self.arms, places)))
        suffixes: Sequence[tuple[str, Callable[[Any], pd.DataFrame], Sequence[Any]]] = [
            ("wide", tables.wide_table, self.predictions if self.wide else ()),
            ("static", partial(joined_table, tables.static_table), by_direction(self.static)),
            ("resonance", tables.predicted_resonance_table, self.resonances),
        ]
        for suffix, make, parts in suffixes:
            for name, part in zip(names, parts, strict=False):
                stem = f"{name}_{suffix}"
                while stem in names:  # of a specimen
                    stem += "_"
                files.append(ResultFile(stem, "table", partial(make, part)))
                if suffix == "static":
                    title = f"{result.name}: {part[0].label if len(part) == 1 else part[0].direction}, static curve"
                    files.append(ResultFile(stem, "figure", partial(plots.prediction.static_figure, part, title)))
        return [*files, measured] if self.measured else files


def by_direction(parts: Sequence[Part]) -> list[list[Part]]:
    """Group successive predictions or static curves of a direction or specimen; a group has one per preload."""
    return [list(group) for _, group in groupby(parts, key=attrgetter("direction"))]


def joined_table(make: Callable[[Part], pd.DataFrame], parts: Sequence[Part]) -> pd.DataFrame:
    """Join tables of predictions or static curves at several preloads, one below the other; `make` makes a table."""
    return pd.concat([make(part) for part in parts], ignore_index=True)
