"""Content of the page of a batch, `index.html`: parts that fail or differ, statistics, and a table of all parts."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from markupsafe import Markup

from bushfit.effects.contract import Array
from bushfit.errors import ModelError
from bushfit.model.file import read_document, require_schema
from bushfit.report import plots
from bushfit.report.batch_document import BATCH_SCHEMA, BatchFile, PartTable
from bushfit.report.page import filled, rendered
from bushfit.report.page.svg import Picture, picture
from bushfit.report.results import ResultFile, contents
from bushfit.report.tables import spread
from bushfit.units import number, split_header
from bushfit.validation import validate_tables

#: Largest number of cells of the table of parts, where a curve is three cells: the page stays below 500 kB.
_MOST_CELLS = 4000
#: Largest number of parts that a list names.
_MOST_NAMED = 20
#: Size of a sparkline [pixels], and smallest relative deviation at its upper and lower edge.
_WIDTH, _HEIGHT, _LEAST_SCALE = 110.0, 26.0, 0.005
_DIFFERENT, _USUAL = "#b4500c", "#1f4e9c"
#: Order of the rows: parts that need attention first.
_ORDER = ("error", "fail", "conditional fail", "not judged", "differs", "conditional pass", "")
#: Text columns that the table of parts contains if they differ between parts.
_LABELS = ("campaign name", "subgroup", "verdict", "named effects", "on a bound")
_TONES = {"pass": "good", "conditional pass": "fair", "not judged": "fair", "conditional fail": "bad", "fail": "bad"}


def read_batch(folder: Path) -> list[ResultFile]:
    """Read and check the document of a batch, batch.json, as the JSON result file `batch`.

    Raises:
        ModelError: the document is missing, or not as bushfit writes it.
    """
    file = folder / "batch.json"
    document = read_document(file)
    require_schema(document, file, "a batch", BATCH_SCHEMA, hint="run the batch again with --resume")
    validate_tables(document, file, BatchFile, kind=ModelError)
    return [ResultFile("batch", "json", document)]


def index_page(files: Sequence[ResultFile], folder: Path, base: str = "") -> str:
    """Make the HTML page of a batch.

    Args:
        files: document of the batch.
        folder: results folder of the batch; the page links each part to its report in this folder, or to its subfolder.
        base: prefix of the links, if the page is written to another folder.

    Returns:
        The page as HTML.
    """
    batch = validate_tables(contents(files, "json")["batch"], None, BatchFile, kind=ModelError)
    parts, curves = batch.parts, Curves.from_batch(batch)
    status = [part_status(part) for part in parts]
    labels = [name for name in _LABELS if len({part.labels.get(name, "") for part in parts}) > 1]
    heads = ["result"] * bool(batch.limits) + labels
    row_limit = max(1, _MOST_CELLS // (len(heads) + len(batch.quantities) + (4 if curves else 1)))
    ordered = sorted(range(len(parts)), key=lambda index: _ORDER.index(status[index]))
    important = sum(map(bool, status))
    first, ordinary = ordered[: min(important, row_limit)], ordered[important:]
    chosen = first + [ordinary[index] for index in spread(len(ordinary), max(0, row_limit - len(first)))]
    warnings = list(dict.fromkeys(line for index in chosen for line in parts[index].warnings))
    reported = [bool(part.folder) and (folder / part.folder / "report.html").exists() for part in parts]
    links = [
        base + quote(part.folder) + ("/report.html" if report else "/") if part.folder else ""
        for part, report in zip(parts, reported, strict=True)
    ]
    listed: dict[str, list[tuple[PartTable, str]]] = {}
    for part, state, link in zip(parts, status, links, strict=True):
        listed.setdefault(state, []).append((part, link))
    rows = []
    for index in chosen:
        part = parts[index]
        mean = 100.0 * float(np.expm1(np.log1p(curves.relative[index]).mean())) if curves else np.nan
        numbers = ", ".join(str(warnings.index(line) + 1) for line in part.warnings)
        remarks = [part.error, part.poor_fit and "poor fit", part.differs and f"differs: {part.differs}"]
        remarks += [*([] if part.poor_fit else part.doubtful.values()), numbers and f"warnings {numbers}"]
        names = [split_header(header)[0] for header in batch.quantities]
        tones = ["bad" if name in part.misses else "fair" if name in part.deviations else "" for name in names]
        values = ["" if value is None else number(value, 4) for value in part.values]
        rows.append(
            {
                "part": part,
                "link": links[index],
                "texts": [part.result or ""] * bool(batch.limits) + [part.labels.get(name, "") for name in labels],
                "curve": curves.sparkline(index, differs=bool(part.deviations)) if curves else "",
                "deviation": number(mean, 2, "+") if np.isfinite(mean) else "",
                "cells": list(zip(values, tones, strict=True)),
                "remarks": "; ".join(filter(None, remarks)),
            }
        )
    units = {header: split_header(header) for header in batch.quantities}
    compared = [table.parts for table in batch.quantities.values() if table.detectable]
    context: dict[str, Any] = {
        "batch": batch,
        "bad": bool(batch.missed or batch.failed),
        "fails": [*listed.get("fail", []), *listed.get("conditional fail", [])][:_MOST_NAMED],
        "unjudged": listed.get("not judged", [])[:_MOST_NAMED],
        "errors": listed.get("error", [])[:_MOST_NAMED],
        "differing": listed.get("differs", [])[:_MOST_NAMED],
        "most_named": _MOST_NAMED,
        "parts_compared": max(compared or [table.parts for table in batch.quantities.values()], default=0),
        "quantities": [
            (table, units[header][0], "" if units[header][1] in (None, "-") else f" {units[header][1]}")
            for header, table in batch.quantities.items()
        ],
        "curves": curves,
        "curves_picture": curves.picture(parts) if curves else None,
        "heads": heads,
        "columns": ["measured stiffness, deviation [%]"] * bool(curves) + [*batch.quantities],
        "rows": rows,
        "warnings": warnings,
        "shown": (len(first), important, len(chosen) - len(first)),
        "tones": _TONES,
    }
    return rendered("index.html", context)


def part_status(part: PartTable) -> str:
    """Reason why a part of a batch needs attention, such as "error", "fail" or "differs"; empty if there is none."""
    result = "" if part.result in ("pass", None) else str(part.result)
    if part.deviations and result in ("", "conditional pass"):
        return "differs"
    return "error" if part.error else result


@dataclass(frozen=True, eq=False)
class Curves:
    """Measured stiffness curves of the n parts of a batch, at k common operating points.

    Args:
        headers: column headers of the points, with units, (k,).
        values: stiffness magnitude in the unit of the headers, (n, k), NaN for parts without a curve.
        usual: True for parts that do not differ from the others, have no poor fit and have a curve, (n,).
    """

    headers: Sequence[str]
    values: Array
    usual: Array

    @classmethod
    def from_batch(cls, batch: BatchFile) -> "Curves | None":
        """Curves of the parts of a batch; None if no usual part has a curve."""
        unknown = [np.nan] * len(batch.curve_points)
        values = np.array([unknown if part.curve is None else part.curve for part in batch.parts], dtype=float)
        usual = np.array([not (part.deviations or part.poor_fit or part.curve is None) for part in batch.parts])
        return cls(batch.curve_points, values, usual) if unknown and usual.any() else None

    @cached_property
    def relative(self) -> Array:
        """Relative deviation of |K| of each part from the median |K| of all parts, at each operating point, (n, k)."""
        return np.asarray(self.values / np.nanmedian(self.values, axis=0) - 1.0)

    @cached_property
    def scale(self) -> float:
        """Relative deviation of |K| at both edges of a sparkline: 1.5 times the largest deviation of a usual part."""
        return max(_LEAST_SCALE, 1.5 * float(np.abs(self.relative[self.usual]).max()))

    def picture(self, parts: Sequence[PartTable]) -> Picture:
        """Drawing of the median and range of the usual curves, and of the single curves of the other parts."""
        curves = zip(parts, self.values, self.usual, strict=True)
        singles = {part.name: curve for part, curve, is_usual in curves if part.curve and not is_usual}
        chart = plots.batch.curves_figure(self.headers, self.values[self.usual], singles)
        return picture(chart, "curves", chart.heading.get_text())

    def sparkline(self, index: int, *, differs: bool) -> Markup:
        """Draw the relative deviation of one curve from the median as a small SVG, with the range of the usual parts.

        Args:
            index: index of the part.
            differs: True to draw the curve in the colour of parts that differ.

        Returns:
            SVG element; empty for a part without a curve.
        """
        line, usual = self.relative[index], self.relative[self.usual]
        if not np.isfinite(line).all():
            return Markup()
        x = np.linspace(1.0, _WIDTH - 1.0, line.size)

        def path(x: Array, relative: Array) -> str:
            y = (0.5 - 0.46 * np.clip(relative / self.scale, -1.0, 1.0)) * _HEIGHT
            return "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True))

        ends = (number(100.0 * float(end), 2, "+") for end in (line.min(), line.max()))
        band = path(np.concatenate([x, x[::-1]]), np.concatenate([usual.min(axis=0), usual.max(axis=0)[::-1]]))
        drawn = {"band": band, "line": path(x, line), "color": _DIFFERENT if differs else _USUAL}
        alt = f"{' to '.join(ends)} % off the median"
        return Markup(filled("spark.html", {"alt": alt, "width": _WIDTH, "height": _HEIGHT, **drawn}))
