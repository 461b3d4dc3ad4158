"""Predicted stiffness and loss of a report as texts with units."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from bushfit.effects.contract import Array
from bushfit.model.covariance import Z95
from bushfit.prediction.caveats import agrees_within_noise
from bushfit.prediction.stiffness import Band, Prediction, predict
from bushfit.report.page.record import ReportRecord
from bushfit.report.tables import spread
from bushfit.units import display_unit, format_aligned, format_range, number

#: Highest frequency of a static stiffness [Hz].
_STATIC = 1.0
#: Frequencies and amplitudes of a place in the table of values, and rows of all places together.
_FREQUENCIES, _AMPLITUDES, _ROWS = 3, 2, 12


def headline(record: ReportRecord, prediction: Prediction) -> dict[str, str]:
    """Stiffness and loss of a place at the operating point in the middle of its grid, and its static stiffness.

    The point is the amplitude in the middle of those predicted and the frequency nearest to the geometric mean of the
    lowest and highest. Static stiffness is that at the lowest tested frequency, where it is at most 1 Hz, at the same
    amplitude. The interval of the dynamic stiffening counts the correlation of both.

    Args:
        record: records of the result.
        prediction: prediction of one place on its grid.

    Returns:
        Texts with units by the names of the template: operating point, dynamic stiffness and loss with their bands,
        static stiffness, dynamic stiffening, expected error, and the tests that the prediction rests on.
    """
    result, place = record.result, prediction.direction
    (length, to_length), _, (name, factor) = place.display
    amplitudes, frequencies = np.unique(prediction.amplitude), np.unique(prediction.frequency)
    amplitude = float(amplitudes[(amplitudes.size - 1) // 2])
    middle = math.sqrt(frequencies[0] * frequencies[-1])
    frequency = float(frequencies[np.argmin(np.abs(np.log(frequencies / middle)))])
    lowest = min([*(result.measured.frequency[:1] if result.measured else ()), *frequencies.tolist()])
    points = predict(result, place, [lowest, frequency], [amplitude])
    unit, to_unit = display_unit(name, factor, float(points.stiffness.value[-1]))
    static, dynamic = (band_at(points.stiffness, index, to_unit) for index in (0, -1))
    loss = band_at(points.loss_factor, -1)
    row = {
        "place": str(place),
        "frequency": f"{number(frequency, 3)} Hz",
        "amplitude": format_range(length, to_length * amplitude),
        "stiffness": f"{number(dynamic[0], 4)} {unit}",
        "stiffness_band": interval(dynamic),
        "loss_factor": number(loss[0], 3),
        "loss_factor_band": interval(loss, 3),
        "loss_angle": f"{number(math.degrees(math.atan(loss[0])), 3)}°",
        "static": "not tested",
        "static_point": f"lowest frequency {number(lowest, 3)} Hz",
        "stiffening": "",
        "accuracy": "",
        "basis": basis(record, str(place)),
    }
    if lowest < frequency and lowest <= _STATIC:
        relative, ratio = points.stiffness.root / points.stiffness.value, dynamic[0] / static[0]
        half = Z95 * ratio * float(np.linalg.norm(relative[:, -1] - relative[:, 0]))
        row["static"], row["static_point"] = f"{number(static[0], 4)} {unit}", f"at {number(lowest, 2)} Hz"
        row["stiffening"] = f"{ratio:.2f} ± {half:.2f}" if half else f"{ratio:.2f}"
    for usable in result.usable:
        if usable.place == str(place):
            errors = number(100 * usable.stiffness, 2), number(usable.loss_factor, 2)
            points_used = f"95 % of {usable.points} {'held-out ' if usable.held_out else ''}points"
            row["accuracy"] = f"stiffness {errors[0]} %, loss factor {errors[1]} ({points_used})"
    return row


def band_at(band: Band, index: int, scale: float = 1.0) -> list[float]:
    """Value, low and high of a band at one operating point, times a factor.

    Args:
        band: band of a prediction.
        index: operating point.
        scale: factor from SI to the unit shown.
    """
    return [scale * float(end[index]) for end in (band.value, band.low, band.high)]


def interval(values: Sequence[float], digits: int = 4) -> str:
    """The ends of an interval with the decimals of its value; empty where it has no width."""
    _, low, high = format_aligned(values, digits, minimum_digits=2)
    return f"{low} to {high}" if values[2] > values[1] else ""


def basis(record: ReportRecord, place: str) -> str:
    """Sentence on the tests that the prediction of a place rests on.

    Returns:
        The sentence, without a full stop.
    """
    fitted = record.result.measured.directions if record.result.measured else ()
    if place in fitted:
        return "fitted to tests in this direction"
    tests = [test for test in record.result.tests if test.place == place and test.held is None and not test.fitted]
    source = f"predicted from {' and '.join(fitted)} tests" if fitted else "calculated from given parameters"
    if not tests:
        return f"{source}; not tested"
    errors = [100.0 * test.nrmse for test in tests]
    size = " to ".join(dict.fromkeys(number(end, 2) for end in (min(errors), max(errors))))
    agrees, single = agrees_within_noise(record.result, record.result.place(place)), len(tests) == 1
    sweeps = "the measured sweep" if single else f"the {len(tests)} measured sweeps"
    if agrees:
        return f"{source}; {sweeps} {'agrees within its' if single else 'agree within their'} noise ({size} %)"
    return f"{source}; {sweeps} differ{'s' * single} by {size} %"


def value_rows(predictions: Sequence[Prediction]) -> Iterator[list[str]]:
    """Rows of predicted values at some points of each grid.

    Args:
        predictions: predictions of several places.

    Yields:
        Place, frequency, amplitude; |K| and its band; loss angle and its band; loss factor, K' and K''.
    """
    frequencies = min(max(_ROWS // max(_AMPLITUDES * len(predictions), 1), 1), _FREQUENCIES)
    for prediction in predictions:
        (length, to_length), _, (unit, factor) = prediction.direction.display
        for index in grid_corners(prediction.amplitude, prediction.frequency, _AMPLITUDES, frequencies):
            stiffness, loss = band_at(prediction.stiffness, index, factor), band_at(prediction.loss_factor, index)
            angles = [math.degrees(math.atan(end)) for end in loss]
            parts = prediction.storage_stiffness, prediction.loss_stiffness
            yield [
                str(prediction.direction),
                f"{number(float(prediction.frequency[index]), 4)} Hz",
                format_range(length, to_length * float(prediction.amplitude[index])),
                f"{number(stiffness[0], 4)} {unit}",
                interval(stiffness),
                f"{number(angles[0], 3)}°",
                interval(angles, 3),
                number(loss[0], 3),
                *(number(factor * float(band.value[index]), 4) for band in parts),
            ]


def grid_corners(amplitude: Array, frequency: Array, amplitudes: int, frequencies: int) -> Iterator[int]:
    """Indices of at most so many operating points, evenly over the amplitudes and frequencies of a grid.

    Args:
        amplitude: amplitude of each point of the grid [m, rad or 1], (n,).
        frequency: frequency of each point [Hz], (n,).
        amplitudes, frequencies: largest number of amplitudes, and of frequencies at each.
    """
    levels = np.unique(amplitude)
    for level in levels[spread(levels.size, amplitudes)]:
        rows = np.flatnonzero(amplitude == level)
        rows = rows[np.argsort(frequency[rows], kind="stable")]
        yield from rows[spread(rows.size, frequencies)].tolist()
