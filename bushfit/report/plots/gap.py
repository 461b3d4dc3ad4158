"""Measured minus model before and after a diagnosis, in percent: maps of sweeps and curves of loops."""

import math
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure, SubFigure

from bushfit.effects.contract import Array
from bushfit.errors import printable
from bushfit.geometry import Place
from bushfit.model.result import Result
from bushfit.report.plots import style
from bushfit.report.plots.fits import loop_labels
from bushfit.report.plots.measured import (
    SECTOR,
    Curve,
    SweepGroup,
    loops_of,
    means,
    phase_after_turn,
    sector_means,
    sweep_groups,
)

#: Height of a row of a map; least and largest height of a map; height of the scale of colours, of loops [cm].
_LEVEL, _LEAST_MAP, _LARGEST_MAP, _SCALE, _LOOPS = 0.6, 1.7, 4.2, 2.6, 4.4
#: Most rows of a map: each is then 1.7 mm high.
_MOST_ROWS = 24
#: Most cells of a row: each is then 1 mm wide.
_MOST_COLUMNS = 60
#: Percentages at which the colour changes.
_EDGES = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
#: Share of the points that may be beyond the end of the scale, so that outliers do not stretch it.
_BEYOND = 0.02
#: Cells this far below the model bear a bar [%]: red and blue are one grey in a print without colours.
_BARRED = 1.0
#: How the name of a row is placed left of its ticks.
_ROW_NAME: dict[str, Any] = {"rotation": 0, "ha": "right", "va": "center", "ma": "center"}


