"""The report of a result: what a customer reads first, then figures, parameters and tests, then an appendix."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bushfit.diagnosis.document import DiagnosisFile, EffectEntry
from bushfit.diagnosis.record import odds_in_words
from bushfit.effects.contract import Array
from bushfit.geometry import STRAINING, TRANSLATION, Bushing, Specimen
from bushfit.model.covariance import Z95
from bushfit.model.document import TestTable
from bushfit.model.result import Misfit, Result
from bushfit.prediction.caveats import agrees_within_noise, by_importance, use_of, warnings_of
from bushfit.prediction.stiffness import Prediction, predict
from bushfit.report import plots
from bushfit.report.page.record import ReportRecord
from bushfit.report.page.svg import Picture, picture
from bushfit.report.parameters import interval_kind, parameter_rows
from bushfit.report.tables import DISPLAYS, spread
from bushfit.units import display_unit, format_aligned, format_range, number

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: A figure of the page: a name for its identifiers, and a function that makes it.
NamedFigure = tuple[str, Callable[[], "Figure | None"]]
#: Colour of the verdict: nothing to do, something to know, something to do.
_TONES = {"consistent": "good", "named": "good", "unexplained": "bad"}
#: Consequence of each verdict for the use of the numbers.
_CONSEQUENCES = {
    "consistent": "The model explains the tests within their noise. Use it within the tested range.",
    "named": "Use the model with the effect that was added, within the tested range.",
    "ambiguous": "Use stiffness and loss within the tested range. Do not attribute the difference to one cause yet.",
    "described": "Use the whole band, from low to high, within the tested range. The cause is not known.",
    "partly": "Part of the difference is not explained. Use the numbers with their bands, within the tested range.",
    "unexplained": "Do not release these numbers: the model misses the tests, and the cause is not known.",
}
#: Conditions of tests by their campaign keys; the first three are shown even if they are not stated.
_CONDITIONS = {
    "temperature_degC": "Temperature",
    "preload": "Preload",
    "date": "Date of tests",
    "operator": "Operator",
    "specimen_number": "Specimen no.",
}
#: Conditions beside each test.
_BESIDE_TEST = {
    "specimen_number": "part {}",
    "temperature_degC": "{} °C",
    "preload": "{} preload",
    "order": "no. {} of the session",
}
#: Highest frequency of a static stiffness [Hz].
_STATIC = 1.0
#: Frequencies and amplitudes of a place in the table of values, and rows of all places together.
_FREQUENCIES, _AMPLITUDES, _ROWS = 3, 2, 12
#: Tests, regions and places that a page lists or draws at most: the files have all.
MOST, _MOST_PLACES = 12, 6
#: Characters of all figures of a page at most: the page stays below 500 kB.
_LARGEST_FIGURES = 440_000


class Headline(NamedTuple):
    """Dynamic and static stiffness of one place at one operating point, as texts with units.

    Args:
        basis: whether the place was fitted, measured or only predicted.
        accuracy: expected error, or an empty text where no tests give one.
    """

    place: str
    frequency: str
    amplitude: str
    stiffness: str
    stiffness_band: str
    loss_factor: str
    loss_factor_band: str
    loss_angle: str
    accuracy: str
    static: str
    static_point: str
    stiffening: str
    basis: str


def report_context(record: ReportRecord) -> dict[str, Any]:
    """Everything that the template of a report needs.

    Args:
        record: records of the result.

    Returns:
        Values of the template by name.
    """
    result, diagnosis, campaign, tests = record.result, record.diagnosis, record.campaign, record.tests
    bodies = [("Bushing", tube_description(result.model.bushing))] if result.model.bushing else []
    bodies += [(f"Specimen {specimen}", _specimen_description(specimen)) for specimen in result.specimens]
    head = {key.replace("_", " ").capitalize(): value for key, value in (campaign.report if campaign else {}).items()}
    predictions = record.predictions[:_MOST_PLACES]
    place_warnings = [prediction.warnings for prediction in record.predictions]
    warnings = warnings_of(result, place_warnings, diagnosis["warnings"] if diagnosis else ())
    figures, more_figures = _figures(record, predictions)
    pictures = _drawn(figures, _LARGEST_FIGURES)
    appendix = _drawn(more_figures, _LARGEST_FIGURES - sum(len(drawn.svg) for drawn in pictures))
    return {
        "name": campaign.name if campaign else result.name,
        "subject": "rubber bushing" if result.model.bushing else "rubber compound",
        "head": head,
        "logo": campaign.logo if campaign else None,
        "facts": [*bodies, *conditions(test.conditions for test in tests)],
        "headlines": [headline(record, prediction) for prediction in predictions],
        "diagnosis": diagnosis,
        "tone": _TONES.get(diagnosis["verdict"], "fair") if diagnosis else "fair",
        "consequence": _CONSEQUENCES[diagnosis["verdict"]] if diagnosis else "",
        "effects": [(effect, [*_sizes(effect)]) for effect in diagnosis["effects"]] if diagnosis else [],
        "odds": odds_in_words(diagnosis) if diagnosis else [],
        "pictures": pictures,
        "appendix": appendix,
        "left_out": len(pictures) < len(figures) or len(record.predictions) > _MOST_PLACES,
        "rows": list(parameter_rows(result)),
        "interval": interval_kind(result),
        "plain": {row.name: row.value for row in parameter_rows(record.joint)} if record.joint else {},
        "quality": result.quality,
        "model_error": result.model_error is not None,
        "equation": result.model.equation().splitlines()[0],
        "tests": [_test_row(test, result.tests) for test in tests[:MOST]],
        "conditioned": any(test.conditions for test in tests),
        "more_tests": max(0, len(tests) - MOST),
        "tabled": [*_tabled(predictions)],
        "gaps": [*_gaps(diagnosis)] if diagnosis else [],
        "warnings": [(line, use_of(line)) for line in by_importance(warnings)],
        "campaign": campaign,
        "files": _files(record),
        "versions": record.versions,
        "levels": _stiffness_levels(predictions),
        "moduli": any(prediction.direction.motion is STRAINING for prediction in predictions),
    }


def headline(record: ReportRecord, prediction: Prediction) -> Headline:
    """Stiffness and loss of a place at the operating point in the middle of its grid, and its static stiffness.

    The point is the amplitude in the middle of those predicted and the frequency nearest to the geometric mean of the
    lowest and highest. Static stiffness is that at the lowest tested frequency, where it is at most 1 Hz, at the same
    amplitude. The interval of the dynamic stiffening counts the correlation of both.

    Args:
        record: records of the result.
        prediction: prediction of one place on its grid.

    Returns:
        Texts with units.
    """
    result, place = record.result, prediction.direction
    (length, to_length), _, (name, factor) = place.display
    amplitudes, frequencies = np.unique(prediction.amplitude), np.unique(prediction.frequency)
    amplitude = float(amplitudes[(amplitudes.size - 1) // 2])
    middle = math.sqrt(frequencies[0] * frequencies[-1])
    frequency = float(frequencies[np.argmin(np.abs(np.log(frequencies / middle)))])
    lowest = min([*(result.measured.frequency[:1] if result.measured else ()), *frequencies.tolist()])
    points = predict(result, place, [lowest, frequency], [amplitude])
    dynamic, static = points.frequency.size - 1, 0
    stiffness = points.stiffness
    unit, to_unit = display_unit(name, factor, float(stiffness.value[dynamic]))
    values = [[to_unit * float(end[i]) for end in (stiffness.value, stiffness.low, stiffness.high)] for i in (0, -1)]
    loss = [float(end[dynamic]) for end in (points.loss_factor.value, points.loss_factor.low, points.loss_factor.high)]
    has_static = static != dynamic and lowest <= _STATIC
    return Headline(
        str(place),
        f"{number(frequency, 3)} Hz",
        format_range(length, to_length * amplitude),
        f"{number(values[-1][0], 4)} {unit}",
        _interval(values[-1]),
        number(loss[0], 3),
        _interval(loss, 3),
        f"{number(math.degrees(math.atan(loss[0])), 3)}°",
        _accuracy(result, str(place)),
        f"{number(values[0][0], 4)} {unit}" if has_static else "not tested",
        f"at {number(lowest, 2)} Hz" if has_static else f"lowest frequency {number(lowest, 3)} Hz",
        _stiffening(points.stiffness.root, stiffness.value) if has_static else "",
        _basis(record, str(place)),
    )


def _interval(values: Sequence[float], digits: int = 4) -> str:
    """The ends of an interval with the decimals of its value; empty where it has no width."""
    _, low, high = format_aligned(values, digits, minimum_digits=2)
    return f"{low} to {high}" if values[2] > values[1] else ""


def _stiffening(root: Array, stiffness: Array) -> str:
    """Ratio of the dynamic and static stiffness with its 95 % interval."""
    ratio = stiffness[-1] / stiffness[0]
    relative = root / stiffness
    half = Z95 * ratio * float(np.linalg.norm(relative[:, -1] - relative[:, 0])) if root.shape[1] > 1 else 0.0
    return f"{ratio:.2f}" if half == 0.0 else f"{ratio:.2f} ± {half:.2f}"


def _accuracy(result: Result, place: str) -> str:
    usable = next((usable for usable in result.usable if usable.place == place), None)
    if usable is None:
        return ""
    points = f"95 % of {usable.points} {'held-out ' if usable.held_out else ''}points"
    stiffness, loss = number(100 * usable.stiffness, 2), number(usable.loss_factor, 2)
    return f"stiffness {stiffness} %, loss factor {loss} ({points})"


def _basis(record: ReportRecord, place: str) -> str:
    """Sentence on the tests that the prediction of a place rests on."""
    fitted = record.result.measured.directions if record.result.measured else ()
    if place in fitted:
        return "fitted to tests of this place"
    tests = [test for test in record.result.tests if test.place == place and test.held is None and not test.fitted]
    source = f"predicted from {' and '.join(fitted)} tests" if fitted else "calculated from given parameters"
    if not tests:
        return f"{source}; not tested"
    worst = max(tests, key=lambda test: test.reduced_chi_square)
    if agrees_within_noise(record.result, record.result.place(place)):
        return f"{source}; the measured sweep agrees within its noise ({number(100 * worst.nrmse, 2)} %)"
    return f"{source}; the measured sweep differs by {number(100 * worst.nrmse, 2)} %"


def _drawn(figures: Sequence[NamedFigure], largest: int) -> list[Picture]:
    """Draw the first figures, as many as have so many characters together."""
    pictures = list[Picture]()
    for name, make in figures:
        if (figure := make()) is None:
            continue
        drawn = picture(figure, name)
        largest -= len(drawn.svg)
        if largest < 0:
            break
        pictures.append(drawn)
    return pictures


def _figures(record: ReportRecord, predictions: Sequence[Prediction]) -> tuple[list[NamedFigure], list[NamedFigure]]:
    """Figures of the page and of its appendix, each with a name for its identifiers.

    The page shows predictions beside measurements, measured minus model, and loops. The appendix shows the residuals of
    the sweeps if nothing else does, storage and loss stiffness, and confidence ellipses.
    """
    result, sweeps, loops, gap, diagnosis = record.result, record.sweeps, record.loops, record.gap, record.diagnosis
    page: list[NamedFigure] = []
    appendix: list[NamedFigure] = []
    if sweeps is not None and gap is None:
        appendix.append(("s", lambda: plots.fits.sweeps_figure(result, sweeps, "Sweeps and their residuals")))
    for count, prediction in enumerate(predictions):
        place = prediction.direction
        draw_place = partial(plots.prediction.prediction_figure, result, prediction, sweeps)
        page.append((f"p{count}-", partial(draw_place, f"{place}: prediction and measurement")))
        if np.unique(prediction.frequency).size > 1:
            parts = partial(plots.appendix.complex_figure, result, prediction, sweeps)
            appendix.append((f"c{count}-", partial(parts, f"{place}: storage and loss stiffness, Cole-Cole diagram")))
    if gap is not None and diagnosis is not None:
        page.append(("g", lambda: plots.gap.gap_figure(gap, result, diagnosis, "Measured minus model")))
    if loops is not None:
        page.append(("l", lambda: plots.fits.loops_figure(result, loops, "Hysteresis loops")))
    appendix.append(("e", lambda: plots.appendix.ellipses_figure(result, "Confidence regions of pairs of parameters")))
    return page, appendix


def tube_description(bushing: Bushing) -> str:
    """Dimensions of a bushing in words."""
    sizes = 2 * bushing.inner_radius, 2 * bushing.outer_radius, bushing.length
    inner, outer, length = (number(1e3 * size, 4) for size in sizes)
    formulas = "; radial formulas corrected by finite elements" if bushing.shape == "calibrated" else ""
    return f"rubber tube, inner diameter {inner} mm, outer diameter {outer} mm, length {length} mm{formulas}"


def _specimen_description(specimen: Specimen) -> str:
    if specimen.area is None or specimen.thickness is None:
        return f"modulus of the compound, {specimen.strain} strain"
    blocks = "one block" if specimen.elements == 1 else f"{specimen.elements} blocks in parallel"
    return (
        f"{blocks} in shear, {number(1e6 * specimen.area, 4)} mm² each, {number(1e3 * specimen.thickness, 4)} mm thick"
    )


def conditions(test_conditions: Iterable[Mapping[str, str | float]]) -> Iterator[tuple[str, str]]:
    """Names and values of the conditions of all tests, each distinct value once.

    Args:
        test_conditions: conditions of each test by their campaign keys.

    Returns:
        An iterator over pairs of name and value.
    """
    tests = list(test_conditions)
    for key, name in _CONDITIONS.items():
        values = list(dict.fromkeys(test[key] for test in tests if key in test))
        if numbers := sorted(value for value in values if not isinstance(value, str)):
            unit = " °C" if key == "temperature_degC" else ""
            yield name, " to ".join(dict.fromkeys(f"{number(end, 3)}{unit}" for end in (numbers[0], numbers[-1])))
        elif values:
            yield name, ", ".join(map(str, values))
        elif key in ("temperature_degC", "preload", "date"):
            yield name, "not stated"


def _test_row(test: TestTable, misfits: Sequence[Misfit]) -> dict[str, str | int]:
    """Texts of a row of the table of tests: range, conditions and misfit of the model."""
    unit, factor = DISPLAYS[test.unit]
    misfit = next((misfit for misfit in misfits if misfit.test == test.test and misfit.held is None), None)
    condition_texts = [
        words.format(value if isinstance(value, str) else number(value, 3))
        for key, words in _BESIDE_TEST.items()
        if (value := test.conditions.get(key)) is not None
    ]
    return {
        "test": test.test,
        "kind": {"loop": "hysteresis loop"}.get(test.kind, test.kind),
        "place": test.place,
        "frequency": format_range("Hz", *test.frequency_Hz),
        "amplitude": format_range(unit, *(factor * end for end in test.amplitude)),
        "rows": test.rows,
        "conditions": ", ".join(condition_texts),
        "use": ("fitted" if misfit.fitted else "not fitted") if misfit else "",
        "nrmse": f"{number(100 * misfit.nrmse, 2)} %" if misfit else "",
        "chi": number(misfit.reduced_chi_square, 2) if misfit else "",
    }


def _sizes(effect: EffectEntry) -> Iterator[tuple[str, str, str]]:
    """Name, value and interval of the parameters of an effect, as texts with units."""
    for name, size in effect["parameters"].items():
        unit, factor = display_unit(size["unit"], 1.0, size["value"])
        value, *ends = format_aligned([factor * x for x in (size["value"], *(size["ci95"] or ()))], 4, minimum_digits=2)
        yield name, f"{value} {unit}".removesuffix(" -"), " to ".join(ends)


def _gaps(diagnosis: DiagnosisFile) -> Iterator[tuple[str, str, str]]:
    """Root mean square of measured minus model in units of noise, before and after: held-out and fitted data."""
    parts = {"held-out data": diagnosis["gap"]["heldout"], "fitted data": diagnosis["gap"]["calibration"]}
    for name, sizes in parts.items():
        ends = (sizes["before"], sizes["after"]) if sizes else (None, None)
        before, after = ("not known" if end is None else f"{end:.2f}" for end in ends)
        yield name, before, after


def _tabled(predictions: Sequence[Prediction]) -> Iterator[list[str]]:
    """Rows of predicted values at some points of each grid.

    Cells: place, frequency, amplitude; |K| and its band; loss angle and its band; loss factor, K' and K''.
    """
    frequencies = min(max(_ROWS // max(_AMPLITUDES * len(predictions), 1), 1), _FREQUENCIES)
    for prediction in predictions:
        (length, to_length), _, (unit, factor) = prediction.direction.display
        for index in grid_corners(prediction.amplitude, prediction.frequency, _AMPLITUDES, frequencies):
            stiffness, loss = (
                [scale * float(end[index]) for end in (band.value, band.low, band.high)]
                for band, scale in ((prediction.stiffness, factor), (prediction.loss_factor, 1.0))
            )
            angles = [math.degrees(math.atan(end)) for end in loss]
            storage, imaginary = (
                factor * float(band.value[index]) for band in (prediction.storage_stiffness, prediction.loss_stiffness)
            )
            yield [
                str(prediction.direction),
                f"{number(float(prediction.frequency[index]), 4)} Hz",
                format_range(length, to_length * float(prediction.amplitude[index])),
                f"{number(stiffness[0], 4)} {unit}",
                _interval(stiffness),
                f"{number(angles[0], 3)}°",
                _interval(angles, 3),
                number(loss[0], 3),
                number(storage, 4),
                number(imaginary, 4),
            ]


def grid_corners(amplitude: Array, frequency: Array, amplitudes: int, frequencies: int) -> Iterator[int]:
    """Indices of at most so many operating points, evenly over the amplitudes and frequencies of a grid, each (n,).

    Args:
        amplitude: amplitude of each point of the grid [m, rad or 1], (n,).
        frequency: frequency of each point [Hz], (n,).
        amplitudes, frequencies: largest number of amplitudes, and of frequencies at each.

    Returns:
        An iterator over indices of operating points.
    """
    levels = np.unique(amplitude)
    for level in levels[spread(levels.size, amplitudes)]:
        rows = np.flatnonzero(amplitude == level)
        rows = rows[np.argsort(frequency[rows], kind="stable")]
        yield from rows[spread(rows.size, frequencies)].tolist()


def _files(record: ReportRecord) -> list[tuple[str, str]]:
    """Every file behind the result with its SHA-256."""
    named = ((file.file, file.sha256) for file in ([record.campaign] if record.campaign else []) + [*record.tests])
    inputs = ((str(source.file), source.sha256) for source in record.result.inputs)
    return list(dict.fromkeys((file, sha256) for file, sha256 in (*named, *inputs) if file and sha256))


def _stiffness_levels(predictions: Sequence[Prediction]) -> str:
    """Lowest and highest level of the predicted stiffness re 1 N/m [dB]; empty without a stiffness."""
    sizes = [p.stiffness.value for p in predictions if p.direction.motion is TRANSLATION]
    if not sizes:
        return ""
    ends = (min(size.min() for size in sizes), max(size.max() for size in sizes))
    return " to ".join(dict.fromkeys(f"{20.0 * math.log10(end):.1f}" for end in ends))
