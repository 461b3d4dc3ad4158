"""Figures for the appendix of a report: storage and loss stiffness, Cole-Cole, and confidence ellipses."""

import math
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.collections import PolyCollection
from scipy.special import fdtri

from bushfit.model.model import FIVE
from bushfit.model.result import Result
from bushfit.prediction.stiffness import Prediction
from bushfit.report.parameters import parameter_rows
from bushfit.report.plots import style
from bushfit.report.plots.measured import sweep_groups
from bushfit.report.plots.prediction import refined
from bushfit.report.tables import response_headers, spread
from bushfit.units import format_range

#: Largest number of amplitudes that are drawn.
_MOST_LEVELS = 6
#: Side of a cell of the matrix of ellipses [cm], and half the side of the frame of an ellipse as a share of it.
_CELL, _HALF_CELL = 2.3, 0.4
#: Correlation from which a pair of parameters is marked: the tests determine only its combination well.
_STRONG = 0.9


@style.in_own_style
def complex_figure(result: Result, prediction: Prediction, table: pd.DataFrame | None, title: str) -> style.Chart:
    """Figure of storage and loss stiffness over frequency, and of loss over storage stiffness (Cole-Cole).

    Args:
        result: fitted or given model.
        prediction: prediction for one direction or specimen, at two or more frequencies.
        table: sweeps from `tables.sweeps_table`; frequency sweeps are drawn as points; None for no points.
        title: title of the figure.

    Returns:
        Figure with three panels; a line with its 95 % band per amplitude, at most six.
    """
    place, fine = prediction.direction, refined(result, prediction)
    amplitude_header, stiffness_header, _ = response_headers(place)
    (unit, length), _, (stiffness_unit, factor) = place.display
    levels = np.unique(prediction.amplitude)
    levels = levels[spread(levels.size, _MOST_LEVELS)]
    of_place = table[table["direction"] == str(place)] if table is not None else None
    groups = sweep_groups(of_place, result) if of_place is not None else []
    measured = [
        curve.rows[curve.rows["outlier"] == "no"]
        for group in groups
        if group.axis == "frequency" and group.shares_levels
        for curve in group.curves
    ]
    figure = style.Chart(title, style.ROW)
    storage, loss, cole_cole = figure.subplots(1, 3)
    for level, look in zip(levels, style.styles(levels.size, "amplitude"), strict=True):
        mask = fine.amplitude == level
        frequency = fine.frequency[mask]
        bands = [fine.storage_stiffness, fine.loss_stiffness]
        line: dict[str, Any] = {"color": look.color, "ls": look.dashes, "lw": 1.1}
        for axes, band in zip((storage, loss), bands, strict=True):
            axes.plot(frequency, factor * band.value[mask], **line)
            axes.fill_between(frequency, factor * band.low[mask], factor * band.high[mask], color=look.color, alpha=0.2)
        cole_cole.plot(*(factor * band.value[mask] for band in bands), **line)
        near = [rows[np.isclose(rows[amplitude_header], level * length, 0.01, 0.0)] for rows in measured]
        if near:
            columns = [stiffness_header, "loss factor [-]"]
            means = pd.concat(near).groupby("frequency [Hz]")[columns].mean()
            x, (magnitude, loss_factor) = means.index.to_numpy(), means.to_numpy().T
            real = magnitude / np.sqrt(1.0 + loss_factor**2)
            imaginary = loss_factor * real
            for axes, points in ((storage, (x, real)), (loss, (x, imaginary)), (cole_cole, (real, imaginary))):
                axes.plot(*points, look.marker, color=look.color, **style.DOT)
    style.label_axes(storage, "frequency [Hz]", f"storage {stiffness_header}", fine.frequency)
    style.label_axes(loss, "frequency [Hz]", f"loss {stiffness_header}", fine.frequency)
    style.label_axes(cole_cole, f"storage [{stiffness_unit}]", f"loss [{stiffness_unit}]")
    cole_cole.locator_params("x", nbins=3)
    style.name_levels(cole_cole, [format_range(unit, length * level) for level in levels], "amplitude")
    return figure.explain("Lines: model, shaded: its 95 % band. Points: measured; repeats are averaged.")


@style.in_own_style
def ellipses_figure(result: Result, title: str) -> style.Chart | None:
    """Figure of the 95 % confidence ellipses of all pairs of the five parameters of the paper's model.

    A positive parameter is fitted by its logarithm, and the confidence region is an ellipse in these coordinates. Axes
    are in standard errors of the coordinates, with the ends of the 95 % intervals as ticks.

    Args:
        result: fitted model.
        title: title of the figure.

    Returns:
        Matrix of ellipses in one panel; None if fewer than two parameters have a standard error.

    Notes:
        The radius is sqrt(2 F), F the 95 % quantile of Fisher's distribution with 2 and the fit's degrees of freedom.
    """
    rows = [row for row in parameter_rows(result) if row.name in FIVE and row.error and row.interval]
    if len(rows) < 2:
        return None
    covariance = result.covariance
    correlations = {frozenset(pair): correlation for *pair, correlation in covariance.correlations()}
    halves = {row.name: covariance.half_width_of(row.name) / (covariance.stderr(row.name) or np.inf) for row in rows}
    angle = np.linspace(0.0, 2.0 * np.pi, 60)
    corners = _HALF_CELL * np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    figure = style.Chart(title, _CELL * (len(rows) - 1))
    axes = figure.subplots()
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    frames, ellipses = [], []
    ticks: dict[str, dict[float, str]] = {"x": {}, "y": {}}
    # one panel for all pairs: a panel for each takes ten times as long to draw
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
            for axis, center, ends, row, outer in (("x", x, x_ends, x_row, y == 0), ("y", y, y_ends, y_row, x == 0)):
                if outer:
                    name = row.name if "^" in row.unit else f"{row.name} [{row.unit}]"
                    low, high = row.interval.split(" to ")
                    ticks[axis] |= {center + ends[0]: low, center: "\n" * (axis == "x") + name, center + ends[1]: high}
    axes.add_collection(PolyCollection(frames, facecolors="none", edgecolors=style.INK, lw=0.8))
    axes.add_collection(PolyCollection(ellipses, facecolors="#1f4e9c40", edgecolors="#1f4e9c", lw=1.0))
    axes.tick_params(length=0.0)
    axes.set_xticks([*ticks["x"]], [*ticks["x"].values()])
    axes.set_yticks([*ticks["y"]], [*ticks["y"].values()])
    axes.set(xlim=(-0.5, len(rows) - 1.5), ylim=(-0.5, len(rows) - 1.4))
    return figure.explain(
        "Ellipses: pairs of values inside are compatible with the tests (95 %). Broken lines: 95 % interval of each "
        f"parameter, with its ends as ticks. Number: correlation, bold from {_STRONG:g}. The tests determine a "
        "combination of such a pair well and each parameter less well: compare the pair, not one parameter."
    )
