"""The gap between model and measurement before and after a diagnosis, in units of noise: maps and loops."""

import math
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from bushfit.effects.contract import Array
from bushfit.fitting.data_sets import DataSet, LoopData, SweepData, parted
from bushfit.geometry import Place
from bushfit.model.model import Model
from bushfit.report.plots import style
from bushfit.report.plots.fits import loop_labels, loops_legend
from bushfit.report.plots.points import SECTORS, Kind, Map, Side, by_direction, by_kind, columns, curves_of, side_of
from bushfit.report.plots.prediction import axis_label
from bushfit.units import told

#: Height of a row of a map; least and largest height of a map, whose name needs two lines, and six of which, of three
#: directions, just fill a page; height of the scale of colours [cm].
_LEVEL, _LEAST_MAP, _LARGEST_MAP, _SCALE = 0.6, 1.7, 4.2, 2.6
#: Height of the panels of loops [cm], with a legend of so many lines.
_LOOPS, _LEGEND_LINES = 4.4, 4
#: Columns and letters of the loops' legend over the width of a figure; letters that the handle of an entry takes.
_LEGEND_COLUMNS, _LEGEND_LETTERS, _HANDLE_LETTERS = 4, 96, 7
#: Where the colour changes, in units of noise: about 1, 2, 5 in each decade.
_EDGES = (1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)
#: Share of the points that may lie beyond the end of the scale: some outliers, so that they do not stretch it.
_BEYOND = 0.02
#: Cells this far below the model bear a bar, in units of noise: red and blue are one grey in a print without colours.
_BARRED = 3.0
#: Loops further off than this, in units of noise, are drawn on a scale that is logarithmic in the end.
_FAR = 40.0
#: Up to where that scale is linear, in units of noise: a little more than a right model scatters.
_NEAR = 5.0
#: How the name of a row stands left of its ticks.
_LEVEL_NAME: dict[str, Any] = {"rotation": 0, "ha": "right", "va": "center", "ma": "center"}


def gap_figure(
    before: Model,
    after: Model,
    data_sets: Sequence[DataSet],
    title: str,
    summary: str,
    *,
    mended: Sequence[DataSet] | None = None,
) -> Figure:
    """How far measurement and model are apart, before and after: sweeps over frequency and amplitude, loops over phase.

    Every value is measured less model, the mean of the repeats or of a sector of the cycle, in units of the noise of
    that mean. All maps share one scale of colours, the loops of a direction one axis. Models that respond alike make
    one column. `mended` are the tests that belong to the model after, where they are others; they are drawn where
    they were recorded.
    """
    every_loop, every_sweep = parted(data_sets)
    loops, sweeps = by_direction(every_loop), by_kind(every_sweep)
    later = dict(zip(data_sets, mended or data_sets, strict=True))
    shown = zip(columns(before, after, later), ({test: test for test in later}, later), strict=False)
    sides = [side_of(model, name, tests, sweeps, loops) for (model, name), tests in shown]
    rows = [(kind, part) for kind in sweeps for part in ("storage", "loss")]
    levels = [np.unique(sides[0].maps[kind].points.held).size for kind, _ in rows]
    heights = [min(max(_LEVEL * count, _LEAST_MAP), _LARGEST_MAP) for count in levels]
    for labels in map(loop_labels, loops.values()):
        entries = min(len(labels), style.MOST_NAMED + 1)  # one more says how many are not named
        lines_of_legend = math.ceil(entries / _legend_columns(labels, len(sides))) * len(labels[0].splitlines())
        heights.append(_LOOPS + style.LINE * max(0, lines_of_legend - _LEGEND_LINES))
    lines = textwrap.wrap(summary, 92)  # as many letters as the width of a figure holds
    figure = style.new_figure(title, sum(heights) + _SCALE * bool(rows) + style.LINE * (len(lines) + 2))
    body: SubFigure = figure.subfigures(1, 1, squeeze=False)[0, 0]
    body.suptitle("\n".join(lines), family=style.fonts(), parse_math=False, **style.NAMES)
    grid = body.subplots(len(heights), len(sides), squeeze=False, height_ratios=heights)
    if rows:
        edges, colors = _scale(sides)
        for row, (kind, part) in zip(grid, rows, strict=False):
            for axes, side in zip(row, sides, strict=True):
                _draw_map(axes, kind, side.maps[kind], part, colors)
            _label_maps(row, kind, part, sides[0].maps[kind], sweeps[kind])
        _draw_scale(body, [axes for row in grid[: len(rows)] for axes in row], edges, colors)
    for row, (direction, mine) in zip(grid[len(rows) :], loops.items(), strict=True):
        _draw_loops(row, direction, mine, [side.loops[direction] for side in sides])
    _head(grid[0], sides)
    return style.explained(figure, *_words(sides[0]))


