"""Dynamic stiffness with 95 % bands at any frequency and amplitude, of the bushing as the car will have it.

Material and component effects are included, instrument effects are excluded: the car does not have the rig's faults. If
the tests cannot distinguish an effect of the bushing from one of the rig, the bands span the predictions with and
without the effect; such effects are called unresolved.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np

from bushfit.effects import Level
from bushfit.effects.contract import Array, RubberConditions
from bushfit.errors import ModelError
from bushfit.fitting.preparation import MeasuredSweep
from bushfit.geometry import TRANSLATION, Place
from bushfit.model.covariance import Z95, Covariance
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.model.sensitivity import stiffness_and_slopes
from bushfit.prediction.caveats import MARGIN, extrapolations, point_warnings, unfitted_warnings
from bushfit.prediction.superposed import LargeMotion, superposed_stiffness_and_slopes
from bushfit.reading.preload import SAME_PRELOAD, Preload
from bushfit.reading.runs import nominal
from bushfit.reduction.resonance import response
from bushfit.units import number

#: Strain at which the resonance of a mass is looked for first; chosen: small for any rubber.
_SMALL_STRAIN = 1e-4
#: Lowest and highest frequency about a resonance over that of small strain.
_DECADE = (0.2, 4.0)
#: Frequencies of this range; chosen: 0.5 % apart, the accuracy to which tests determine a peak.
_RESONANCE_POINTS = 600
#: Transmissibility from which a point counts as near the peak; chosen: about 0.6 to 1.3 of the peak's frequency, where
#: the mount decides how far the mass moves.
_NEAR_PEAK = 1.5
#: Predicted quantities.
_BANDS = ("stiffness", "loss_factor", "storage_stiffness", "loss_stiffness")


@dataclass(frozen=True, eq=False)
class Band:
    """Predicted quantity at n operating points, with its 95 % band.

    Args:
        value, low, high: prediction, and lower and upper end of its 95 % band, (n,) each.
        root: changes of the quantity by r independent errors of one standard deviation, (r, n); their root sum of
            squares is the standard error. r is 0 if the uncertainty is unknown.
    """

    value: Array
    low: Array
    high: Array
    root: Array = field(default_factory=lambda: np.empty((0, 1)))

    def logarithm(self) -> Band:
        """Band of the natural logarithm of the (positive) quantity."""
        low, high = (np.log(self.value) + end / self.value - 1.0 for end in (self.low, self.high))
        return Band(np.log(self.value), low, high, self.root / self.value)

    def minus(self, subtrahend: Band) -> Band:
        """Band of the difference from another quantity, at the same points and with independent errors.

        Notes: the distance from the difference to an end of its band is the root sum of squares of the distances in the
        two bands (G. Zou, A. Donner, Stat. Med. 27 (2008) 1693).
        """
        value = self.value - subtrahend.value
        low = value - np.hypot(self.value - self.low, subtrahend.high - subtrahend.value)
        high = value + np.hypot(self.high - self.value, subtrahend.value - subtrahend.low)
        return Band(value, low, high, np.concatenate((self.root, -subtrahend.root)))


@dataclass(frozen=True, eq=False)
class Prediction:
    """Predicted dynamic stiffness K' + i K'' at n operating points, sorted by amplitude, then frequency.

    Args:
        direction: direction or specimen.
        frequency: frequency of each point [Hz], (n,).
        amplitude: zero-to-peak amplitude of each point [m, rad or 1], (n,).
        stiffness: magnitude |K| [N/m or N m/rad].
        loss_factor: K''/K' [1].
        storage_stiffness, loss_stiffness: K' and K'' [N/m or N m/rad].
        warnings: sentences on directions, frequencies and strains that were not fitted, on excluded effects of the rig,
            and on unresolved effects.
        if_rigs: prediction if the unresolved effects belong to the rig, which the bands include; None without
            unresolved effects.
        measured: measured complex stiffness at these points, mean of the repeats [N/m or N m/rad], (n,); nan at a
            point without a measurement; None without sweeps.
        preload: preload of all points; None if the tests of this direction did not have several.
        over: slow large motion or static offset under the harmonic; None for the harmonic alone.
    """

    direction: Place
    frequency: Array
    amplitude: Array
    stiffness: Band
    loss_factor: Band
    storage_stiffness: Band
    loss_stiffness: Band
    warnings: tuple[str, ...] = ()
    if_rigs: Prediction | None = None
    measured: Array | None = None
    preload: Preload | None = None
    over: LargeMotion | None = None

    @property
    def label(self) -> str:
        """Direction or specimen for users, with preload and large motion: "axial at a preload of 500 N"."""
        preload = f" at a preload of {self.preload.text(self.direction)}" if self.preload else ""
        return f"{self.direction}{preload}" + (f" over {self.over.describe(self.direction)}" if self.over else "")


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
        preload: preload within the tested range; None for none, or the tested preload nearest to none.
        over: slow large motion or static offset under the harmonic; None for the harmonic alone.

    Returns:
        Prediction at all combinations of frequency and amplitude.

    Raises:
        ModelError: a frequency or amplitude is not positive, the preload is outside the tested range, or the model has
            no law in time for a slow motion.
    """
    for name, values in (("frequency", frequencies), ("amplitude", amplitudes)):
        if not (np.size(values) and np.all(np.isfinite(values)) and np.min(values) > 0):
            raise ModelError(f"impossible {name} to predict at", found=str(np.asarray(values)), expected="above zero")
    amplitude, frequency = (
        axis.ravel() for axis in np.meshgrid(np.unique(amplitudes), np.unique(frequencies), indexing="ij")
    )
    conditions = RubberConditions(temperature, preload=tested_preload(result, direction, preload))
    points = direction, frequency, amplitude, conditions, over
    if over:
        over.require(direction, frequency, result.model.without(Level.INSTRUMENT))
    predictions = [predict_with_model(source, model, *points) for source, model in candidates(result, rig=rig)]
    bushings = predictions[0]
    rigs = predictions[2 ** len(result.unresolved) - 1] if result.unresolved and not rig else None
    measured = None if sweeps is None else measured_stiffness(direction, frequency, amplitude, sweeps)
    bands: dict[str, Any] = {
        name: envelope([getattr(prediction, name) for prediction in predictions]) for name in _BANDS
    }
    warnings = point_warnings(
        result,
        direction,
        np.array((frequency, amplitude, bushings.stiffness.value)),
        rigs.stiffness.value if rigs else None,
        None if rig else measured,
        temperature,
        preload,
    )
    bands |= {"if_rigs": rigs, "measured": measured, "preload": conditions.preload, "over": over}
    together = (
        extrapolations(
            result,
            direction,
            np.array([over.frequency or frequency.min()]),
            np.array([abs(over.displacement) + amplitude.max()]),
            temperature,
            f"{direction}, with the large motion",
        )
        if over
        else ()
    )
    return replace(bushings, **bands, warnings=(*warnings, *together))


