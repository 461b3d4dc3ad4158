"""Predictions over frequency and amplitude as in the paper's Figs. 7 to 9, with measured points laid over."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bushfit.effects.contract import Array
from bushfit.fitting.data_sets import SweepData
from bushfit.geometry import Direction
from bushfit.prediction import Band, Prediction
from bushfit.report.plots.points import Points, means
from bushfit.report.plots.style import INK, POINT, ROW, dress, explain, least_span, legend, new_figure, readable, styles
from bushfit.units import for_people

#: Points of a model's line.
FINE = 60
#: Width of a line with the rig's effects.
_THIN = 0.6
#: A measured point belongs to a predicted level that is as near as this, relative and absolute.
_SAME = (0.01, 0.0)


def fine_grid(prediction: Prediction) -> tuple[Array, Array]:
    """Frequencies [Hz] and amplitudes [m or rad] that hold a prediction's own and enough between them for smooth
    lines: what `prediction_figure` takes as `curves`."""
    frequencies, amplitudes = (
        own if own.size < 2 else np.union1d(own, np.geomspace(own[0], own[-1], FINE))
        for own in map(np.unique, (prediction.frequency, prediction.amplitude))
    )
    return frequencies, amplitudes


def prediction_figure(
    prediction: Prediction,
    measured: Sequence[SweepData],
    title: str,
    *,
    curves: Prediction | None = None,
    rig: Prediction | None = None,
    note: str = "",
) -> Figure:
    """Magnitude and loss factor over frequency per amplitude, and over amplitude per frequency (Figs. 7 to 9).

    Args:
        prediction: its amplitudes (up to six) and frequencies (up to four) become the lines.
        measured: sweeps to lay over; other directions and levels are left out.
        title: names the bushing.
        curves: the prediction on `fine_grid`, for smooth lines; without it they run straight from point to point.
        rig: the same as these lines, with the rig's effects: drawn thin where points are laid over, which it meets.
        note: what else a reader must know, such as what the prediction leaves out.
    """
    lines = prediction if curves is None else curves
    mine = [data_set for data_set in measured if data_set.direction is prediction.direction]
    points = means(mine)
    frequencies, amplitudes = np.unique(prediction.frequency), np.unique(prediction.amplitude)
    rows: list[tuple[str, Array]] = []
    if frequencies.size > 1 or amplitudes.size == 1:
        rows.append(("frequency", _spread(amplitudes, 6)))
    if amplitudes.size > 1:
        known = frequencies[[np.isclose(points.frequency, f, *_SAME).any() for f in frequencies]]
        rows.append(("amplitude", _spread(known if known.size > 1 else frequencies, 4)))
    figure = new_figure(title, len(rows) * ROW)
    pairs = zip(figure.subplots(len(rows), 2, squeeze=False), rows, strict=True)
    drawn = [draw(pair, prediction.direction, lines, points, *row, rig) for pair, row in pairs]
    laid = any(drawn)
    banded = np.any(lines.stiffness.high > lines.stiffness.low)
    shade = "; shaded: its 95 % band, where that is wider than the line" if banded else ""
    through = " Thin lines: the same with what belongs to the rig, as the points were measured." if laid and rig else ""
    explain(figure, f"Lines: model{shade}.{through}", points_note(mine) if laid else "", note)
    return figure


def draw(
    pair: Sequence[Axes],
    direction: Direction,
    lines: Prediction | Points,
    points: Points,
    along: str,
    levels: Array,
    rig: Prediction | None = None,
) -> bool:
    """Stiffness left, loss factor right, a line and its points per level, through these a thin line of the `rig`;
    returns whether there were points."""
    other = "amplitude" if along == "frequency" else "frequency"
    units = direction.display
    scales = {"frequency": ("Hz", 1.0), "amplitude": units.displacement}
    unit, scale = scales[along]
    x, where = scale * getattr(lines, along), scale * getattr(points, along)
    inside = (where >= x.min() * (1 - _SAME[0])) & (where <= x.max() * (1 + _SAME[0]))
    marked = [inside & np.isclose(getattr(points, other), level, *_SAME) for level in levels]
    drawn = styles(levels.size, other)
    stiffness_unit, factor = for_people(*units.stiffness, float(lines.stiffness.value.max()))
    kinds = (
        ("stiffness", factor, f"{direction} stiffness |K| [{stiffness_unit}]"),
        ("loss_factor", 1.0, f"{direction} loss factor [-]"),
    )
    for axes, (kind, factor, name) in zip(pair, kinds, strict=True):
        bands: tuple[Band, Band] = getattr(lines, kind), getattr(points, kind)
        line, point = (factor * np.stack((band.value, band.low, band.high)) for band in bands)
        for style, level, spots in zip(drawn, levels, marked, strict=True):
            at = getattr(lines, other) == level
            value, low, high = line[:, at]
            axes.plot(
                x[at], value, color=style.color, ls=style.dashes, lw=1.3, marker="" if at.sum() > 1 else "_", ms=14
            )
            axes.fill_between(x[at], low, high, color=style.color, alpha=0.22, lw=0)
            if spots.any():
                if rig is not None:
                    axes.plot(x[at], factor * getattr(rig, kind).value[at], color=style.color, lw=_THIN)
                mean, low, high = point[:, spots]
                axes.vlines(where[spots], low, high, color=style.color, lw=0.7, alpha=0.7)
                axes.plot(where[spots], mean, style.marker, color=style.color, **POINT)
        dress(axes, f"{along} [{unit}]", name)
        readable(axes, x)
        least_span(axes, 0.04 * line.max() if kind == "stiffness" else 0.01)
    unit, scale = scales[other]
    handles = [style.handle(bool(spots.any())) for style, spots in zip(drawn, marked, strict=True)]
    labels = [f"{scale * level:.3g} {unit}" for level in levels]
    order = slice(None, None, 1 if other == "amplitude" else -1)  # as the lines lie, the stiffest on top
    handles, labels, laid = handles[order], labels[order], any(spots.any() for spots in marked)
    if laid and rig is not None:
        handles += [Line2D([], [], color=INK, lw=1.3), Line2D([], [], color=INK, lw=_THIN, marker="o", **POINT)]
        labels += ["bushing", "with the rig"]
    legend(pair[-1], handles, labels, other)
    return laid


def points_note(data_sets: Sequence[SweepData]) -> str:
    """What the points of sweeps are."""
    repeated = any(np.unique(data_set.sweep.repeat).size > 1 for data_set in data_sets)
    return f"Points: measured{', mean of the repeats, with bars from the lowest to the highest' if repeated else ''}."


def _spread(levels: Array, most: int) -> Array:
    """At most that many levels, evenly picked from first to last."""
    return levels[np.unique(np.linspace(0, levels.size - 1, min(most, levels.size)).round().astype(int))]
