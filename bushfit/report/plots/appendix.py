"""Figures for the appendix of a report: storage and loss stiffness, Cole-Cole, and confidence ellipses."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.special import fdtri

from bushfit.effects.contract import Array
from bushfit.model.model import FIVE
from bushfit.model.result import Result
from bushfit.prediction.stiffness import Prediction
from bushfit.report.parameters import ParameterRow, parameter_rows
from bushfit.report.plots import style
from bushfit.report.plots.measured import sweep_groups
from bushfit.report.plots.prediction import lines_of
from bushfit.report.tables import columns_of, spread
from bushfit.units import format_range

#: Most amplitudes that are drawn.
_MOST_LEVELS = 6
#: Side of a cell of the matrix of ellipses [cm].
_CELL = 2.3
#: Correlation from which a pair is marked: only its combination is known well.
_STRONG = 0.9


@style.in_own_style
def complex_figure(result: Result, prediction: Prediction, table: pd.DataFrame | None, title: str) -> Figure:
    """Storage and loss stiffness over frequency, and loss over storage stiffness (Cole-Cole), per amplitude.

    Args:
        result: the model.
        prediction: of one place, at two frequencies or more.
        table: sweeps, as `tables.sweeps_table` makes it; those that step the frequency are laid over; None without.
        title: of the figure.
    """
    place = prediction.direction
    amplitude_header, stiffness_header, _ = columns_of(place)
    (unit, length), _, (stiffness_unit, factor) = place.display
    lines = lines_of(result, prediction).bushing
    levels = np.unique(prediction.amplitude)
    levels = levels[spread(levels.size, _MOST_LEVELS)]
    measured = _measured(result, prediction, table)
    figure = style.new_figure(title, style.ROW)
    storage, loss, cole_cole = figure.subplots(1, 3)
    for level, look in zip(levels, style.styles(levels.size, "amplitude"), strict=True):
        here = lines.amplitude == level
        frequency = lines.frequency[here]
        for axes, band in ((storage, lines.storage_stiffness), (loss, lines.loss_stiffness)):
            axes.plot(frequency, factor * band.value[here], color=look.color, ls=look.dashes, lw=1.1)
            axes.fill_between(frequency, factor * band.low[here], factor * band.high[here], color=look.color, alpha=0.2)
        real, imaginary = (factor * b.value[here] for b in (lines.storage_stiffness, lines.loss_stiffness))
        cole_cole.plot(real, imaginary, color=look.color, ls=look.dashes, lw=1.1)
        near = measured[np.isclose(measured[amplitude_header], level * length, 0.01, 0.0)]
        x, magnitude, loss_factor = (near[name] for name in ("frequency [Hz]", stiffness_header, "loss factor [-]"))
        real = magnitude / np.sqrt(1.0 + loss_factor**2)
        imaginary = loss_factor * real
        for axes, points in ((storage, (x, real)), (loss, (x, imaginary)), (cole_cole, (real, imaginary))):
            axes.plot(*points, look.marker, color=look.color, **style.DOT)
    style.label_axes(storage, "frequency [Hz]", f"storage {stiffness_header}", lines.frequency)
    style.label_axes(loss, "frequency [Hz]", f"loss {stiffness_header}", lines.frequency)
    style.label_axes(cole_cole, f"storage [{stiffness_unit}]", f"loss [{stiffness_unit}]")
    style.name_levels(
        cole_cole, [format_range(unit, length * level) for level in levels], "amplitude", [True] * levels.size
    )
    return style.explained(figure, "Lines: model, shaded: its 95 % band. Points: measured, mean of the repeats.")


def _measured(result: Result, prediction: Prediction, table: pd.DataFrame | None) -> pd.DataFrame:
    """Means over the repeats of the sweeps at the place of a prediction that step the frequency."""
    amplitude, stiffness, _ = columns_of(prediction.direction)
    keys, values = ["frequency [Hz]", amplitude], [stiffness, "loss factor [-]"]
    if table is None or table.empty:
        return pd.DataFrame(columns=[*keys, *values], dtype=float)
    here = table[table["direction"] == str(prediction.direction)]
    groups = [group for group in sweep_groups(here, result) if group.axis == "frequency" and group.shares_levels]
    rows = [curve.rows[curve.rows["outlier"] == "no"] for group in groups for curve in group.curves]
    empty = pd.DataFrame(columns=[*keys, *values], dtype=float)
    return pd.concat(rows).groupby(keys, as_index=False)[values].mean() if rows else empty


@style.in_own_style
def ellipses_figure(result: Result, title: str) -> Figure | None:
    """95 % confidence ellipses of all pairs of the paper's parameters; None for fewer than two with an error.

    A positive parameter is fitted by its logarithm, in which the region is an ellipse. Axes are in standard errors of
    these coordinates, with the ends of the 95 % intervals as ticks.

    Notes:
        The radius is sqrt(2 F), F the 95 % quantile of Fisher's distribution with 2 and the fit's degrees of freedom.
    """
    rows = [row for row in parameter_rows(result) if row.name in FIVE and row.error and row.interval]
    if len(rows) < 2:
        return None
    correlations = {frozenset((one, other)): size for one, other, size in result.covariance.correlations()}
    count = len(rows) - 1
    figure = style.new_figure(title, _CELL * count)
    grid = figure.subplots(count, count, squeeze=False)
    for down, low in enumerate(rows[1:]):
        for across, left in enumerate(rows[:-1]):
            axes = grid[down, across]
            if across > down:
                axes.set_visible(False)
                continue
            correlation = correlations.get(frozenset((left.name, low.name)), 0.0)
            _draw_ellipse(axes, result, (left.name, low.name), correlation)
            _label(axes, left.interval, low.interval, bottom=down == count - 1, left=across == 0)
            if down == count - 1:
                axes.set_xlabel(_name(left), **style.WORDS)
            if across == 0:
                axes.set_ylabel(_name(low), **style.WORDS)
    return style.explained(
        figure,
        "Ellipses: pairs of values inside are compatible with the tests (95 %). Broken lines: 95 % interval of each "
        f"parameter, with its ends as ticks. Number: correlation, bold from {_STRONG:g}. Of such a pair the tests "
        "determine a combination well and each parameter less well: compare the pair, not one of them.",
    )


def _name(row: ParameterRow) -> str:
    """Name of a parameter, with its unit unless the unit has an exponent."""
    return row.name if "^" in row.unit else f"{row.name} [{row.unit}]"


def _draw_ellipse(axes: Axes, result: Result, pair: Sequence[str], correlation: float) -> None:
    covariance = result.covariance
    chosen = np.array(covariance.names)[:, None] == np.array(pair)
    radius = float(np.sqrt(2.0 * fdtri(2.0, covariance.freedom(chosen).min(), 0.95)))
    angle = np.linspace(0.0, 2.0 * np.pi, 60)
    y: Array = correlation * np.cos(angle) + np.sqrt(max(1.0 - correlation**2, 0.0)) * np.sin(angle)
    axes.fill(radius * np.cos(angle), radius * y, facecolor="#1f4e9c40", edgecolor="#1f4e9c", lw=1.0)
    x_half, y_half = (covariance.half(name) / (covariance.stderr(name) or np.inf) for name in pair)
    for line, half in ((axes.axvline, x_half), (axes.axhline, y_half)):
        for end in (-half, half):
            line(end, color=style.GREY, lw=0.6, ls=(0, (4, 3)))
    strong = abs(correlation) >= _STRONG
    look: dict[str, Any] = {"weight": "bold", "color": "#9b0f18"} if strong else {"color": style.INK}
    axes.set_title(f"{correlation:+.2f}", fontsize=style.SMALL, pad=2.0, **look)
    axes.set(xlim=(-1.15 * radius, 1.15 * radius), ylim=(-1.15 * radius, 1.15 * radius))
    axes.set_xticks([-x_half, x_half])
    axes.set_yticks([-y_half, y_half])


def _label(axes: Axes, x_interval: str, y_interval: str, *, bottom: bool, left: bool) -> None:
    """Write the ends of the intervals at the outer panels."""
    axes.set_xticklabels(x_interval.split(" to ") if bottom else ["", ""])
    axes.set_yticklabels(y_interval.split(" to ") if left else ["", ""])
    axes.tick_params(labelsize=style.SMALL - 1.0, colors=style.INK, length=2.0)