def tested_preload(result: Result, place: Place, preload: Preload | None) -> Preload | None:
    """Preload of a prediction, which must be within the preloads of the fitted tests.

    Args:
        result: fitted result.
        place: direction or specimen.
        preload: requested preload; None for none, or the tested preload nearest to none.

    Returns:
        The preload; None if it is not requested and the model does not depend on it in this direction.

    Raises:
        ModelError: the tests of this direction do not have several preloads, or none as small or as large.
    """
    tested = result.measured.preloads_of(place) if result.measured else None
    if preload is None:
        return Preload(float(np.clip(0.0, tested.low, tested.high)), tested.unit) if tested else None
    if result.measured is None and result.model.depends_on_preload:  # of a simulation: exact, without a range
        return preload
    refuse = partial(ModelError, place=str(place), found=f"a preload of {preload.text(place)}")
    if tested is None:
        raise refuse(
            "the model was not fitted to several preloads of this direction",
            expected="tests at two preloads or more",
            hint='state preload = "500 N" for each test of the campaign, "none" without, and fit it again',
        )
    margin = SAME_PRELOAD * max(abs(tested.low), abs(tested.high))
    if preload.unit != tested.unit and preload.value:
        raise refuse("the tests state the preload in another quantity", expected=tested.text(place))
    if not tested.low - margin <= preload.value <= tested.high + margin:
        hint = "test the bushing at this preload, and fit all tests together"
        raise refuse("this preload is outside of the tests", expected=tested.text(place), hint=hint)
    return Preload(preload.value, tested.unit)


