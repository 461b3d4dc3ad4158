"""Dynamic stiffness of the bushing alone, without the test rig, with 95 % bands at any frequency and amplitude.

Material and component effects are included; instrument effects are excluded, because a car does not contain the rig. If
the tests cannot decide whether an effect belongs to the bushing or to the rig, the bands span the predictions with and
without the effect; such effects are called unresolved.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from bushfit.caveat import Caveat
from bushfit.effects import Level
from bushfit.effects.contract import UNKNOWN, Array, RubberConditions
from bushfit.effects.temperature import REFERENCE
from bushfit.errors import ModelError
from bushfit.fitting.preparation import MeasuredSweep
from bushfit.geometry import Place
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.model.sensitivity import stiffness_and_slopes
from bushfit.prediction.bands import Band, candidates, envelope, uncertainty
from bushfit.prediction.caveats import (
    MARGIN,
    agrees_within_noise,
    extrapolations,
    format_deviation,
    rig_effects,
    unfitted_warnings,
)
from bushfit.prediction.superposed import LargeMotion, superposed_stiffness_and_slopes, timed_candidates
from bushfit.reading.preload import SAME_PRELOAD, Preload
from bushfit.reading.runs import nominal
from bushfit.units import CELSIUS, number

#: Predicted quantities.
_BANDS = ("stiffness", "loss_factor", "storage_stiffness", "loss_stiffness")
#: Relative difference up to which two stiffnesses are equal.
_SAME = 1e-6


@dataclass(frozen=True, eq=False)
class Prediction:
    """Predicted dynamic stiffness K' + i K'' at n operating points, sorted by amplitude, then frequency.

    Args:
        direction: direction or specimen.
        frequency: frequency of each point [Hz], (n,).
        amplitude: zero-to-peak amplitude of each point [m, rad or 1], (n,).
        stiffness: magnitude |K| [N/m, N m/rad or, of a specimen with a strain amplitude, Pa].
        loss_factor: K''/K' [1].
        storage_stiffness, loss_stiffness: K' and K'', in the unit of |K|.
        warnings: warnings on directions, frequencies and strains that were not fitted, on excluded effects of the rig,
            and on unresolved effects.
        if_in_rig: prediction if the unresolved effects belong to the rig, not to the bushing; the bands include it.
            None without unresolved effects.
        measured: measured complex stiffness at these points, mean of the repeats, in the unit of |K|, (n,); nan at a
            point without a measurement; None without sweeps.
        conditions: preload and temperature of all points, as of `rubber_conditions`.
        over: slow large motion or static offset under the harmonic; None for the harmonic alone.
    """

    direction: Place
    frequency: Array
    amplitude: Array
    stiffness: Band
    loss_factor: Band
    storage_stiffness: Band
    loss_stiffness: Band
    warnings: tuple[Caveat, ...] = ()
    if_in_rig: Prediction | None = None
    measured: Array | None = None
    conditions: RubberConditions = UNKNOWN
    over: LargeMotion | None = None

    @property
    def complex_stiffness(self) -> Array:
        """Predicted complex stiffness K' + i K'', in the unit of |K|, (n,)."""
        return self.storage_stiffness.value + 1j * self.loss_stiffness.value

    @property
    def label(self) -> str:
        """Direction or specimen for users, with conditions and large motion: "axial at a preload of 500 N"."""
        return self.add_conditions(str(self.direction))

    def add_conditions(self, text: str) -> str:
        """Add preload, temperature and large motion to the text on a prediction, as in "axial at 60 degC over 1 mm"."""
        text = add_conditions(text, self.conditions, self.direction)
        return f"{text} over {self.over.describe(self.direction)}" if self.over else text


