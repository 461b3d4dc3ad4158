"""Pictures of hysteresis loops, and maps of what is left of each place before and after a diagnosis."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd
from markupsafe import Markup

from bushfit.effects.contract import Array
from bushfit.geometry import Place
from bushfit.report.page.chart import (
    MOST_LEVELS,
    MOST_PLACES,
    Cells,
    Panel,
    Rule,
    Series,
    chart,
    colors,
    every_nth,
    maps,
    span_of,
)
from bushfit.report.page.readback import ReportData
from bushfit.report.page.sweeps import Level, by_stepped, levels_of
from bushfit.report.tables import columns_of, complete, moved_of, numbers, shortened, spread
from bushfit.units import format_range, number, split_header

#: Rows of all loops of a page, with which it stays below 500 kB; but no loop has fewer than `_FEWEST`.
_MOST_ROWS, _FEWEST = 2400, 24
#: Width of a point of a loop [pixels].
_DOT = 2.6
#: Most columns and rows of a map of cells: each is then some pixels wide and high.
_MOST_COLUMNS, _MOST_LEVELS = 24, 12
#: Letters of the name of a row at most.
_LONGEST = 24


def loop_panels(found: ReportData) -> list[Panel]:
    """Force over displacement of each place, measured and modelled, and measured less model."""
    tested = [(place, rows) for _, place, rows in found.measured("loop")]
    counts = [min(rows["test"].nunique(), MOST_LEVELS) for _, rows in tested]
    most = max(_FEWEST, _MOST_ROWS // max(1, sum(sorted(counts)[-MOST_PLACES:])))
    frequencies = {test.test: test.frequency_Hz[0] for test in found.tests}
    panels = list[Panel]()
    for place, rows in tested:
        if loops := dict(_last_cycles(place, rows, frequencies)):
            steps = {name: every_nth(loop.shape[1], most) for name, loop in loops.items()}
            every = max(step.step for step in steps.values())
            rarely = f", one row in {every}" if every > 1 else ""
            notes = [f"The last cycle of each loop. Points: measured{rarely}. Lines: model."]
            if left := rows["test"].nunique() - len(loops):
                notes.append(f"{left} further loops are left out of the picture; loops.csv has all.")
            pictures = _charts(place, {name: loop[:, steps[name]] for name, loop in loops.items()})
            panels.append(Panel(str(place), pictures, notes))
    return panels[:MOST_PLACES]


def _last_cycles(place: Place, rows: pd.DataFrame, frequencies: dict[str, float]) -> Iterator[tuple[str, Array]]:
    """The loops of a place, at most eight: displacement, measured and modelled force of the last cycle, (3, n)."""
    resisting = columns_of(place)[2]
    headers = moved_of(place), resisting, f"model {resisting}"
    rows = complete(rows, "time [s]", *headers)
    names = list(dict.fromkeys(rows["test"]))
    for name in (names[at] for at in spread(len(names), MOST_LEVELS)):
        mine = rows[rows["test"] == name]
        (time,) = numbers(mine, "time [s]")
        period = 1.0 / frequencies[name] if frequencies.get(name) else np.inf
        yield name, numbers(mine, *headers)[:, time >= time.max() - period]


def _charts(place: Place, loops: dict[str, Array]) -> list[Markup]:
    moved, resisting, _ = place.motion.words
    unit = place.display.force.name
    labels = f"{moved} [{place.display.displacement.name}]", f"{resisting} [{unit}]"
    whole, left, spans, off = [], [], [], []
    for (name, (x, measured, model)), color in zip(loops.items(), colors(len(loops)), strict=True):
        whole.append(Series(name, color, line=(x, model), points=(x, measured)))
        left.append(Series(name, color, points=(x, measured - model)))
        spans.append(f"{name}: measured {span_of(measured)} {unit}, model {span_of(model)}")
        off.append(f"{name}: {span_of(measured - model)} {unit}")
    loops_in_words = f"{labels[1]} over {labels[0]}, measured and model; {'; '.join(spans)}"
    left_in_words = f"{resisting}, measured less model, over {moved}; {'; '.join(off)}"
    return [
        chart(f"{place}: hysteresis", labels, whole, loops_in_words, dot=_DOT),
        chart(f"{place}: measured less model", labels, left, left_in_words, dot=_DOT, rules=[Rule(0.0, "")]),
    ]


def gap_panels(found: ReportData) -> list[Panel]:
    """What is left of each place before and after, measured less model in %."""
    gap = found.gap
    if gap is None or not any(str(name).endswith("before [%]") for name in gap):
        return []
    panels = list[Panel]()
    for place in list(found.places.values())[:MOST_PLACES]:
        shown = list(_maps_at(place, gap, found))
        if shown:
            changed = any(len(cells.sides) > 1 for cells in shown)
            heads = ("before", "after") if changed else ("model and tests",)
            parts = []
            for cells in shown:
                sizes = (np.sqrt(np.nanmean(np.square(cells.side(at)))) for at in range(len(heads)))
                sides = (f"{head} {number(float(size), 2)} %" for head, size in zip(heads, sizes, strict=True))
                parts.append(f"{cells.name}: {', '.join(sides)}")
            words = f"Measured less model, {place}, root mean square of the cells; {'; '.join(parts)}"
            picture = maps(f"{place}: measured less model, %", heads, shown, words)
            panels.append(Panel(str(place), [picture], []))
    return panels


def _maps_at(place: Place, gap: pd.DataFrame, found: ReportData) -> Iterator[Cells]:
    """Maps of a place: of sweeps storage and loss, of loops the force."""
    mine = gap[gap["direction"] == str(place)]
    for _, along, held, rows in by_stepped(place, mine[mine["kind"] == "sweep"], found.tests):
        levels = levels_of(found, rows, held)
        (x,), (name, unit) = numbers(pd.concat([level.rows for level in levels]), along), split_header(along)
        ends = format_range(unit or "", float(x.min())), name.split()[0], format_range(unit or "", float(x.max()))
        for part in ("storage", "loss"):
            yield _map(part, levels, x, ends)
    loops = complete(mine[mine["kind"] == "loop"], "time [s]", "frequency [Hz]", moved_of(place))
    if len(loops):  # means over 15 deg of the cycle
        levels = levels_of(found, loops, "test")
        turned = list[Array]()  # phase of the rows after the upper turn of the motion, in cycles
        for level in levels:
            time, frequency, moved = numbers(level.rows, "time [s]", "frequency [Hz]", moved_of(place))
            first = np.mean((moved - moved.mean()) * np.exp(-2j * np.pi * time * frequency))
            turned.append((time * frequency + np.angle(first) / (2.0 * np.pi)) % 1.0)
        yield _map("force", levels, np.floor(np.concatenate(turned) * 24), ("upper turn", "cycle", "360 deg"))


def _map(part: str, levels: Sequence[Level], along: Array, ends: tuple[str, str, str]) -> Cells:
    """One map: means over the rows of the levels that fall into a cell, before and after; `along` of all rows, (n,)."""
    table = pd.concat([level.rows for level in levels])
    place = np.repeat(np.arange(len(levels)), [len(level.rows) for level in levels])
    (row, first), (column, columns) = _binned(place, _MOST_LEVELS), _binned(along, _MOST_COLUMNS)
    cell, size = row * len(columns) + column, len(first) * len(columns)
    count = np.bincount(cell, minlength=size)
    sides = []
    for off in numbers(table, *(f"{part} {when} [%]" for when in ("before", "after"))):
        sums = np.bincount(cell, np.nan_to_num(off), minlength=size)
        sides.append(np.where(count > 0, sums / np.maximum(count, 1), np.nan).reshape(len(first), -1))
    same = np.array_equal(sides[0], sides[1], equal_nan=True)
    short = [shortened(levels[n].name, _LONGEST) for n in first]
    return Cells(part, short, ends, sides[:1] if same else sides)


def _binned(values: Any, most: int) -> tuple[Array, list[Any]]:
    """Number of the bin of each value, and the first value of each of at most so many bins of neighbours."""
    levels, place = np.unique(values, return_inverse=True)
    bins = np.arange(levels.size) * min(most, levels.size) // levels.size
    return bins[place], levels[np.unique(bins, return_index=True)[1]].tolist()
