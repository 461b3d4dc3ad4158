"""What the page of a comparison tells: what was compared, what differs, parameters and curves, what is left open."""

from collections.abc import Iterator, Sequence
from dataclasses import astuple
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from bushfit.geometry import Bushing
from bushfit.model.file import read_document
from bushfit.report.compare_document import ComparedEntry
from bushfit.report.compared import FAMILY_HEADS, Heads, Panel, SideBySide, Sides, chance, parameter_cells, signed
from bushfit.report.page.chart import DASHES, MOST_PLACES, Rule, Series, chart, colors, every_nth, span_of
from bushfit.report.page.chart import Panel as PlacePanel
from bushfit.report.page.report import MOST, conditions, corners, tube
from bushfit.report.page.sweeps import LOG_FREQUENCIES
from bushfit.report.results import ResultFile, json_file
from bushfit.report.tables import numbers
from bushfit.units import format_aligned, format_range, number, split_header

#: Curves of a page, and points of all of them, of which each has a value and a band: with these it stays below 500 kB;
#: but no curve has fewer than `_FEWEST`.
_MOST_CURVES, _MOST_POINTS, _FEWEST = 300, 7000, 12
#: Frequencies and amplitudes of a place whose values are tabled, and rows of all places together.
_FREQUENCIES, _AMPLITUDES, _ROWS = 3, 2, 24
#: Conditions of tests that change a rubber.
_CONDITIONS = ("Temperature", "Preload")


def read_comparison(folder: Path) -> list[ResultFile]:
    """The comparison in a folder.

    Raises:
        ModelError: a compare.json that is not as bushfit writes it.
    """
    file = folder / "compare.json"
    document = read_document(file)
    SideBySide.of(document, file)
    return [json_file("compare", document)]


