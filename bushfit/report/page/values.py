"""Predicted stiffness and loss factor as texts with units, for the report of a result."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from bushfit.effects.contract import Array
from bushfit.model.covariance import Z95
from bushfit.model.result import Result
from bushfit.prediction.bands import Band, agreeing_models
from bushfit.prediction.caveats import MARGIN
from bushfit.prediction.static_curve import static_curve, static_rate
from bushfit.prediction.stiffness import Prediction, predict
from bushfit.prediction.superposed import untimed_effects
from bushfit.report.tables import spread_indices
from bushfit.units import CELSIUS, display_unit, format_aligned, number

#: Highest frequency at which a stiffness is reported as static [Hz].
_STATIC = 1.0
#: Largest numbers in the table of values: frequencies and amplitudes of each direction or specimen, and all rows.
_FREQUENCIES, _AMPLITUDES, _ROWS = 3, 2, 12


def middle_point(result: Result, prediction: Prediction) -> Prediction:
    """Predict the middle amplitude and, of the frequencies, that nearest to the geometric mean of lowest and highest.

    Args:
        result: final model.
        prediction: prediction for one direction or specimen.

    Returns:
        Prediction at this one operating point.
    """
    amplitudes, frequencies = np.unique(prediction.amplitude), np.unique(prediction.frequency)
    middle = math.sqrt(frequencies[0] * frequencies[-1])
    frequency = frequencies[np.argmin(np.abs(np.log(frequencies / middle)))]
    return predict(result, prediction.direction, [frequency], [amplitudes[(amplitudes.size - 1) // 2]])


def headline_texts(result: Result, point: Prediction) -> dict[str, str]:
    """Key values of a direction or specimen for the top of a report, as texts.

    The static stiffness is that of the static curve to the same amplitude, if a test was made at 1 Hz or below and the
    model has a law in time. The dynamic stiffening is the ratio of dynamic to static stiffness; its band assumes common
    errors of the parameters, and independent errors of the model.

    Args:
        result: final model.
        point: prediction for one direction or specimen at one operating point.

    Returns:
        Texts with units by template variable: operating point, dynamic stiffness and loss with their 95 % bands, static
        stiffness and dynamic stiffening.
    """
    place, frequency, amplitude = point.direction, float(point.frequency[0]), float(point.amplitude[0])
    length, _, (name, factor) = place.display
    lowest = min([*(result.measured.frequency[:1] if result.measured else ()), frequency])
    unit, to_unit = display_unit(name, factor, float(point.stiffness.value[0]))
    dynamic, loss = band_at(point.stiffness, 0, to_unit), band_at(point.loss_factor, 0)
    preload, kelvin = point.conditions.preload, point.conditions.temperature
    conditions = [f"preload {preload.text(place)}"] if preload else []
    conditions += [] if kelvin is None else [f"{number(float(kelvin) - CELSIUS, 3)} °C"]
    tests = result.campaign.tests if result.campaign else ()
    tested = [end for test in tests if test.place == str(place) for end in test.amplitude]
    is_new = bool(tested and abs(np.clip(amplitude, min(tested), max(tested)) / amplitude - 1.0) > MARGIN)
    row = {
        "place": str(place),
        "frequency": f"{number(frequency, 3)} Hz",
        "amplitude": length.text(amplitude) + ", not tested in this direction" * is_new,
        "conditions": ", ".join(conditions),
        "stiffness": f"{format_aligned(dynamic[:1], 4)[0]} {unit}",
        "stiffness_band": format_interval(dynamic),
        "loss_factor": format_aligned(loss[:1], 3)[0],
        "loss_factor_band": format_interval(loss, 3),
        "loss_angle": f"{format_aligned([math.degrees(math.atan(loss[0]))], 3)[0]}°",
        "static": "not tested",
        "static_band": "",
        "static_point": f"lowest frequency {number(lowest, 3)} Hz",
        "stiffening": "",
        "stiffening_band": "",
    }
    if lowest < frequency and lowest <= _STATIC and not untimed_effects(result.model):
        curve = static_curve(result, place, amplitude, static_rate(result, place))
        static, (high, low) = band_at(curve.secant, 0, to_unit), map(Band.logarithm, (point.stiffness, curve.secant))
        ratio = high.minus(low)
        if not (result.model.unnamed or result.model_error) and len(agreeing_models(result)) == 1:
            # the parameters alone are uncertain, and their errors are common to both
            half = Z95 * np.linalg.norm(high.root - low.root, axis=0)
            ratio = Band(ratio.value, ratio.value - half, ratio.value + half)
        stiffening = np.exp(ratio.ends[:, 0]).tolist()
        row |= {"static": f"{format_aligned(static[:1], 4)[0]} {unit}", "static_band": format_interval(static)}
        row |= {"static_point": f"at {curve.rate_text}", "stiffening_band": format_interval(stiffening)}
        row["stiffening"] = format_aligned(stiffening[:1], 4)[0]
    return row


def band_at(band: Band, index: int, scale: float = 1.0) -> list[float]:
    """Value, low end and high end of a 95 % band at one operating point, times a factor.

    Args:
        band: band of a prediction [SI].
        index: index of the operating point.
        scale: factor from SI to the display unit.
    """
    return [scale * end for end in band.ends[:, index].tolist()]


def format_interval(values: Sequence[float], digits: int = 4) -> str:
    """Format (value, low, high) as "low to high" with the decimals of the value; empty if the interval has no width."""
    _, low, high = format_aligned(values, digits, minimum_digits=2)
    return f"{low} to {high}" if values[2] > values[1] else ""


def value_rows(predictions: Sequence[Prediction]) -> Iterator[list[str]]:
    """Rows of the table of predicted values in a report, at a few operating points of each prediction.

    Args:
        predictions: predictions for several directions and specimens.

    Yields:
        Texts: direction or specimen, frequency, amplitude; |K| and its 95 % band; loss angle and its band; loss factor,
        storage stiffness K' and loss stiffness K''.
    """
    frequencies = min(max(_ROWS // max(_AMPLITUDES * len(predictions), 1), 1), _FREQUENCIES)
    for prediction in predictions:
        length, _, (unit, factor) = prediction.direction.display
        for index in spread_points(prediction.amplitude, prediction.frequency, _AMPLITUDES, frequencies):
            stiffness, loss = band_at(prediction.stiffness, index, factor), band_at(prediction.loss_factor, index)
            angles = [math.degrees(math.atan(end)) for end in loss]
            parts = prediction.storage_stiffness, prediction.loss_stiffness
            yield [
                str(prediction.direction),
                f"{number(float(prediction.frequency[index]), 4)} Hz",
                length.text(float(prediction.amplitude[index])),
                f"{format_aligned(stiffness[:1], 4)[0]} {unit}",
                format_interval(stiffness),
                f"{format_aligned(angles[:1], 3)[0]}°",
                format_interval(angles, 3),
                *format_aligned(loss[:1], 3),
                *(format_aligned([factor * float(band.value[index])], 4)[0] for band in parts),
            ]


def spread_points(amplitude: Array, frequency: Array, amplitudes: int, frequencies: int) -> Iterator[int]:
    """Choose a few operating points of a grid, evenly over its amplitudes and frequencies, ends included.

    Args:
        amplitude: amplitude of each point of the grid, in any unit, (n,).
        frequency: frequency of each point [Hz], (n,).
        amplitudes: largest number of amplitudes.
        frequencies: largest number of frequencies at each amplitude.

    Yields:
        Indices of the chosen points.
    """
    levels = np.unique(amplitude)
    for level in levels[spread_indices(levels.size, amplitudes)]:
        rows = np.flatnonzero(amplitude == level)
        rows = rows[np.argsort(frequency[rows], kind="stable")]
        yield from rows[spread_indices(rows.size, frequencies)].tolist()