@style.in_own_style
def gap_figure(table: pd.DataFrame, result: Result, diagnosis: Mapping[str, Any], title: str) -> Figure:
    """Measured minus model of all tests, before and after what was added: one column where nothing changes.

    Sweeps are maps over the stepped quantity (across) and the level (upwards); loops are curves over the phase of the
    cycle. All maps share one scale of colours, the loops of a place one axis.

    Args:
        table: as `tables.gap_table` makes it.
        result: the model to use, whose specimens give places by their names.
        diagnosis: the document of diagnosis.json.
        title: of the figure.

    Returns:
        Figure with a row of panels per map and per place with loops.
    """
    sides = _sides(table, diagnosis)
    sweeps = table[table["kind"] == "sweep"]
    groups = sweep_groups(sweeps, result) if len(sweeps) else []
    loops = list(loops_of(table[table["kind"] == "loop"], result))
    rows = [(group, part) for group in groups for part in ("storage", "loss")]
    heights = [min(max(_LEVEL * len(_map_rows(group)), _LEAST_MAP), _LARGEST_MAP) for group, _ in rows]
    heights += [_LOOPS] * len(loops)
    summary = textwrap.wrap(_summary(diagnosis), 92)
    figure = style.new_figure(title, sum(heights) + _SCALE * bool(rows) + style.LINE * (len(summary) + 2))
    body: SubFigure = figure.subfigures(1, 1, squeeze=False)[0, 0]
    body.suptitle("\n".join(summary), family=style.fonts(), parse_math=False, **style.NAMES)
    grid = body.subplots(len(heights), len(sides), squeeze=False, height_ratios=heights)
    if rows:
        edges, colors = _scale(sweeps, sides)
        for panels, (group, part) in zip(grid, rows, strict=False):
            for axes, side in zip(panels, sides, strict=True):
                _draw_map(axes, group, f"{part} {side} [%]", colors)
            _label_maps(panels, group, part)
        _draw_scale(body, [axes for panels in grid[: len(rows)] for axes in panels], edges, colors)
    for panels, (place, of_place) in zip(grid[len(rows) :], loops, strict=True):
        _draw_loops(panels, place, of_place, list(sides))
    for axes, name in zip(grid[0], sides.values(), strict=True):
        lines = [line for part in name.splitlines() for line in textwrap.wrap(part, 80 // len(sides))]
        axes.set_title("\n".join(lines), weight="bold", pad=7.0, parse_math=False, **style.NAMES)
    repeats = "A cell is the mean of the repeats. "
    return style.explained(
        figure,
        f"Maps: measured minus model in percent of |K|, real part (storage) and imaginary part (loss). {repeats}Pale "
        f"grey: within {_EDGES[0]:g} %. A bar in a cell: {_BARRED:g} % or more below the model. White: not measured."
        * bool(rows),
        f"Loops: measured minus model in percent of half the force range, means over {SECTOR:g}° of the cycle."
        * bool(loops),
    )


def _sides(table: pd.DataFrame, diagnosis: Mapping[str, Any]) -> dict[str, str]:
    """Title of each column of the figure: "before" and, if it differs, "after"."""
    changed = any(
        not np.allclose(table[name], table[str(name).replace("before", "after")], equal_nan=True)
        for name in table
        if str(name).endswith("before [%]")
    )
    gaps = diagnosis["gap"]["calibration"]
    tails = {side: f"\ndata fitted {gap:.2f} × noise" for side, gap in gaps.items() if gap is not None}
    if not changed:
        return {"before": "nothing added" + tails.get("before", "")}
    effects = diagnosis["effects"]
    mistaken = any(effect["test"] for effect in effects)
    added = " and ".join(effect["name"] for effect in effects)
    names = {"before": "tests as recorded", "after": "with the record corrected"} if mistaken else {}
    names = names or {"before": "before", "after": f"after adding {added}" if added else "after"}
    return {side: name + tails.get(side, "") for side, name in names.items()}


def _summary(diagnosis: Mapping[str, Any]) -> str:
    held_out = diagnosis["gap"]["heldout"]
    text = f"{diagnosis['verdict']}: {diagnosis['summary']}"
    if held_out and None not in held_out.values():
        text += f". Held-out data: {held_out['before']:.2f} × noise before, {held_out['after']:.2f} × noise after"
    return printable(text, lines=True)


def _map_rows(group: SweepGroup) -> list[Curve]:
    """The rows of a map: the curves of a group, or neighbouring curves together where there are too many."""
    curves = group.curves
    if len(curves) <= _MOST_ROWS:
        return list(curves)
    blocks = np.array_split(np.arange(len(curves)), _MOST_ROWS)
    merged = []
    for block in blocks:
        rows = pd.concat([curves[index].rows for index in block])
        merged.append(Curve(curves[block[0]].name, curves[block[0]].level, rows))
    return merged


def _scale(sweeps: pd.DataFrame, sides: Mapping[str, str]) -> tuple[Array, ScalarMappable]:
    """Percentages at which the colour changes, and the colours: blue below the model, red above, grey between.

    The scale ends where 2 % of the points are beyond it.
    """
    values = np.abs(sweeps[[f"{part} {side} [%]" for part in ("storage", "loss") for side in sides]].to_numpy())
    needed = int(np.searchsorted(_EDGES, np.nanquantile(values, 1.0 - _BEYOND))) + 1
    edges = np.array(_EDGES[: max(needed, 4)])
    shades = np.linspace(0.12, 1.0, edges.size) / 2.0  # the palest is just visible
    colors = colormaps["RdBu_r"](0.5 + np.concatenate((-shades[::-1], [0.0], shades)))
    colors[edges.size, :3] = 0.92
    both = np.concatenate((-edges[::-1], edges))
    return both, ScalarMappable(BoundaryNorm(both, len(colors), extend="both"), ListedColormap(colors))


def _draw_map(axes: Axes, group: SweepGroup, header: str, colors: ScalarMappable) -> None:
    """Draw a row of cells per level, each as wide as the step."""
    rows = _map_rows(group)
    x_values = np.concatenate([curve.rows[group.x_header] for curve in rows])
    logarithmic = _is_logarithmic(x_values)
    ends = []
    for row, curve in enumerate(rows):
        x, values = _binned(*means(curve.rows, group.x_header, header))
        low, high = _cells(x, logarithmic=logarithmic)
        corners = (low, row - 0.5), (high, row - 0.5), (high, row + 0.5), (low, row + 0.5)
        cells = np.stack([np.stack(np.broadcast_arrays(*corner), axis=1) for corner in corners], axis=1)
        look: dict[str, Any] = {"norm": colors.norm, "cmap": colors.cmap, "lw": 0.0, "antialiaseds": False}
        axes.add_collection(PolyCollection(list(cells), array=values, **look), autolim=False)
        below = values < -_BARRED
        inset = 0.3 * (high - low)[below]
        axes.hlines(np.full(inset.size, row), low[below] + inset, high[below] - inset, color="white", lw=1.1)
        ends.append((low.min(), high.max()))
    x_start, x_end = np.array(ends)[:, 0].min(), np.array(ends)[:, 1].max()
    axes.hlines(np.arange(1, len(rows)) - 0.5, x_start, x_end, color="white", lw=1.5)
    axes.set(ylim=(-0.5, len(rows) - 0.5))
    if logarithmic:
        style.logarithmic(axes, x_values)
    axes.set_xlim(x_start, x_end)
    axes.grid(visible=False)
    axes.spines[:].set(visible=True, color=style.GREY)


def _binned(x: Array, values: Array) -> tuple[Array, Array]:
    """Means of neighbouring points, at most 60."""
    blocks = np.array_split(np.arange(x.size), min(x.size, _MOST_COLUMNS))
    return np.array([x[block].mean() for block in blocks]), np.array([values[block].mean() for block in blocks])


def _is_logarithmic(values: Array) -> bool:
    """Check for values that are spaced more evenly by ratio than by difference."""
    distinct = np.unique(values)
    if distinct.size < 3:
        return False
    ratios, steps = np.diff(np.log(distinct)), np.diff(distinct)
    return bool(np.std(ratios) / np.mean(ratios) < np.std(steps) / np.mean(steps))


def _cells(values: Array, *, logarithmic: bool) -> tuple[Array, Array]:
    """Lower and upper edge of the cell of each value, (n,) each: half way to its neighbours.

    Where one neighbour is much further away than the other, a point was left out and the nearer one decides.
    """
    x = np.log(values) if logarithmic else values
    steps = np.diff(x) if x.size > 1 else np.array([0.2 if logarithmic else 0.2 * x[0]])
    step_below, step_above = (np.concatenate(ends)[: x.size] for ends in ((steps[:1], steps), (steps, steps[-1:])))
    step_below, step_above = (
        np.where(step_below > 1.75 * step_above, step_above, step_below),
        np.where(step_above > 1.75 * step_below, step_below, step_above),
    )
    low, high = x - step_below / 2.0, x + step_above / 2.0
    return (np.exp(low), np.exp(high)) if logarithmic else (np.maximum(low, 0.0), high)


def _label_maps(panels: Sequence[Axes], group: SweepGroup, part: str) -> None:
    names = [style.file_name(curve.name, 24) for curve in _map_rows(group)]
    ticks = np.arange(0, len(names), math.ceil(len(names) / 10))
    for axes in panels:
        axes.set_yticks(ticks, [names[tick] for tick in ticks])
        axes.tick_params(labelleft=axes is panels[0], labelbottom=part == "loss")
        if part == "loss":
            axes.set_xlabel(group.x_header, **style.NAMES)
    style.label_left(panels[0], f"{group.place}\n{part}", **_ROW_NAME)


def _draw_scale(figure: SubFigure, maps: Sequence[Axes], edges: Array, colors: ScalarMappable) -> None:
    bar = figure.colorbar(colors, ax=maps, location="bottom", shrink=0.76, aspect=42, pad=0.03, extendfrac=0.04)
    bar.ax.set_xticks(edges, [f"{edge:g}" for edge in edges], **style.WORDS)
    bar.ax.tick_params(length=2, colors=style.INK)
    bar.outline.set(edgecolor=style.GREY, linewidth=0.6)
    bar.set_label("measured minus model [% of |K|]", **style.NAMES)
    for x, side, words in ((-0.05, "right", "measured\nbelow model"), (1.05, "left", "measured\nabove model")):
        bar.ax.text(x, 0.5, words, transform=bar.ax.transAxes, ha=side, va="center", **style.NAMES)
    middle = (edges[:-1] + edges[1:]) / 2.0
    barred = middle[middle < -_BARRED]
    bar.ax.plot(barred, np.full(barred.size, 0.5), "_", color="white", ms=6, mew=1.1)


def _draw_loops(panels: Sequence[Axes], place: Place, loops: dict[str, pd.DataFrame], sides: Sequence[str]) -> None:
    """Draw the loops of a place over the phase of the cycle, before and after on one scale."""
    looks = style.styles(len(loops), "loop")
    for axes, side in zip(panels, sides, strict=True):
        style.label_axes(axes, "phase after the upper turn [deg]", "")
        for loop, look in zip(loops.values(), looks, strict=True):
            curve = sector_means(phase_after_turn(loop, place), loop[f"force {side} [%]"].to_numpy())
            axes.plot(*curve, color=look.color, ls=look.dashes, lw=1.3)
        axes.axhline(0.0, color=style.GREY, lw=0.6, zorder=1)
        style.widen_span(axes, 1.0)
        axes.set(xlim=(0.0, 360.0), xticks=range(0, 361, 90))
    limits = [axes.get_ylim() for axes in panels]
    for axes in panels:
        axes.set_ylim(min(low for low, _ in limits), max(high for _, high in limits))
        axes.tick_params(labelleft=axes is panels[0])
    style.label_left(panels[0], f"{place}\nloops\n[%]", **_ROW_NAME)
    style.legend(panels[-1], [look.handle(False) for look in looks], loop_labels(place, loops), "")
