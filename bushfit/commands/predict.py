"""predict: stiffness and loss factor of a fitted model over frequency and amplitude."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Unpack

import numpy as np

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.session import measured_session
from bushfit.caveat import Caveat
from bushfit.commands.loading import HasResult, as_result
from bushfit.commands.predicted import PredictionOutput
from bushfit.effects import Level
from bushfit.effects.contract import RubberConditions
from bushfit.effects.temperature import REFERENCE
from bushfit.errors import ModelError, UnitError
from bushfit.fitting.preparation import MeasuredSweep, prepare_sweeps
from bushfit.geometry import Bushing, Direction, Place, Specimen, default_places, get_places
from bushfit.model.arms import Arms, model_arms
from bushfit.model.result import Result
from bushfit.model.transfer import transfer_compound
from bushfit.prediction.conditions import tested_preload
from bushfit.prediction.grid import GridOptions, default_grid, grid_settings, requested_grid, static_reach
from bushfit.prediction.resonance import PredictedResonance, predict_resonance
from bushfit.prediction.static_curve import StaticCurve, static_curve, static_rate
from bushfit.prediction.stiffness import Prediction
from bushfit.prediction.stiffness import predict as predict_stiffness
from bushfit.prediction.superposed import LargeMotion
from bushfit.reading.measurement import SAME_TEMPERATURE, Loop, Sweep
from bushfit.reading.preload import Preload, parse_preload
from bushfit.units import CELSIUS

#: Directions that are predicted by default: those of the paper.
_DIRECTIONS = (Direction.AXIAL, Direction.RADIAL)


def predict(
    model: Result | HasResult,
    campaign: Campaign | None = None,
    *,
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
    notes: Sequence[Caveat] = (),
    **grid: Unpack[GridOptions],
) -> PredictionOutput:
    """Predict stiffness and loss factor over a grid, with 95 % bands.

    Args:
        model: result, or output with a result.
        campaign: campaign whose sweeps the figures show for comparison, and whose grid is the default.
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
        grid: directions (default axial and radial, and all specimens), frequencies [Hz], amplitudes [m],
            torsion_amplitudes [rad], strain_amplitudes; see `GridOptions`.

    Returns:
        Predictions by direction, resonances and Maxwell arms, with the result files.

    Raises:
        ModelError: a direction, frequency, amplitude, temperature or preload for which the model cannot predict.
        UnitError: a preload that is neither a displacement nor a force of a direction.
    """
    result, directions = as_result(model), grid.get("directions")
    preloaded = [tested.place for tested in result.measured.preloads] if preloads and result.measured else []
    if isinstance(bushing, str):
        of_bushing = [place for place in result.specimens if place.bushing and place.body == bushing]
        default = [str(place) for place in of_bushing if str(place) in preloaded] or _DIRECTIONS
        directions = [str(place) for name in directions or default for place in get_places(name, of_bushing)]
    elif bushing:
        result, note = transfer_compound(result, bushing)
        notes, directions = (*notes, note), directions or [str(direction) for direction in _DIRECTIONS]
    if campaign:
        campaign, shape_notes = _assign_bushing(campaign, result)
        notes = (*notes, *shape_notes)
    sweeps = campaign.sweeps if campaign else ()
    check_temperature(result, temperature)
    if len(preloads) > 1 and (wide or mass):
        problem = "wide tables and resonances require a single preload"
        raise ModelError(problem, found=", ".join(preloads), expected="one, or none")
    settings = grid_settings({**grid, "directions": directions or preloaded}, campaign)
    specimens = {specimen.name: specimen for specimen in (*result.specimens, *(campaign.specimens if campaign else ()))}
    places = [place for name in settings.directions or () for place in get_places(name, [*specimens.values()])]
    places = places or default_places(result.model.bushing, [*specimens.values()])
    measured = _predictable_sweeps(result, campaign) if campaign and not over else []
    compared_sweeps = [
        sweep
        for sweep in measured
        if "temperature" not in result.model.depends_on
        or (tested := sweep.conditions.temperature) is None
        or abs(np.mean(tested) - (temperature or REFERENCE)) <= SAME_TEMPERATURE
    ]
    predictions, resonances, curves = list[Prediction](), list[PredictedResonance](), list[StaticCurve]()
    loads = [(place, preload) for place in places for preload in requested_preloads(result, place, preloads)]
    for place, preload in loads:
        drawn = [sweep for sweep in compared_sweeps if preload is None or preload.equals(sweep.test.preload)]
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
            reach = static_reach(result, place, prediction.amplitude, settings)
            rate, load = static_rate(result, place, static_rates), prediction.conditions.preload if preloads else None
            curves.append(static_curve(result, place, reach, rate, temperature=temperature, preload=load))
    maxwell: tuple[Arms, ...] = ()
    if arms:
        frequency = np.concatenate([prediction.frequency for prediction in predictions])
        band = float(frequency.min()), float(frequency.max())
        maxwell = model_arms(result.model.without(Level.INSTRUMENT), band, arms, RubberConditions(temperature))
        if not maxwell:
            raise ModelError(
                "the model has no frequency-dependent branch that Maxwell arms can represent",
                place="--arms",
                expected="a model with frequency-dependent stiffness, for example with a springpot",
            )
    notes = (*notes, *(note.about(sweep.name) for sweep in measured for note in sweep.notes))
    return PredictionOutput(result, predictions, measured, notes, resonances, maxwell, curves, wide)


def check_temperature(result: Result, temperature: float | None) -> None:
    """Raise a ModelError if a temperature [K] is requested of a model that does not depend on it."""
    if temperature is not None and "temperature" not in result.model.depends_on:
        raise ModelError(
            "the model has no effect of temperature",
            found=f"{temperature - CELSIUS:.4g} degC requested",
            expected="a model with the effect of temperature",
            hint="fit tests at several temperatures with --effect temperature",
        )


def _assign_bushing(campaign: Campaign, result: Result) -> tuple[Campaign, list[Caveat]]:
    """Assign the tests of a campaign to a fitted bushing with the same geometry, if several bushings were fitted.

    Returns:
        The campaign, and a warning if it tests another shape than that of a single fitted bushing.
    """
    bushing, fitted = campaign.bushing, result.bushings
    if bushing and result.model.bushing and not fitted:
        both = bushing, result.model.bushing
        sizes, fitted_sizes = ((body.inner_radius, body.outer_radius, body.length) for body in both)
        sentence = f"{campaign.path.name} tests a bushing of another shape, {bushing.name}"
        sentence += f"; --bushing {campaign.path.name} predicts that shape"
        note = Caveat("other_shape_tested", sentence).about(result.name)
        return campaign, [] if np.allclose(sizes, fitted_sizes, atol=0.0) else [note]
    bodies = [body for body in fitted if bushing and replace(bushing, name=body.name) == body]
    listed = {place.bushing for place in campaign.specimens if place.bushing}
    different = sorted({body.name for body in listed - {*fitted}} & {body.name for body in fitted})
    different += [bushing.name] if bushing and fitted and not bodies else []
    if different:
        found, names = ", ".join(different), " or ".join(body.name for body in fitted)
        expected = f"the geometry of {names} in the model"
        raise ModelError("the campaign tests another bushing", file=campaign.path, found=found, expected=expected)
    if not bodies:
        return campaign, []
    places = {place.axis: place for place in result.specimens if place.bushing == bodies[0]}
    loops = [replace(loop, direction=places.get(loop.direction.axis, loop.direction)) for loop in campaign.loops]
    sweeps = [replace(sweep, direction=places.get(sweep.direction.axis, sweep.direction)) for sweep in campaign.sweeps]
    return replace(campaign, loops=tuple(loops), sweeps=tuple(sweeps)), []


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


def _predictable_sweeps(result: Result, campaign: Campaign) -> list[MeasuredSweep]:
    """Sweeps of a campaign that the model can predict, with the temperature and earlier strains of their points."""
    tests: tuple[Loop | Sweep, ...] = (*campaign.loops, *campaign.sweeps)
    conditions = measured_session(result.model.bushing, tests)[len(campaign.loops) :]
    return [
        replace(sweep, test_conditions=conditions)
        for sweep, conditions in zip(prepare_sweeps(campaign.sweeps), conditions, strict=True)
        if result.model.bushing or isinstance(sweep.direction, Specimen)
    ]