def car_models(model: Model, unresolved: Sequence[str]) -> list[Model]:
    """List the models that may describe the bushing in the car, without instrument effects.

    Each model has a different subset of the unresolved effects.

    Args:
        model: fitted model.
        unresolved: names of effects that belong either to the bushing or to the rig.

    Returns:
        Models; the first has all unresolved effects, the last has none.
    """
    bare = model.without(Level.INSTRUMENT)
    count = range(len(unresolved) + 1)
    return [bare.without(*names) for size in count for names in combinations(unresolved, size)]


def _alternatives(result: Result, *, rig: bool) -> Iterator[Model]:
    """Yield each model that the tests do not rule out, with the effects of the rig or as in the car (`car_models`)."""
    resolved = {*result.model.effects} - {*result.unresolved}
    for model in (alternative.model for alternative in result.alternatives):
        twins = [effect.name for effect in model.records if effect.twins and effect.name not in resolved]
        yield from [model] if rig else car_models(model, twins)


def candidates(result: Result, *, rig: bool = False) -> list[tuple[Result, Model]]:
    """List the models that agree with the tests, the predicted one first; a band spans the predictions of all.

    Args:
        result: fitted result.
        rig: True to include the effects of the rig, as in the tests.

    Returns:
        Models with the result that gives their errors: `car_models`, then the alternatives, which have no model error.
    """
    models = [result.model] if rig else car_models(result.model, result.unresolved)
    explained = replace(result, model_error=None)
    return [(result, model) for model in models] + [(explained, model) for model in _alternatives(result, rig=rig)]


