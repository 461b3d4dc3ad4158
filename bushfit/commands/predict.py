"""predict: stiffness and loss factor of a fitted model over frequency and amplitude."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import groupby
from operator import attrgetter
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import pandas as pd

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import PredictSettings
from bushfit.campaign.session import measured_session
from bushfit.commands.loading import HasResult, as_result
from bushfit.effects import Level
from bushfit.effects.contract import Array, RubberConditions
from bushfit.effects.temperature import REFERENCE
from bushfit.errors import ModelError, UnitError
from bushfit.fitting.agreement import expected_errors_without_refits, misfits
from bushfit.fitting.preparation import MeasuredSweep, prepare_sweeps
from bushfit.geometry import Bushing, Direction, Place, Specimen, default_places, get_places
from bushfit.model.arms import Arms, model_arms
from bushfit.model.result import ExpectedError, Misfit, Result
from bushfit.model.transfer import transfer_compound
from bushfit.prediction.caveats import warnings_of
from bushfit.prediction.grid import default_grid, grid_settings, requested_grid, static_reach
from bushfit.prediction.resonance import PredictedResonance, predict_resonance
from bushfit.prediction.static_curve import StaticCurve, static_curve, static_rate
from bushfit.prediction.stiffness import Prediction, tested_preload
from bushfit.prediction.stiffness import predict as predict_stiffness
from bushfit.prediction.superposed import LargeMotion
from bushfit.reading.measurement import SAME_TEMPERATURE, Loop, Sweep
from bushfit.reading.preload import Preload, parse_preload
from bushfit.report import plots, tables
from bushfit.report.results import ResultFile, place_names
from bushfit.report.tables import prediction_table
from bushfit.units import CELSIUS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Frequencies, amplitudes or other numbers of a grid.
Numbers = Sequence[float] | Array
#: Content of `predict --json`: columns of each table by header, null in an empty cell; and warnings.
PredictionDocument = dict[str, dict[str, list[float | None]] | list[str]]
#: Directions that are predicted by default: those of the paper.
_DIRECTIONS = (Direction.AXIAL, Direction.RADIAL)


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
        files: tables and figures.
    """

    result: Result
    predictions: Sequence[Prediction]
    measured: Sequence[MeasuredSweep] = ()
    notes: Sequence[str] = ()
    resonances: Sequence[PredictedResonance] = ()
    arms: Sequence[Arms] = ()
    static: Sequence[StaticCurve] = ()
    files: Sequence[ResultFile] = ()

    def __repr__(self) -> str:
        places = ", ".join(dict.fromkeys(str(prediction.direction) for prediction in self.predictions))
        return f"Prediction of {self.result.name}: {places}"

    @property
    def document(self) -> Mapping[str, Any]:
        """Content of `predict --json`: tables of the predictions by direction, Maxwell arms, tests and warnings."""
        document: dict[str, Any] = {
            str(predictions[0].direction): table_columns(joined_table(prediction_table, predictions))
            for predictions in by_direction(self.predictions)
        }
        for resonance in self.resonances:
            document[f"{resonance.place}_resonance"] = table_columns(tables.predicted_resonance_table(resonance))
        for curves in by_direction(self.static):
            document[f"{curves[0].direction}_static"] = table_columns(joined_table(tables.static_table, curves))
        if self.arms:
            document["arms"] = [
                {
                    "in_place_of": arms.stands_for,
                    "shear_modulus_Pa": arms.modulus.tolist(),
                    "relaxation_time_s": arms.time.tolist(),
                    "band_Hz": arms.band,
                    "largest_relative_error": arms.error,
                }
                for arms in self.arms
            ]
        return {**document, "warnings": self.warnings}

    @property
    def warnings(self) -> list[str]:
        """Warnings of the model, of each prediction, static curve and resonance, without repetition."""
        predicted = [prediction.warnings for prediction in self.predictions]
        predicted += [curve.warnings for curve in self.static]
        predicted += [resonance.warnings for resonance in self.resonances]
        return warnings_of(self.result, predicted, self.notes)

    @cached_property
    def tests(self) -> tuple[Misfit, ...]:
        """Misfit of the model with each measured sweep and run: NRMSE, reduced chi-square, mean gap of |K|."""
        return misfits(self.result.model, *split_by_fit(self.result, self.measured))

    @cached_property
    def usable(self) -> tuple[ExpectedError, ...]:
        """Expected error of |K| (relative) and loss factor (absolute) in each direction, from the measured sweeps."""
        return expected_errors_without_refits(self.result.model, *split_by_fit(self.result, self.measured))


