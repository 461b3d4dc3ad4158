"""Figures for the appendix of a report: storage and loss stiffness, Cole-Cole, and confidence ellipses."""

import math
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axis import Axis
from matplotlib.collections import PolyCollection
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
#: Half the side of the frame of an ellipse, as a share of its cell.
_HALF_CELL = 0.4
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

    Returns:
        Figure with three panels.
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
        mask = lines.amplitude == level
        frequency = lines.frequency[mask]
        for axes, band in ((storage, lines.storage_stiffness), (loss, lines.loss_stiffness)):
            axes.plot(frequency, factor * band.value[mask], color=look.color, ls=look.dashes, lw=1.1)
            axes.fill_between(frequency, factor * band.low[mask], factor * band.high[mask], color=look.color, alpha=0.2)
        real, imaginary = (factor * b.value[mask] for b in (lines.storage_stiffness, lines.loss_stiffness))
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
    sweeps = table[table["direction"] == str(prediction.direction)]
    groups = [group for group in sweep_groups(sweeps, result) if group.axis == "frequency" and group.shares_levels]
    rows = [curve.rows[curve.rows["outlier"] == "no"] for group in groups for curve in group.curves]
    empty = pd.DataFrame(columns=[*keys, *values], dtype=float)
    return pd.concat(rows).groupby(keys, as_index=False)[values].mean() if rows else empty


@style.in_own_style
def ellipses_figure(result: Result, title: str) -> Figure | None:
    """95 % confidence ellipses of all pairs of the paper's parameters.

    A positive parameter is fitted by its logarithm, in which the region is an ellipse. Axes are in standard errors of
    these coordinates, with the ends of the 95 % intervals as ticks.

    Args:
        result: fitted model.
        title: title of the figure.

    Returns:
        Matrix of ellipses in one panel; None for fewer than two parameters with an error.

    Notes:
        The radius is sqrt(2 F), F the 95 % quantile of Fisher's distribution with 2 and the fit's degrees of freedom.
    """
    rows = [row for row in parameter_rows(result) if row.name in FIVE and row.error and row.interval]
    if len(rows) < 2:
        return None
    covariance = result.covariance
    correlations = {frozenset(pair): correlation for *pair, correlation in covariance.correlations()}
    halves = {row.name: covariance.half(row.name) / (covariance.stderr(row.name) or np.inf) for row in rows}
    angle = np.linspace(0.0, 2.0 * np.pi, 60)
    corners = _HALF_CELL * np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    figure = style.new_figure(title, _CELL * (len(rows) - 1))
    axes = figure.subplots()
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    frames, ellipses = [], []
    # one panel for all pairs: a panel each takes ten times as long to draw
    for y, y_row in enumerate(rows[:0:-1]):
        for x, x_row in enumerate(rows[: len(rows) - 1 - y]):
            correlation = correlations.get(frozenset((x_row.name, y_row.name)), 0.0)
            chosen = np.isin(covariance.names, (x_row.name, y_row.name))
            radius = float(np.sqrt(2.0 * fdtri(2.0, covariance.freedom(chosen).min(), 0.95)))
            scale = _HALF_CELL / (1.15 * radius)
            across, up = np.cos(angle), correlation * np.cos(angle) + math.sqrt(1.0 - correlation**2) * np.sin(angle)
            ellipses.append(np.stack([x + scale * radius * across, y + scale * radius * up], axis=1))
            frames.append(corners + np.array([x, y]))
            x_ends, y_ends = (scale * halves[row.name] * np.array([-1.0, 1.0]) for row in (x_row, y_row))
            dashed: dict[str, Any] = {"color": style.GREY, "lw": 0.6, "ls": [(0, (4, 3))]}
            axes.vlines(x + x_ends, y - _HALF_CELL, y + _HALF_CELL, **dashed)
            axes.hlines(y + y_ends, x - _HALF_CELL, x + _HALF_CELL, **dashed)
            strong = {"weight": "bold", "color": "#9b0f18"} if abs(correlation) >= _STRONG else {}
            text = f"{correlation:+.2f}"
            axes.text(x, y + _HALF_CELL + 0.02, text, ha="center", va="bottom", **(style.WORDS | strong))
            if y == 0:
                _add_ticks(axes.xaxis, x, x_ends, x_row, "\n")
            if x == 0:
                _add_ticks(axes.yaxis, y, y_ends, y_row)
    axes.add_collection(PolyCollection(frames, facecolors="none", edgecolors=style.INK, lw=0.8))
    axes.add_collection(PolyCollection(ellipses, facecolors="#1f4e9c40", edgecolors="#1f4e9c", lw=1.0))
    axes.tick_params(length=0.0)
    axes.set(xlim=(-0.5, len(rows) - 1.5), ylim=(-0.5, len(rows) - 1.4))
    return style.explained(
        figure,
        "Ellipses: pairs of values inside are compatible with the tests (95 %). Broken lines: 95 % interval of each "
        f"parameter, with its ends as ticks. Number: correlation, bold from {_STRONG:g}. The tests determine a "
        "combination of such a pair well and each parameter less well: compare the pair, not one parameter.",
    )


def _add_ticks(axis: Axis, center: int, ends: Array, row: ParameterRow, before: str = "") -> None:
    """Add the name of a parameter and the ends of its interval to the ticks of the matrix of ellipses."""
    name = row.name if "^" in row.unit else f"{row.name} [{row.unit}]"
    low, high = row.interval.split(" to ")
    texts = [text.get_text() for text in axis.get_ticklabels()] if center else []
    ticks = [*axis.get_ticklocs()] if center else []
    axis.set_ticks([*ticks, center + ends[0], center, center + ends[1]], labels=[*texts, low, before + name, high])
