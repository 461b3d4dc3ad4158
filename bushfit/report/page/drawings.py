"""The pictures of a result: each place's sweeps and loops beside the model, and what is left before and after."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from markupsafe import Markup

from bushfit.effects.contract import Array
from bushfit.geometry import Place
from bushfit.model.document import TestTable
from bushfit.model.result import Result
from bushfit.report.contents import Tables
from bushfit.report.page.chart import DASHES, Cells, Rule, Series, chart, colors, maps
from bushfit.report.page.gathered import (
    MOST_LEVELS,
    Curve,
    LoopCurve,
    Sweeps,
    cells_at,
    gap_of,
    loops_at,
    places_of,
    sweeps_at,
    tests_of,
)
from bushfit.report.tables import columns_of
from bushfit.units import number

#: Points of sweeps, and rows of loops, of a whole page: with these it stays below 500 kB.
_MOST_POINTS, _MOST_ROWS = 3200, 2400
#: Fewest points of a curve, however many there are.
_FEWEST = 24
#: Most places that are drawn: a page of more is no page.
MOST_PLACES = 8
#: Width of a point of a loop [pixels].
_DOT = 2.6
#: Amplitudes that were stepped over more than this ratio lie on a logarithmic axis; and frequencies over this one.
_DECADES, LOG_FREQUENCIES = 3.0, 40.0


@dataclass(frozen=True, eq=False)
class Drawn:
    """What is drawn of a place: its pictures, and what must be said of them."""

    place: str
    pictures: Sequence[Markup]
    notes: Sequence[str]


def _by_place(result: Result, tables: Tables, table: pd.DataFrame) -> Iterator[tuple[str, Place, pd.DataFrame]]:
    """Name and rows of each place that has any."""
    for name, place in places_of(result, tables).items():
        rows = table[table["direction"] == str(place)]
        if len(rows):
            yield name, place, rows


def tested_panels(result: Result, tables: Tables, tests: Sequence[TestTable]) -> list[Drawn]:
    """Stiffness and loss factor of each place, measured and predicted."""
    table = tests_of(tables, "sweep")
    if table is None:
        return []
    found: list[Drawn] = []
    most = max(_FEWEST, _MOST_POINTS // (MOST_LEVELS * min(len(places_of(result, tables)), MOST_PLACES) or 1))
    for name, place, rows in _by_place(result, tables, table):
        if kinds := [sweeps for sweeps in sweeps_at(place, rows, tests, tables.get(name), most) if sweeps.curves]:
            found.append(
                Drawn(str(place), [chart for sweeps in kinds for chart in _sweeps(sweeps)], _notes(kinds, most))
            )
    return found[:MOST_PLACES]


def _notes(kinds: Sequence[Sweeps], most: int) -> list[str]:
    """What a reader has to know of the pictures of a place."""
    notes = []
    if any(sweeps.predicted for sweeps in kinds):
        notes.append("Lines with 95 % bands: prediction, without effects of the rig.")
    if any(not sweeps.predicted for sweeps in kinds):
        notes.append("Lines without bands: the model at the measured points.")
    notes.append("Points: measured, mean of the repeats.")
    if any(curve.rigs is not None for sweeps in kinds for curve in sweeps.curves):
        notes.append("Broken grey lines: the same if what was added is the rig's; the bands span both.")
    if left := sum(sweeps.left_out for sweeps in kinds):
        notes.append(f"{left} further levels are left out of the picture; the tables have all.")
    if any(curve.measured.shape[1] >= most for sweeps in kinds for curve in sweeps.curves):
        notes.append(f"Of each curve at most {most} points, every n-th, are drawn.")
    return notes


def _sweeps(sweeps: Sweeps) -> Iterator[Markup]:
    """|K| and loss factor of sweeps over what they step through."""
    x = np.concatenate([curve.measured[0] for curve in sweeps.curves])
    log = bool(x.max() > (_DECADES if sweeps.stepped == "amplitude" else LOG_FREQUENCIES) * x.min() > 0.0)
    stiffness = columns_of(sweeps.place)[1]
    for row, label in enumerate((stiffness, "loss factor [-]"), start=1):
        what = label.partition(" [")[0]
        looks = zip(sweeps.curves, colors(len(sweeps.curves)), DASHES, strict=False)
        series = [each for curve, *look in looks for each in _series(curve, row, *look)]
        title = f"{sweeps.place}: {what}"
        yield chart(title, (sweeps.x_label, label), series, _described(sweeps, row, what, label), log=log)


def _series(curve: Curve, row: int, color: str, dashes: str) -> Iterator[Series]:
    """One level in a chart of |K| (row 1) or loss factor (row 2), and the same if it is the rig's."""
    x, values = curve.model[0], curve.model[row]
    points = curve.measured[0], curve.measured[row]
    if curve.rigs is not None:
        yield Series("", "#777777", "3 3", line=(x, curve.rigs[row - 1]))
    band = None if curve.band is None else (x, curve.band[2 * row - 2], curve.band[2 * row - 1])
    yield Series(curve.name, color, "" if curve.band is None else dashes, (x, values), band, points)