def predict(
    model: Result | HasResult,
    campaign: Campaign | None = None,
    *,
    directions: Sequence[str] | None = None,
    frequencies: Numbers | None = None,
    amplitudes: Numbers | None = None,
    torsion_amplitudes: Numbers | None = None,
    strain_amplitudes: Numbers | None = None,
    temperature: float | None = None,
    preloads: Sequence[str] = (),
    bushing: Bushing | str | None = None,
    mass: float | None = None,
    base_acceleration: float | None = None,
    wide: bool = False,
    arms: float | None = None,
    static: bool = False,
    static_rates: Mapping[str, float] | None = None,
    over: LargeMotion | None = None,
    notes: Sequence[str] = (),
) -> PredictionOutput:
    """Predict stiffness and loss factor over a grid, with 95 % bands.

    Args:
        model: result, or output with a result.
        campaign: campaign whose sweeps the figures show for comparison, and whose grid is the default.
        directions: directions or specimens; default axial and radial, and all specimens.
        frequencies: frequencies [Hz].
        amplitudes: zero-to-peak displacements [m].
        torsion_amplitudes: zero-to-peak rotations [rad].
        strain_amplitudes: zero-to-peak strains of specimens that give a modulus.
        temperature: temperature [K], if the model has the effect of temperature.
        preloads: preloads with their unit, such as "500 N", within the tested range; default none.
        bushing: one of several fitted bushings by its name, or another bushing of the same compound.
        mass: mass on the bushing [kg], to predict its resonance.
        base_acceleration: zero-to-peak acceleration of the base under the mass [m/s^2].
        wide: True to add tables with one column per amplitude.
        arms: maximum relative error of Maxwell arms; None for no Maxwell arms.
        static: True to add static curves.
        static_rates: rates of the static curves by SI unit of displacement: "m" [m/s], "rad" [rad/s] or "1" [1/s];
            default the rate of the slowest loop.
        over: slow large motion or static offset under the harmonic of each frequency and amplitude.
        notes: further warnings.

    Returns:
        Predictions by direction, resonances and Maxwell arms, with the result files.

    Raises:
        ModelError: a direction, frequency, amplitude, temperature or preload for which the model cannot predict.
        UnitError: a preload that is no displacement or force of a direction.
    """
    result = as_result(model)
    if isinstance(bushing, str):
        of_bushing = [place for place in result.specimens if place.bushing and place.body == bushing]
        preloaded = [tested.place for tested in result.measured.preloads] if preloads and result.measured else []
        default = [str(place) for place in of_bushing if str(place) in preloaded] or _DIRECTIONS
        directions = [str(place) for name in directions or default for place in get_places(name, of_bushing)]
    elif bushing:
        result, note = transfer_compound(result, bushing)
        notes, directions = (*notes, note), directions or [str(direction) for direction in _DIRECTIONS]
    campaign = campaign and _assign_bushing(campaign, result)
    if campaign and campaign.bushing and result.model.bushing and not result.bushings:
        bodies = campaign.bushing, result.model.bushing
        sizes, fitted_sizes = ((body.inner_radius, body.outer_radius, body.length) for body in bodies)
        if not np.allclose(sizes, fitted_sizes, atol=0.0):
            other = f"{result.name}: {campaign.path.name} tests a bushing of another shape, {campaign.bushing.name}"
            notes = (*notes, f"{other}; --bushing {campaign.path.name} predicts that shape")
    sweeps = campaign.sweeps if campaign else ()
    depends_on_temperature = result.model.depends_on("temperature")
    if temperature is not None and not depends_on_temperature:
        raise ModelError(
            "the model has no effect of temperature",
            found=f"{temperature - CELSIUS:.4g} degC asked for",
            expected="a model with the effect of temperature",
            hint="fit tests at several temperatures with --effect temperature",
        )
    if len(preloads) > 1 and (wide or mass):
        problem = "wide tables and resonances require a single preload"
        raise ModelError(problem, found=", ".join(preloads), expected="one, or none")
    if preloads and directions is None and result.measured:
        directions = [tested.place for tested in result.measured.preloads] or None
    requested = grid_of(directions, frequencies, amplitudes, torsion_amplitudes, strain_amplitudes)
    settings = grid_settings(requested, campaign)
    specimens = {specimen.name: specimen for specimen in (*result.specimens, *(campaign.specimens if campaign else ()))}
    places = [place for name in settings.directions or () for place in get_places(name, [*specimens.values()])]
    places = places or default_places(result.model.bushing, [*specimens.values()])
    measured = _predictable_sweeps(result, campaign) if campaign and not over else []
    drawn_sweeps = [
        sweep
        for sweep in measured
        if not depends_on_temperature
        or (tested := sweep.conditions.temperature) is None
        or abs(np.mean(tested) - (temperature or REFERENCE)) <= SAME_TEMPERATURE
    ]
    predictions, resonances, curves = list[Prediction](), list[PredictedResonance](), list[StaticCurve]()
    loads = [(place, preload) for place in places for preload in requested_preloads(result, place, preloads)]
    for place, preload in loads:
        drawn = [
            sweep
            for sweep in drawn_sweeps
            if sweep.direction == place and (preload is None or preload.equals(sweep.sweep.preload))
        ]
        prediction = predict_stiffness(
            result,
            place,
            *requested_grid(default_grid(result, place, sweeps), settings, place),
            sweeps=drawn if measured else None,
            temperature=temperature,
            preload=preload if preloads else None,
            over=over,
        )
        predictions.append(prediction)
        if mass and base_acceleration:
            shaken = mass, base_acceleration, settings.frequencies
            resonances.append(predict_resonance(result, place, *shaken, temperature=temperature, preload=preload))
        if static or static_rates:
            motion = (
                static_reach(result, place, prediction.amplitude, settings),
                static_rate(result, place, static_rates),
            )
            load = prediction.preload if preloads else None
            curves.append(static_curve(result, place, *motion, temperature=temperature, preload=load))
    maxwell: tuple[Arms, ...] = ()
    if arms:
        frequency = np.concatenate([prediction.frequency for prediction in predictions])
        band = float(frequency.min()), float(frequency.max())
        maxwell = model_arms(result.model.without(Level.INSTRUMENT), band, arms, RubberConditions(temperature))
        if not maxwell:
            raise ModelError(
                "the model has nothing that Maxwell arms could represent",
                place="--arms",
                expected="a model whose stiffness depends on frequency, as by a springpot",
            )
    notes = (*notes, *(f"{sweep.name}: {note}" for sweep in measured for note in sweep.notes))
    output = PredictionOutput(result, predictions, measured, notes, resonances, maxwell, curves)
    return replace(output, files=_files(output, drawn_sweeps, temperature, wide=wide))


