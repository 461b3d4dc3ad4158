"""The page of a batch: what came of it, who differs, control charts, capability, and a row a bushing to sort."""

import math
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import chain
from pathlib import Path
from typing import Self
from urllib.parse import quote

import numpy as np
import pandas as pd
from markupsafe import Markup

from bushfit.effects.contract import Array
from bushfit.errors import ModelError
from bushfit.model.file import read_document, require_schema
from bushfit.reduction.arrays import scatter
from bushfit.report.page import filled, rendered
from bushfit.report.page.chart import DASHES, LIMIT, Axis, Rule, Series, chart, colors, outline, span_of, stroke
from bushfit.report.page.readback import canonical, read_table
from bushfit.report.process import ENOUGH, LEVEL, Process, charted
from bushfit.report.results import Documents, ResultFile, Tables, json_file, table_file
from bushfit.report.tables import BETWEEN, numbers, spread
from bushfit.units import number, split_header
from bushfit.validation import Number, WholeNumber, validate_tables

#: Points of a chart at most but for those that need a look, taken evenly and in no step that cavities or shifts have:
#: multiples of the golden section are.
_MOST_POINTS, _GOLDEN = 250, 0.6180339887498949
#: What lies further from the median than this, in standard deviations of the batch, is drawn at the edge of a chart.
_FURTHEST = 12.0
#: Curves of single bushings in the picture of all, at most.
_MOST_CURVES = 6
#: Width of the band about the median, and of a row's picture, in standard deviations of the batch; and the least of the
#: latter as a share of the median: less is noise of any rig.
_BAND, _REACH, _LEAST_REACH = 2.0, 5.0, 0.005
#: Size of a row's picture [pixels].
_WIDE, _HIGH = 110.0, 26.0
#: Colours of what lies beyond control limits, or differs, and of the other bushings.
_BEYOND, _USUAL = "#b4500c", "#1f4e9c"
#: The column of a point of a curve as measured.
_MEASURED = re.compile(r"measured stiffness (.+) (\S+) Hz (\S+) (\S+) \[(.+)\]")
#: Least and largest.
Ends = Sequence[float]
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
class Quantity:
    """quantities: of a column its median, robust standard deviation, limits, and what the order of test tells."""

    median: Number
    sigma: Number
    allowed: tuple[Number | None, Number | None] = (None, None)
    process: Process | None = None


@dataclass(frozen=True, eq=False)
class Column:
    """A quantity of all bushings.

    Args:
        header: of its column of the table.
        found: what batch.json says of it.
        known: its values, NaN where a bushing has none, (n,).
        order, subgroups: numbers of the rows in the order of test, (n,), and in that order their subgroups, or none.
    """

    header: str
    found: Quantity
    known: Array
    order: Array
    subgroups: Sequence[str]

    @property
    def limits(self) -> list[float]:
        """The ends of what is allowed, as far as there are some."""
        return [end for end in self.found.allowed if end is not None]

    @cached_property
    def out(self) -> Array:
        """Which bushings are out of limits, (n,) bool."""
        low, high = (np.nan if end is None else end for end in self.found.allowed)
        return (self.known < low) | (self.known > high)

    def charts(self) -> Iterator[Markup]:
        """Values, or means of subgroups, in the order of test, and their ranges where these make control limits."""
        values, ranges, size = charted(self.known[self.order], self.subgroups)
        median, sigma, of = self.found.median, self.found.sigma, self.found.process
        center, *control = (of and of["control"]) or (median, -math.inf, math.inf)
        drawn = [end for end in control if math.isfinite(end) and (end > 0.0 or np.nanmin(self.known) < 0.0)]
        rules = [Rule(center, "mean" if drawn else "median")]
        rules += [Rule(end, "control limit" * (end == drawn[0]), "2 3") for end in drawn]
        rules += [Rule(end, "limit" * (end == self.limits[0]), "6 3", LIMIT) for end in self.limits]
        words = f"median {number(median, 4)}, robust std dev {number(sigma, 2)}, {int(self.out.sum())} out of limits"
        reach = _FURTHEST * sigma or math.inf
        out = self.out[self.order] if size == 1 else np.zeros(values.size, dtype=bool)
        yield self._chart(
            "mean of subgroups: " * (size > 1), values, out, control, rules, words, (median - reach, median + reach)
        )
        if of and of["ranges"]:
            middle, most = of["ranges"]
            rules = [Rule(middle, "mean range"), Rule(most, "control limit", "2 3")]
            kind, words = "range of subgroups: " if size > 1 else "moving range: ", f"mean {number(middle, 3)}"
            yield self._chart(kind, ranges, ranges < 0.0, (0.0, most), rules, words, (0.0, 3.0 * most))

    def _chart(
        self, kind: str, values: Array, out: Array, control: Ends, rules: list[Rule], words: str, reach: Ends
    ) -> Markup:
        """Points over the order of test; what is beyond `reach`, where no rule is, is drawn at the edge."""
        at, levels = np.arange(1.0, values.size + 1.0), [rule.value for rule in rules]
        beyond = (values < control[0]) | (values > control[1])
        shown = np.clip(values, min(reach[0], *levels), max(reach[1], *levels))
        looks = (
            ("", _USUAL, ~out & ~beyond & (_GOLDEN * at % 1.0 < _MOST_POINTS / values.size)),
            ("out of limits", LIMIT, out & _some(out)),
            ("beyond control limits", _BEYOND, beyond & ~out & _some(beyond)),
        )
        series = [Series(name, color, points=(at[which], shown[which])) for name, color, which in looks if which.any()]
        unit, title = (split_header(self.header)[1] or "").replace("-", ""), f"{kind}{self.header}"
        labels = f"{'subgroup' if self.subgroups else 'bushing'}, in the order of test", unit
        return chart(title, labels, series, f"{title}, {words}", rules=rules, dot=4.6 if values.size <= 60 else 3.0)


