"""The page of a batch: what came of it, who differs, control charts, capability, and a row a bushing to sort."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path
from urllib.parse import quote

import numpy as np
import pandas as pd

from bushfit.errors import ModelError
from bushfit.model.file import read_document, require_schema
from bushfit.report.contents import Contents, Documents, Page, Tables
from bushfit.report.page import rendered
from bushfit.report.page.readback import canonical, read_table
from bushfit.report.page.steady import Column, Curves, Quantity
from bushfit.report.process import ENOUGH, LEVEL
from bushfit.report.tables import BETWEEN, spread
from bushfit.units import number, split_header
from bushfit.validation import Number, WholeNumber, check_tables

#: What "schema" of the document says.
SCHEMA = "bushfit/batch/1"
#: Cells of the table at most, of which a curve weighs three: with these the page stays below 500 kB.
_MOST_CELLS = 4000
#: Quantities with charts at most, those with limits first, and bushings that differ or failed, named at most.
_MOST_CHARTS, _MOST_NAMED = 12, 20
#: Bushings that a quantity must be known of for a chart.
_FEWEST = 3
#: How the rows are ordered: what needs a look first.
_ORDER = ("failed", "fail", "conditional fail", "differs", "conditional pass")
#: Columns of words, and those that end a row as remarks.
_WORDS = ("campaign name", "subgroup", "status", "limits", "verdict", "named effects")
_REMARKS = ("out of limits", "on the edge", "differs in", "on a bound", "warnings")
#: What curves are compared by, and the column of how far each is off.
_CURVE, _OFF = "measured stiffness", "measured stiffness off the median [%]"
#: Limits are told by these words, and coloured so.
_TONES = {"pass": "good", "conditional pass": "fair", "conditional fail": "bad", "fail": "bad"}


@dataclass(frozen=True)
class Differing:
    """differ: a bushing that differs from the others, the number of its row from 1, and by what: robust z."""

    row: WholeNumber
    by: Mapping[str, Number]


@dataclass(frozen=True)
class Batch:
    """batch.json, as far as the page tells it."""

    title: str
    rows: WholeNumber
    done: WholeNumber
    quantities: Mapping[str, Quantity]
    limits: Mapping[str, WholeNumber]
    warnings: tuple[str, ...] = ()
    differ: tuple[Differing, ...] = ()
    order: str = "as the manifest lists them"
    least_told: Number | None = None


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
    order = np.argsort(table["order of test [-]"]) if "order of test [-]" in table else np.arange(len(table))
    named = table["subgroup"].iloc[order].tolist() if "subgroup" in table else [""]
    known = {name: each for name, each in batch.quantities.items() if name in table}
    together = np.asarray(order), named if all(named) else []
    columns = [Column(name, each, table[name].to_numpy(), *together) for name, each in known.items()]
    by = {each.row - 1: each.by for each in batch.differ if 0 < each.row <= len(table)}
    shown = [name for name in _WORDS if name in table and len(set(table[name])) > 1]
    remarks = [name for name in _REMARKS if name in table]
    curves = Curves.of(table) if _OFF in table else None
    listed, important = _ordered(table, by)
    most = max(1, _MOST_CELLS // (len(shown) + len(columns) + (4 if curves else 1)))
    first, others = listed[: min(important, most)], listed[important:]
    sample = [others[at] for at in spread(len(others), max(0, most - len(first)))]
    chosen = [*first, *sample]
    warned = {at: table["warnings"][at].split(BETWEEN) if table["warnings"][at] else [] for at in chosen}
    footnotes = list(dict.fromkeys(line for lines in warned.values() for line in lines))
    for at, lines in warned.items():
        table.loc[at, "warnings"] = ", ".join(str(footnotes.index(line) + 1) for line in lines)
    charts = [column for column in columns if np.isfinite(column.known).sum() >= _FEWEST]
    charts.sort(key=lambda column: not column.limits)
    rows = dict(zip(chosen, table.iloc[chosen].to_dict("records"), strict=True))
    names, failed = table["name"], table[table["status"] == "failed"][:_MOST_NAMED]

    def link(at: int) -> str:
        """What the name of a bushing leads to: its report, else its folder, if it has one."""
        folder = table["folder"][at]
        return base + quote(folder) + ("/report.html" if folder in reported else "/") if folder else ""

    def cells(at: int) -> Iterator[tuple[str, str]]:
        """Values, and a tone for what is out of limits or differs."""
        for column in columns:
            value, differs = column.known[at], split_header(column.header)[0] in by.get(at, {})
            tone = "bad" if column.out[at] else "fair" if differs else ""
            yield "" if np.isnan(value) else number(float(value), 4), tone

    context = {
        "batch": batch,
        "charts": list(chain.from_iterable(column.charts() for column in charts[:_MOST_CHARTS])),
        "left_charts": max(0, len(charts) - _MOST_CHARTS),
        "columns": columns,
        "steady": any(
            found and (found["control"] or found["index"]) for found in (each.found.process for each in columns)
        ),
        "curves": curves,
        "curves_picture": curves.picture({at: names[at] for at in by}) if curves else "",
        "differ": [
            (names[at], link(at), table["differs in"][at]) for at in [*by][:_MOST_NAMED] if "differs in" in table
        ],
        "heads": [*shown, *(["stiffness off median [%]"] if curves else []), *(column.header for column in columns)],
        "remarked": any(any(table[name]) for name in remarks),
        "footnotes": footnotes,
        "texts": len(shown),
        "rows": [
            {
                "name": rows[at]["name"],
                "link": link(at),
                "words": [rows[at][name] for name in shown],
                "curve": curves.row(at, differs=_CURVE in by.get(at, {})) if curves else "",
                "off": f"{rows[at][_OFF]:+.1f}" if curves and np.isfinite(rows[at][_OFF]) else "",
                "cells": cells(at),
                "remarks": "; ".join(f"{name}: {rows[at][name]}" for name in remarks if rows[at][name]),
            }
            for at in chosen
        ],
        "left_rows": (important - len(first), len(others) - len(sample)),
        "important": important,
        "tones": _TONES,
        "enough": ENOUGH,
        "level": LEVEL,
        "failed": [*zip(failed["name"], failed.get("error", failed["name"]), strict=True)],
    }
    return rendered("index.html", context)


def _ordered(table: pd.DataFrame, differ: Collection[int]) -> tuple[list[int], int]:
    """Numbers of the rows, those that need a look first, else as they stand; and how many need one."""
    limits = table["limits"] if "limits" in table else [""] * len(table)
    words = [status if status == "failed" else limit for status, limit in zip(table["status"], limits, strict=True)]
    order = np.array([_ORDER.index(word) if word in _ORDER else len(_ORDER) for word in words], dtype=int)
    order[list(differ)] = np.minimum(order[list(differ)], _ORDER.index("differs"))
    return np.argsort(order, kind="stable").tolist(), int((order < len(_ORDER)).sum())