def _assign_bushing(campaign: Campaign, result: Result) -> Campaign:
    """Assign the tests of a campaign to the one of several fitted bushings that has the campaign's geometry."""
    bushing, fitted = campaign.bushing, result.bushings
    bodies = [body for body in fitted if bushing and replace(bushing, name=body.name) == body]
    listed = {place.bushing for place in campaign.specimens if place.bushing}
    different = sorted({body.name for body in listed - {*fitted}} & {body.name for body in fitted})
    different += [bushing.name] if bushing and fitted and not bodies else []
    if different:
        found, expected = (
            ", ".join(different),
            f"the geometry of {' or '.join(body.name for body in fitted)} in the model",
        )
        raise ModelError("the campaign tests another bushing", file=campaign.path, found=found, expected=expected)
    if not bodies:
        return campaign
    places = {place.axis: place for place in result.specimens if place.bushing == bodies[0]}
    return replace(
        campaign,
        loops=tuple(
            replace(loop, direction=places.get(loop.direction.axis, loop.direction)) for loop in campaign.loops
        ),
        sweeps=tuple(replace(one, direction=places.get(one.direction.axis, one.direction)) for one in campaign.sweeps),
    )


def requested_preloads(result: Result, place: Place, preloads: Sequence[str]) -> list[Preload | None]:
    """Parse the preloads at which a direction is predicted.

    Args:
        result: fitted result.
        place: direction or specimen.
        preloads: texts such as "500 N"; if empty, the direction is predicted at the tested preload nearest to zero.

    Returns:
        Preloads within the tested range; None in place of a preload if the model does not depend on it.
    """
    if not preloads:
        return [tested_preload(result, place, None)]
    parsed = [parse_preload(text, place) for text in preloads]
    if None in parsed:
        found, expected = f'"{preloads[parsed.index(None)]}"', 'such as "500 N", "1.5 mm" or "none"'
        raise UnitError(f"not a preload of the {place} direction", place="preload", found=found, expected=expected)
    return [tested_preload(result, place, preload) for preload in parsed]


def grid_of(directions: Sequence[str] | None, *axes: Numbers | None) -> PredictSettings:
    """Make the grid settings of a prediction; None selects the default of an axis.

    Args:
        directions: directions or specimens by name.
        axes: frequencies [Hz], amplitudes [m], torsion amplitudes [rad] and strain amplitudes.
    """
    frequencies, amplitudes, rotations, strains = (
        None if axis is None else tuple(float(value) for value in axis) for axis in axes
    )
    places = None if directions is None else tuple(directions)
    return PredictSettings(frequencies, amplitudes, rotations, places, strains)


