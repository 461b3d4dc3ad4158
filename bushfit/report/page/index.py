"""Content of the page of a batch, `index.html`: parts that fail or differ, statistics, and a table of all parts."""

from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from bushfit.caveat import to_caveats
from bushfit.report import plots
from bushfit.report.batch_document import BatchFile, PartTable
from bushfit.report.page import render_page
from bushfit.report.page.svg import picture
from bushfit.report.tables import spread_indices
from bushfit.units import split_header

#: Largest number of cells of the table of parts, where a curve is three cells: the page stays below 500 kB.
_MOST_CELLS = 4000
#: Largest number of parts that a list names.
_MOST_NAMED = 20
#: Smallest relative deviation at the upper and lower edge of a sparkline.
_LEAST_SCALE = 0.005
#: Order of the rows: parts that need attention first.
_ORDER = ("error", "fail", "conditional fail", "not judged", "differs", "conditional pass", "")
#: Text columns that the table of parts contains if they differ between parts (the first: also from the part's name).
_LABELS = ("campaign name", "subgroup", "verdict", "probable effects", "at bound")


def index_page(batch: BatchFile, folder: Path, base: str = "") -> str:
    """Make the HTML page of a batch.

    Args:
        batch: content of batch.json.
        folder: results folder of the batch; the page links each part to its report in this folder, or to its subfolder.
        base: prefix of the links, if the page is written to another folder.

    Returns:
        The page as HTML.
    """
    parts, units = batch.parts, {header: split_header(header) for header in batch.quantities}
    curves = np.array([part.curve or [np.nan] * len(batch.curve_points) for part in parts], dtype=float)
    usual = np.array([bool(part.curve) and not (part.deviations or part.poor_fit) for part in parts])
    has_curves = bool(usual.any())
    relative = curves / np.exp(np.nanmedian(np.log(curves), axis=0)) - 1.0 if has_curves else curves
    scale = max(_LEAST_SCALE, 1.5 * float(np.abs(relative[usual]).max())) if has_curves else 0.0
    heights = np.clip(relative / scale, -1.0, 1.0) if has_curves else relative
    status, links, listed = list[str](), list[str](), {name: list[tuple[PartTable, str]]() for name in _ORDER}
    for part in parts:
        differs = part.deviations and part.result in (None, "pass", "conditional pass")
        result = "" if part.result == "pass" else part.result or ""
        status.append("differs" if differs else "error" if part.error else result)
        page = "report.html" if (folder / part.folder / "report.html").exists() else ""
        links.append(f"{base}{quote(part.folder)}/{page}" if part.folder else "")
        listed[status[-1]].append((part, links[-1]))
    named_twice = all(part.labels.get("campaign name") in ("", part.name) for part in parts)
    labels = [name for name in _LABELS[named_twice:] if len({part.labels.get(name, "") for part in parts}) > 1]
    columns = bool(batch.limits) + len(labels) + len(batch.quantities) + (4 if has_curves else 1)
    row_limit = max(1, _MOST_CELLS // columns)
    ordered = sorted(range(len(parts)), key=lambda index: _ORDER.index(status[index]))
    important = sum(map(bool, status))
    first, ordinary = ordered[: min(important, row_limit)], ordered[important:]
    chosen = first + [ordinary[index] for index in spread_indices(len(ordinary), max(0, row_limit - len(first)))]
    rows, warnings = list[tuple[Any, ...]](), dict[str, list[tuple[str, str]]]()
    caveats = {index: to_caveats(parts[index].warnings, parts[index].warning_kinds) for index in chosen}
    for index in chosen:
        for warning in caveats[index]:
            warnings.setdefault(warning.kind, []).append((parts[index].name, warning.text))
    numbers, summaries = {kind: number for number, kind in enumerate(warnings, start=1)}, list[str]()
    for named in warnings.values():  # such as "3 parts, with the figures of A7: ..."
        names, lines = (list(dict.fromkeys(column)) for column in zip(*named, strict=True))
        several = f"{len(names)} parts{', with the figures of ' + names[0] if len(lines) > 1 else ''}"
        summaries.append(f"{names[0] if len(names) == 1 else several}: {lines[0]}")
    for index in chosen:
        is_known = has_curves and np.isfinite(relative[index]).all()
        mean = 100.0 * np.expm1(np.log1p(relative[index]).mean()) if is_known else None
        notes = sorted({numbers[warning.kind] for warning in caveats[index]})
        curve, drawn = (lines[index].tolist() if is_known else [] for lines in (relative, heights))
        rows.append((parts[index], links[index], curve, drawn, mean, notes))
    pictures = []
    if has_curves:
        singles = {part.name: curves[k] for k, part in enumerate(parts) if part.curve and not usual[k]}
        chart = plots.batch.curves_figure(batch.curve_points, curves[usual], singles)
        pictures.append(picture(chart, "curves", chart.heading.get_text()))
    tables = batch.quantities.values()
    compared = [table for table in tables if table.detectable] or tables
    context: dict[str, Any] = {
        "batch": batch,
        "listed": listed | {"fail": [*listed["fail"], *listed["conditional fail"]]},
        "most_named": _MOST_NAMED,
        "parts_compared": max((table.parts for table in compared), default=0),
        "units": units,
        "scale": scale,
        "band": [heights[usual].min(axis=0).tolist(), heights[usual].max(axis=0).tolist()] if has_curves else [],
        "pictures": pictures,
        "labels": labels,
        "columns": ["measured stiffness, deviation [%]"] * has_curves + [*batch.quantities],
        "rows": rows,
        "warnings": summaries,
        "shown": (len(first), important, len(chosen) - len(first)),
    }
    return render_page("index.html", context)