def comparison_context(found: SideBySide) -> dict[str, Any]:
    """All that the template of a comparison asks for."""
    document, names = found.document, found.names
    named, *others = names.values()
    families = bool(document["families"])
    curves = 8 * len(names)  # of a place: four pictures, each at two levels
    places = found.places[: min(MOST_PLACES, _MOST_CURVES // curves)]
    shown = [found.sides(place) for place in places]
    entries = [_entry(entry) for entry in document["compared"]]
    looks = dict(zip(names, colors(len(names)), strict=True))
    most = max(_FEWEST, _MOST_POINTS // max(sum(len(panel.lines) for sides in shown for panel in sides.panels), 1))
    body = document["compared"][0]["bushing"]
    title = f"{others[0]} against {named}" if len(others) == 1 else f"{len(others)} results against {named}"
    return {
        "document": document,
        "names": names,
        "resisted": "modulus" if all(sides.panels[0].header.startswith("modulus") for sides in shown) else "stiffness",
        "title": f"Model families on {body.name if body else document['compared'][0]['source']}" if families else title,
        "entries": entries,
        "differ": [name for name in _CONDITIONS if len({entry["conditions"].get(name) for entry in entries}) > 1],
        "sizes": [row for place in places for row in _sizes(found, place)],
        "family_heads": FAMILY_HEADS,
        "family_rows": [*found.family_cells()],
        "judged": families and len(others) + document["words"][0].startswith("use "),  # older files give no advice
        "most": MOST,
        "cells": parameter_cells,
        "chance": chance,
        "places": [PlacePanel(s.place, [_picture(s, panel, looks, most) for panel in s.panels], []) for s in shown],
        "left_places": len(found.places) - len(places),
        "tabled": [*_tabled(found, places)][: 2 * _ROWS],
        "files": _files(document["compared"]),
    }


def _entry(entry: ComparedEntry) -> dict[str, Any]:
    """What a result is of, in words: its body, its tests and their conditions."""
    bushing, measured = entry["bushing"], entry["measured"]
    tests = "given, not fitted"
    if measured:
        strain = format_range("%", *(100.0 * end for end in measured.strain))
        tests = f"{format_range('Hz', *measured.frequency)}, strain {strain}, {', '.join(measured.directions)}"
    stated = dict(conditions(source.conditions for source in entry["inputs"]))
    body = tube(Bushing(*astuple(bushing))) if bushing else "rubber compound"
    return {"of": entry, "body": body, "tests": tests, "conditions": stated}


def _sizes(found: SideBySide, place: str) -> Iterator[dict[str, Any]]:
    """How far each is off the first at a place: least and largest difference, and at how many points it is sure."""
    for label, table in found.at(place).items():
        heads = Heads.of(table)
        row: dict[str, Any] = {"label": label, "place": place}
        for key, header, scale, unit in (("stiffness", heads.relative, 100.0, " %"), ("loss", heads.loss, 1.0, "")):
            (values,) = scale * numbers(table, header)
            known = np.sort(values[np.isfinite(values)])[[0, -1]].tolist() if np.isfinite(values).any() else []
            ends = dict.fromkeys(signed(end, 0.1 * max(map(abs, known))) for end in known)
            row[key] = " to ".join(ends) + unit
            sure = int((table[f"{header}, sure"] == "yes").sum())
            count = "all" if sure == len(table) else f"{sure} of"
            certain = np.ptp(numbers(table, f"{header}, low", f"{header}, high"), axis=0).any()
            said = f"sure at {count} {len(table)} points" if sure else "not shown"
            row[f"{key}_sure"] = said if certain else "of unknown error"
        yield row


def _picture(sides: Sides, panel: Panel, looks: dict[str, str], most: int) -> Markup:
    what, unit = split_header(panel.header)
    unit = (unit or "").removesuffix("-")
    series, words = [], []
    for line in panel.lines:
        at = every_nth(line.x.size, most)
        name = f"{line.label}, {sides.levels[line.level]}"
        x, value, low, high = (each[at] for each in (line.x, line.value, line.low, line.high))
        alone = (x, value) if x.size == 1 else None
        series.append(Series(name, looks[line.label], DASHES[line.level], (x, value), (x, low, high), alone))
        words.append(f"{name}: {span_of(line.value)} {unit}".strip())
    x = panel.lines[0].x
    log = bool(x.max() > LOG_FREQUENCIES * x.min() > 0.0)
    rules = [Rule(0.0, f"{next(iter(looks))}, the reference")] if panel.least else []
    alt = f"{what} over {split_header(sides.along)[0]}, {sides.place}; {'; '.join(words)}"
    labels = sides.along, f"{panel.header}"
    return chart(f"{sides.place}: {what}", labels, series, alt, log=log, rules=rules, least=panel.least)


def _tabled(found: SideBySide, places: Sequence[str]) -> Iterator[tuple[Any, ...]]:
    """Values of the first and of each other at some corners of the grid, with the intervals of their differences.

    Rows of cells: place, label, frequency, amplitude; then of stiffness and loss factor both values, their difference
    with its interval, and whether it is more than chance at all points at once.
    """
    tables = [(label, place, table) for place in places for label, table in found.at(place).items()]
    most = max(_ROWS // max(len(tables), 1), 1)
    amplitudes = min(most, _AMPLITUDES)
    for label, place, table in tables:
        heads, loss = Heads.of(table), "loss factor [-]"
        ((_, length), (_, unit)) = (split_header(header) for header in heads[:2])
        kinds = ((heads.stiffness, heads.relative, f" {unit}", 100.0, " %"), (loss, heads.loss, "", 1.0, ""))
        for row in corners(table, heads.amplitude, amplitudes, min(most // amplitudes, _FREQUENCIES)):
            cells = []
            for what, difference, of, scale, percent in kinds:
                value, low, high = (scale * row[f"{difference}{end}"] for end in ("", ", low", ", high"))
                shown, *ends = (signed(each, high - low) for each in (value, low, high))
                sides = format_aligned([row[f"{who} {what}"] for who in ("reference", "other")], 4)
                sure = row[f"{difference}, sure"] == "yes"
                cells.append((*(side + of for side in sides), shown + percent, " to ".join(ends), sure))
            at = f"{number(row['frequency [Hz]'], 4)} Hz", format_range(length or "", row[heads.amplitude])
            yield place, label, *at, *cells


def _files(compared: Sequence[ComparedEntry]) -> list[tuple[str, str]]:
    """Every file behind the comparison with its hash, and what it belongs to: what was compared, and its tests."""
    found: dict[tuple[str, str], list[str]] = {}
    for entry in compared:
        named = [(entry["source"], entry["sha256"] or ""), *((str(s.file), s.sha256) for s in entry["inputs"])]
        for each in named:
            found.setdefault(each, []).append(entry["label"])
    words_of = {file: f"{', '.join(dict.fromkeys(labels))}: {file[0]}" for file, labels in found.items()}
    return [(words, sha256) for (_, sha256), words in words_of.items() if sha256]