def _predictable_sweeps(result: Result, campaign: Campaign) -> list[MeasuredSweep]:
    """Sweeps of a campaign that the model can predict, with the temperature and earlier strains of their points."""
    tests: tuple[Loop | Sweep, ...] = (*campaign.loops, *campaign.sweeps)
    conditions = measured_session(result.model.bushing, tests)[len(campaign.loops) :]
    return [
        replace(sweep, test_conditions=conditions)
        for sweep, conditions in zip(prepare_sweeps(campaign.sweeps), conditions, strict=True)
        if result.model.bushing or isinstance(sweep.direction, Specimen)
    ]


def split_by_fit(result: Result, sweeps: Sequence[MeasuredSweep]) -> tuple[list[MeasuredSweep], list[MeasuredSweep]]:
    """Split sweeps into those to which the model was fitted, by the hash of their files, and the others."""
    digests = {source.sha256 for source in result.inputs}
    fitted = [sweep for sweep in sweeps if sweep.source and sweep.source.sha256 in digests]
    return fitted, [sweep for sweep in sweeps if sweep not in fitted]


def _files(
    output: PredictionOutput, drawn_sweeps: Sequence[MeasuredSweep], temperature: float | None, *, wide: bool
) -> list[ResultFile]:
    """Tables and figures of a prediction.

    Args:
        output: the prediction.
        drawn_sweeps: measured sweeps that the figures show.
        temperature: temperature of the prediction [K]; None for the reference temperature.
        wide: True to add tables with one column per amplitude.
    """
    result, by_place = output.result, by_direction(output.predictions)
    places = [predictions[0].direction for predictions in by_place]
    names = place_names(places)

    def draw(prediction: Prediction) -> Figure:
        """Draw a prediction with the measured sweeps of its direction.

        Returns:
            Figure with the warnings below it.
        """
        place = prediction.direction
        measured = [sweep for sweep in drawn_sweeps if sweep.direction == place]
        table = tables.sweeps_table(result.model, measured) if measured else None
        title = result.name if isinstance(place, Direction) else str(place)
        title += f", over {prediction.over.describe(place)}" if prediction.over else ""
        note = plots.style.warnings_note(warnings_of(result, [], (*prediction.warnings, *output.notes)))
        return plots.prediction.prediction_figure(result, prediction, table, title, note, temperature)

    files = list[ResultFile]()
    for name, predictions in zip(names, by_place, strict=True):
        files.append(ResultFile(name, "table", partial(joined_table, prediction_table, predictions)))
        files.append(ResultFile(name, "figure", partial(draw, predictions[0])))
        if len(predictions) > 1:
            over_preload = partial(plots.preload.preload_figure, result, predictions, result.name, temperature)
            files.append(ResultFile(f"{name}_preload", "figure", over_preload))
    if output.arms:
        files.append(ResultFile("arms", "table", partial(tables.arms_table, result.model, output.arms, places)))
    suffixes: Sequence[tuple[str, Callable[[Any], pd.DataFrame], Sequence[Any]]] = [
        ("wide", tables.wide_table, output.predictions if wide else ()),
        ("static", partial(joined_table, tables.static_table), by_direction(output.static)),
        ("resonance", tables.predicted_resonance_table, output.resonances),
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
    if output.measured:
        files.append(ResultFile("measured", "table", partial(measured_table, result, output.measured)))
    return files


def by_direction(parts: Sequence[Part]) -> list[list[Part]]:
    """Group successive predictions or static curves of a direction or specimen; a group has one per preload."""
    return [list(group) for _, group in groupby(parts, key=attrgetter("direction"))]


def measured_table(result: Result, sweeps: Sequence[MeasuredSweep]) -> pd.DataFrame:
    """Table of measured sweeps beside the values of the model; sweeps to which the model was fitted come first."""
    fitted, not_fitted = split_by_fit(result, sweeps)
    counts = [sum(sweep.frequency.size for sweep in part) for part in (fitted, not_fitted)]
    table = tables.sweeps_table(result.model, [*fitted, *not_fitted])
    return table.assign(fitted=np.repeat(["yes", "no"], counts))


def joined_table(make: Callable[[Part], pd.DataFrame], parts: Sequence[Part]) -> pd.DataFrame:
    """Join the tables, made by `make`, of predictions or static curves at several preloads, one below the other."""
    return pd.concat([make(part) for part in parts], ignore_index=True)


def table_columns(table: pd.DataFrame) -> dict[str, list[Any]]:
    """Convert a table to lists by column header, with None for empty cells."""
    return {str(name): [None if x != x else x for x in column.tolist()] for name, column in table.items()}
