"""Figures of a batch: scatter of each quantity with limits and outliers, and measured stiffness curves."""

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from bushfit.effects.contract import Array
from bushfit.reduction.arrays import median_and_scatter
from bushfit.report.batch_document import BatchFile
from bushfit.report.plots import style
from bushfit.report.tables import shorten
from bushfit.units import number, split_header

#: Colours of limits and of values outside the limits, and of values within the limits.
_OUT, _GOOD = "#c1272d", "#31688e"
#: Largest number of bushings whose 95 % intervals are drawn, and whose names are ticks along x; of letters of a tick.
_MOST_INTERVALS, _MOST_ALONG, _MOST_LETTERS_ALONG = 200, 40, 32
#: Largest number of bushings outside the limits that the title of a panel names, and of letters of their names.
_MOST_NAMED, _MOST_LETTERS = 3, 60
#: Distance from the median, in robust standard deviations, from which a value is drawn at the edge of the panel.
_FURTHEST = 12.0
#: Columns of panels, and largest number of panels of a figure, which is then one metre high.
_COLUMNS, _MOST_PANELS = 2, 40
#: Largest number of curves of single parts in a figure.
_MOST_CURVES = 6
#: Header of a column with one point of the measured stiffness curves.
_POINT = re.compile(
    r"measured stiffness (?P<place>.+) (?P<frequency>\S+) Hz (?P<amplitude>\S+) (?P<length>\S+) \[(?P<unit>.+)\]"
)


def quantities_to_draw(batch: BatchFile, table: pd.DataFrame) -> list[str]:
    """Headers of the quantities for `batch_figure`: those with limits, and those known for at least three parts.

    Args:
        batch: content of batch.json.
        table: table of the batch, batch.csv.
    """
    quantities = batch.quantities.items()
    return [header for header, quantity in quantities if table[header].count() >= (1 if quantity.limits else 3)]


