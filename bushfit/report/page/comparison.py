"""Content of the page of a comparison: parameters, stiffness and loss factor side by side, and their differences."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from bushfit.caveat import to_caveats
from bushfit.report import plots
from bushfit.report.compare_document import ComparisonFile
from bushfit.report.compared import (
    FAMILY_HEADS,
    LOSS,
    PlaceDifferences,
    family_cells,
    format_difference,
    format_p_value,
    parameter_cells,
    place_differences,
)
from bushfit.report.page import render_page
from bushfit.report.page.report import MOST, group_warnings, summarize_conditions
from bushfit.report.page.svg import picture
from bushfit.report.page.values import spread_points
from bushfit.report.results import ResultFile
from bushfit.units import format_aligned, format_range, number, split_header

#: Largest product of the numbers of results and of directions and specimens for which the page has a figure.
_MOST_DRAWN = 12
#: Largest numbers in the table of values: frequencies and amplitudes of each direction or specimen, and all rows.
_FREQUENCIES, _AMPLITUDES, _ROWS = 3, 2, 24
#: Test conditions that affect the properties of rubber; the page states a difference in them.
_CONDITIONS = ("Temperature", "Preload")


def comparison_page(comparison: ComparisonFile, chart: ResultFile | None = None) -> str:
    """Make the HTML page of a comparison.

    Args:
        comparison: validated comparison.
        chart: figure of the comparison; None to make it.

    Returns:
        The page as HTML.
    """
    names, compared, differences = comparison.names, comparison.compared, place_differences(comparison)
    conditions = [summarize_conditions(source.conditions for source in entry.inputs) for entry in compared]
    labels: dict[tuple[str, str], list[str]] = {}
    for entry in compared:
        inputs = [(str(source.file), source.sha256) for source in entry.inputs]
        for file, sha256 in dict.fromkeys([(entry.source, entry.sha256), *inputs]):
            if sha256:
                labels.setdefault((file, sha256), []).append(entry.label)
    moduli = all(results[0].stiffness.startswith("modulus") for results in differences.values())
    pictures = []
    if len(names) * len(differences) <= _MOST_DRAWN:
        figure = chart.content() if chart else plots.comparison.comparison_figure(comparison)
        pictures.append(picture(figure, "compare", figure.heading.get_text()))
    context = {
        "document": comparison,
        "names": names,
        "resisted": "modulus" if moduli else "stiffness",
        "entries": [{"of": entry, "conditions": stated} for entry, stated in zip(compared, conditions, strict=True)],
        "differ": [name for name in _CONDITIONS if len({stated[name] for stated in conditions}) > 1],
        "sizes": [difference_sizes(one) for of_place in differences.values() for one in of_place],
        "family_heads": FAMILY_HEADS,
        "family_rows": [*family_cells(comparison)],
        "most": MOST,
        "cells": parameter_cells,
        "chance": format_p_value,
        "pictures": pictures,
        "tabled": [*value_rows(differences)][: 2 * _ROWS],
        "warnings": group_warnings(to_caveats(comparison.warnings, comparison.warning_kinds)),
        "files": [(f"{', '.join(letters)}: {file}", sha256) for (file, sha256), letters in labels.items()],
    }
    return render_page("compare.html", context)


def difference_sizes(one: PlaceDifferences) -> dict[str, str]:
    """Summarise the differences of a result from the first one in a direction or specimen, as texts.

    Returns:
        Texts by key: `label`, `place`, range over the operating points of the relative difference of the stiffness |K|
        [%] (`stiffness`) and of the absolute difference of the loss factor (`loss`), and the number of significant
        points (`stiffness_sure`, `loss_sure`).
    """
    row, table = {"label": one.label, "place": one.place}, one.table
    for key, header, scale, unit in zip(("stiffness", "loss"), one.changes, (100.0, 1.0), (" %", ""), strict=True):
        values, low, high = scale * one.band(header)
        finite_ends = np.sort(values[np.isfinite(values)])[[0, -1]].tolist() if np.isfinite(values).any() else []
        ends = dict.fromkeys(format_difference(end, 0.1 * max(map(abs, finite_ends))) for end in finite_ends)
        row[key] = " to ".join(ends) + unit
        significant = int((table[f"{header}, significant"] == "yes").sum())
        count = "all" if significant == len(table) else f"{significant} of"
        sentence = f"significant at {count} {len(table)} points" if significant else "not significant"
        row[f"{key}_sure"] = sentence if (high - low).any() else "error not known"
    return row


def value_rows(differences: Mapping[str, Sequence[PlaceDifferences]]) -> Iterator[tuple[Any, ...]]:
    """Rows of the table of values: the first result and each other one at a few operating points.

    Args:
        differences: differences of each result from the first, by direction or specimen.

    Yields:
        Direction or specimen, label, frequency, amplitude; then for stiffness and for loss factor a tuple: both values,
        difference, 95 % interval of the difference, and True if it is significant when all points are tested together.
    """
    all_differences = [one for of_place in differences.values() for one in of_place]
    point_limit = max(_ROWS // max(len(all_differences), 1), 1)
    amplitudes = min(point_limit, _AMPLITUDES)
    for one in all_differences:
        (_, length), (_, unit) = split_header(one.amplitude), split_header(one.stiffness)
        relative, loss = one.changes
        kinds = (one.stiffness, relative, f" {unit}", 100.0, " %"), (LOSS, loss, "", 1.0, "")
        frequency, amplitude = (one.table[header].to_numpy() for header in ("frequency [Hz]", one.amplitude))
        for index in spread_points(amplitude, frequency, amplitudes, min(point_limit // amplitudes, _FREQUENCIES)):
            row, cells = one.table.iloc[index], []
            for quantity, difference, suffix, scale, percent in kinds:
                value, low, high = (scale * row[f"{difference}{end}"] for end in ("", ", low", ", high"))
                size, *ends = (format_difference(end, high - low) for end in (value, low, high))
                sides = format_aligned([row[f"{who} {quantity}"] for who in ("reference", "other")], 4)
                significant = row[f"{difference}, significant"] == "yes"
                cells.append((*(side + suffix for side in sides), size + percent, " to ".join(ends), significant))
            point = f"{number(frequency[index], 4)} Hz", format_range(length or "", amplitude[index])
            yield one.place, one.label, *point, *cells
