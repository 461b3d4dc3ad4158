"""Predictions over frequency and amplitude as in the paper's Figs. 7 to 9, with measured points."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bushfit.effects.contract import Array
from bushfit.model.result import Result
from bushfit.prediction.caveats import rig_effects
from bushfit.prediction.stiffness import Band, Prediction, predict
from bushfit.reading.runs import nominal
from bushfit.report.plots import style
from bushfit.report.plots.fits import draw_curves, draw_points, drawn_points, points_note, stiffness_scale
from bushfit.report.plots.measured import Axis, Curve, SweepGroup, sweep_groups
from bushfit.report.tables import IF_RIGS, columns_of, spread
from bushfit.units import display_unit, format_range

#: Points of a model's line.
_FINE = 30
#: Most amplitudes drawn over frequency, and frequencies drawn over amplitude: more bands cover each other.
_MOST_AMPLITUDES, _MOST_FREQUENCIES = 6, 4
#: Width of a model's line, of one with the rig's effects, and of a double line and its white core [point].
_LINE, _THIN, _DOUBLE, _CORE = 1.3, 0.6, 2.4, 0.7
#: A measured point belongs to a predicted level if its own or its nominal level is as near as this, relative.
_SAME = 0.01


class Lines(NamedTuple):
    """A prediction on a fine grid, and the same with what may be different.

    Args:
        bushing: as the car will have it.
        rig: with the effects of the rig, as in the tests; None where the model has none.
    """

    bushing: Prediction
    rig: Prediction | None


def lines_of(result: Result, prediction: Prediction) -> Lines:
    """The prediction on its own grid refined for smooth lines.

    Args:
        result: fitted or given model.
        prediction: prediction of one place on its grid.

    Returns:
        Prediction for the bushing alone and with the rig.
    """
    grid = [
        values if values.size < 2 else np.union1d(values, np.geomspace(values[0], values[-1], _FINE))
        for values in map(np.unique, (prediction.frequency, prediction.amplitude))
    ]
    place = prediction.direction
    rig = predict(result, place, *grid, rig=True) if rig_effects(result) else None
    return Lines(predict(result, place, *grid), rig)


@style.in_own_style
def prediction_figure(
    result: Result, prediction: Prediction, table: pd.DataFrame | None, title: str, note: str = ""
) -> Figure:
    """Stiffness magnitude and loss factor over frequency per amplitude, and over amplitude per frequency.

    Up to six amplitudes and four frequencies are drawn, those that were tested first. Sweeps that held nothing have a
    row of panels of their own, with the model at their points.

    Args:
        result: the model.
        prediction: of one place.
        table: sweeps to lay over, as `tables.sweeps_table` makes it; None without.
        title: of the figure.
        note: sentences below the figure.

    Returns:
        Figure with one or two rows of panels, and one per group of free sweeps.
    """
    place, lines = prediction.direction, lines_of(result, prediction)
    groups = _groups_at(result, prediction, table)
    free = [group.thinned() for group in groups if group.palette == "loop" and np.isnan(group.curves[0].level)]
    points = [group for group in groups if not (group.palette == "loop" and np.isnan(group.curves[0].level))]
    rows = _rows(prediction, points)
    figure = style.new_figure(title, (len(rows) + len(free)) * style.ROW)
    grid = figure.subplots(len(rows) + len(free), 2, squeeze=False)
    laid = [
        draw_prediction(pair, lines, points, axis, levels)
        for pair, (axis, levels) in zip(grid[len(free) :], rows, strict=True)
    ]
    for pair, group in zip(grid, free, strict=False):
        draw_curves(pair, group, result)
    stiffness = lines.bushing.stiffness
    sentences = [
        "Lines: model; shaded: its 95 % band, where it is wider than the line."
        if np.any(stiffness.high > stiffness.low)
        else "Lines: model."
    ]
    if any(laid) and lines.rig:
        sentences.append("Thin lines: the model with the effects of the rig, as the points were measured.")
    if lines.bushing.if_rigs:
        sentences.append(f"Double lines: the model {IF_RIGS}; the band spans both.")
    if np.unique(prediction.amplitude).size > _MOST_AMPLITUDES:
        sentences.append(f"{_MOST_AMPLITUDES} of {np.unique(prediction.amplitude).size} amplitudes are drawn.")
    if table is not None and (any(laid) or free):
        sentences.append(points_note(table[table["direction"] == str(place)]))
    return style.explained(figure, *sentences, note)


def _groups_at(result: Result, prediction: Prediction, table: pd.DataFrame | None) -> list[SweepGroup]:
    if table is None or table.empty:
        return []
    return sweep_groups(table[table["direction"] == str(prediction.direction)], result)


def _rows(prediction: Prediction, groups: Sequence[SweepGroup]) -> list[tuple[Axis, Array]]:
    """Rows of panels: the quantity along x and the levels drawn [SI], rising."""
    frequencies, amplitudes = np.unique(prediction.frequency), np.unique(prediction.amplitude)
    rows: list[tuple[Axis, Array]] = []
    if frequencies.size > 1 or amplitudes.size == 1:
        rows.append(("frequency", _chosen(amplitudes, _measured(groups, "amplitude"), _MOST_AMPLITUDES)))
    if amplitudes.size > 1:
        rows.append(("amplitude", _chosen(frequencies, _measured(groups, "frequency"), _MOST_FREQUENCIES)))
    return rows


def _measured(groups: Sequence[SweepGroup], quantity: Axis) -> Array:
    """Amplitudes [SI] or frequencies [Hz] of all measured points."""
    columns = []
    for group in groups:
        length = group.place.display.displacement.factor if quantity == "amplitude" else 1.0
        header = columns_of(group.place)[0] if quantity == "amplitude" else "frequency [Hz]"
        columns += [curve.rows[header].to_numpy() / length for curve in group.curves]
    return np.concatenate([np.empty(0), *columns])


def _chosen(levels: Array, measured: Array, maximum: int) -> Array:
    """The levels that were measured, or all where fewer than two were; at most so many, evenly."""
    measured_levels = levels[[np.isclose(measured, level, _SAME, 0.0).any() for level in levels]]
    chosen = measured_levels if measured_levels.size > 1 else levels
    return chosen[spread(chosen.size, maximum)]


def draw_prediction(
    pair: Sequence[Axes], lines: Lines, groups: Sequence[SweepGroup], axis: Axis, levels: Array
) -> bool:
    """Draw stiffness magnitude (left) and loss factor (right), a line with its band and its points per level.

    Args:
        pair: two panels.
        lines: predicted.
        groups: measured at the same place.
        axis: quantity along x.
        levels: held amplitudes [m, rad or 1] or frequencies [Hz], rising, (k,).

    Returns:
        Whether there are points at these levels.
    """
    prediction, place = lines.bushing, lines.bushing.direction
    fixed: Axis = "amplitude" if axis == "frequency" else "frequency"
    amplitude_header, stiffness_header, _ = columns_of(place)
    scales = {"frequency": 1.0, "amplitude": place.display.displacement.factor}
    x_header = "frequency [Hz]" if axis == "frequency" else amplitude_header
    x, held_values = scales[axis] * getattr(prediction, axis), getattr(prediction, fixed)
    points = _points_at(groups, "frequency [Hz]" if fixed == "frequency" else amplitude_header, scales[fixed] * levels)
    to_table = place.display.stiffness.factor
    factor, labels = stiffness_scale(place, to_table * float(prediction.stiffness.value.max()))
    looks, laid = style.styles(levels.size, fixed), [len(rows) > 0 for rows in points]
    kinds = (("stiffness", stiffness_header, factor), ("loss_factor", "loss factor [-]", 1.0))
    for axes, label, (name, header, scale) in zip(pair, labels, kinds, strict=True):
        from_si = scale * (to_table if name == "stiffness" else 1.0)
        for look, level, rows in zip(looks, levels, points, strict=True):
            mask = held_values == level
            _draw_line(axes, x[mask], getattr(prediction, name), mask, from_si, look)
            if prediction.if_rigs is not None:
                rig_values = from_si * getattr(prediction.if_rigs, name).value[mask]
                axes.plot(x[mask], rig_values, color=look.color, lw=_DOUBLE)
                axes.plot(x[mask], rig_values, color="white", lw=_CORE)
            if len(rows):
                if lines.rig is not None:
                    axes.plot(x[mask], from_si * getattr(lines.rig, name).value[mask], color=look.color, lw=_THIN)
                draw_points(axes, rows, x_header, header, scale, look, levels.size)
        style.label_axes(axes, x_header, label, x)
        highest = from_si * getattr(prediction, name).high.max()
        style.widen_span(axes, 0.04 * highest if name == "stiffness" else 0.01)  # flat curves shall look flat
    unit, to_people = display_unit(*(("Hz", 1.0) if fixed == "frequency" else place.display.displacement), levels.min())
    names = [format_range(unit, to_people * level) for level in levels]
    extra_lines = _other_lines(with_rig=any(laid) and lines.rig is not None, if_rigs=prediction.if_rigs is not None)
    style.name_levels(pair[-1], names, fixed, laid, extra_lines)
    return any(laid)


def _draw_line(axes: Axes, x: Array, band: Band, mask: Array, scale: float, look: style.Style) -> None:
    marker = "_" if x.size == 1 else ""  # a single point is a stroke
    axes.plot(x, scale * band.value[mask], color=look.color, ls=look.dashes, lw=_LINE, marker=marker, ms=14.0)
    axes.fill_between(x, scale * band.low[mask], scale * band.high[mask], color=look.color, alpha=0.22, lw=0)


def _points_at(groups: Sequence[SweepGroup], header: str, levels: Array) -> list[pd.DataFrame]:
    """Measured rows at each level, by the value of their column or by the nominal level it belongs to."""
    empty = pd.DataFrame()
    if not groups:
        return [empty] * levels.size
    rows = pd.concat([drawn_points(Curve("", np.nan, curve.rows)) for group in groups for curve in group.curves])
    values = rows[header].to_numpy()
    near = [np.abs(column[:, None] / levels - 1.0) for column in (values, nominal(values))]
    distance = np.where(near[0].min(axis=1, keepdims=True) <= _SAME, near[0], near[1])
    nearest = (distance <= _SAME) & (distance == distance.min(axis=1, keepdims=True))
    return [rows[mask] for mask in nearest.T]


def _other_lines(*, with_rig: bool, if_rigs: bool) -> dict[str, Line2D | tuple[Line2D, ...]]:
    """Further entries of the legend, where other lines than the bushing's are drawn."""
    lines: dict[str, Line2D | tuple[Line2D, ...]] = {}
    if with_rig or if_rigs:
        lines["bushing"] = Line2D([], [], color=style.INK, lw=_LINE)
    if with_rig:
        lines["with the rig"] = Line2D([], [], color=style.INK, lw=_THIN, marker="o", **style.POINT)
    if if_rigs:
        double = ((style.INK, _DOUBLE), ("white", _CORE))
        lines[IF_RIGS] = tuple(Line2D([], [], color=color, lw=width) for color, width in double)
    return lines