@style.fixed_settings()
def batch_figure(batch: BatchFile, table: pd.DataFrame) -> style.Chart:
    """Figure of the scatter of a batch: one panel per quantity, with a point per bushing in the order of the manifest.

    Up to forty quantities are drawn. The names of up to forty bushings are ticks along x.

    Args:
        batch: content of batch.json: names of the bushings, limits, and missed limits.
        table: table of the batch, batch.csv: values and 95 % intervals.

    Returns:
        Figure with two columns of panels.
    """
    headers, names = quantities_to_draw(batch, table), [part.name for part in batch.parts]
    drawn = headers[:_MOST_PANELS]
    tick_names = [shorten(name, _MOST_LETTERS_ALONG) for name in names] if len(names) <= _MOST_ALONG else []
    rows = math.ceil(len(drawn) / _COLUMNS)
    letters = max(map(len, tick_names), default=0)
    figure = style.Chart(f"{batch.title}: {len(names)} bushings", style.ROW * rows + 0.12 * letters)
    grid = figure.subplots(rows, _COLUMNS, sharex=True, squeeze=False)
    for axes in grid.flat[len(drawn) :]:
        axes.remove()
    for index, (axes, header) in enumerate(zip(grid.flat, drawn, strict=False)):
        _draw_quantity(axes, batch, table, header)
        lowest = index + _COLUMNS >= len(drawn)
        axes.tick_params(labelbottom=lowest)
        axes.xaxis.set_in_layout(index // _COLUMNS == rows - 1)  # its labels may extend into the empty cell below
        if tick_names:
            axes.set_xticks(range(1, len(tick_names) + 1), tick_names, rotation=90, fontsize=style.SMALL - 1)
        elif lowest:
            axes.set_xlabel("bushing, in the manifest's order", **style.WORDS)
        axes.set_xlim(0.5, len(names) + 0.5)
    return figure.explain(
        "Grey line: median of the batch.",
        "Bars: 95 % intervals." * (len(names) <= _MOST_INTERVALS),
        "Dashed: limits; red: outside the limits." * any(batch.quantities[header].limits for header in drawn),
        "Triangles: outside the panel.",
        f"The first {len(drawn)} of {len(headers)} quantities." * (len(headers) > len(drawn)),
    )


def _draw_quantity(axes: Axes, batch: BatchFile, table: pd.DataFrame, header: str) -> None:
    """Draw one quantity of all bushings, with its median and limits; the title names bushings outside the limits.

    The y axis contains the limits, a typical 95 % interval, and all values that are not far from the median.

    Args:
        axes: panel.
        batch: content of batch.json.
        table: table of the batch, with n rows.
        header: column header of the quantity.
    """
    all_values, limits = table[header].to_numpy(dtype=float), batch.quantities[header].limits
    name = split_header(header)[0]
    missed = [part.name for part in batch.parts if name in part.misses]
    bad = np.array([name in part.misses for part in batch.parts]) & np.isfinite(all_values)
    x, finite, widths = np.arange(1, len(table) + 1), all_values[np.isfinite(all_values)], np.empty(0)
    if f"{header}, low" in table:
        low_ends, high_ends = (table[f"{header}, {end}"].to_numpy(dtype=float) for end in ("low", "high"))
        widths = (high_ends - low_ends)[np.isfinite(high_ends - low_ends)]
        if len(table) <= _MOST_INTERVALS:
            axes.vlines(x, low_ends, high_ends, color=np.where(bad, _OUT, _GOOD), lw=0.8, alpha=0.6, zorder=2)
    middle, sigma = median_and_scatter(finite)
    near = finite[np.abs(finite - middle) <= _FURTHEST * sigma] if sigma > 0.0 else finite
    half = max(float(np.median(widths)) / 2.0 if widths.size else 0.0, 5e-4 * abs(middle)) or 1.0
    low, high = min(near.min(), *limits, middle - half), max(near.max(), *limits, middle + half)
    values = np.clip(all_values, low, high)
    look = style.POINT if len(table) <= _MOST_INTERVALS else style.DOT
    markers = (("o", values == all_values), ("^", values < all_values), ("v", values > all_values))
    for marker, mask in markers:
        for color, chosen in ((_GOOD, mask & ~bad), (_OUT, mask & bad)):
            axes.plot(x[chosen], values[chosen], marker, color=color, zorder=3, rasterized=True, **look)
    axes.axhline(middle, color=style.GREY, lw=0.9, zorder=1)
    for limit in limits:
        axes.axhline(limit, color=_OUT, lw=0.9, ls=(0, (5, 2)), zorder=3)
    style.label_axes(axes, "", "")
    margin = 0.08 * (high - low)
    axes.set_ylim(low - margin, high + margin)
    axes.xaxis.set_major_locator(MaxNLocator(5, integer=True))
    axes.yaxis.get_offset_text().set_fontsize(style.SMALL)
    title, color = header, style.INK
    if missed:
        more = f" and {len(missed) - _MOST_NAMED} more" if len(missed) > _MOST_NAMED else ""
        named = shorten(", ".join(missed[:_MOST_NAMED]), _MOST_LETTERS)
        title, color = f"{title}: {len(missed)} out\n{named}{more}", _OUT
    axes.set_title(title, loc="left", pad=3, fontsize=style.SMALL, color=color)


@style.fixed_settings()
def curves_figure(headers: Sequence[str], usual: Array, singles: Mapping[str, Array]) -> style.Chart:
    """Figure of the measured stiffness curves of a batch: median and range of the usual parts, and unusual parts.

    Args:
        headers: column headers of the points, such as "measured stiffness axial 25 Hz 0.1 mm [N/mm]", (k,).
        usual: stiffness magnitude of the usual parts, in the unit of the headers, (n, k).
        singles: stiffness magnitude of unusual parts by name, (k,) each; the first six are drawn as single curves.

    Returns:
        Figure with one panel.
    """
    points = [match.groupdict() for header in headers if (match := _POINT.fullmatch(header))]
    place, unit, length = (points[0][name] for name in ("place", "unit", "length"))
    frequency, amplitude = (np.array([float(point[name]) for point in points]) for name in ("frequency", "amplitude"))
    over_frequency = bool(np.ptp(frequency))
    x, x_label = (frequency, "frequency [Hz]") if over_frequency else (amplitude, f"amplitude [{length}]")
    level = f"{number(amplitude[0], 3)} {length}" if over_frequency else f"{number(frequency[0], 3)} Hz"
    figure = style.Chart(f"Dynamic stiffness as measured: {place}, {level}", style.ROW)
    axes = figure.subplots()
    axes.fill_between(x, usual.min(axis=0), usual.max(axis=0), color=style.GREY, alpha=0.3, lw=0, label="other parts")
    axes.plot(x, np.median(usual, axis=0), color=style.INK, lw=style.LINE, label="median")
    named = dict([*singles.items()][:_MOST_CURVES])
    for look, (name, values) in zip(style.styles(len(named), "loop"), named.items(), strict=True):
        line: dict[str, Any] = {"color": look.color, "marker": look.marker, "lw": style.LINE, **style.POINT}
        axes.plot(x, values, label=shorten(name, 24), **line)
    style.label_axes(axes, x_label, f"|K| [{unit}]", x)
    axes.legend()
    names = f" Single curves: {', '.join(named)}." if named else ""
    return figure.explain(f"Measured, without a model: median and range (grey) of the other parts.{names}")