def predict(
    result: Result,
    direction: Place,
    frequencies: Sequence[float] | Array,
    amplitudes: Sequence[float] | Array,
    *,
    rig: bool = False,
    sweeps: Sequence[MeasuredSweep] | None = None,
    temperature: float | None = None,
    preload: Preload | None = None,
    over: LargeMotion | None = None,
) -> Prediction:
    """Predict the dynamic stiffness on a grid, with 95 % bands from the covariance of the fit (delta method).

    The bands span all models that agree with the tests: with and without the unresolved effects, and with each of the
    effects that the tests cannot distinguish.

    Args:
        result: fitted result.
        direction: direction or specimen.
        frequencies: frequencies [Hz], in any order.
        amplitudes: zero-to-peak amplitudes [m, rad or 1], in any order.
        rig: True to include the effects of the rig, as in the tests.
        sweeps: measured sweeps for comparison; None for no comparison.
        temperature: temperature of the rubber [K]; None for the reference temperature.
        preload: preload within the tested range; None for the tested preload nearest to zero.
        over: slow large motion or static offset under the harmonic; None for the harmonic alone.

    Returns:
        Prediction at all combinations of frequency and amplitude.

    Raises:
        ModelError: a frequency or amplitude is not positive, the preload is outside the tested range, or the model has
            no law in time for a slow motion.
    """
    for name, values in (("frequency", frequencies), ("amplitude", amplitudes)):
        if not (np.size(values) and np.all(np.isfinite(values)) and np.min(values) > 0):
            raise ModelError(f"impossible {name}", found=str(np.asarray(values)), expected="above zero")
    amplitude, frequency = (
        axis.ravel() for axis in np.meshgrid(np.unique(amplitudes), np.unique(frequencies), indexing="ij")
    )
    conditions = rubber_conditions(result, direction, temperature, preload)
    if over:
        models, untimed = timed_candidates(result, f"{direction}, with the large motion", rig=rig)
        over.check_superposable(direction, frequency)
        point = np.array([over.frequency or frequency.min()]), np.array([abs(over.displacement) + amplitude.max()])
        together = extrapolations(result, direction, *point, temperature, f"{direction}, with the large motion")
    else:
        models, untimed, together = candidates(result, rig=rig), [], iter(())
    predictions = list[Prediction]()
    for source, model in models:
        predictions.append(predict_with_model(source, model, direction, frequency, amplitude, conditions, over))
    bands: dict[str, Any] = {
        name: envelope([getattr(prediction, name) for prediction in predictions]) for name in _BANDS
    }
    prediction = replace(
        predictions[0],
        **bands,
        if_in_rig=predictions[2 ** len(result.unresolved) - 1] if result.unresolved and not rig else None,
        measured=None if sweeps is None else measured_stiffness(direction, frequency, amplitude, sweeps),
        conditions=conditions,
        over=over,
    )
    compared = replace(prediction, measured=None) if rig else prediction
    warnings = point_warnings(result, compared, temperature, preload)
    return replace(prediction, warnings=(*warnings, *together, *untimed))


def point_warnings(
    result: Result, prediction: Prediction, temperature: float | None, preload: Preload | None
) -> Iterator[Caveat]:
    """Generate the warnings on a prediction: unfitted directions and ranges, effects of the rig, unresolved effects.

    Args:
        result: fitted result.
        prediction: prediction for the bushing without the rig, with the measured stiffness if sweeps are compared.
        temperature: temperature of the prediction [K]; None for the reference temperature.
        preload: requested preload; None if none is requested.

    Yields:
        Warnings.
    """
    place, measured, stiffness = prediction.direction, prediction.measured, prediction.stiffness.value
    yield from result.undecided
    yield from unfitted_warnings(result, place)
    confirmed = np.zeros(stiffness.shape, dtype=bool)
    if measured is not None and agrees_within_noise(result, place):
        confirmed = np.isfinite(measured)
    if not confirmed.all():
        points = prediction.frequency[~confirmed], prediction.amplitude[~confirmed]
        yield from extrapolations(result, place, *points, temperature)
    requested = {"temperature": temperature, "preload": preload}
    conditions = {name for name, value in requested.items() if value is not None}
    effects = result.model.without(Level.INSTRUMENT).records
    yield from (effect.assumption for effect in effects if effect.assumption and not conditions & {*effect.depends_on})
    rig = rig_effects(result)
    if rig and measured is not None and not np.isnan(measured).all():
        percent = format_deviation(stiffness / np.abs(measured))
        loss_difference = prediction.loss_factor.value - measured.imag / measured.real
        ends = [number(end, 2, "+") for end in (np.nanmin(loss_difference), np.nanmax(loss_difference))]
        sentence = (
            f"without {' and '.join(rig)} the predicted stiffness is {percent}, and the predicted loss factor "
            f"{' to '.join(ends)}, compared with the measured values"
        )
        yield Caveat("rig_difference", sentence).about(place)
    if prediction.if_in_rig and not np.allclose(prediction.if_in_rig.stiffness.value, stiffness, rtol=_SAME):
        percent = format_deviation(prediction.if_in_rig.stiffness.value / stiffness)
        names = " and ".join(result.unresolved)
        sentence = f"stiffness {percent} if {names} belongs to the rig; the band, low to high, includes both"
        yield Caveat("stiffness_if_rig", sentence).about(place)


def add_conditions(text: str, conditions: RubberConditions, place: Place) -> str:
    """Add preload and temperature, if known, to the text on a prediction: "axial at a preload of 500 N and 60 degC".

    Args:
        text: text on the prediction.
        conditions: conditions of the rubber, with a single temperature.
        place: direction or specimen.
    """
    known = [] if conditions.preload is None else [f"a preload of {conditions.preload.text(place)}"]
    known += [] if conditions.temperature is None else [f"{number(float(conditions.temperature) - CELSIUS, 3)} degC"]
    return f"{text} at {' and '.join(known)}" if known else text


