"""Figure of predictions over frequency and amplitude, as in Figs. 7 to 9 of the paper, with measured points."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from bushfit.effects.contract import Array
from bushfit.model.result import Result
from bushfit.prediction.caveats import rig_effects
from bushfit.prediction.static_curve import StaticCurve
from bushfit.prediction.stiffness import Prediction, predict
from bushfit.reading.runs import nominal_amplitudes
from bushfit.report.plots import style
from bushfit.report.plots.fits import FINE, draw_curves, points_note, points_to_draw
from bushfit.report.plots.measured import Axis, header_of, rows_at_conditions, sweep_groups, table_stiffness
from bushfit.report.plots.pairs import ResponsePair
from bushfit.report.tables import IF_RIGS, displacement_header, quantity_words, spread_indices
from bushfit.units import display_unit, format_range

#: Largest number of levels drawn over each quantity: six amplitudes over frequency, four frequencies over amplitude.
#: More bands would overlap.
_MOST_LEVELS: dict[Axis, int] = {"frequency": 6, "amplitude": 4}
#: Line widths [point]: model with the effects of the rig, double line, and white core of the double line.
_THIN, _DOUBLE, _CORE = 0.6, 2.4, 0.7
#: Largest relative distance of a measured or nominal level from the predicted level that it belongs to.
_SAME = 0.01


@style.fixed_settings()
def prediction_figure(
    result: Result, prediction: Prediction, table: pd.DataFrame | None, title: str, note: str = ""
) -> style.Chart:
    """Figure of predicted stiffness magnitude and loss factor over frequency and over amplitude, with measured points.

    Lines are predicted on a finer grid, which contains the frequencies and amplitudes of the prediction.
    Up to six amplitudes and four frequencies are drawn, preferably levels that were measured. Sweeps in which neither
    amplitude nor frequency is fixed have a separate row of panels, with the model at their points.

    Args:
        result: fitted or given model.
        prediction: prediction for one direction or specimen.
        table: measured sweeps, a row per point, with the columns of sweeps.csv; those at the conditions of the
            prediction are drawn as points. None for no points.
        title: title of the figure.
        note: further sentences below the figure.

    Returns:
        Figure with one or two rows of panels, and one more for each group of such sweeps.
    """
    place, fine, rig = prediction.direction, prediction, None
    frequencies, amplitudes = np.unique(prediction.frequency), np.unique(prediction.amplitude)
    if not prediction.over:  # which takes too long to repeat
        fine_axes = [
            values if values.size < 2 else np.union1d(values, np.geomspace(values[0], values[-1], FINE))
            for values in (frequencies, amplitudes)
        ]
        conditions: Any = {key: getattr(prediction.conditions, key) for key in ("temperature", "preload")}
        refined = partial(predict, result, place, *fine_axes, **conditions)
        fine, rig = refined(), refined(rig=True) if rig_effects(result) else None
    of_place = None if table is None else rows_at_conditions(table, prediction)
    groups = [] if of_place is None or of_place.empty else sweep_groups(of_place, result)
    free = [group.thinned() for group in groups if group.palette == "loop" and np.isnan(group.curves[0].level)]
    rows = [curve.rows for group in groups for curve in group.curves if not np.isnan(curve.level)]
    points = pd.concat(rows) if rows else None
    panels: list[tuple[Axis, Array]] = []
    if frequencies.size > 1 or amplitudes.size == 1:
        panels.append(("frequency", amplitudes))
    if amplitudes.size > 1:
        panels.append(("amplitude", frequencies))
    figure = style.Chart(title, (len(panels) + len(free)) * style.ROW)
    grid = figure.subplots(len(panels) + len(free), 2, squeeze=False)
    for pair, group in zip(grid, free, strict=False):
        draw_curves(pair, group, result)
    laid = [
        draw_prediction(pair, fine, rig, points, axis, levels)
        for pair, (axis, levels) in zip(grid[len(free) :], panels, strict=True)
    ]
    has_band = bool(np.any(fine.stiffness.high > fine.stiffness.low))
    return figure.explain(
        "Lines: model; shaded: 95 % band, if it is wider than the line." if has_band else "Lines: model.",
        "Thin lines: the model with the effects of the rig, as the points were measured." * bool(any(laid) and rig),
        f"Double lines: the model if {' and '.join(result.unresolved)} belongs to the rig; the band includes both."
        * bool(fine.if_in_rig),
        f"{_MOST_LEVELS['frequency']} of {amplitudes.size} amplitudes are drawn."
        * (amplitudes.size > _MOST_LEVELS["frequency"]),
        points_note(of_place) if of_place is not None and (any(laid) or free) else "",
        note=note,
    )


@style.fixed_settings()
def static_figure(curves: Sequence[StaticCurve], title: str) -> style.Chart:
    """Figure of static curves: force over displacement, and its slope, with 95 % bands.

    Args:
        curves: predicted static curves of one direction or specimen, one per preload.
        title: title of the figure.

    Returns:
        Figure with two panels.
    """
    curve, place = curves[0], curves[0].direction
    (_, length), (name, force), (stiffness_name, stiffness) = place.display
    unit, factor = display_unit(name, force, max(float(np.abs(one.mean.value).max()) for one in curves))
    slope_unit, slope_factor = display_unit(stiffness_name, stiffness, float(curve.secant.value[0]))
    figure = style.Chart(title, style.ROW)
    panels = figure.subplots(1, 2)
    for one, look in zip(curves, style.styles(len(curves), "loop"), strict=True):
        x = one.displacement * length
        for line in (one.loading, one.unloading):
            panels[0].plot(x, factor * line.value, color=look.color, lw=_THIN)
        for axes, band, scale in zip(panels, (one.mean, one.slope), (factor, slope_factor), strict=True):
            style.draw_band(axes, x, scale * band.ends, look, lw=style.LINE)
    preloads = [one.conditions.preload for one in curves]
    if len(curves) > 1:
        handles = [look.handle(False) for look in style.styles(len(curves), "loop")]
        style.legend(panels[1], handles, [load.text(place) for load in preloads if load], "preload")
    style.label_axes(panels[0], displacement_header(place), f"{quantity_words(place)[1]} [{unit}]")
    style.label_axes(panels[1], displacement_header(place), f"static {quantity_words(place)[2]} [{slope_unit}]")
    panels[1].set_ylim(bottom=0.0)
    return figure.explain(
        f"Thin lines: loading and unloading at {curve.rate_text}; thick: their mean, and its slope; shaded: 95 % band."
    )


def draw_prediction(
    panels: Sequence[Axes],
    prediction: Prediction,
    rig: Prediction | None,
    table: pd.DataFrame | None,
    axis: Axis,
    levels: Array,
) -> bool:
    """Draw predicted stiffness magnitude (left) and loss factor (right), with 95 % bands and measured points.

    Args:
        panels: left and right panel.
        prediction: prediction on a fine grid.
        rig: the same prediction with the effects of the rig; None if the model has no such effects.
        table: measured sweeps of the same direction or specimen, a row per point, with the columns frequency,
            amplitude, stiffness, loss factor and outlier of sweeps.csv; None for no points.
        axis: quantity along x.
        levels: fixed amplitudes [m, rad or 1] or frequencies [Hz], one for each line, ascending, (k,).

    Returns:
        True if measured points were drawn.
    """
    place = prediction.direction
    fixed: Axis = "amplitude" if axis == "frequency" else "frequency"
    scales = {"frequency": 1.0, "amplitude": place.display.displacement.factor}
    x_header, fixed_header = header_of(place, axis), header_of(place, fixed)
    points = points_near(table, fixed_header, scales[fixed] * levels)
    measured = np.array([len(rows) > 0 for rows in points])
    chosen = np.flatnonzero(measured) if measured.sum() > 1 else np.arange(levels.size)
    chosen = chosen[spread_indices(chosen.size, _MOST_LEVELS[axis])]
    x, looks = scales[axis] * getattr(prediction, axis), style.styles(chosen.size, fixed)
    pair = ResponsePair(panels, place, float(prediction.stiffness.value.max()), x_header, x)
    for look, index in zip(looks, chosen, strict=True):
        mask, rows = getattr(prediction, fixed) == levels[index], points_to_draw(points[index])
        bands = [band.ends[:, mask] for band in (prediction.stiffness, prediction.loss_factor)]
        marker = "_" if mask.sum() == 1 else ""  # a single point is a stroke
        pair.draw_bands(x[mask], bands, look, lw=style.LINE, marker=marker, ms=14.0)
        if prediction.if_in_rig is not None:
            pair.plot(x[mask], prediction.if_in_rig.complex_stiffness[mask], color=look.color, lw=_DOUBLE)
            pair.plot(x[mask], prediction.if_in_rig.complex_stiffness[mask], color="white", lw=_CORE)
        if len(rows) and rig is not None:
            pair.plot(x[mask], rig.complex_stiffness[mask], color=look.color, lw=_THIN)
        if len(rows):
            pair.draw_points(rows[x_header].to_numpy(), table_stiffness(rows, place), look, chosen.size)
    spans = 0.04 * pair.factor * prediction.stiffness.high.max(), 0.01  # flat stays flat
    for axes, span in zip(panels, spans, strict=True):
        style.widen_span(axes, span)
    extra_lines: dict[str, Line2D | tuple[Line2D, ...]] = {}
    if (with_rig := bool(measured[chosen].any() and rig)) or prediction.if_in_rig:
        extra_lines["bushing"] = Line2D([], [], color=style.INK, lw=style.LINE)
    if with_rig:
        extra_lines["with the rig"] = Line2D([], [], color=style.INK, lw=_THIN, marker="o", **style.POINT)
    if prediction.if_in_rig:
        double = ((style.INK, _DOUBLE), ("white", _CORE))
        extra_lines[IF_RIGS] = tuple(Line2D([], [], color=color, lw=width) for color, width in double)
    unit, to_people = display_unit(*(("Hz", 1.0) if fixed == "frequency" else place.display.displacement), levels.min())
    names = [format_range(unit, to_people * level) for level in levels[chosen]]
    style.name_levels(panels[-1], names, fixed, measured[chosen].tolist(), extra_lines)
    return bool(measured[chosen].any())


def points_near(table: pd.DataFrame | None, header: str, levels: Array) -> list[pd.DataFrame]:
    """Find the measured points at each predicted amplitude (or frequency), within 1 % of the measured or nominal one.

    Args:
        table: sweeps of one direction or specimen; None for no points.
        header: header of the column of amplitudes or frequencies.
        levels: predicted amplitudes or frequencies in the unit of that column, (k,).

    Returns:
        A table for each of the k predicted amplitudes or frequencies, without rows if it was not measured.
    """
    if table is None:
        return [pd.DataFrame({"outlier": []})] * levels.size
    values = table[header].to_numpy()
    by_value, by_nominal = (np.abs(column[:, None] / levels - 1.0) for column in (values, nominal_amplitudes(values)))
    distance = np.where(by_value.min(axis=1, keepdims=True) <= _SAME, by_value, by_nominal)
    nearest = (distance <= _SAME) & (distance == distance.min(axis=1, keepdims=True))
    return [table[mask] for mask in nearest.T]
