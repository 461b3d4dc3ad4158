"""Figure of the gap, measured minus model in percent, before and after a diagnosis: maps of sweeps, curves of loops."""

import math
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap

from bushfit.effects.contract import Array
from bushfit.effects.unnamed import NAME as UNNAMED
from bushfit.effects.unnamed import effect_label
from bushfit.geometry import Place
from bushfit.model.result import Result
from bushfit.report.plots import style
from bushfit.report.plots.fits import loop_labels
from bushfit.report.plots.measured import (
    SECTOR,
    Curve,
    SweepGroup,
    draw_sector_means,
    loops_by_direction,
    sweep_groups,
)
from bushfit.report.tables import shorten

#: Heights [cm]: row of a map; smallest and largest map; colour bar; panel of loops; labels of a row of panels.
_LEVEL, _LEAST_MAP, _LARGEST_MAP, _SCALE, _LOOPS, _LABELS = 0.6, 1.9, 4.2, 0.5, 4.4, 0.85
#: Largest number of rows of a map (each then 1.7 mm high) and of cells of a row (each then 1 mm wide).
_MOST_ROWS, _MOST_COLUMNS = 24, 60
#: Percentages at which the colour changes.
_EDGES = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
#: Share of the points that may be beyond the end of the scale, so that outliers do not stretch it.
_BEYOND = 0.02
#: Distance below the model [%] from which a cell has a bar: red and blue look the same in grey print.
_BARRED = 1.0
#: Text properties of the name of a row, left of its ticks.
_ROW_NAME: dict[str, Any] = {"rotation": 0, "ha": "right", "va": "center", "ma": "center"}


