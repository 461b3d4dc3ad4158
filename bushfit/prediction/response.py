"""Force over time for a displacement history, from the laws in time, with its 95 % band."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.fft import next_fast_len

from bushfit.caveat import Caveat, join_names
from bushfit.effects.contract import UNKNOWN, Array, RubberConditions
from bushfit.effects.history import History
from bushfit.effects.unnamed import NAME as UNNAMED
from bushfit.geometry import Place, Specimen
from bushfit.model.covariance import Z95
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.model.sensitivity import force_and_slopes
from bushfit.prediction.bands import Band, envelope, uncertainty
from bushfit.prediction.caveats import BEYOND, MARGIN, extrapolations, unfitted_warnings
from bushfit.prediction.conditions import OperatingPoints, PredictedPlace, rubber_conditions
from bushfit.prediction.superposed import correction_factor, models_with_time_law
from bushfit.reduction.displacement import noise_and_highest_frequency
from bushfit.units import number

#: Largest stroke, relative to the range, that noise of the displacement may cause, and largest share of such strokes
#: without a warning; chosen.
_NOISE, _MOST_NOISE = 2e-3, 0.2
#: Largest share of the travel in strokes shorter than any in the tests without a warning; chosen.
_MOST_SHORT = 0.2
#: Smallest ratio of the first displacement to the largest later step that is a jump; chosen.
_JUMP = 2.0
#: Smallest number of samples per mean cycle without a warning: with 20 the springpot errs by 0.7 % of its force.
_FEWEST_PER_CYCLE = 20.0
#: Number of frequencies, evenly spaced in their logarithm, at which a smooth correction is evaluated.
_CORRECTED = 200


@dataclass(frozen=True, eq=False)
class TimeResponse(PredictedPlace):
    """Predicted force over time for a displacement history, with the tested range of the motion.

    Args:
        direction: direction or specimen.
        history: displacement [m, rad or 1], (n,), evenly sampled.
        force: force [N, N m or Pa] with its 95 % band, (n,).
        unit_strain: equivalent strain per displacement [1/m, 1/rad or 1].
        tested: largest strain [1] and strain rate [1/s] of the fitted tests; None if the model was not fitted.
        warnings: warnings on extrapolation and on effects that are left out or constant.
        conditions: temperature [K] and preload of the rubber; None for a condition that the model does not depend on.
    """

    direction: Place
    history: History
    force: Band
    unit_strain: float
    tested: tuple[float, float] | None = None
    warnings: tuple[Caveat, ...] = ()
    conditions: RubberConditions = UNKNOWN

    @property
    def peak(self) -> float:
        """Largest magnitude of the force [N, N m or Pa]."""
        return float(np.abs(self.force.value).max())

    @cached_property
    def summary(self) -> dict[str, Any]:
        """Values that summarise the motion and the force, as in `respond --json`.

        Returns:
            Peak and rms force, mean power that the motion transfers to the bushing [W] or to a unit volume of a
            specimen [W/m^3], largest strain and strain rate [SI]; and the fractions of the samples, 0 to 1, whose
            strain, and whose strain rate, exceeds that of all fitted tests; None if the model was not fitted.
        """
        history, force = self.history, self.force.value
        strain, rate = (self.unit_strain * np.abs(values) for values in (history.value, history.rate))
        shares: list[float | None] = [None, None]
        if self.tested:
            limits = zip((strain, rate), self.tested, strict=True)
            shares = [float(np.mean(values > limit * (1.0 + MARGIN))) for values, limit in limits]
        return {
            "peak_force": self.peak,
            "rms_force": float(np.sqrt(np.mean(np.square(force)))),
            "energy_per_second": work(history, force) / (history.step * history.value.size),
            "largest_strain": float(strain.max()),
            "largest_strain_rate_per_s": float(rate.max()),
            "share_of_time_above_tested_strain": shares[0],
            "share_of_time_above_tested_strain_rate": shares[1],
        }


def work(history: History, force: Array) -> float:
    """Work done on the bushing by a force [N, N m or Pa], (n,), from the first to the last sample of a motion.

    Returns:
        Work [J], or work per volume [J/m^3] of a stress over a strain.
    """
    if history.periodic:
        return float(np.sum(force * history.rate) * history.step)
    return float(np.trapezoid(force, history.value))


def time_response(
    result: Result, place: Place, history: History, *, temperature: float | None = None, rig: bool = False
) -> TimeResponse:
    """Compute the force for a displacement history.

    Args:
        result: fitted result.
        place: direction or specimen.
        history: displacement [m, rad or 1], (n,), from `History.sampled`.
        temperature: temperature of the rubber [K]; None for the reference temperature.
        rig: True to include the effects of the rig, as in the tests; False for the bushing alone, as in a car.

    Returns:
        Force with a band that spans all models that agree with the tests. Effects of the rig (unless `rig`) and, in a
        steady state, effects of the first cycles are left out; the band excludes alternatives without a law in time.

    Raises:
        ModelError: an effect of the model has no law in time.
    """
    conditions = rubber_conditions(result, place, temperature)
    left_out = {effect.name for effect in result.model.records if history.periodic and effect.is_transient}
    rivals = tuple(replace(rival, model=rival.model.without(*left_out)) for rival in result.alternatives)
    timed = replace(result, model=result.model.without(*left_out), alternatives=rivals)
    models, untimed = models_with_time_law(timed, str(place), rig=rig)
    force = envelope([_force(source, model, place, history, conditions) for source, model in models])
    tested = None
    if result.measured:
        fitted = (place for place in result.fitted_places if result.model.bushing or isinstance(place, Specimen))
        places = {str(place): place for place in fitted}
        ends = [
            (test.amplitude[-1] * result.model.unit_strain(places[test.place]), test.frequency_Hz[-1])
            for test in (result.campaign.tests if result.campaign else ())
            if test.place in places
        ]
        largest, highest = result.measured.strain[1], result.measured.frequency[1]
        tested = largest, max(2.0 * np.pi * strain * hertz for strain, hertz in ends or [(largest, highest)])
    response = TimeResponse(place, history, force, result.model.unit_strain(place), tested, conditions=conditions)
    return replace(response, warnings=(*_warnings(result, response, sorted(left_out)), *untimed))


def _force(result: Result, model: Model, place: Place, history: History, conditions: RubberConditions) -> Band:
    """Force of one model over a displacement history, with its 95 % band.

    Args:
        result: fitted result, which gives the errors.
        model: the fitted model or a variant with other effects.
        place: direction or specimen.
        history: displacement [m, rad or 1], (n,).
        conditions: temperature and preload of the rubber.

    Notes:
        An unnamed correction of the model multiplies each frequency of the force by the ratio of the stiffness with and
        without the correction in a sine of equal rms displacement, which is exact for a sine (statistical
        linearisation, T. K. Caughey, J. Acoust. Soc. Am. 35 (1963) 1706); the mean force is not corrected.

        The model's relative errors of real and imaginary part multiply the force and its Hilbert transform. The largest
        of three errors is used: at the mean frequency and the peak amplitude; at the mean frequency and the amplitude
        of a sine of equal rms; and far from the tested points, because the tests are sines but not this motion.
    """
    amplitude = np.array([np.abs(history.value).max(), np.sqrt(2.0) * np.std(history.value)])
    amplitude = np.maximum(amplitude, np.finfo(float).eps)
    points = OperatingPoints(place, np.full(2, history.frequency), amplitude, conditions)
    errors = uncertainty(result, model, points)
    named = model.without(UNNAMED)
    if named.structure.layers:  # one model's solution of implicit equations is the start for its derivatives
        named.force(place, history, kind="loop", conditions=conditions)
    force, slopes = force_and_slopes(named, place, history, errors.covariance.names, conditions)
    if model.unnamed:
        samples = force.size if history.periodic else next_fast_len(2 * force.size)
        frequency = np.fft.rfftfreq(samples, history.step)[1:]
        grid = np.geomspace(frequency[0], frequency[-1], _CORRECTED)
        factor = correction_factor(model, OperatingPoints(place, grid, amplitude[1], conditions))
        spectrum = np.fft.rfft(force, samples)
        spectrum[1:] *= np.interp(np.log(frequency), np.log(grid), factor)
        force = np.fft.irfft(spectrum, samples)[: force.size]
    half = errors.scale.max() * errors.covariance.half_width(slopes)
    if errors.relative.size:
        from scipy.signal import hilbert  # slow to import

        measured_in_sines = model.unnamed or result.model_error
        far = measured_in_sines.far_deviation if measured_in_sines else 0.0
        relative = np.linalg.norm([errors.relative.real, errors.relative.imag], axis=1)
        real, imaginary = np.maximum(relative.max(axis=-1), far)
        quadrature = hilbert(force, next_fast_len(force.size)).imag[: force.size]
        half = np.sqrt(half**2 + Z95**2 * ((real * force) ** 2 + (imaginary * quadrature) ** 2))
    return Band(force, force - half, force + half)


def _warnings(result: Result, response: TimeResponse, left_out: list[str]) -> Iterator[Caveat]:
    """Yield warnings on a time response: directions and ranges not fitted, effects left out, and coarse sampling.

    Args:
        result: fitted result.
        response: predicted force over time.
        left_out: names of the effects that the response leaves out.
    """
    place, history, length = response.direction, response.history, response.direction.display.displacement
    yield from result.rival_warnings
    yield from unfitted_warnings(result, place)
    if result.measured:
        largest = max(np.abs(history.value).max(), result.measured.strain[0] / response.unit_strain)
        point = np.array([history.frequency]), np.array([largest])
        yield from extrapolations(result, OperatingPoints(place, *point, response.conditions))
    if response.tested and (share := response.summary["share_of_time_above_tested_strain_rate"]):
        ends = [number(rate, 3) for rate in (response.summary["largest_strain_rate_per_s"], response.tested[1])]
        rates = f"strain rates up to {ends[0]} 1/s, but fitted at up to {ends[1]} 1/s only"
        sentence = f"{rates}, in {number(100.0 * share, 2)} % of time: {BEYOND}"
        yield Caveat("extrapolated_rate", sentence).about(place)
    if (result.model.unnamed or result.model_error) and "friction" in result.model.effects:
        sentence = (
            "friction laws that agree in sines can differ in a mixed motion by more than the band. Judge the "
            "model by a measured force ([[validation]]), or compare it with a fit with --effect distributed_sliders"
        )
        yield Caveat("friction_laws_differ", sentence).about(place)
    if left_out:
        sentence = f"{join_names(left_out)} left out, because no law describes this motion"
        yield Caveat("effects_without_law", sentence).about(place)
    if constant := result.model.constant_modifiers:
        sine = f"{number(history.frequency, 3)} Hz and {length.text(history.amplitude.item())}"
        yield Caveat("constant_effects", f"{join_names(constant)} constant, as in a sine of {sine}").about(place)
    strokes, start = np.abs(history.strokes.strides), abs(float(history.value[0]))
    if not history.periodic and start > _JUMP * np.abs(np.diff(history.value)).max():
        sentence = f"the history begins at {length.text(start)}, but the model starts from rest at 0"
        advice = "Begin the history at rest, or subtract its first value"
        yield Caveat("motion_begins_off_zero", f"{sentence}. {advice}").about(place)
    shortest = 2.0 * (1.0 - MARGIN) * result.measured.strain[0] / response.unit_strain if result.measured else 0.0
    short = strokes[strokes < shortest].sum() / max(strokes.sum(), np.finfo(float).tiny)
    if np.mean(strokes < _NOISE * np.ptp(history.value)) > _MOST_NOISE:
        noise, highest = noise_and_highest_frequency(history.value, history.step)
        cutoff = f'"{number(2.0 * highest, 2)} Hz"' if 4.0 * highest * history.step < 1.0 else "above all wanted motion"
        size = length.text(noise, digits=2)
        sentence = f"most reversals of the displacement are as small as its noise, {size} rms: use --lowpass {cutoff}"
        yield Caveat("noisy_motion", sentence).about(place)
    elif short > _MOST_SHORT:
        stroke = f"strokes shorter than the shortest tested, {length.text(shortest / (1.0 - MARGIN))}"
        sentence = f"{number(100.0 * short, 2)} % of the travel is in {stroke}"
        yield Caveat("extrapolated_stroke", f"{sentence}: {BEYOND}").about(place)
    if not history.periodic and (samples := 1.0 / (history.frequency * history.step)) < _FEWEST_PER_CYCLE:
        sentence = f"the history has {number(samples, 2)} samples in a mean cycle, too few for the force between"
        yield Caveat("coarse_motion", f"{sentence} samples: sample it more finely").about(place)
