"""Pictures of many bushings: the scatter of a batch, its limits and who is out of them; and results side by side."""

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from bushfit.effects.contract import Array
from bushfit.reduction.arrays import scatter
from bushfit.report.compared import SideBySide
from bushfit.report.plots import style
from bushfit.report.tables import shortened
from bushfit.units import number

#: Colour of limits and of what is out of them.
_OUT = "#c1272d"
#: Colour of what is within the limits.
_GOOD = "#31688e"
#: Up to this many bushings are drawn as single points; beyond, as a cloud with its histogram.
_CLOUD = 200
#: Most bushings whose names stand along x, and most letters of these: more do not fit along a panel.
_MOST_ALONG, _MOST_LETTERS_ALONG = 40, 32
#: Most bushings that a panel names, and most letters of these, which then are half as wide as the panel.
_MOST_NAMED, _MOST_LETTERS = 4, 24
#: Width of a letter in a panel, as a share of the panel's, and height of a line [point].
_LETTER, _LINE = 0.021, 8.5
#: Values further out than this many robust standard deviations are drawn at the edge.
_FURTHEST = 12.0
#: Panels side by side.
_COLUMNS = 2
#: Most panels of a picture: it is then a metre high.
_MOST_PANELS = 40
#: Width of a line [point].
_STROKE = 1.3
#: Dashes of the smallest and of the largest value that is held.
_DASHES = ("-", (0, (4, 1.5)))
#: Markers on a line, or fewer: they tell lines apart in grey print.
_MARKS = 5
#: Curves of single parts in one picture at most.
_MOST_CURVES = 6
#: Header of a point of a measured curve.
_POINT = re.compile(
    r"measured stiffness (?P<place>.+) (?P<frequency>\S+) Hz (?P<amplitude>\S+) (?P<length>\S+) \[(?P<unit>.+)\]"
)


@dataclass(frozen=True, eq=False)
class Panel:
    """One quantity of a batch.

    Args:
        title: what it is, with its unit.
        values: value of each bushing, NaN where it is not known, (n,).
        allowed: the lowest and the highest allowed value; empty where there is no limit.
        missed: places of the bushings that miss it.
        intervals: ends of the 95 % intervals, (2, n), where they are known.
    """

    title: str
    values: Array
    allowed: tuple[float, ...] = ()
    missed: Collection[int] = ()
    intervals: Array | None = None