def rubber_conditions(
    result: Result, place: Place, temperature: float | None = None, preload: Preload | None = None
) -> RubberConditions:
    """Temperature and preload of a prediction; None in place of a condition on which the model does not depend.

    Args:
        result: fitted result.
        place: direction or specimen.
        temperature: temperature [K]; None for the reference temperature.
        preload: requested preload, as of `tested_preload`.
    """
    kelvin = (REFERENCE if temperature is None else temperature) if "temperature" in result.model.depends_on else None
    return RubberConditions(kelvin, preload=tested_preload(result, place, preload))


def tested_preload(result: Result, place: Place, preload: Preload | None) -> Preload | None:
    """Choose the preload of a prediction: the requested one, if it is within the tested range, or the default.

    Args:
        result: fitted result.
        place: direction or specimen.
        preload: requested preload; None for the tested preload nearest to zero.

    Returns:
        The preload; None if it is not requested and the model does not depend on it in this direction.

    Raises:
        ModelError: the tests of this direction do not have several preloads, or none as small or as large.
    """
    ranges = result.measured.preloads if result.measured else ()
    tested = next((preload_range for preload_range in ranges if preload_range.place == str(place)), None)
    if preload is None:
        return Preload(float(np.clip(0.0, tested.low, tested.high)), tested.unit) if tested else None
    if result.measured is None and "preload" in result.model.depends_on:  # of a simulation: exact, without a range
        return preload
    refuse = partial(ModelError, place=str(place), found=f"a preload of {preload.text(place)}")
    if tested is None:
        raise refuse(
            "the model was not fitted to several preloads of this direction",
            expected="tests at two or more preloads",
            hint='state preload = "500 N" for each test of the campaign, "none" without preload, and fit again',
        )
    margin = SAME_PRELOAD * max(abs(tested.low), abs(tested.high))
    if preload.unit != tested.unit and preload.value:
        raise refuse("the tests state the preload in another quantity", expected=tested.text(place))
    if not tested.low - margin <= preload.value <= tested.high + margin:
        hint = "test the bushing at this preload, and fit all tests together"
        raise refuse("this preload is outside the tested range", expected=tested.text(place), hint=hint)
    return Preload(preload.value, tested.unit)


def predict_with_model(
    result: Result,
    model: Model,
    direction: Place,
    frequency: Array,
    amplitude: Array,
    conditions: RubberConditions,
    over: LargeMotion | None = None,
) -> Prediction:
    """Predict the stiffness with one model, with the uncertainty of the fit and the error of the model.

    Args:
        result: fitted result, which provides the covariance and the model error.
        model: the fitted model or a variant with fewer or other effects.
        direction: direction or specimen.
        frequency: frequency of each point [Hz], (n,).
        amplitude: zero-to-peak amplitude of each point [m, rad or 1], (n,).
        conditions: temperature and preload of the rubber.
        over: slow large motion or static offset under the harmonic; None for the harmonic alone.

    Returns:
        Prediction without warnings.
    """
    errors = uncertainty(result, model, direction, frequency, amplitude, conditions)
    names = errors.covariance.names
    if over:
        stiffness, slopes = superposed_stiffness_and_slopes(
            model, direction, frequency, amplitude, over, names, conditions
        )
    else:
        stiffness, slopes = stiffness_and_slopes(model, direction, frequency, amplitude, names, conditions=conditions)
    slopes = np.concatenate((slopes, errors.relative * stiffness))
    relative, loss_factor = slopes / stiffness, stiffness.imag / stiffness.real
    return Prediction(
        direction,
        frequency,
        amplitude,
        stiffness=errors.band(np.abs(stiffness), np.abs(stiffness) * relative.real),
        loss_factor=errors.band(loss_factor, (1.0 + loss_factor**2) * relative.imag),
        storage_stiffness=errors.band(stiffness.real, slopes.real),
        loss_stiffness=errors.band(stiffness.imag, slopes.imag),
    )


def measured_stiffness(direction: Place, frequency: Array, amplitude: Array, sweeps: Sequence[MeasuredSweep]) -> Array:
    """Average the measured stiffness at operating points.

    Args:
        direction: direction or specimen.
        frequency: frequency of each point [Hz], (n,).
        amplitude: zero-to-peak amplitude of each point [m, rad or 1], (n,).
        sweeps: measured sweeps; sweeps of other directions are ignored.

    Returns:
        Mean complex stiffness of all measurements within 1 % of each point [N/m or N m/rad], (n,); nan without a
        measurement.
    """
    mine = [sweep.with_weight() for sweep in sweeps if sweep.direction == direction]
    f, x, stiffness = (
        np.concatenate([np.empty(0), *(getattr(sweep, name) for sweep in mine)])
        for name in ("frequency", "amplitude", "measured")
    )
    far = np.minimum(*(np.abs(reached / amplitude[:, None] - 1.0) for reached in (x, nominal(x))))
    near = (np.abs(f / frequency[:, None] - 1.0) <= MARGIN) & (far <= MARGIN)
    count = near.sum(axis=1)
    return np.where(count > 0, near @ stiffness / np.maximum(count, 1), np.nan)
