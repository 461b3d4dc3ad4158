"""Content of the report of a result: summary for the customer, figures, parameters, tests and appendix."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from bushfit.caveat import Caveat, to_caveats
from bushfit.diagnosis.document import DiagnosisFile
from bushfit.diagnosis.record import format_odds
from bushfit.effects.unnamed import effect_label
from bushfit.errors import ModelError
from bushfit.geometry import STRAINING, TRANSLATION, get_places
from bushfit.geometry.point import parse_point
from bushfit.model.file import from_document, require_schema
from bushfit.model.result import Result
from bushfit.prediction.caveats import agrees_within_noise, warnings_of
from bushfit.prediction.stiffness import Prediction, predict
from bushfit.report import plots
from bushfit.report.diagnosed import permitted_use
from bushfit.report.page import render_page
from bushfit.report.page.record import JOINT, MODELS, predict_tables, tested_tables
from bushfit.report.page.svg import Picture, picture
from bushfit.report.page.values import headline_texts, middle_point, value_rows
from bushfit.report.parameters import correlation_texts, effect_sizes, parameter_rows
from bushfit.report.results import ResultFile
from bushfit.report.tables import DISPLAYS
from bushfit.units import number
from bushfit.validation import validate_tables

if TYPE_CHECKING:
    from bushfit.report.plots.style import Chart

#: Schema of diagnosis.json.
DIAGNOSIS = "bushfit/diagnosis/3"
#: Label of each test condition by campaign key; temperature, preload and date are listed even if they are not stated.
_CONDITIONS = {
    "temperature_degC": "Temperature",
    "preload": "Preload",
    "date": "Date of tests",
    "operator": "Operator",
    "specimen_number": "Specimen no.",
}
#: Largest numbers of tests and regions, and of directions and specimens, in a page; the result files contain all.
MOST, _MOST_PLACES = 12, 6
#: Largest total size of the figures of a page [characters]: the page stays below 500 kB.
_LARGEST_FIGURES = 440_000


def report_page(files: Sequence[ResultFile], date: str | None = None, folder: Path | None = None) -> str:
    """Make the report of a result as an HTML page.

    Args:
        files: documents (model, fit without the effects of a diagnosis, diagnosis), tables (sweeps, loops, gap, and
            predictions of directions and specimens) and figures.
        date: date of the report; None for the date that the campaign states.
        folder: folder that the files were read from, for error messages; None for the files of a run.

    Returns:
        The page as HTML.

    Raises:
        ModelError: a document or table that is not as bushfit writes it.
    """
    documents, tables = (
        {file.name: file.content() for file in files if file.kind == kind} for kind in ("json", "table")
    )
    paths = {name: folder / f"{name}.json" for name in documents} if folder else {}
    name = next(name for name in MODELS if name in documents)
    model, provenance = documents[name], documents[name].get("provenance", {})
    result, joint = from_document(model, paths.get(name)), documents.get(JOINT)
    plain = from_document(joint, paths.get(JOINT)) if joint else result
    is_extended = plain.model.effects != result.model.effects  # else joint.json is of an earlier run
    campaign, diagnosis = result.campaign, documents.get("diagnosis")
    if diagnosis:
        file, hint = paths.get("diagnosis"), "bushfit diagnose writes it again"
        require_schema(diagnosis, file, "a diagnosis", DIAGNOSIS, hint=hint)
        diagnosis = validate_tables(diagnosis, file, DiagnosisFile, kind=ModelError)
    head = {**(campaign.report if campaign else {}), **({"date": date} if date else {})}
    tested = tested_tables(tables)
    by_name, tests = predict_tables(result, tables, tested.get("sweeps")), campaign.tests if campaign else ()
    predictions = [*by_name.values()][:_MOST_PLACES]
    points_listed = [parse_point(text) for text in head.pop("operating_points", "").split("; ") if text]
    places = [(point, place) for point in points_listed for place in get_places(point.place, result.specimens)]
    points = [predict(result, place, [point.frequency], [point.amplitude]) for point, place in places]
    place_warnings = [prediction.warnings for prediction in (*by_name.values(), *points)]
    points = points or [middle_point(result, prediction) for prediction in predictions]
    notes = to_caveats(diagnosis["warnings"], diagnosis.get("warning_kinds", ())) if diagnosis else ()
    warnings = warnings_of(result, place_warnings, notes)
    charts = {file.name: file for file in files if file.kind == "figure"}
    pictures, left_out = draw_figures(result, diagnosis, tested, by_name, charts)
    sizes = [p.stiffness.value for p in predictions if p.direction.motion is TRANSLATION]
    ends = [20.0 * math.log10(end) for end in (min(map(np.min, sizes)), max(map(np.max, sizes)))] if sizes else []
    sources: list[Any] = [*([campaign] if campaign else []), *tests]
    context = {
        "result": result,
        "campaign": campaign,
        "diagnosis": diagnosis,
        "versions": {"bushfit": provenance.get("bushfit") or "", **provenance.get("packages", {})},
        "head": {key.replace("_", " ").capitalize(): text for key, text in head.items()},
        "conditions": summarize_conditions(test.conditions for test in tests),
        "headlines": [headline_texts(result, point) for point in points],
        "agrees": agrees_within_noise,
        "sizes": effect_sizes,
        "label": effect_label,
        "odds": format_odds(diagnosis) if diagnosis else [],
        "use": permitted_use(diagnosis) if diagnosis else "",
        "pictures": pictures,
        "left_out": left_out,
        "rows": list(parameter_rows(result)),
        "plain": {row.name: row.value for row in parameter_rows(plain)} if is_extended else {},
        "correlations": correlation_texts(result),
        "tests": tests[:MOST],
        "validation": tables.get("validation"),
        "agreement": {misfit.test: misfit for misfit in result.tests if misfit.held is None},
        "displays": DISPLAYS,
        "more_tests": max(0, len(tests) - MOST),
        "tabled": [*value_rows(predictions)],
        "warnings": group_warnings(warnings),
        "files": ({str(one.file): one.sha256 for one in sources if one.file and one.sha256} | result.files).items(),
        "levels": " to ".join(dict.fromkeys(f"{end:.1f}" for end in ends)),
        "moduli": any(prediction.direction.motion is STRAINING for prediction in predictions),
    }
    return render_page("report.html", context)


def draw_figures(
    result: Result,
    diagnosis: DiagnosisFile | None,
    tables: Mapping[str, pd.DataFrame],
    predictions: Mapping[str, Prediction],
    charts: Mapping[str, ResultFile],
) -> tuple[list[Picture], bool]:
    """Draw the figures of a report, as many as fit the size limit of the page.

    The figures are predictions with measurements, measured minus model (without a diagnosis: sweeps and their
    residuals), loops, and validation records.

    Args:
        result: final model.
        diagnosis: content of diagnosis.json; None without a diagnosis.
        tables: tables of measured and modelled tests by file name: gap, sweeps, loops and validation_....
        predictions: predictions for directions and specimens by the file name of their table, such as "axial".
        charts: figures made in the run, by file name; other figures are made from the tables.

    Returns:
        Figures of the report, and True if further figures are left out.
    """
    sweeps, loops, gap = (tables.get(name) for name in ("sweeps", "loops", "gap"))
    title = result.name
    # file name, heading, function and its arguments
    figures: list[tuple[str, str, Callable[..., Chart], tuple[Any, ...]]] = []
    for name, prediction in [*predictions.items()][:_MOST_PLACES]:
        is_measured = sweeps is not None and str(prediction.direction) in {*sweeps["direction"]}
        heading = f"{prediction.direction}: prediction{' and measurement' * is_measured}"
        figures.append((name, heading, plots.prediction.prediction_figure, (result, prediction, sweeps, title)))
    if gap is not None and diagnosis is not None:
        figures.append(("gap", "Measured minus model", plots.gap.gap_figure, (gap, result, diagnosis, title)))
    elif sweeps is not None:
        figures.append(("sweeps", "Sweeps and their residuals", plots.fits.sweeps_figure, (result, sweeps, title)))
    if loops is not None:
        figures.append(("loops", "Hysteresis loops", plots.fits.loops_figure, (result, loops, title)))
    for name, table in tables.items():
        if name.startswith("validation_"):
            heading = f"Validation record {name.removeprefix('validation_')}, never fitted"
            figures.append((name, heading, plots.response.response_figure, (title, table)))
    pictures, room = list[Picture](), _LARGEST_FIGURES
    for name, heading, draw, arguments in figures:
        chart = charts[name].content() if name in charts else draw(*arguments)
        drawing = picture(chart, f"f{len(pictures)}-", heading)
        room -= len(drawing.svg)
        if room <= 0:
            break
        pictures.append(drawing)
    return pictures, len(pictures) < len(figures) or len(predictions) > _MOST_PLACES


def group_warnings(warnings: Iterable[Caveat]) -> dict[str, list[Caveat]]:
    """Group warnings that have the same consequence for the use of the numbers.

    Returns:
        Warnings by the sentence that states their consequence, the most important first.
    """
    groups = dict[str, list[Caveat]]()
    for warning in sorted(warnings, key=attrgetter("rank")):
        groups.setdefault(warning.consequence, []).append(warning)
    return groups


def summarize_conditions(test_conditions: Iterable[Mapping[str, str | float]]) -> dict[str, str]:
    """Summarise the conditions of all tests: temperature, preload, date, operator and specimen number.

    Args:
        test_conditions: conditions of each test by campaign key.

    Returns:
        Text by name of the condition: a range of numbers, or the distinct values.
    """
    tests, texts = list(test_conditions), dict[str, str]()
    for key, name in _CONDITIONS.items():
        values = list(dict.fromkeys(test[key] for test in tests if key in test))
        if numbers := sorted(value for value in values if not isinstance(value, str)):
            unit = " °C" if key == "temperature_degC" else ""
            ends = dict.fromkeys(f"{number(end, 3)}{unit}" for end in (numbers[0], numbers[-1]))
            texts[name] = " to ".join(ends)
        elif values or key in ("temperature_degC", "preload", "date"):
            texts[name] = ", ".join(map(str, values)) or "not stated"
    return texts
