"""The page of a batch: what came of it, a control chart of each quantity, and a row a bushing to sort."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Self
from urllib.parse import quote

import numpy as np
import pandas as pd
from markupsafe import Markup

from bushfit.effects.contract import Array
from bushfit.errors import ModelError
from bushfit.model.file import read_document, require_schema
from bushfit.report.contents import Contents, Documents, Tables
from bushfit.report.page import rendered
from bushfit.report.page.chart import LIMIT, Rule, Series, chart
from bushfit.report.page.readback import canonical, read_table
from bushfit.report.tables import BETWEEN
from bushfit.units import for_people, number, split_header
from bushfit.validation import Number, WholeNumber, check_tables

#: What "schema" of the document says.
SCHEMA = "bushfit/batch/1"
#: Cells of the table, and points of a chart, at most: with these the page stays below 500 kB.
_MOST_CELLS, _MOST_POINTS = 4000, 400
#: Charts at most, those with limits first.
_MOST_CHARTS = 12
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


def read_batch(folder: Path, base: str = "", rows: Path | None = None) -> Contents:
    """What a batch wrote, with its page; links begin with `base`.

    Args:
        rows: folder of the batch, where these are not in it yet.

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
    pages = frozenset(
        f"{page.parent.parent.name}/{page.parent.name}" for page in (rows or folder).glob("bushings/*/report.html")
    )
    page = partial(index_page, reported=pages, base=base)
    return Contents({"batch": document}, {"batch": lambda: table}, {}, {"index": page})


def index_page(documents: Documents, tables: Tables, *, reported: Collection[str] = (), base: str = "") -> str:
    """The page of a batch as HTML.

    Args:
        documents, tables: `batch` of each.
        reported: folders of the bushings that have a report of their own.
        base: what links begin with.
    """
    batch = check_tables(documents["batch"], None, Batch, kind=ModelError)
    table = canonical(tables["batch"])
    columns = [_Column.of(name, each, table) for name, each in batch.quantities.items() if name in table]
    shown = [name for name in _WORDS if name in table and any(table[name])]
    remarks = [name for name in _REMARKS if name in table]
    order = _ordered(table)
    first = order[: max(1, _MOST_CELLS // (len(shown) + len(columns) + 1))]
    warned = {at: table["warnings"][at].split(BETWEEN) if table["warnings"][at] else [] for at in first}
    footnotes = list(dict.fromkeys(line for lines in warned.values() for line in lines))
    for at, lines in warned.items():
        table.loc[at, "warnings"] = ", ".join(str(footnotes.index(line) + 1) for line in lines)
    charts = [column for column in columns if np.isfinite(column.known).sum() >= _FEWEST]
    charts.sort(key=lambda column: not column.limits)
    rows = table.to_dict("records")
    context = {
        "batch": batch,
        "charts": [_chart(column) for column in charts[:_MOST_CHARTS]],
        "left_charts": max(0, len(charts) - _MOST_CHARTS),
        "heads": [*shown, *(column.header for column in columns)],
        "remarked": any(any(table[name]) for name in remarks),
        "footnotes": footnotes,
        "texts": len(shown),
        "rows": [
            {
                "name": rows[at]["name"],
                "link": _link(rows[at]["folder"], reported, base),
                "words": [rows[at][name] for name in shown],
                "cells": [(column.cells[at], column.out[at]) for column in columns],
                "remarks": "; ".join(f"{name}: {rows[at][name]}" for name in remarks if rows[at][name]),
            }
            for at in first
        ],
        "left_rows": len(order) - len(first),
        "tones": _TONES,
        "failed": [(row["name"], row["error"]) for row in rows if row["status"] == "failed"][:20],
    }
    return rendered("index.html", context)


@dataclass(frozen=True, eq=False)
class _Column:
    """A quantity of all bushings in the unit in which people read it, NaN where it is not known, (n,)."""

    header: str
    known: Array
    median: float
    sigma: float
    low: float
    high: float

    @classmethod
    def of(cls, name: str, quantity: Quantity, table: pd.DataFrame) -> Self:
        """A column of the table of the batch."""
        what, _, unit = name.rpartition(" [")
        unit, factor = for_people(unit.rstrip("]"), 1.0, quantity.median)
        low, high = quantity.allowed
        ends = (-math.inf if low is None else low * factor, math.inf if high is None else high * factor)
        values = table[name].to_numpy() * factor
        return cls(f"{what} [{unit}]", values, quantity.median * factor, quantity.sigma * factor, *ends)

    @property
    def limits(self) -> list[float]:
        """The ends of what is allowed, as far as there are some."""
        return [end for end in (self.low, self.high) if math.isfinite(end)]

    @cached_property
    def out(self) -> Array:
        """Which bushings are out of limits, (n,) bool."""
        return (self.known < self.low) | (self.known > self.high)

    @cached_property
    def cells(self) -> list[str]:
        """The values as texts."""
        return ["" if math.isnan(value) else number(value, 4) for value in self.known.tolist()]


def _ordered(table: pd.DataFrame) -> list[int]:
    """Numbers of the rows, those that need a look first, else as they stand."""
    limits = table["limits"] if "limits" in table else [""] * len(table)
    words = [status if status == "failed" else limit for status, limit in zip(table["status"], limits, strict=True)]
    order = [_ORDER.index(word) if word in _ORDER else len(_ORDER) for word in words]
    return np.argsort(order, kind="stable").tolist()


def _link(folder: str, reported: Collection[str], base: str) -> str:
    """What the name of a bushing leads to: its report, else its folder, if it has one."""
    return base + quote(folder) + ("/report.html" if folder in reported else "/") if folder else ""


def _chart(column: _Column) -> Markup:
    """A control chart: values in the manifest's order, median and three standard deviations, limits."""
    values, median, sigma, out = column.known, column.median, column.sigma, column.out
    at = np.arange(1.0, values.size + 1.0)
    reach = [median - _FURTHEST * sigma, median + _FURTHEST * sigma, *column.limits]
    far = ((values < min(reach)) | (values > max(reach))) & (sigma > 0.0)
    shown = np.where(far, np.clip(values, min(reach), max(reach)), values)
    thin = np.arange(values.size) % max(1, -(-values.size // _MOST_POINTS)) == 0
    looks = (
        ("", "#1f4e9c", ~out & ~far & thin),
        ("out of limits", LIMIT, out & _some(out)),
        ("further out", "#b4500c", far & ~out & _some(far)),
    )
    series = [Series(name, color, points=(at[which], shown[which])) for name, color, which in looks if which.any()]
    rules = [Rule(median, "median")]
    if sigma > 0.0:
        rules.append(Rule(median - _CONTROL * sigma, "3 standard deviations", dashes="2 3"))
        rules.append(Rule(median + _CONTROL * sigma, "", dashes="2 3"))
    rules += [Rule(end, "" if place else "limit", "6 3", LIMIT) for place, end in enumerate(column.limits)]
    words = (
        f"{column.header} of {int(np.isfinite(values).sum())} bushings: median {number(median, 4)}, robust standard "
        f"deviation {number(sigma, 2)}, {int(out.sum())} out of limits"
    )
    unit = (split_header(column.header)[1] or "").replace("-", "")
    dot = 4.6 if values.size <= 60 else 3.0
    return chart(column.header, ("bushing, in the manifest's order", unit), series, words, rules=rules, dot=dot)


def _some(which: Array) -> Array:
    """At most so many of the chosen as a chart draws, evenly, (n,) bool."""
    return (np.cumsum(which) - 1) % max(1, -(-int(which.sum()) // _MOST_POINTS)) == 0
