"""The page of a batch: what came of it, a control chart of each quantity, and a row a bushing to sort."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from markupsafe import Markup

from bushfit.effects.contract import Array
from bushfit.errors import ModelError
from bushfit.model.file import read_document, require_schema
from bushfit.report.contents import Contents, Documents, Page, Tables
from bushfit.report.page import rendered
from bushfit.report.page.chart import LIMIT, Rule, Series, chart
from bushfit.report.page.readback import canonical, read_table
from bushfit.report.tables import BETWEEN
from bushfit.units import for_people, number
from bushfit.validation import Number, WholeNumber, check_tables

#: What "schema" of the document says.
SCHEMA = "bushfit/batch/1"
#: Cells of the table, and points of a chart, at most: with these the page stays below 500 kB.
_MOST_CELLS, _MOST_POINTS = 4000, 400
#: Charts at most, those with limits first.
_MOST_CHARTS = 12
#: Colour of what lies beyond a chart.
FAR = "#b4500c"
#: Control limits, in standard deviations of the batch about its median, as on Shewhart's charts.
_CONTROL = 3.0
#: Bushings that a quantity must be known of for a chart.
_FEWEST = 3
#: How the rows are ordered: what needs a look first.
_ORDER = ("failed", "fail", "conditional fail", "conditional pass")
#: Columns of words, and those that end a row as remarks.
_WORDS = ("status", "limits", "verdict", "named effects")
_REMARKS = ("out of limits", "on the edge", "on a bound", "warnings")
#: What lies further from the median than this, in standard deviations of the batch, is drawn at the edge of a chart.
_FURTHEST = 12.0
#: Limits are told by these words, and coloured so.
_TONES = {"pass": "good", "conditional pass": "fair", "conditional fail": "bad", "fail": "bad"}


@dataclass(frozen=True)
class Quantity:
    """quantities: of a column its median, robust standard deviation, and the lowest and highest allowed."""

    median: Number
    sigma: Number
    allowed: tuple[Number | None, Number | None] = (None, None)


@dataclass(frozen=True)
class Batch:
    """batch.json, as far as the page tells it."""

    title: str
    rows: WholeNumber
    done: WholeNumber
    quantities: Mapping[str, Quantity]
    limits: Mapping[str, WholeNumber]
    warnings: tuple[str, ...] = ()


def is_batch(folder: Path) -> bool:
    """Whether a folder is that of a batch."""
    return (folder / "batch.json").exists() or (folder / "batch.csv").exists()


def read_batch(folder: Path, base: str = "") -> Contents:
    """What a batch wrote, with its page; links begin with `base`.

    Raises:
        ModelError: files that are missing, or not as bushfit writes them.
    """
    file = folder / "batch.json"
    document = read_document(file)
    require_schema(document, file, "a batch", SCHEMA, hint="run the batch again with --resume")
    check_tables(document, file, Batch, kind=ModelError)
    table = read_table(folder, "batch")
    if table is None or not {"name", "status", "folder", "warnings"} <= set(table):
        raise ModelError(
            "the table of the batch is missing", file=folder / "batch.csv", hint="run the batch again with --resume"
        )
    return Contents({"batch": document}, {"batch": lambda: table}, {}, {"index": page_of(folder, base)})


def page_of(folder: Path, base: str = "") -> Page:
    """What makes the page of a batch, its bushings linked to their reports in a folder; links begin with `base`."""
    reports = folder.glob("bushings/*/report.html")
    reported = frozenset(f"{report.parent.parent.name}/{report.parent.name}" for report in reports)
    return partial(index_page, reported=reported, base=base)


def index_page(documents: Documents, tables: Tables, *, reported: Collection[str] = (), base: str = "") -> str:
    """The page of a batch as HTML.

    Args:
        documents, tables: `batch` of each.
        reported: folders of the bushings that have a report of their own.
        base: what links begin with.
    """
    batch = check_tables(documents["batch"], None, Batch, kind=ModelError)
    table = canonical(tables["batch"])
    quantities = {header: each for header, each in batch.quantities.items() if header in table}
    shown = [name for name in _WORDS if name in table and any(table[name])]
    rows = _ordered(table)
    most = max(1, _MOST_CELLS // (len(shown) + len(quantities) + 1))
    warned = [cell.split(BETWEEN) if cell else [] for cell in table["warnings"]]
    footnotes = list(dict.fromkeys(line for at in rows[:most] for line in warned[at]))
    for at in rows[:most]:
        table.loc[at, "warnings"] = ", ".join(str(footnotes.index(line) + 1) for line in warned[at])
    charts = sorted(quantities, key=lambda header: all(end is None for end in quantities[header].allowed))
    charts = [header for header in charts if np.isfinite(table[header]).sum() >= _FEWEST]
    return rendered(
        "index.html",
        {
            "batch": batch,
            "charts": [
                _chart(header, quantities[header], table[header].to_numpy()) for header in charts[:_MOST_CHARTS]
            ],
            "left_charts": max(0, len(charts) - _MOST_CHARTS),
            "heads": [*shown, *(_for_people(header, each)[0] for header, each in quantities.items())],
            "remarked": any(any(table[name]) for name in _REMARKS if name in table),
            "footnotes": footnotes,
            "texts": len(shown),
            "rows": [_row(table.iloc[at], shown, quantities, reported, base) for at in rows[:most]],
            "left_rows": max(0, len(rows) - most),
            "tones": _TONES,
            "failed": [
                (row["name"], row["error"]) for row in table[table["status"] == "failed"].head(20).to_dict("records")
            ],
        },
    )


def _ordered(table: Any) -> list[int]:
    """Numbers of the rows, those that need a look first, else as they stand."""
    limits = table["limits"] if "limits" in table else [""] * len(table)
    words = [status if status == "failed" else limit for status, limit in zip(table["status"], limits, strict=True)]
    order = [_ORDER.index(word) if word in _ORDER else len(_ORDER) for word in words]
    return np.argsort(order, kind="stable").tolist()


def _row(
    row: Any, shown: list[str], quantities: Mapping[str, Quantity], reported: Collection[str], base: str
) -> dict[str, Any]:
    """A bushing in a row: its link, its words, and its numbers with whether they are out of limits."""
    folder = row["folder"]
    page = "/report.html" if folder in reported else "/"
    cells = []
    for header, quantity in quantities.items():
        value, (low, high) = float(row[header]), quantity.allowed
        out = (low is not None and value < low) or (high is not None and value > high)
        cells.append(("" if math.isnan(value) else number(value * _for_people(header, quantity)[1], 4), out))
    link = base + quote(folder) + page if folder else ""
    remarks = "; ".join(f"{name}: {row[name]}" for name in _REMARKS if row.get(name))
    return {
        "name": row["name"],
        "link": link,
        "words": [row[name] for name in shown],
        "cells": cells,
        "remarks": remarks,
    }


def _for_people(header: str, quantity: Quantity) -> tuple[str, float]:
    """A header with the unit in which people read its numbers, and the factor to it."""
    name, _, unit = header.rpartition(" [")
    unit, factor = for_people(unit.rstrip("]"), 1.0, quantity.median)
    return f"{name} [{unit}]", factor


def _chart(header: str, quantity: Quantity, values: Array) -> Markup:
    """A control chart: values in the manifest's order, median and three standard deviations, limits."""
    header, factor = _for_people(header, quantity)
    at, values = np.arange(1.0, values.size + 1.0), values * factor
    median, sigma = quantity.median * factor, quantity.sigma * factor
    limits = [end * factor for end in quantity.allowed if end is not None]
    low, high = (end if end is None else end * factor for end in quantity.allowed)
    out = (values < (-math.inf if low is None else low)) | (values > (math.inf if high is None else high))
    ends = min(median - _FURTHEST * sigma, *limits, median), max(median + _FURTHEST * sigma, *limits, median)
    far = ((values < ends[0]) | (values > ends[1])) & (sigma > 0.0)
    shown = np.where(far, np.clip(values, *ends), values)
    thin = np.arange(values.size) % max(1, -(-values.size // _MOST_POINTS)) == 0
    looks = (
        ("", "#1f4e9c", ~out & ~far & thin),
        ("out of limits", LIMIT, out & _some(out)),
        ("further out", FAR, far & ~out & _some(far)),
    )
    series = [Series(name, color, points=(at[which], shown[which])) for name, color, which in looks]
    dot = 4.6 if values.size <= 60 else 3.0
    rules = [Rule(median, "median")]
    if sigma > 0.0:
        control = median - _CONTROL * sigma, median + _CONTROL * sigma
        rules += [Rule(control[0], "3 standard deviations", dashes="2 3"), Rule(control[1], "", dashes="2 3")]
    rules += [Rule(end, "" if place else "limit", limit=True, dashes="6 3") for place, end in enumerate(limits)]
    words = (
        f"{header} of {int(np.isfinite(values).sum())} bushings: median {number(median, 4)}, robust standard deviation "
    )
    words += f"{number(sigma, 2)}, {int(out.sum())} out of limits"
    there = [one for one in series if one.points and one.points[0].size]
    unit = header.rpartition(" [")[2].rstrip("]")
    return chart(
        header, ("bushing, in the manifest's order", unit.replace("-", "")), there, words, rules=rules, dot=dot
    )


def _some(which: Array) -> Array:
    """At most so many of the chosen as a chart draws, evenly, (n,) bool."""
    return (np.cumsum(which) - 1) % max(1, -(-int(which.sum()) // _MOST_POINTS)) == 0
