"""Static curve: force over displacement in a slow cycle at constant rate, from the laws in time, with its 95 % band."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bushfit.caveat import Caveat
from bushfit.effects.contract import UNKNOWN, Array, RubberConditions
from bushfit.effects.history import History
from bushfit.effects.unnamed import NAME as UNNAMED
from bushfit.geometry import Place
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.model.sensitivity import force_and_slopes
from bushfit.prediction.bands import Band, Uncertainty, envelope, expected_error, uncertainty
from bushfit.prediction.caveats import extrapolations
from bushfit.prediction.conditions import OperatingPoints, PredictedPlace, rubber_conditions
from bushfit.prediction.superposed import correction_factor, models_with_time_law
from bushfit.reading.preload import Preload

#: Default rate of a model without loops, in display units per minute (10 mm/min): common in static tests of rubber.
_DEFAULT_RATE = 10.0
#: Displacements of a curve, and samples of the cycle between two of them.
_POINTS, _SAMPLES = 101, 10


@dataclass(frozen=True, eq=False)
class StaticCurve(PredictedPlace):
    """Force over displacement in the steady state of a slow triangular motion.

    Args:
        direction: direction or specimen.
        displacement: displacements from the lowest to the highest [m, rad or 1], (n,).
        loading, unloading: force with rising and with falling displacement [N, N m or Pa].
        mean: mean of loading and unloading, the static curve.
        slope: derivative of the mean with respect to displacement: the static stiffness at each displacement [N/m, N
            m/rad or Pa].
        secant: static stiffness from end to end, (1,) [N/m, N m/rad or Pa].
        rate: rate of the motion [m/s, rad/s or 1/s].
        warnings: warnings on extrapolation, and on alternatives without a law in time.
        conditions: temperature [K] of the rubber, and preload at which displacement and force are zero; None for a
            condition that the model does not depend on.
    """

    direction: Place
    displacement: Array
    loading: Band
    unloading: Band
    mean: Band
    slope: Band
    secant: Band
    rate: float
    warnings: tuple[Caveat, ...] = ()
    conditions: RubberConditions = UNKNOWN

    @property
    def rate_text(self) -> str:
        """Rate with its unit, such as "10 mm/min"."""
        return f"{self.direction.display.displacement.text(60.0 * self.rate)}/min"


def static_rate(result: Result, place: Place, rates: Mapping[str, float] | None = None) -> float:
    """Choose the rate of a static curve.

    The first available of: the rate in `rates`; the rate of the slowest loop in this direction; the strain rate of the
    slowest loop in any direction; 10 mm, 10 deg or 10 % of strain per minute.

    Args:
        result: fitted result, whose campaign lists the loops.
        place: direction or specimen.
        rates: rates by SI unit of displacement (m, rad or 1) [unit/s]; rates of other units are ignored.

    Returns:
        Rate [m/s, rad/s or 1/s].
    """
    if rates and place.motion.displacement_unit in rates:
        return rates[place.motion.displacement_unit]
    loops = [test for test in result.campaign.tests if test.kind == "loop"] if result.campaign else []
    loops = [test for test in loops if test.place == str(place)] or loops
    if not loops:
        return _DEFAULT_RATE / (60.0 * place.display.displacement.factor)
    slowest = min(loops, key=lambda test: test.frequency_Hz[0])
    ratio = result.model.unit_strain(result.place(slowest.place)) / result.model.unit_strain(place)
    return 4.0 * slowest.frequency_Hz[0] * slowest.amplitude[-1] * ratio


def static_curve(
    result: Result,
    place: Place,
    reach: float,
    rate: float,
    *,
    temperature: float | None = None,
    preload: Preload | None = None,
) -> StaticCurve:
    """Compute the static curve of a fitted model without the effects of the test rig.

    Args:
        result: fitted result.
        place: direction or specimen.
        reach: largest displacement, in both senses [m, rad or 1].
        rate: rate of the motion [m/s, rad/s or 1/s].
        temperature: temperature of the rubber [K]; None for the reference temperature.
        preload: preload about which the motion takes place, within the tested range; None for the tested
            preload nearest to zero.

    Returns:
        Curve at evenly spaced displacements from -reach to reach.

    Raises:
        ModelError: an effect of the model has no law in time, or the preload is outside the tested range.
    """
    models, untimed = models_with_time_law(result, f"{place}, static curve")
    displacement = np.linspace(-reach, reach, _POINTS)
    conditions = rubber_conditions(result, place, temperature, preload)
    point = OperatingPoints(place, np.array([rate / (4.0 * reach)]), np.array([reach]), conditions)
    parts = [_forces(model, uncertainty(source, model, point), point, displacement) for source, model in models]
    if result.model.unnamed:  # the mean force has no part out of phase, so the error of the loss factor does not matter
        parts.append(_forces(models[0][1], expected_error(result, place, np.zeros(1)), point, displacement))
    loading, unloading, mean, slope, secant = (envelope(bands) for bands in zip(*parts, strict=True))
    warnings = (*extrapolations(result, point, f"{place}, static curve"), *untimed)
    return StaticCurve(place, displacement, loading, unloading, mean, slope, secant, rate, warnings, conditions)


def _forces(model: Model, errors: Uncertainty, point: OperatingPoints, displacement: Array) -> list[Band]:
    """Bands of the static curve of one model, in the steady state of a slow triangular motion.

    Args:
        model: the fitted model or a variant with other effects.
        errors: errors of the parameters, and of the model itself, at `point`.
        point: direction or specimen, frequency and amplitude of the motion, and conditions of the rubber.
        displacement: evenly spaced displacements from -reach to reach [m, rad or 1], (n,).

    Returns:
        Loading force, unloading force, their mean and its slope (d mean/d displacement), (n,) each, and secant, (1,).
    """
    strokes = np.linspace(displacement[0], displacement[-1], _SAMPLES * (_POINTS - 1) + 1)
    cycle = History.steady(np.concatenate((strokes, strokes[-2:0:-1])), float(point.frequency[0]))
    names, (place, *_, conditions) = errors.covariance.names, point
    force, slopes = force_and_slopes(model.without(UNNAMED), place, cycle, names, conditions)
    changes = np.concatenate((force[None], slopes, errors.relative.real * force))
    if model.unnamed:  # as in a sine of the same frequency and amplitude
        changes *= np.abs(correction_factor(model, point))
    loading = changes[:, : strokes.size : _SAMPLES]
    unloading = np.roll(changes, -1, axis=-1)[:, ::-1][:, : strokes.size : _SAMPLES]
    mean = 0.5 * (loading + unloading)
    secant = (mean[:, -1:] - mean[:, :1]) / (displacement[-1] - displacement[0])
    curves = (loading, unloading, mean, np.gradient(mean, displacement, axis=-1, edge_order=2), secant)
    return [errors.band(curve[0], curve[1:]) for curve in curves]