def envelope(bands: Sequence[Band]) -> Band:
    """Band of the first of several predictions, widened to include the bands of the others."""
    low, high = (np.array([getattr(band, end) for band in bands]) for end in ("low", "high"))
    return replace(bands[0], low=low.min(axis=0), high=high.max(axis=0))


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Errors of a prediction with one model: of its parameters, and of the model itself.

    Args:
        covariance: covariance of the k uncertain parameters of the model.
        scale: factor of the parameters' errors at each point, (n,); below 1 where the error of the model replaces them.
        relative: complex relative errors of the stiffness by e independent errors of the model, (e, n); e is 0 or 2.
    """

    covariance: Covariance
    scale: Array
    relative: Array

    def band(self, value: Array, slopes: Array) -> Band:
        """95 % band of a quantity, (n,), from its changes by parameters and model errors, (k + e, n)."""
        count = len(self.covariance.names)
        half = np.hypot(
            self.scale * self.covariance.half_width(slopes[:count]), Z95 * np.linalg.norm(slopes[count:], axis=0)
        )
        root = np.concatenate((self.scale * (self.covariance.root.T @ slopes[:count]), slopes[count:]))
        return Band(value, value - half, value + half, root)


def uncertainty(
    result: Result, model: Model, place: Place, frequency: Array, amplitude: Array, conditions: RubberConditions
) -> Uncertainty:
    """Collect the errors of a prediction with one model at operating points.

    Args:
        result: fitted result, which provides the covariance and the model error.
        model: the fitted model or a variant with fewer or other effects.
        place: direction or specimen.
        frequency: frequency of each point [Hz], (n,).
        amplitude: zero-to-peak amplitude of each point [m, rad or 1], (n,).
        conditions: temperature of the rubber.

    Returns:
        Errors. An unnamed correction or a model error adds an error of the real and one of the imaginary part; within
        the measured range these replace the errors of the parameters.
    """
    names = [name for name in result.covariance.names if name in model.values]
    covariance = result.covariance.restricted(names)
    correction = model.unnamed or result.model_error
    if not correction:
        return Uncertainty(covariance, np.ones(frequency.size), np.empty((0, frequency.size)))
    share, error, weight = correction.evaluate(
        model.setting(place, conditions=conditions), 2.0 * np.pi * frequency, amplitude
    )
    relative = error / (1.0 + share) if model.unnamed else np.hypot(error, [share.real, share.imag])
    return Uncertainty(covariance, np.sqrt(1.0 - np.square(weight)), np.array([[1.0], [1.0j]]) * relative)


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


@dataclass(frozen=True, eq=False)
class PredictedResonance:
    """Predicted response of a mass on a bushing whose base is shaken with a sine of constant acceleration.

    Args:
        place: direction or specimen.
        mass: mass on the bushing [kg].
        base_acceleration: zero-to-peak acceleration of the base [m/s^2].
        frequency: frequency of each point [Hz], (n,).
        amplitude: zero-to-peak deformation of the bushing [m], (n,).
        transmissibility: complex ratio of the accelerations of mass and base [-], (n,).
        stiffness: complex stiffness of the bushing at each frequency and amplitude [N/m], (n,).
        warnings: sentences on a direction, and on frequencies and strains near the peak, that were not fitted, and on
            unresolved effects.
        if_rigs: response at these frequencies if the unresolved effects belong to the rig; None without such effects.
    """

    place: Place
    mass: float
    base_acceleration: float
    frequency: Array
    amplitude: Array
    transmissibility: Array
    stiffness: Array
    warnings: tuple[str, ...] = ()
    if_rigs: PredictedResonance | None = None

    @property
    def peak(self) -> tuple[float, float]:
        """Frequency of the largest transmissibility [Hz], and its magnitude |T| [-]."""
        index = int(np.argmax(np.abs(self.transmissibility)))
        return float(self.frequency[index]), float(abs(self.transmissibility[index]))


def predict_resonance(
    result: Result,
    place: Place,
    mass: float,
    base_acceleration: float,
    frequencies: Sequence[float] | Array | None,
    *,
    temperature: float | None = None,
    preload: Preload | None = None,
) -> PredictedResonance:
    """Predict the response of a mass on the bushing or specimen, whose stiffness depends on amplitude.

    Args:
        result: fitted result.
        place: direction of translation, or specimen with a displacement.
        mass: mass on the bushing [kg].
        base_acceleration: zero-to-peak acceleration of the base [m/s^2].
        frequencies: frequencies [Hz]; None for a range about the resonance.
        temperature: temperature of the rubber [K]; None for the reference temperature.
        preload: preload within the tested range; None as in `predict`.

    Returns:
        Transmissibility and amplitude at the frequencies.

    Raises:
        ModelError: the direction has no displacement and force, such as torsion.
    """
    if place.motion is not TRANSLATION:
        raise ModelError("this cannot carry a mass", found=str(place), expected="a direction or mount with a stiffness")
    bushings, *rig_models = car_models(result.model, result.unresolved)
    conditions = RubberConditions(temperature, preload=tested_preload(result, place, preload))
    if frequencies is None:
        small = bushings.stiffness(place, 1.0, _SMALL_STRAIN / bushings.unit_strain(place), conditions=conditions)
        resonance = float(np.sqrt(np.abs(small) / mass)) / (2.0 * np.pi)
        frequencies = resonance * np.geomspace(_DECADE[0], _DECADE[1], _RESONANCE_POINTS)
    frequency = np.asarray(frequencies, dtype=float)
    base = base_acceleration / (2.0 * np.pi * frequency) ** 2

    def shaken(model: Model) -> PredictedResonance:
        stiffness_at = partial(model.stiffness, place, frequency, conditions=conditions)
        amplitude, ratio = response(stiffness_at, mass, frequency, base)
        stiffness = stiffness_at(amplitude)
        return PredictedResonance(place, mass, base_acceleration, frequency, amplitude, ratio, stiffness)

    predicted, if_rigs = shaken(bushings), shaken(rig_models[-1]) if rig_models else None
    near = np.abs(predicted.transmissibility) >= min(_NEAR_PEAK, predicted.peak[1])
    subject = f"{place}, resonance of {number(mass, 3)} kg"
    warnings = [
        *unfitted_warnings(result, place),
        *extrapolations(result, place, frequency[near], predicted.amplitude[near], temperature, subject),
    ]
    if result.alternatives:
        peaks = np.array([shaken(model).peak for model in _alternatives(result, rig=False)])
        (low, smallest), (high, largest) = peaks.min(axis=0), peaks.max(axis=0)
        span = f"{number(low, 4)} to {number(high, 4)} Hz, |T| {number(smallest, 4)} to {number(largest, 4)}"
        warnings += [*result.undecided, f"{subject}: {span}, for all models that agree with the tests"]
    if if_rigs:
        peak, ratio = (number(value, 4) for value in if_rigs.peak)
        warnings.append(
            f"{subject}: at {peak} Hz, |T| {ratio}, if {' and '.join(result.unresolved)} belongs to the rig"
        )
    return replace(predicted, warnings=tuple(warnings), if_rigs=if_rigs)