def _legend_columns(labels: Sequence[str], sides: int) -> int:
    """Columns of the loops' legend above one of so many panels side by side."""
    longest = max(len(line) for label in labels for line in label.splitlines())
    return math.ceil(min(_LEGEND_COLUMNS, _LEGEND_LETTERS // (longest + _HANDLE_LETTERS)) / sides)


def _scale(sides: Sequence[Side]) -> tuple[Array, ScalarMappable]:
    """The values at which the colour changes, in units of noise, and the colours.

    Steps from a pale grey (within the noise) to dark, blue where the measurement is below the model and red above. They
    end where 2 % of the points are left beyond.
    """
    maps = [drawn for side in sides for drawn in side.maps.values()]
    values = np.abs(np.concatenate([part for drawn in maps for part in (drawn.storage, drawn.loss)]))
    needed = int(np.searchsorted(_EDGES, np.quantile(values, 1.0 - _BEYOND))) + 1
    edges = np.array(_EDGES[: max(needed, 4)])  # with fewer, what lies within the noise would look like a find
    shades = np.linspace(0.12, 1.0, edges.size) / 2.0  # the first is just seen
    colors = colormaps["RdBu_r"](0.5 + np.concatenate((-shades[::-1], [0.0], shades)))
    colors[edges.size, :3] = 0.92  # within the noise: nothing that was measured is white
    both = np.concatenate((-edges[::-1], edges))
    return both, ScalarMappable(BoundaryNorm(both, len(colors), extend="both"), ListedColormap(colors))


def _draw_map(axes: Axes, kind: Kind, drawn: Map, part: str, colors: ScalarMappable) -> None:
    """Draw a row of cells per held value, each as wide as the step; what was not measured stays white."""
    values: Array = getattr(drawn, part)
    along = drawn.points.along * (kind.place.display.displacement.factor if kind.axis == "amplitude" else 1.0)
    even = _evenly(along)
    levels, row = np.unique(drawn.points.held, return_inverse=True)
    low, high = np.empty_like(values), np.empty_like(values)
    for level in range(levels.size):
        at = row == level
        low[at], high[at] = _cells(along[at], logarithmic=even)
    corners = (low, -0.5), (high, -0.5), (high, 0.5), (low, 0.5)
    cells = list(np.stack([np.stack((x, row + y), axis=1) for x, y in corners], axis=1))
    look: dict[str, Any] = {"norm": colors.norm, "cmap": colors.cmap, "ec": "face", "lw": 0.2}
    axes.add_collection(PolyCollection(cells, array=values, **look), autolim=False)
    below = values < -_BARRED
    inset = 0.3 * (high - low)[below]
    axes.hlines(row[below], low[below] + inset, high[below] - inset, color="white", lw=1.1)
    axes.hlines(np.arange(1, levels.size) - 0.5, low.min(), high.max(), color="white", lw=1.5)
    axes.set(ylim=(-0.5, levels.size - 0.5))
    if even:
        style.logarithmic(axes, along)
    axes.set_xlim(low.min(), high.max())
    axes.tick_params(labelsize=style.SMALL, colors=style.INK)
    axes.spines[:].set_color(style.GREY)
    axes.set_yticks(np.arange(0, levels.size, math.ceil(levels.size / 10)))


def _evenly(along: Array) -> bool:
    """Whether what is stepped is spaced more evenly by ratio than by difference."""
    distinct = np.unique(along)
    if distinct.size < 3:
        return False
    ratios, steps = np.diff(np.log(distinct)), np.diff(distinct)
    return bool(np.std(ratios) / np.mean(ratios) < np.std(steps) / np.mean(steps))


def _cells(along: Array, *, logarithmic: bool) -> tuple[Array, Array]:
    """Lower and upper edge of the cell of each frequency [Hz] or amplitude, (n,) each.

    They lie half way to the neighbours; where one of them is much further off than the other, as far off as on the
    other's side. The cell of a lone frequency is a fifth as wide as that.
    """
    x = np.log(along) if logarithmic else along
    steps = np.diff(x) if x.size > 1 else np.array([0.2 if logarithmic else 0.2 * x[0]])
    left, right = (np.concatenate(ends)[: x.size] for ends in ((steps[:1], steps), (steps, steps[-1:])))
    far = 1.75  # a step so many times its neighbour is a point that was left out, not a coarse grid
    left, right = np.where(left > far * right, right, left), np.where(right > far * left, left, right)
    low, high = x - left / 2.0, x + right / 2.0
    return (np.exp(low), np.exp(high)) if logarithmic else (np.maximum(low, 0.0), high)


def _label_maps(row: Sequence[Axes], kind: Kind, part: str, drawn: Map, sweeps: Sequence[SweepData]) -> None:
    unit, factor = ("Hz", 1.0) if kind.axis == "amplitude" else kind.place.display.displacement
    levels = np.unique(drawn.points.held)
    names = [told(unit, factor * level) for level in levels]
    if curves := curves_of(sweeps, kind):  # of which a level is the number
        names = [style.file_name(curves[round(level) - 1].name) for level in levels]
    for axes in row:
        axes.set_yticklabels([names[round(tick)] for tick in axes.get_yticks()])
        axes.tick_params(labelleft=axes is row[0], labelbottom=part == "loss")
        if part == "loss":
            axes.set_xlabel(axis_label(kind.place, kind.axis), **style.NAMES)
    style.label_left(row[0], f"{kind.place}\n{part}", **_LEVEL_NAME)


def _head(row: Sequence[Axes], sides: Sequence[Side]) -> None:
    """Write above the first row, and above its legend if it has one, what each column shows."""
    legend = row[0].get_legend()
    height = legend.get_window_extent().height * 72.0 / row[0].figure.dpi if legend else 0.0
    for axes, side in zip(row, sides, strict=True):
        lines = [*textwrap.wrap(side.title, 80 // len(sides)), f"data fitted {side.gap:.2f} x noise"]
        axes.set_title("\n".join(lines), weight="bold", pad=height + 7.0, parse_math=False, **style.NAMES)


def _draw_scale(figure: SubFigure, maps: Sequence[Axes], edges: Array, colors: ScalarMappable) -> None:
    bar = figure.colorbar(colors, ax=maps, location="bottom", shrink=0.76, aspect=42, pad=0.03, extendfrac=0.04)
    every = 1 if edges.size <= 14 else 2  # numbers of more would run together
    from_end = np.minimum(np.arange(edges.size), np.arange(edges.size)[::-1])
    numbers = ["" if place % every else f"{edge:g}" for edge, place in zip(edges, from_end, strict=True)]
    bar.ax.set_xticks(edges, numbers, **style.WORDS)
    bar.ax.tick_params(length=2, colors=style.INK)
    bar.outline.set(edgecolor=style.GREY, linewidth=0.6)
    bar.set_label("measured less model, in units of noise", **style.NAMES)
    for x, side, words in ((-0.05, "right", "measured\nbelow model"), (1.05, "left", "measured\nabove model")):
        bar.ax.text(x, 0.5, words, transform=bar.ax.transAxes, ha=side, va="center", **style.NAMES)
    middle = (edges[:-1] + edges[1:]) / 2.0
    barred = middle[middle < -_BARRED]
    bar.ax.plot(barred, np.full(barred.size, 0.5), "_", color="white", ms=6, mew=1.1)


def _draw_loops(
    row: Sequence[Axes], direction: Place, data_sets: Sequence[LoopData], sides: Sequence[Sequence[tuple[Array, Array]]]
) -> None:
    """Draw what is left of one direction's loops over the phase of the cycle, before and after on one scale."""
    furthest = max(float(np.abs(values).max()) for curves in sides for _, values in curves)
    for axes, curves in zip(row, sides, strict=True):
        style.label_axes(axes, "phase after the upper turn [deg]", "")
        for curve, look in zip(curves, style.styles(len(curves), "loop"), strict=True):
            axes.plot(*curve, color=look.color, ls=look.dashes, lw=1.3)
        if furthest > _FAR:
            axes.set_yscale("symlog", linthresh=_NEAR, linscale=0.7)
            powers = 10.0 ** np.arange(1, int(np.log10(furthest)) + 1)
            axes.yaxis.set_major_locator(FixedLocator([*-powers[::-1], 0.0, *powers]))
            axes.yaxis.set_minor_locator(NullLocator())
            axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        style.noise_band(axes)
        axes.set(xlim=(0.0, 360.0), xticks=range(0, 361, 90))
    limits = [axes.get_ylim() for axes in row]
    for axes in row:
        axes.set_ylim(min(low for low, _ in limits), max(high for _, high in limits))
        axes.tick_params(labelleft=axes is row[0])
    style.label_left(row[0], f"{direction}\nloops\n/ noise", **_LEVEL_NAME)
    loops_legend(
        row[0],
        data_sets,
        title="",
        ncols=_legend_columns(loop_labels(data_sets), len(row)),
        loc="lower left",
        bbox_to_anchor=(-0.02, 1.0),
        handlelength=2.4,
        columnspacing=1.2,
    )


def _words(side: Side) -> list[str]:
    maps, loops = bool(side.maps), bool(side.loops)
    repeated = any(drawn.repeated for drawn in side.maps.values())
    within = " and ".join(["within 2 (maps)"] * maps + ["in the grey (loops)"] * loops)
    merged = max((drawn.merged for drawn in side.maps.values()), default=1)
    points = [drawn.points for drawn in side.maps.values()]
    holes = any(each.along.size < np.unique(each.along).size * np.unique(each.held).size for each in points)
    of = [*["its repeats"] * repeated, *[f"up to {merged} neighbouring rows"] * (merged > 1)]
    across = "frequency across, amplitude"
    if any(kind.stepped != "frequency" for kind in side.maps):
        across = "across what is stepped (or the frequency), what is held (or the test)"
    return [
        f"Maps: {across} upwards; pale grey: model and measurement agree within the noise. A bar in a cell: 3 and more "
        "below." * maps,
        f"A cell is the mean of {' and of '.join(of)}, in units of the noise of that mean." * bool(of),
        "White: not measured." * holes,
        f"Loops: measured less model over the cycle, means over {360 // SECTORS} deg, in units of the noise of that "
        "mean." * loops,
        f"Where the model is right, 95 % lie {within}.",
    ]
