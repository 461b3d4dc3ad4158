"""Maps of what is left of each place before and after a diagnosis: measured less model in %."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd

from bushfit.effects.contract import Array
from bushfit.geometry import Place
from bushfit.report.page.chart import MOST_PLACES, Cells, Panel, maps
from bushfit.report.page.readback import ReportData
from bushfit.report.page.sweeps import Level, by_stepped, levels_of
from bushfit.report.tables import complete, moved_of, numbers, shortened
from bushfit.units import number, split_header, told

#: Most columns and rows of a map of cells: each is then some pixels wide and high.
_MOST_COLUMNS, _MOST_ROWS = 24, 12
#: Letters of the name of a row at most.
_LONGEST = 24


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
            picture = maps(f"{place}: measured less model, %", heads, shown, _in_words(place, heads, shown))
            panels.append(Panel(str(place), [picture], []))
    return panels


def _in_words(place: Place, heads: Sequence[str], shown: Sequence[Cells]) -> str:
    """Maps in words: the root mean square of what is left."""
    parts = []
    for cells in shown:
        sizes = (number(float(np.sqrt(np.nanmean(np.square(cells.side(at))))), 2) for at in range(len(heads)))
        parts.append(f"{cells.name}: " + ", ".join(f"{head} {size} %" for head, size in zip(heads, sizes, strict=True)))
    return f"Measured less model, {place}, root mean square of the cells; {'; '.join(parts)}"


def _maps_at(place: Place, gap: pd.DataFrame, found: ReportData) -> Iterator[Cells]:
    """Maps of a place: of sweeps storage and loss, of loops the force."""
    mine = gap[gap["direction"] == str(place)]
    for _, along, held, rows in by_stepped(place, mine[mine["kind"] == "sweep"], found.tests):
        levels = levels_of(found, rows, held)
        (x,), (name, unit) = numbers(pd.concat([level.rows for level in levels]), along), split_header(along)
        ends = told(unit or "", float(x.min())), name.split()[0], told(unit or "", float(x.max()))
        for part in ("storage", "loss"):
            yield _map(part, levels, x, ends)
    loops = complete(mine[mine["kind"] == "loop"], "time [s]", "frequency [Hz]", moved_of(place))
    if len(loops):  # means over 15 deg of the cycle
        levels = levels_of(found, loops, "test")
        turned = np.concatenate([_phase(place, level.rows) for level in levels])
        yield _map("force", levels, np.floor(turned * 24), ("upper turn", "cycle", "360 deg"))


def _phase(place: Place, rows: pd.DataFrame) -> Array:
    """Phase of the rows of a loop after the upper turn of its motion, in cycles, (n,)."""
    time, frequency, moved = numbers(rows, "time [s]", "frequency [Hz]", moved_of(place))
    first = np.mean((moved - moved.mean()) * np.exp(-2j * np.pi * time * frequency))
    return (time * frequency + np.angle(first) / (2.0 * np.pi)) % 1.0


def _map(part: str, levels: Sequence[Level], along: Array, ends: tuple[str, str, str]) -> Cells:
    """One map: means over the rows of the levels that fall into a cell, before and after; `along` of all rows, (n,)."""
    table = pd.concat([level.rows for level in levels])
    place = np.repeat(np.arange(len(levels)), [len(level.rows) for level in levels])
    (row, first), (column, columns) = _binned(place, _MOST_ROWS), _binned(along, _MOST_COLUMNS)
    cell, size = row * len(columns) + column, len(first) * len(columns)
    count = np.bincount(cell, minlength=size)
    sides = []
    for off in numbers(table, *(f"{part} {when} [%]" for when in ("before", "after"))):
        sums = np.bincount(cell, -np.nan_to_num(off), minlength=size)
        sides.append(np.where(count > 0, sums / np.maximum(count, 1), np.nan).reshape(len(first), -1))
    same = np.array_equal(sides[0], sides[1], equal_nan=True)
    short = [shortened(levels[n].name, _LONGEST) for n in first]
    return Cells(part, short, ends, sides[:1] if same else sides)


def _binned(values: Any, most: int) -> tuple[Array, list[Any]]:
    """Number of the bin of each value, and the first value of each of at most so many bins of neighbours."""
    levels, place = np.unique(values, return_inverse=True)
    bins = np.arange(levels.size) * min(most, levels.size) // levels.size
    return bins[place], levels[np.unique(bins, return_index=True)[1]].tolist()
