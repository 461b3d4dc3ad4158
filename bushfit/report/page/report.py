"""The report of a result, in the order in which its reader asks: what was tested, the verdict, the numbers."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from markupsafe import Markup
from scipy.special import fdtri

from bushfit.diagnosis.document import EffectEntry, GapEntry
from bushfit.diagnosis.record import odds_in_words
from bushfit.geometry import STRAINING, TRANSLATION, Bushing, Specimen
from bushfit.model.document import TestTable
from bushfit.model.model import FIVE
from bushfit.model.result import Misfit, Result
from bushfit.prediction.caveats import of_points, warnings_of
from bushfit.report.page import filled
from bushfit.report.page.chart import MOST_PLACES
from bushfit.report.page.gap import gap_panels, loop_panels
from bushfit.report.page.readback import ReportData
from bushfit.report.page.sweeps import amplitude_panels, cole_cole_panels, frequency_panels, sweeps_of
from bushfit.report.parameters import Row, interval_kind, parameter_rows
from bushfit.report.tables import DISPLAYS, IF_RIGS, columns_of, complete, numbers, spread
from bushfit.units import display_unit, format_aligned, format_range, number

#: How a verdict is coloured: nothing to do, something to know, something to do.
_TONES = {"consistent": "good", "named": "good", "unexplained": "bad"}
#: Conditions of tests, as a campaign has them, and what a page calls them.
_CONDITIONS = {
    "temperature_degC": "Temperature",
    "preload": "Preload",
    "date": "Date of tests",
    "operator": "Operator",
    "specimen_number": "Specimen no.",
}
#: What stands of them beside each test.
_STATED = {
    "specimen_number": "part {}",
    "temperature_degC": "{} °C",
    "preload": "{} preload",
    "order": "{}. in the session",
}
#: Frequencies and amplitudes of a place whose predicted values are tabled, and rows of all places together.
_FREQUENCIES, _AMPLITUDES, _ROWS = 3, 2, 12
#: Regions and tests that a page lists at most: the documents have all.
MOST = 12
#: Side of a cell, the way from one to the next, and the room left for the ends of intervals [pixels].
_CELL, _PITCH, _LEFT, _TOP = 76.0, 80.0, 52.0, 26.0
#: Half a cell is so many times an ellipse that touches both edges.
_ROOM = 1.12
#: Corners of an ellipse as it is drawn.
_CORNERS = 48
#: Way from the middle of a cell to the ends of an interval of well known errors, as a share of its side.
_END = 0.5 * 1.96 / (2.45 * _ROOM)


def report_context(found: ReportData) -> dict[str, Any]:
    """All that the template of a report asks for."""
    result, diagnosis, campaign, tests = found.result, found.diagnosis, found.campaign, found.tests
    gaps = [*_gaps(diagnosis["gap"])] if diagnosis else []
    report = campaign.report if campaign else {}
    every = sweeps_of(found)
    bodies = [("Bushing", tube(result.model.bushing))] if result.model.bushing else []
    bodies += [(f"Specimen {specimen}", _specimen(specimen)) for specimen in result.specimens]
    return {
        "name": campaign.name if campaign else result.name,
        "subject": "rubber bushing" if result.model.bushing else "rubber compound",
        "head": {key.replace("_", " ").capitalize(): value for key, value in report.items()},
        "logo": campaign.logo if campaign else None,
        "facts": [*bodies, *conditions(test.conditions for test in tests)],
        "tests": [_tested(test, result.tests) for test in tests[:MOST]],
        "conditioned": any(test.conditions for test in tests),
        "more_tests": max(0, len(tests) - MOST),
        "diagnosis": diagnosis,
        "tone": _TONES.get(diagnosis["verdict"], "fair") if diagnosis else "fair",
        "has_odds": found.has_odds,
        "odds": odds_in_words(diagnosis) if diagnosis and found.has_odds else [],
        "effects": [(effect, [*_sizes(effect)]) for effect in diagnosis["effects"]] if diagnosis else [],
        "usable": [(place, _degrees(place.loss_factor)) for place in result.usable],
        "rows": list(parameter_rows(result)),
        "interval": interval_kind(result),
        "plain": {row.name: row.value for row in parameter_rows(found.plain)} if found.plain else {},
        "quality": result.quality,
        "model_error": result.model_error is not None,
        "correlations": [
            f"{one}/{other} {size:+.2f}"
            for one, other, size in result.covariance.correlations()
            if abs(size) > 0.9  # they trade off against each other
        ],
        "equation": result.model.equation().splitlines()[0],
        "corner": corner(result),
        "places": frequency_panels(every),
        "payne": amplitude_panels(found),
        "cole_cole": cole_cole_panels(every),
        "tabled": [*_tabled(found)],
        "loops": loop_panels(found),
        "gap": gap_panels(found),
        "gaps": gaps,
        "added": any(before != after for _, before, after in gaps if after),
        "warnings": warnings_of(result, _of_tables(found), diagnosis["warnings"] if diagnosis else ()),
        "campaign": campaign,
        "files": _files(found),
        "versions": found.versions,
        "levels": _levels(found),
        "moduli": any(place.motion is STRAINING for place in found.places.values()),
    }


def _of_tables(found: ReportData) -> Iterator[Iterator[str]]:
    """The warnings of what is predicted in the table of each place."""
    for name, place in found.places.items():
        (amplitude, stiffness, _), ((_, length), _, (_, unit)) = columns_of(place), place.display
        headers = "frequency [Hz]", amplitude, stiffness
        if name not in found.tables:
            continue
        table = complete(found.tables[name], *headers)
        table = table[numbers(table, stiffness)[0] != 0.0]  # which only a hand puts there
        if len(table):
            others = (f"{stiffness}, {IF_RIGS}", f"measured {stiffness}")
            rigs, measured = (numbers(table, each)[0] / unit if each in table else None for each in others)
            measured = None if measured is None else np.where(measured == 0.0, np.nan, measured)
            grid = numbers(table, *headers) / [[1.0], [length], [unit]]
            yield of_points(found.result, place, grid, rigs, measured, None)


def tube(bushing: Bushing) -> str:
    sizes = 2 * bushing.inner_radius, 2 * bushing.outer_radius, bushing.length
    inner, outer, length = (number(1e3 * size, 4) for size in sizes)
    formulas = "; radial formulas corrected by finite elements" if bushing.shape == "calibrated" else ""
    return f"rubber tube, inner diameter {inner} mm, outer diameter {outer} mm, length {length} mm{formulas}"


def _specimen(specimen: Specimen) -> str:
    if specimen.area is None or specimen.thickness is None:
        return f"modulus of the compound, {specimen.strain} strain"
    blocks = "one block" if specimen.elements == 1 else f"{specimen.elements} blocks in parallel"
    return (
        f"{blocks} in shear, {number(1e6 * specimen.area, 4)} mm² each, {number(1e3 * specimen.thickness, 4)} mm thick"
    )


def conditions(stated: Iterable[Mapping[str, str | float]]) -> Iterator[tuple[str, str]]:
    """Conditions of all tests: each value once; of three that every report has, too, that they are not stated."""
    tests = list(stated)
    for key, name in _CONDITIONS.items():
        values = list(dict.fromkeys(test[key] for test in tests if key in test))
        if degrees := sorted(value for value in values if not isinstance(value, str)):
            unit = " °C" if key == "temperature_degC" else ""
            yield name, " to ".join(dict.fromkeys(f"{number(end, 3)}{unit}" for end in (degrees[0], degrees[-1])))
        elif values:
            yield name, ", ".join(map(str, values))
        elif key in ("temperature_degC", "preload", "date"):
            yield name, "not stated"


def _tested(test: TestTable, misfits: Sequence[Misfit]) -> dict[str, str | int]:
    """A test in a row of a table: its range, and how well the model meets it."""
    unit, factor = DISPLAYS[test.unit]
    met = next((misfit for misfit in misfits if misfit.test == test.test and misfit.held is None), None)
    stated = [
        words.format(value if isinstance(value, str) else number(value, 3))
        for key, words in _STATED.items()
        if (value := test.conditions.get(key)) is not None
    ]
    return {
        "test": test.test,
        "kind": {"loop": "hysteresis loop", "sweep": "sweep"}.get(test.kind, test.kind),
        "place": test.place,
        "frequency": format_range("Hz", *test.frequency_Hz),
        "amplitude": format_range(unit, *(factor * end for end in test.amplitude)),
        "rows": test.rows,
        "conditions": ", ".join(stated),
        "nrmse": f"{number(100 * met.nrmse, 2)} %" if met else "",
        "chi": number(met.reduced_chi_square, 2) + " (not fitted)" * (not met.fitted) if met else "",
    }


def _sizes(effect: EffectEntry) -> Iterator[tuple[str, str, str]]:
    """Name, value and interval of the parameters of an effect that was named, as people read them."""
    for name, size in effect["parameters"].items():
        unit, factor = display_unit(size["unit"], 1.0, size["value"])
        value, *ends = format_aligned([factor * x for x in (size["value"], *(size["ci95"] or ()))], 4, minimum_digits=2)
        yield name, f"{value} {unit}".removesuffix(" -"), " to ".join(ends)


def _files(found: ReportData) -> list[tuple[str, str]]:
    """Every file behind the result with its hash: the campaign, its tests, fitted or not, and what else was fitted."""
    named = ((file.file, file.sha256) for file in ([found.campaign] if found.campaign else []) + [*found.tests])
    inputs = ((str(source.file), source.sha256) for source in found.result.inputs)
    return list(dict.fromkeys((file, sha256) for file, sha256 in (*named, *inputs) if file and sha256))


def _gaps(gap: GapEntry) -> Iterator[tuple[str, str, str]]:
    """Root mean square of what is left before and after, in units of noise: held out first."""
    parts = {"held out, predicted from the other tests": gap["heldout"], "data fitted": gap["calibration"]}
    for words, sizes in parts.items():
        ends = (sizes["before"], sizes["after"]) if sizes else ()
        known = ["not known" if end is None else f"{end:.2f}" for end in ends]
        before, after = known or ("not testable", "")
        yield words, before, after


def _tabled(found: ReportData) -> Iterator[tuple[str, ...]]:
    """Predicted values at some corners of the grid of each place, their bands, and what was measured there.

    Rows of cells: place, unit, frequency, amplitude; |K| and loss angle, each with its band and as measured; loss
    factor, K' and K''.
    """
    places = [(found.tables[name], place) for name, place in found.places.items() if name in found.tables]
    frequencies = min(max(_ROWS // max(_AMPLITUDES * len(places), 1), 1), _FREQUENCIES)
    for table, place in places[:MOST_PLACES]:
        amplitude, stiffness, _ = columns_of(place)
        names, parts = (stiffness, "loss factor [-]"), (f"storage {stiffness}", f"loss {stiffness}")
        band = [f"{name}, {end}" for name in names for end in ("low", "high")]
        (length, _), _, (unit, _) = place.display
        known = complete(table, "frequency [Hz]", amplitude, *names, *band, *parts)
        kinds: tuple[tuple[str, int, Callable[[float], float]], ...] = ((names[0], 4, float), (names[1], 3, _degrees))
        for row in corners(known, amplitude, _AMPLITUDES, frequencies):
            cells = [str(place), unit, f"{number(row['frequency [Hz]'], 4)} Hz", format_range(length, row[amplitude])]
            for name, digits, shown in kinds:
                ends = [shown(row[key]) for key in (name, f"{name}, low", f"{name}, high")]
                value, *ends_told = format_aligned(ends, digits, minimum_digits=2)
                measured = row.get(f"measured {name}", np.nan)
                cells += [value, " to ".join(ends_told)]
                cells.append("" if np.isnan(measured) else format_aligned([shown(measured)], digits)[0])
            yield *cells, *(format_aligned([row[name]], 4)[0] for name in (names[1], *parts))


def _degrees(loss_factor: float) -> float:
    """The loss angle of a loss factor [deg]."""
    return math.degrees(math.atan(loss_factor))


def _levels(found: ReportData) -> str:
    """Levels of the predicted stiffness re 1 N/m, least and largest; "" where there is none."""
    sizes = [
        numbers(found.tables[name], columns_of(place)[1])[0] / place.display.stiffness.factor
        for name, place in found.places.items()
        if place.motion is TRANSLATION and name in found.tables
    ]
    known = [size for each in sizes for size in each.tolist() if size > 0.0]
    ends = [f"{20.0 * math.log10(end):.1f}" for end in (min(known), max(known))] if known else []
    return " to ".join(dict.fromkeys(ends))


def corners(table: pd.DataFrame, amplitude: str, amplitudes: int, frequencies: int) -> Iterator[dict[str, Any]]:
    """At most so many rows of a table of operating points, evenly over its amplitudes and frequencies."""
    levels = np.unique(table[amplitude])
    for level in levels[spread(levels.size, amplitudes)]:
        mine = table[table[amplitude] == level].sort_values("frequency [Hz]").to_dict("records")
        yield from ({str(key): cell for key, cell in mine[at].items()} for at in spread(len(mine), frequencies))


def corner(result: Result) -> Markup | None:
    """Ellipses that hold two parameters at once with 95 %, in the coordinates of the fit; None of fewer than two.

    Notes: a strictly positive parameter is fitted by its logarithm, in which the ellipse is one; its radius is
    sqrt(2 F(0.95; 2, nu)) standard errors, nu the degrees of freedom of the errors (Satterthwaite).
    """
    rows = [row for row in parameter_rows(replace(result, profile={})) if row.name in FIVE]
    known = [row.name for row in rows if row.error and result.covariance.stderr(row.name)]
    if len(known) < 2:
        return None
    correlation = {frozenset(pair): size for *pair, size in result.covariance.correlations()}
    cells, told = [], []
    for down, low in enumerate(rows):
        for across, left in enumerate(rows[:down]):
            at = _LEFT + _PITCH * across, _TOP + _PITCH * down
            if low.name in known and left.name in known:
                size = correlation[frozenset((left.name, low.name))]
                cells.append((*at, *_drawn(result, (left.name, low.name), size, *at), f"{size:+.2f}", abs(size) > 0.9))
                told.append(f"{left.name}/{low.name} {size:+.2f}")
            else:
                cells.append((*at, "", "", "", False))
    unknown = [f"{row.name}: {' '.join(words)}" for row in rows if (words := _untold(row, result))]
    diagonal = []
    for n, row in enumerate(rows):
        lines = filter(None, (row.value, f"± {row.error}" if row.error else "", row.unit.replace("-", "")))
        diagonal.append((_LEFT + _PITCH * n, _TOP + _PITCH * n, row.name, [*lines], _untold(row, result)))
    alt = f"95 % confidence ellipses of pairs of parameters; correlations {', '.join(told)}"
    context = {
        "title": "Which values go together",
        "alt": "; ".join([alt, *unknown]),
        "width": _LEFT + _PITCH * len(FIVE),
        "height": _TOP + _PITCH * len(rows) + 18.0,
        "cells": cells,
        "side": _CELL,
        "pitch": _PITCH,
        "diagonal": diagonal,
        "ends": [*_ends(rows)],
    }
    return Markup(filled("corner.html", context))


def _untold(row: Row, result: Result) -> Sequence[str]:
    """In short lines what the tests do not tell of a parameter; none where they tell its value."""
    if not row.error:
        return row.state or "at least value", "no information"
    value = result.model.values[row.name]  # noqa: PD011  # no frame
    wide = result.covariance.half(row.name) >= abs(value)
    return ("unknown by", "100 % or more") if wide else ()


def _drawn(result: Result, pair: tuple[str, str], correlation: float, left: float, top: float) -> tuple[str, str]:
    """The ellipse of a pair in its cell, and the 95 % intervals of either alone."""
    covariance = result.covariance
    chosen = np.array(covariance.names)[:, None] == np.array(pair)
    radius = np.sqrt(2.0 * fdtri(2.0, covariance.freedom(chosen).min(), 0.95))
    scale = _CELL / 2.0 / (_ROOM * radius)
    angle = np.linspace(0.0, 2.0 * np.pi, _CORNERS, endpoint=False)
    x, y = np.cos(angle), correlation * np.cos(angle) + np.sqrt(max(1.0 - correlation**2, 0.0)) * np.sin(angle)
    middle = left + _CELL / 2.0, top + _CELL / 2.0
    corners = zip(middle[0] + scale * radius * x, middle[1] - scale * radius * y, strict=True)
    outline = "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in corners) + "Z"
    half = [scale * covariance.half(name) / (covariance.stderr(name) or np.inf) for name in pair]
    rules = [f"M{middle[0] + side * half[0]:.1f} {top:.1f}v{_CELL:.1f}" for side in (-1.0, 1.0)]
    rules += [f"M{left:.1f} {middle[1] + side * half[1]:.1f}h{_CELL:.1f}" for side in (-1.0, 1.0)]
    return outline, "".join(rules)


def _ends(rows: Sequence[Row]) -> Iterator[tuple[float, float, str, str]]:
    """Where the ends of the intervals stand beside the cells: below the columns, left of the rows."""
    for n, row in enumerate(rows):
        low, _, high = row.interval.partition(" to ")
        place = _PITCH * n + _CELL / 2.0
        for sign, end, anchor in ((-1.0, low, "start"), (1.0, high, "end")):
            if n < len(rows) - 1:
                yield _LEFT + place + 0.5 * sign * _CELL, _TOP + _PITCH * len(rows) + 10.0, end, anchor
            if n:
                yield _LEFT - 5.0, _TOP + place - _END * sign * _CELL + 4.0, end, "end"