def _described(sweeps: Sweeps, row: int, what: str, label: str) -> str:
    """A chart of sweeps in words."""
    unit = label.partition("[")[2].rstrip("]").removesuffix("-")
    over = sweeps.x_label.partition(" [")[0]
    parts = [f"{what} over {over}, {sweeps.place}, measured and model"]
    for curve in sweeps.curves:
        spans = (f"{span_of(values[row])} {unit}".strip() for values in (curve.measured, curve.model))
        parts.append("{}: measured {}, model {}".format(curve.name, *spans))
    return "; ".join(parts)


def span_of(values: Array) -> str:
    """Least and largest of the values that are known, in words."""
    known = values[np.isfinite(values)]
    return f"{number(float(known.min()), 3)} to {number(float(known.max()), 3)}" if known.size else "nothing"


def loop_panels(result: Result, tables: Tables, tests: Sequence[TestTable]) -> list[Drawn]:
    """Force over displacement of each place, measured and modelled."""
    table = tests_of(tables, "loop")
    if table is None:
        return []
    found: list[Drawn] = []
    drawn = table.groupby("direction")["test"].nunique().clip(upper=MOST_LEVELS).nlargest(MOST_PLACES).sum()
    most = max(_FEWEST, _MOST_ROWS // max(1, int(drawn)))
    for _, place, rows in _by_place(result, tables, table):
        if loops := loops_at(place, rows, tests, most):
            every = max(loop.every for loop in loops)
            rarely = f", one row in {every}" if every > 1 else ""
            notes = [f"The last cycle of each loop. Points: measured{rarely}. Lines: model."]
            if left := rows["test"].nunique() - len(loops):
                notes.append(f"{left} further loops are left out of the picture; loops.csv has all.")
            found.append(Drawn(str(place), _loops(place, loops), notes))
    return found[:MOST_PLACES]


def _loops(place: Place, loops: Sequence[LoopCurve]) -> list[Markup]:
    """Hysteresis loops of a place, and what of them is left."""
    moved, resisting, _ = place.motion.words
    unit = place.display.force.name
    labels = f"{moved} [{place.display.displacement.name}]", f"{resisting} [{unit}]"
    whole, left, spans, off = [], [], [], []
    for loop, color in zip(loops, colors(len(loops)), strict=True):
        x, measured, model = loop.rows
        whole.append(Series(loop.name, color, line=(x, model), points=(x, measured)))
        left.append(Series(loop.name, color, points=(x, measured - model)))
        spans.append(f"{loop.name}: measured {span_of(measured)} {unit}, model {span_of(model)}")
        off.append(f"{loop.name}: {span_of(measured - model)} {unit}")
    said = f"{labels[1]} over {labels[0]}, measured and model; {'; '.join(spans)}"
    less = f"{resisting}, measured less model, over {moved}; {'; '.join(off)}"
    return [
        chart(f"{place}: hysteresis", labels, whole, said, dot=_DOT),
        chart(f"{place}: measured less model", labels, left, less, dot=_DOT, rules=[Rule(0.0, "")]),
    ]


def gap_panels(result: Result, tables: Tables, tests: Sequence[TestTable]) -> list[Drawn]:
    """What is left of each place before and after, measured less model in %."""
    gap = gap_of(tables)
    if gap is None or not any(str(name).endswith("before [%]") for name in gap):
        return []
    found: list[Drawn] = []
    for place in list(places_of(result, tables).values())[:MOST_PLACES]:
        shown = list(cells_at(place, gap, tests))
        if shown:
            heads = ("before", "after") if max(len(cells.sides) for cells in shown) > 1 else ("model and tests",)
            shown = [
                Cells(each.name, each.rows, each.along, (*each.sides, *each.sides)[: len(heads)]) for each in shown
            ]
            title = f"{place}: measured less model, %"
            found.append(Drawn(str(place), [maps(title, heads, shown, _mapped(place, heads, shown))], []))
    return found


def _mapped(place: Place, heads: Sequence[str], shown: Sequence[Cells]) -> str:
    """Maps in words: the root mean square of what is left."""
    parts = []
    for cells in shown:
        sizes = (
            f"{head} {number(float(np.sqrt(np.nanmean(np.square(side)))), 2)} %"
            for head, side in zip(heads, cells.sides, strict=True)
        )
        parts.append(f"{cells.name}: {', '.join(sizes)}")
    return f"Measured less model, {place}, root mean square of the cells; {'; '.join(parts)}"
