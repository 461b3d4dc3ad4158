"""Dynamic stiffness of the bushing alone, without the test rig, with 95 % bands at any frequency and amplitude.

Material and component effects are included; instrument effects are excluded, because a car does not contain the rig. If
the tests cannot decide whether an effect belongs to the bushing or to the rig, the bands span the predictions with and
without the effect; such effects are called unresolved.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bushfit.caveat import Caveat, join_names
from bushfit.effects import Level
from bushfit.effects.contract import UNKNOWN, Array, RubberConditions
from bushfit.errors import ModelError
from bushfit.fitting.preparation import MeasuredSweep
from bushfit.geometry import Place
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.model.sensitivity import stiffness_and_slopes
from bushfit.prediction.bands import Band, Uncertainty, agreeing_models, envelope, expected_error, uncertainty
from bushfit.prediction.caveats import (
    MARGIN,
    agrees_within_noise,
    extrapolations,
    format_deviation,
    rig_effects,
    unfitted_warnings,
)
from bushfit.prediction.conditions import OperatingPoints, PredictedPlace, rubber_conditions
from bushfit.prediction.superposed import LargeMotion, models_with_time_law
from bushfit.reading.preload import Preload
from bushfit.reading.runs import nominal_amplitudes
from bushfit.units import number

#: Predicted quantities.
_BANDS = ("stiffness", "loss_factor", "storage_stiffness", "loss_stiffness")
#: Relative difference up to which two stiffnesses are equal.
_SAME = 1e-6


@dataclass(frozen=True, eq=False)
class Prediction(PredictedPlace):
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
        if_in_rig: prediction if the unresolved effects, which may belong to the bushing or to the rig, belong to the
            rig; the bands include it. None without unresolved effects.
        measured: measured complex stiffness at these points, mean of the repeats, in the unit of |K|, (n,); nan at a
            point without a measurement; None without sweeps.
        conditions: temperature [K] and preload of the rubber; None for a condition that the model does not depend on.
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

    def add_conditions(self, text: str) -> str:
        """Add preload, temperature and large motion to the text on a prediction, as in "axial at 60 degC over 1 mm"."""
        text = super().add_conditions(text)
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

    The bands span all models that agree with the tests: with and without effects that may belong to the bushing or to
    the rig, and with each of the effects that the tests cannot distinguish. If the model contains a smooth correction,
    the bands include the expected error of the direction as well.

    Args:
        result: fitted result.
        direction: direction or specimen.
        frequencies: frequencies [Hz], in any order.
        amplitudes: zero-to-peak amplitudes [m, rad or 1], in any order.
        rig: True to include the effects of the rig, as in the tests.
        sweeps: measured sweeps for comparison; None for no comparison.
        temperature: temperature of the rubber [K]; None for the reference temperature.
        preload: preload within the tested range; None for the tested preload nearest to zero.
        over: slow large motion, or static offset, on which the harmonic is superposed; None for the harmonic alone.

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
    points = OperatingPoints(direction, frequency, amplitude, conditions)
    if over:
        models, untimed = models_with_time_law(result, f"{direction}, with the large motion", rig=rig)
        both = np.array([over.frequency or frequency.min()]), np.array([abs(over.displacement) + amplitude.max()])
        subject = f"{direction}, with the large motion"
        together = extrapolations(result, OperatingPoints(direction, *both, conditions), subject)
    else:
        models, untimed, together = agreeing_models(result, rig=rig), [], iter(())
    predictions = [predict_with_model(model, points, uncertainty(one, model, points), over) for one, model in models]
    if result.model.unnamed and not over:
        error = expected_error(result, direction, predictions[0].loss_factor.value)
        predictions.append(predict_with_model(models[0][1], points, error, over))
    bands: dict[str, Any] = {name: envelope([getattr(one, name) for one in predictions]) for name in _BANDS}
    in_rig = predictions[2 ** len(result.unresolved) - 1] if result.unresolved and not rig else None
    measured = None if sweeps is None else measured_stiffness(points, sweeps)
    prediction = replace(predictions[0], **bands, if_in_rig=in_rig, measured=measured, over=over)
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
    yield from result.rival_warnings
    yield from unfitted_warnings(result, place)
    confirmed = np.zeros(stiffness.shape, dtype=bool)
    if measured is not None and agrees_within_noise(result, place):
        confirmed = np.isfinite(measured)
    if not confirmed.all():
        points = prediction.frequency[~confirmed], prediction.amplitude[~confirmed]
        yield from extrapolations(result, OperatingPoints(place, *points, prediction.conditions))
    requested = {"temperature": temperature, "preload": preload}
    conditions = {name for name, value in requested.items() if value is not None}
    effects = result.model.without(Level.INSTRUMENT).records
    yield from (effect.assumption for effect in effects if effect.assumption and not conditions & {*effect.depends_on})
    rig = rig_effects(result)
    if rig and measured is not None and not np.isnan(measured).all():
        percent = format_deviation(stiffness / np.abs(measured))
        loss_difference = prediction.loss_factor.value - measured.imag / measured.real
        ends = [number(end, 2, "+") for end in (np.nanmin(loss_difference), np.nanmax(loss_difference))]
        both = f"the predicted stiffness is {percent}, and the predicted loss factor {' to '.join(ends)}"
        sentence = f"without {join_names(rig)} {both}, compared with the measured values"
        yield Caveat("rig_difference", sentence).about(place)
    if prediction.if_in_rig and not np.allclose(prediction.if_in_rig.stiffness.value, stiffness, rtol=_SAME):
        percent = format_deviation(prediction.if_in_rig.stiffness.value / stiffness)
        names = join_names(result.unresolved)
        sentence = f"stiffness {percent} with {names} in the rig; the band, low to high, includes both"
        yield Caveat("stiffness_if_rig", sentence).about(place)


def predict_with_model(
    model: Model, points: OperatingPoints, errors: Uncertainty, over: LargeMotion | None
) -> Prediction:
    """Predict the stiffness with one model.

    Args:
        model: the fitted model or a variant with fewer or other effects.
        points: operating points.
        errors: uncertainty of the fit, and error of the model, at these points.
        over: slow large motion or static offset under the harmonic; None for the harmonic alone.

    Returns:
        Prediction without warnings.
    """
    (direction, frequency, amplitude, conditions), names = points, errors.covariance.names
    if over:
        stiffness, slopes = over.stiffness_and_slopes(model, points, names)
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
        conditions=conditions,
    )


def measured_stiffness(points: OperatingPoints, sweeps: Sequence[MeasuredSweep]) -> Array:
    """Average the measured stiffness at operating points.

    Args:
        points: operating points.
        sweeps: measured sweeps; sweeps of other directions are ignored.

    Returns:
        Mean complex stiffness of all measurements within 1 % of each point [N/m or N m/rad], (n,); nan without a
        measurement.
    """
    mine = [sweep.with_weight() for sweep in sweeps if sweep.direction == points.place]
    f, x, stiffness = (
        np.concatenate([np.empty(0), *(getattr(sweep, name) for sweep in mine)])
        for name in ("frequency", "amplitude", "measured")
    )
    far = np.minimum(*(np.abs(reached / points.amplitude[:, None] - 1.0) for reached in (x, nominal_amplitudes(x))))
    near = (np.abs(f / points.frequency[:, None] - 1.0) <= MARGIN) & (far <= MARGIN)
    count = near.sum(axis=1)
    return np.where(count > 0, near @ stiffness / np.maximum(count, 1), np.nan)