def _some(which: Array) -> Array:
    """At most so many of the chosen as a chart draws, evenly, (n,) bool."""
    return (np.cumsum(which) - 1) % max(1, -(-int(which.sum()) // _MOST_POINTS)) == 0


@dataclass(frozen=True, eq=False)
class Curves:
    """The stiffness curves of a batch as measured.

    Args:
        title, along: place and level; what lies along x, with its unit.
        unit: of stiffness.
        x, values: the steps, (k,), and |K| of each bushing, (k, n).
    """

    title: str
    along: str
    unit: str
    x: Array
    values: Array

    @classmethod
    def of(cls, table: pd.DataFrame) -> Self | None:
        """Those of the table of a batch; None where none is whole."""
        found = {name: match for name in table if (match := _MEASURED.fullmatch(str(name)))}
        values = numbers(table, *map(str, found))
        if not np.isfinite(values).all(axis=0).any():
            return None
        place, _, _, length, unit = next(iter(found.values())).groups()
        frequency, amplitude = np.array([(float(each[2]), float(each[3])) for each in found.values()]).T
        over = bool(np.ptp(frequency))
        held = f"{number(amplitude[0], 3)} {length}" if over else f"{number(frequency[0], 3)} Hz"
        along, x = ("frequency [Hz]", frequency) if over else (f"amplitude [{length}]", amplitude)
        return cls(f"{place}, {held}", along, unit, x, values)

    @cached_property
    def _band(self) -> tuple[Array, Array]:
        """Median and robust standard deviation at each point, (k,)."""
        known = self.values[:, np.isfinite(self.values).all(axis=0)]
        median, sigma = np.array([scatter(each) for each in known]).T
        return median, sigma

    def picture(self, names: Mapping[int, str]) -> Markup:
        """Median and band of all, and the curves of some bushings, by the numbers of their rows."""
        x, (median, sigma) = self.x, self._band
        band = x, np.maximum(median - _BAND * sigma, 0.0), median + _BAND * sigma
        all_of = Series(f"median, {_BAND:g} std dev", "#595959", line=(x, median), band=band)
        chosen = [at for at in names if np.isfinite(self.values[:, at]).all()][:_MOST_CURVES]
        looks = zip(chosen, colors(len(chosen)), DASHES[1:], strict=False)
        single = [Series(names[at], color, dashes, line=(x, self.values[:, at])) for at, color, dashes in looks]
        named = ", ".join(names[at] for at in chosen) or "none"
        alt = f"|K| as measured, {self.title}: median {span_of(median)} {self.unit}; single curves: {named}"
        labels = self.along, f"|K| [{self.unit}]"
        return chart(
            f"Dynamic stiffness as measured: {self.title}",
            labels,
            [all_of, *single],
            alt,
            log=self.along.startswith("frequency"),
        )

    @cached_property
    def reach(self) -> float:
        """Half the height of a row's picture, as a share of the median."""
        return max(_LEAST_REACH, _REACH * float(np.median(self._band[1] / self._band[0])))

    def row(self, at: int, *, differs: bool) -> Markup:
        """The curve of a bushing off the median, against the band of all, the size of a word."""
        median, sigma = self._band
        off, half = self.values[:, at] / median - 1.0, np.clip(_BAND * sigma / median, 0.0, self.reach)
        if not np.isfinite(off).all():
            return Markup()
        x = Axis.over("", [self.x], 1.0, _WIDE - 1.0, log=self.along.startswith("frequency"))(self.x)
        y = Axis("", -self.reach, self.reach, _HIGH - 1.0, 1.0)
        low, high = (number(100.0 * float(end), 2, "+") for end in (off.min(), off.max()))
        drawn = {"band": outline(x, y(-half), y(half)), "line": stroke(x, y(np.clip(off, -self.reach, self.reach)))}
        size = {"width": _WIDE, "height": _HIGH, "color": _BEYOND if differs else _USUAL}
        return Markup(filled("spark.html", {"alt": f"{low} to {high} % off the median", **drawn, **size}))


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


def read_batch(folder: Path) -> list[ResultFile]:
    """Document and table of a batch.

    Raises:
        ModelError: files that are missing, or not as bushfit writes them.
    """
    file = folder / "batch.json"
    document = read_document(file)
    require_schema(document, file, "a batch", SCHEMA, hint="run the batch again with --resume")
    validate_tables(document, file, Batch, kind=ModelError)
    table = read_table(folder, "batch")
    if table is None or not {"name", "status", "folder", "warnings"} <= set(table):
        raise ModelError(
            "the table of the batch is missing", file=folder / "batch.csv", hint="run the batch again with --resume"
        )
    return [json_file("batch", document), table_file("batch", lambda: table)]


def page_of(folder: Path, base: str = "") -> Callable[[Documents, Tables], str]:
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
    batch = validate_tables(documents["batch"], None, Batch, kind=ModelError)
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