@style.in_own_style
def batch_figure(panels: Sequence[Panel], title: str, names: Sequence[str]) -> Figure:
    """Two columns of panels, the bushings along x in the manifest's order; of more than forty quantities the first.

    Args:
        panels: quantities of the batch.
        title: name of the batch.
        names: names of the bushings, (n,); they are ticks along x where they are few.

    Returns:
        Figure with a panel per quantity.
    """
    drawn = panels[:_MOST_PANELS]
    tick_names = [shortened(name, _MOST_LETTERS_ALONG) for name in names] if len(names) <= _MOST_ALONG else []
    lines = math.ceil(len(drawn) / _COLUMNS)
    height = style.ROW * (0.9 + 0.1 * bool(tick_names)) * lines + 0.35 * style.FRAME
    height += 0.12 * max(0, max(map(len, tick_names), default=0) - 16)  # there is room for 16 letters as it is
    figure = style.new_figure(f"{title}: {len(names)} bushings", height)
    grid = figure.subplots(lines, _COLUMNS, sharex=True, squeeze=False)
    for axes in grid.flat[len(drawn) :]:
        axes.set_visible(False)
    for place, (axes, panel) in enumerate(zip(grid.flat, drawn, strict=False)):
        _draw(axes, panel, names)
        lowest = place + _COLUMNS >= len(drawn)
        axes.tick_params(labelbottom=lowest)
        axes.xaxis.set_in_layout(place // _COLUMNS == lines - 1)  # else its labels hang into the empty cell below
        if tick_names:
            ticks = range(1, len(tick_names) + 1)
            axes.set_xticks(
                ticks, tick_names, rotation=90, fontsize=style.SMALL - 1, family=style.fonts(), parse_math=False
            )
        elif lowest:
            axes.set_xlabel("bushing, in the manifest's order", **style.WORDS)
        axes.set_xlim(0.5, len(names) + 0.5)
    limits = (
        "Dashed: limits; red: outside the limits, the worst with its name."
        if any(panel.allowed for panel in drawn)
        else ""
    )
    beyond_note = "Triangles: outside the panel; the farthest has its name and value."
    few = len(names) <= _CLOUD and any(panel.intervals is not None for panel in drawn)
    more = f"The first {len(drawn)} of {len(panels)} quantities." * (len(panels) > len(drawn))
    return style.explained(
        figure, "Grey line: median of the batch.", "Bars: 95 % intervals." * few, limits, beyond_note, more
    )


def _draw(axes: Axes, panel: Panel, names: Sequence[str]) -> None:
    """One quantity over all bushings, with its limits and the names of those that miss them."""
    finite = np.isfinite(panel.values)
    place, values = np.flatnonzero(finite), panel.values[finite]
    ends = None if panel.intervals is None else panel.intervals[:, finite]
    low, high = _reach(values, panel.allowed, ends)
    clipped = np.clip(values, low, high)
    bad = np.isin(place, list(panel.missed))
    cloud = values.size > _CLOUD
    good_style = {**style.DOT, "ms": 1.6, "alpha": max(0.15, min(1.0, 1500 / values.size))} if cloud else style.POINT
    if ends is not None and not cloud:
        axes.vlines(place + 1, *ends, color=np.where(bad, _OUT, _GOOD), lw=0.8, alpha=0.6, zorder=2)
    kinds = (~bad, _GOOD, good_style, 2), (bad, _OUT, style.DOT if cloud else style.POINT, 4)
    for chosen, color, look, order in kinds:
        for marker, mask in (("o", clipped == values), ("^", clipped < values), ("v", clipped > values)):
            subset, drawn = chosen & mask, look if marker == "o" else style.POINT
            axes.plot(place[subset] + 1, clipped[subset], marker, color=color, zorder=order, rasterized=cloud, **drawn)
    axes.axhline(float(np.median(values)), color=style.GREY, lw=0.9, zorder=1)
    for limit in filter(math.isfinite, panel.allowed):
        axes.axhline(limit, color=_OUT, lw=0.9, ls=(0, (5, 2)), zorder=3)
    style.label_axes(axes, "", "")
    margin = 0.08 * (high - low)
    axes.set_ylim(low - margin, high + margin)
    axes.xaxis.set_major_locator(MaxNLocator(5, integer=True))
    axes.yaxis.get_offset_text().set_fontsize(style.SMALL)
    count = f": {len(panel.missed)} out" if panel.missed else ""
    axes.set_title(panel.title + count, fontsize=style.SMALL, loc="left", color=_OUT if count else style.INK, pad=3)
    _name(axes, panel, (low, high), names)
    if cloud:  # how many bushings lie where, at the right edge
        counts, edges = np.histogram(clipped, bins=60, range=axes.get_ylim())
        side = axes.inset_axes((1.005, 0.0, 0.13, 1.0), sharey=axes)
        side.barh(edges[:-1], counts, height=np.diff(edges), align="edge", color=_GOOD, alpha=0.5, lw=0)
        side.set_axis_off()


def _reach(values: Array, allowed: Sequence[float], ends: Array | None) -> tuple[float, float]:
    """Lowest and highest value to show.

    They hold all values but those far out, the limits, and a usual 95 % interval: no smaller difference means anything.
    """
    middle, sigma = scatter(values)
    spread = _FURTHEST * sigma
    limits = [limit for limit in allowed if math.isfinite(limit)]
    near = values[np.abs(values - middle) <= spread] if spread > 0.0 else values
    half = np.ptp(ends, axis=0) / 2.0 if ends is not None else np.empty(0)
    half = half[np.isfinite(half)]
    rounding = 5e-4 * abs(middle)
    minimum_half = max(float(np.median(half)) if half.size else 0.0, rounding) or 1.0
    return min(float(near.min()), *limits, middle - minimum_half), max(
        float(near.max()), *limits, middle + minimum_half
    )


def _name(axes: Axes, panel: Panel, reach: tuple[float, float], names: Sequence[str]) -> None:
    """Name the bushings that miss a limit or lie beyond the panel, furthest out first, so that no name covers another.

    What lies beyond the panel bears the value that it does not show.
    """
    low, high = panel.allowed if panel.allowed else (-math.inf, math.inf)
    middle = float(np.nanmedian(panel.values))
    outside = set(np.flatnonzero((panel.values < reach[0]) | (panel.values > reach[1])).tolist())

    def order(k: int) -> tuple[bool, float]:
        value = panel.values[k]
        return k not in panel.missed, min(high - value, value - low) if k in panel.missed else -abs(value - middle)

    occupied: list[tuple[float, float, int, bool]] = []
    for k in sorted(outside.union(panel.missed), key=order)[:_MOST_NAMED]:
        value = float(np.clip(panel.values[k], *reach))
        text = shortened(names[k], _MOST_LETTERS) + (f": {number(panel.values[k], 3)}" if k in outside else "")
        place, above = (k + 0.5) / panel.values.size, value < (reach[0] + reach[1]) / 2.0
        half, line = 0.5 * _LETTER * len(text), 1
        center = min(max(place, half), 1.0 - half)
        while any(
            abs(center - other_center) < half + room and other_line == line and side == above
            for other_center, room, other_line, side in occupied
        ):
            line += 1
        occupied.append((center, half, line, above))
        axes.annotate(
            text,
            (center, value),
            xycoords=("axes fraction", "data"),
            xytext=(0, (1 if above else -1) * _LINE * line),
            textcoords="offset points",
            ha="center",
            va="center",
            bbox={"facecolor": "white", "alpha": 0.7, "lw": 0, "pad": 0.3},
            fontsize=style.SMALL - 1,
            color=_OUT if k in panel.missed else style.GREY,
            family=style.fonts(),
            parse_math=False,
            zorder=1.5,
        )


@style.in_own_style
def curves_figure(headers: Sequence[str], usual: Array, singles: Mapping[str, Array]) -> Figure:
    """Measured stiffness curves of a batch: median and range of the usual parts, and single parts.

    Args:
        headers: columns of the points, such as "measured stiffness axial 25 Hz 0.1 mm [N/mm]", (k,).
        usual: stiffness of the parts that do not differ, in the unit of the headers, (n, k).
        singles: stiffness of the parts that differ, by name, (k,) each; six are drawn.

    Returns:
        Figure with one panel.
    """
    points = [match.groupdict() for header in headers if (match := _POINT.fullmatch(header))]
    place, unit, length = (points[0][name] for name in ("place", "unit", "length"))
    frequency, amplitude = (np.array([float(point[name]) for point in points]) for name in ("frequency", "amplitude"))
    over_frequency = bool(np.ptp(frequency))
    x, x_label = (frequency, "frequency [Hz]") if over_frequency else (amplitude, f"amplitude [{length}]")
    level = f"{number(amplitude[0], 3)} {length}" if over_frequency else f"{number(frequency[0], 3)} Hz"
    figure = style.new_figure(f"Dynamic stiffness as measured: {place}, {level}", style.ROW + 0.35 * style.FRAME)
    axes = figure.subplots()
    axes.fill_between(x, usual.min(axis=0), usual.max(axis=0), color=style.GREY, alpha=0.3, lw=0, label="other parts")
    axes.plot(x, np.median(usual, axis=0), color=style.INK, lw=_STROKE, label="median")
    named = dict([*singles.items()][:_MOST_CURVES])
    for look, (name, values) in zip(style.styles(len(named), "loop"), named.items(), strict=True):
        axes.plot(
            x, values, color=look.color, marker=look.marker, lw=_STROKE, **style.POINT, label=style.file_name(name, 24)
        )
    style.label_axes(axes, x_label, f"|K| [{unit}]", x)
    axes.legend(fontsize=style.SMALL, frameon=False)
    names = f" Single curves: {', '.join(named)}." if named else ""
    return style.explained(
        figure, f"Measured, without a model: median of the parts, and range of those that do not differ (grey).{names}"
    )


@style.in_own_style
def comparison_figure(comparison: SideBySide) -> Figure:
    """All results at every place they are compared at: two rows of panels a place, the differences below the values.

    Drawn over frequency at the smallest and the largest amplitude, or over amplitude where there is one frequency.

    Args:
        comparison: validated comparison.

    Returns:
        Figure with four panels per place.
    """
    first, *other_labels = comparison.names
    contrasts = [comparison.curves(place) for place in comparison.places]
    figure = style.new_figure(f"{', '.join(other_labels)} against {first}", 2 * len(contrasts) * style.ROW)
    grid = figure.subplots(2 * len(contrasts), 2, squeeze=False)
    looks = dict(zip(comparison.names, style.styles(len(comparison.names), "loop"), strict=True))
    for i, sides in enumerate(contrasts):
        for axes, panel in zip(grid[2 * i : 2 * i + 2].flat, sides.panels, strict=True):
            for line in panel.lines:
                look, line_style = looks[line.label], {"ls": _DASHES[line.level], "lw": _STROKE, **style.POINT}
                markers = {"marker": look.marker, "markevery": max(line.x.size // _MARKS, 1)}
                axes.plot(line.x, line.value, color=look.color, **markers, **line_style)
                # bands of several results lie on each other
                axes.fill_between(line.x, line.low, line.high, color=look.color, alpha=0.18, lw=0)
            y_label = panel.header if panel.minimum_span else f"{sides.place} {panel.header}"
            style.label_axes(axes, sides.x_header, y_label, panel.lines[0].x)
            if panel.minimum_span:
                axes.axhline(0.0, color=looks[first].color, lw=_STROKE)
                style.widen_span(axes, panel.minimum_span)
        marked = {"lw": _STROKE, **style.POINT}
        lines = [Line2D([], [], color=look.color, marker=look.marker, **marked) for look in looks.values()]
        dashes = [Line2D([], [], color=style.INK, lw=_STROKE, ls=dash) for dash in _DASHES[: len(sides.levels)]]
        called = [f"{label}: {style.file_name(name)}" for label, name in comparison.names.items()]
        style.legend(grid[2 * i, 1], lines, called, "", extra_lines=dict(zip(sides.levels, dashes, strict=True)))
    return style.explained(
        figure,
        "Shaded: 95 % bands. Lower panels: the band of each point by itself; "
        "compare.json and the terminal state what is valid for all points together.",
    )