@style.fixed_settings()
def gap_figure(table: pd.DataFrame, result: Result, diagnosis: Mapping[str, Any], title: str) -> style.Chart:
    """Figure of the gap, measured minus model in percent, of all tests before and after a diagnosis.

    Sweeps over frequency are colour maps with the frequency across and the fixed amplitude upwards; for sweeps over
    amplitude, it is the other way round. Loops are curves over the phase of the cycle. All maps share one colour scale,
    and all loops of one direction or specimen share one y axis.

    Args:
        table: gap of every sweep point and loop row, with the columns of `diagnosed.gap_table` (gap.csv).
        result: final model, which gives the specimens by their names.
        diagnosis: content of diagnosis.json.
        title: title of the figure.

    Returns:
        Figure with two columns, before and after, or one column if the diagnosis changes nothing.
    """
    sides = column_titles(table, result, diagnosis)
    sweeps = table[table["kind"] == "sweep"]
    groups = sweep_groups(sweeps, result) if len(sweeps) else []
    maps = [(group, map_rows(group)) for group in groups]
    loops = list(loops_by_direction(table[table["kind"] == "loop"], result))
    heights = [2.0 * min(max(_LEVEL * len(rows), _LEAST_MAP), _LARGEST_MAP) for _, rows in maps]
    heights += [_SCALE] * bool(maps) + [_LOOPS] * len(loops)
    whole_title = f"{title}, {diagnosis['verdict']}: {diagnosis['summary']}"
    figure = style.Chart(whole_title, sum(heights) + _LABELS * len(heights))
    grid = figure.add_gridspec(len(heights), 1, height_ratios=heights)
    first: list[Axes] = []
    if maps:
        edges, colors = color_scale(sweeps, list(sides))
        for row, (group, rows) in enumerate(maps):
            panels = grid[row].subgridspec(2, len(sides), hspace=0.08, wspace=0.1).subplots(squeeze=False)
            names = [shorten(curve.name, 24) for curve in rows]
            ticks = np.arange(0, len(names), math.ceil(len(names) / 10))
            for of_part, part in zip(panels, ("storage", "loss"), strict=True):
                for axes, side in zip(of_part, sides, strict=True):
                    draw_map(axes, group, rows, f"{part} {side} [%]", colors)
                    axes.set_yticks(ticks, [names[tick] for tick in ticks])
                    axes.tick_params(labelleft=axes is of_part[0], labelbottom=part == "loss")
                    axes.set_xlabel(group.x_header if part == "loss" else "")
                style.label_left(of_part[0], f"{group.place}\n{part}", **_ROW_NAME)
            first = first or list(panels[0])
        _draw_scale(figure.add_subplot(grid[len(maps)]), edges, colors)
    for row, (place, of_place) in enumerate(loops, start=len(heights) - len(loops)):
        panels = grid[row].subgridspec(1, len(sides), wspace=0.1).subplots(squeeze=False)[0]
        _draw_loops(panels, place, of_place, list(sides))
        first = first or list(panels)
    for axes, name in zip(first, sides.values(), strict=True):
        lines = [line for part in name.splitlines() for line in textwrap.wrap(part, 80 // len(sides))]
        axes.set_title("\n".join(lines), weight="bold", pad=7.0, **style.NAMES)
    held_out, note = diagnosis["gap"]["heldout"], ""
    if held_out and None not in held_out.values():
        note = f"Held-out data: {held_out['before']:.2f} × noise before, {held_out['after']:.2f} × noise after."
    return figure.explain(
        "Maps: measured minus model in percent of |K|, real part (storage) and imaginary part (loss). A cell is the "
        f"mean of its points. Pale grey: within {_EDGES[0]:g} %. A bar in a cell: {_BARRED:g} % or more below the "
        "model. White: not measured." * bool(maps),
        f"Loops: measured minus model in percent of half the force range, means over {SECTOR:g}° of the cycle."
        * bool(loops),
        note=note,
    )


def column_titles(table: pd.DataFrame, result: Result, diagnosis: Mapping[str, Any]) -> dict[str, str]:
    """Titles of the columns of the figure, with the root mean square gap in units of noise.

    Args:
        table: gap of every sweep point and loop row, with the columns of `diagnosed.gap_table` (gap.csv).
        result: final model.
        diagnosis: content of diagnosis.json.

    Returns:
        Titles by the keys "before" and, if the diagnosis changes anything, "after".
    """
    headers = [str(header) for header in table if str(header).endswith("before [%]")]
    pairs = ((table[header], table[header.replace("before", "after")]) for header in headers)
    changed = not all(np.allclose(*pair, equal_nan=True) for pair in pairs)
    names = {"before": "before", "after": "after"}
    if not changed:
        names = {"before": "nothing added"}
    elif any(effect["test"] for effect in diagnosis["effects"]):
        names = {"before": "tests as recorded", "after": "with the record corrected"}
    else:
        found = {UNNAMED, *(effect["name"] for effect in diagnosis["effects"])}
        added = [effect_label(name) for name in result.model.effects if name in found]
        names["after"] = f"after adding {' and '.join(added)}" if added else names["after"]
    gaps = diagnosis["gap"]["calibration"]
    tails = {side: f"\nfitted {gaps[side]:.2f} × noise" for side in names if gaps[side] is not None}
    return {side: name + tails.get(side, "") for side, name in names.items()}


def map_rows(group: SweepGroup) -> list[Curve]:
    """Rows of the colour map of a group of sweeps: its curves, with neighbours merged if there are more than 24."""
    curves = group.curves
    if len(curves) <= _MOST_ROWS:
        return list(curves)
    blocks = np.array_split(np.arange(len(curves)), _MOST_ROWS)
    rows = [pd.concat([curves[index].rows for index in block]) for block in blocks]
    return [curves[block[0]]._replace(rows=merged) for block, merged in zip(blocks, rows, strict=True)]


def color_scale(sweeps: pd.DataFrame, sides: Sequence[str]) -> tuple[Array, ScalarMappable]:
    """Colour scale of the gap of sweeps: blue below the model, red above, grey between.

    The scale ends at the percentage that at most 2 % of the points exceed, and at 50 % at the most.

    Args:
        sweeps: rows of the sweeps in the table of the gap.
        sides: columns of the figure, "before" and "after".

    Returns:
        Percentages at which the colour changes, ascending, (k,); and the map from percentages to k + 1 colours.
    """
    values = np.abs(sweeps[[f"{part} {side} [%]" for part in ("storage", "loss") for side in sides]].to_numpy())
    needed = int(np.searchsorted(_EDGES, np.nanquantile(values, 1.0 - _BEYOND))) + 1
    edges = np.array(_EDGES[: max(needed, 4)])
    shades = np.linspace(0.12, 1.0, edges.size) / 2.0  # the palest is just visible
    colors = colormaps["RdBu_r"](0.5 + np.concatenate((-shades[::-1], [0.0], shades)))
    colors[edges.size, :3] = 0.92
    both = np.concatenate((-edges[::-1], edges))
    return both, ScalarMappable(BoundaryNorm(both, len(colors), extend="both"), ListedColormap(colors))


def draw_map(axes: Axes, group: SweepGroup, rows: Sequence[Curve], header: str, colors: ScalarMappable) -> None:
    """Draw the gap of a group of sweeps as a colour map: a row per fixed amplitude (or frequency), a cell per step.

    Args:
        axes: panel.
        group: group of sweeps, which gives the quantity across.
        rows: points of each row of the map, the smallest amplitude or frequency first.
        header: header of the column to draw, measured minus model [%].
        colors: colour scale from `color_scale`.
    """
    x_values = np.unique(np.concatenate([row.rows[group.x_header] for row in rows]))
    steps, ratios = np.diff(x_values), np.diff(np.log(x_values))
    logarithmic = x_values.size > 2 and np.std(ratios) / np.mean(ratios) < np.std(steps) / np.mean(steps)
    ends = []
    for y, row in enumerate(rows):
        means = row.rows.groupby(group.x_header)[header].mean()
        blocks = np.array_split(np.arange(means.size), min(means.size, _MOST_COLUMNS))
        columns = means.index.to_numpy(), means.to_numpy()
        x, values = (np.array([column[block].mean() for block in blocks]) for column in columns)
        low, high = cell_edges(x, logarithmic=bool(logarithmic))
        cells = list(zip(low.tolist(), (high - low).tolist(), strict=True))
        look: dict[str, Any] = {"norm": colors.norm, "cmap": colors.cmap, "lw": 0.0, "antialiaseds": False}
        axes.broken_barh(cells, (y - 0.5, 1.0), array=values, **look)
        below = values < -_BARRED
        inset = 0.3 * (high - low)[below]
        axes.hlines(np.full(inset.size, y), low[below] + inset, high[below] - inset, color="white", lw=1.1)
        ends.append((low.min(), high.max()))
    x_start, x_end = min(low for low, _ in ends), max(high for _, high in ends)
    axes.hlines(np.arange(1, len(rows)) - 0.5, x_start, x_end, color="white", lw=1.5)
    axes.set(ylim=(-0.5, len(rows) - 0.5))
    if logarithmic:
        style.make_logarithmic(axes, x_values)
    axes.set_xlim(x_start, x_end)
    axes.grid(visible=False)
    axes.spines[:].set(visible=True, color=style.GREY)


def cell_edges(values: Array, *, logarithmic: bool) -> tuple[Array, Array]:
    """Lower and upper edges, (n,) each, of the cells of a map, half way between neighbouring values.

    If one neighbour is much further away than the other, a point is missing and the nearer neighbour sets both edges.

    Args:
        values: ascending frequencies or amplitudes of the cells in the unit of the axis, (n,).
        logarithmic: True for a logarithmic axis; half way is then the geometric mean.
    """
    x = np.log(values) if logarithmic else values
    steps = np.diff(x) if x.size > 1 else np.array([0.2 if logarithmic else 0.2 * x[0]])
    below, above = np.append(steps[:1], steps)[: x.size], np.append(steps, steps[-1:])[: x.size]
    low = x - np.where(below > 1.75 * above, above, below) / 2.0
    high = x + np.where(above > 1.75 * below, below, above) / 2.0
    return (np.exp(low), np.exp(high)) if logarithmic else (np.maximum(low, 0.0), high)


def _draw_scale(axes: Axes, edges: Array, colors: ScalarMappable) -> None:
    """Draw the colour bar that all maps share in its own panel."""
    axes.set_axis_off()
    bar = axes.figure.colorbar(colors, cax=axes.inset_axes((0.12, 0.0, 0.76, 0.7)), orientation="horizontal")
    bar.ax.set_xticks(edges, ["" if edge == -_EDGES[0] else f"{edge:g}" for edge in edges], **style.WORDS)  # room
    bar.ax.tick_params(length=2)
    bar.outline.set(edgecolor=style.GREY, linewidth=0.6)
    bar.set_label("measured minus model [% of |K|]")
    for x, side, text in ((-0.05, "right", "measured\nbelow model"), (1.05, "left", "measured\nabove model")):
        bar.ax.text(x, 0.5, text, transform=bar.ax.transAxes, ha=side, va="center", **style.NAMES)
    middle = (edges[:-1] + edges[1:]) / 2.0
    barred = middle[middle < -_BARRED]
    bar.ax.plot(barred, np.full(barred.size, 0.5), "_", color="white", ms=6, mew=1.1)


def _draw_loops(panels: Sequence[Axes], place: Place, loops: dict[str, pd.DataFrame], sides: Sequence[str]) -> None:
    """Draw measured minus model force of the loops of a direction over the phase of the cycle, before and after.

    Args:
        panels: one panel per side, with a common y scale.
        place: direction or specimen of the loops.
        loops: rows of each loop by the name of its test, with the gap in percent of half the force range.
        sides: columns of the figure, "before" and "after".
    """
    looks = style.styles(len(loops), "loop")
    for axes, side in zip(panels, sides, strict=True):
        style.label_axes(axes, "phase after peak [deg]", "")
        for loop, look in zip(loops.values(), looks, strict=True):
            draw_sector_means(axes, loop, place, f"force {side} [%]", look)
        axes.axhline(0.0, color=style.GREY, lw=0.6, zorder=1)
        style.widen_span(axes, 1.0)
    limits = [axes.get_ylim() for axes in panels]
    for axes in panels:
        axes.set_ylim(min(low for low, _ in limits), max(high for _, high in limits))
        axes.tick_params(labelleft=axes is panels[0])
    style.label_left(panels[0], f"{place}\nloops\n[%]", **_ROW_NAME)
    style.legend(panels[-1], [look.handle(False) for look in looks], loop_labels(place, loops), "")
