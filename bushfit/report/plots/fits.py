"""Figures of a fit: sweeps and loops, measured and modelled, with the residuals (measured minus model)."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from bushfit.effects.contract import Array
from bushfit.geometry import Place
from bushfit.model.result import Result
from bushfit.report.plots import style
from bushfit.report.plots.measured import (
    MOST_CURVES,
    MOST_LOOPS,
    SECTOR,
    SweepGroup,
    draw_sector_means,
    loops_by_direction,
    phase_after_turn,
    sweep_groups,
    table_stiffness,
)
from bushfit.report.plots.pairs import ResponsePair, stride
from bushfit.report.tables import displacement_header, response_headers, shorten
from bushfit.units import display_unit, format_range

#: Height of a panel of residuals [cm].
_STRIP = 2.6
#: Number of points of a line of the model.
FINE = 30
#: Largest number of rows of a loop that are drawn.
_MOST_ROWS = 240
#: Stated relative error above which a point is not drawn, because its scatter would hide other points.
_WORST_DRAWN = 0.05
_OUTLIERS = "Crosses: outliers, drawn at the edge if they are beyond it."


@style.fixed_settings()
def sweeps_figure(result: Result, table: pd.DataFrame, title: str) -> style.Chart:
    """Figure of stiffness magnitude and loss factor of sweeps, measured and modelled, with the residuals below.

    Args:
        result: fitted model, with the effects of the rig that the tests include.
        table: measured and modelled sweeps, a row per point, with the columns of `tables.sweeps_table` (sweeps.csv).
        title: title of the figure.

    Returns:
        Figure with four panels per direction or specimen and stepped quantity (frequency or amplitude).
    """
    groups = [group.thinned() for group in sweep_groups(table, result)]
    figure = style.Chart(title, (style.ROW + _STRIP) * len(groups))
    grid = figure.add_gridspec(len(groups), 2)
    for line, group in enumerate(groups):
        columns = [grid[line, i].subgridspec(2, 1, height_ratios=[style.ROW, _STRIP], hspace=0.1) for i in (0, 1)]
        pair = [figure.add_subplot(column[0]) for column in columns]
        strips = [figure.add_subplot(column[1], sharex=panel) for column, panel in zip(columns, pair, strict=True)]
        draw_curves(pair, group, result)
        looks, rows = style.styles(len(group.curves), group.palette), pd.concat([curve.rows for curve in group.curves])
        x, outliers = rows[group.x_header].to_numpy(), rows[rows["outlier"] == "yes"]
        for strip, part in zip(strips, ("stiffness", "loss"), strict=True):
            header = f"{part} residual [noise]"
            for curve, look in zip(group.curves, looks, strict=True):
                points = points_to_draw(curve.rows)
                points = points[:: stride(len(points), len(looks))]
                strip.plot(
                    points[group.x_header], points[header], look.marker, color=look.color, alpha=0.8, **style.DOT
                )
            style.label_axes(strip, group.x_header, f"{part} residual\n/ noise", x)
            if group.axis == "amplitude" and x.max() > 3.0 * x.min():
                style.make_logarithmic(strip, x)
            style.noise_band(strip)
            style.mark_outliers(strip, outliers[group.x_header].to_numpy(), outliers[header].to_numpy())
        for panel in pair:
            panel.set_xlabel("")
            panel.tick_params(labelbottom=False)
    return figure.explain(
        "Lines: model.",
        points_note(table),
        "Lower panels: measured minus model, in units of noise. 95 % of the points should be in the grey band.",
        _OUTLIERS * bool((table["outlier"] == "yes").any()),
        f"Only {MOST_CURVES} of the levels are drawn." * any(len(group.curves) == MOST_CURVES for group in groups),
    )


def draw_curves(panels: Sequence[Axes], group: SweepGroup, result: Result) -> None:
    """Draw stiffness magnitude (left) and loss factor (right) of sweeps: measured points and lines of the model.

    Args:
        panels: left and right panel.
        group: sweeps of one direction or specimen, with a curve per fixed amplitude (or frequency).
        result: fitted model, with the effects of the rig.
    """
    rows = pd.concat([curve.rows for curve in group.curves])
    largest = float(np.abs(table_stiffness(rows, group.place)).max())
    pair = ResponsePair(panels, group.place, largest, group.x_header, rows[group.x_header].to_numpy())
    looks, length = style.styles(len(group.curves), group.palette), group.place.display.displacement.factor
    shares_levels = group.palette in ("amplitude", "frequency")  # a colour bar can then name the curves
    for curve, look in zip(group.curves, looks, strict=True):
        drawn, x = points_to_draw(curve.rows), curve.rows[group.x_header].to_numpy()
        pair.draw_points(drawn[group.x_header].to_numpy(), table_stiffness(drawn, group.place), look, len(group.curves))
        if not shares_levels or result.model.depends_on:  # conditions vary: the line joins the measured points
            modelled = pd.Series(table_stiffness(curve.rows, group.place, "model ")).groupby(x).mean()
            line = modelled.index.to_numpy(), modelled.to_numpy()
        else:
            fine = np.geomspace(x.min(), x.max(), FINE)
            axes = (fine, curve.level / length) if group.axis == "frequency" else (curve.level, fine / length)
            line = fine, result.model.stiffness(group.place, *np.broadcast_arrays(*axes))
        pair.plot(*line, color=look.color, ls=look.dashes, lw=style.LINE)
    names = [shorten(curve.name, 30) for curve in group.curves]
    if shares_levels:
        style.name_levels(panels[-1], names, group.palette)
    else:
        style.legend(panels[-1], [look.handle(True) for look in looks], names, "test")


def points_to_draw(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows of a table of sweeps to draw: without outliers and without points whose stated error is above 5 %."""
    keep = rows["outlier"] == "no"
    if "stated error [-]" in rows:
        keep &= ~(rows["stated error [-]"] > _WORST_DRAWN)
    return rows[keep]


def points_note(table: pd.DataFrame) -> str:
    """Explain the measured points of a figure of sweeps: means of repeats or single points, and hidden points."""
    point = [name for name in table if name in ("sweep", "stepped", "frequency [Hz]") or "amplitude [" in str(name)]
    repeated = bool(table.duplicated(point).any())
    bars = "mean of the repeats, with bars from the smallest to the largest" if repeated else "as measured"
    hidden = int((table["stated error [-]"] > _WORST_DRAWN).sum()) if "stated error [-]" in table else 0
    left_out = f" {hidden} points with a stated error above {100 * _WORST_DRAWN:g} % are not drawn." if hidden else ""
    return f"Points: {bars}.{left_out}"


@style.fixed_settings()
def loops_figure(result: Result, table: pd.DataFrame, title: str) -> style.Chart:
    """Figure of force over displacement of loops, measured and modelled, and of residuals over the phase of the cycle.

    At most 240 rows of the first two and last two cycles of each loop are drawn.

    Args:
        result: fitted model, with the effects of the rig.
        table: measured and modelled loops, a row per sample, with the columns of `tables.loops_table` (loops.csv).
        title: title of the figure.

    Returns:
        Figure with two panels per direction or specimen.
    """
    places = list(loops_by_direction(table, result))
    figure = style.Chart(title, 1.25 * style.ROW * len(places))  # nearly square panels for hysteresis loops
    grid = figure.subplots(len(places), 2, squeeze=False, width_ratios=[1.15, 1.0])
    for (place, loops), (force_panel, phase_panel) in zip(places, grid, strict=True):
        looks = style.styles(len(loops), "loop")
        _draw_forces(force_panel, place, loops, looks)
        style.label_axes(phase_panel, "phase after the peak [deg]", "force residual / noise")
        for loop, look in zip(loops.values(), looks, strict=True):
            counted = loop[loop["outlier"] == "no"]
            rows = _drawn_rows(counted)
            points = phase_after_turn(counted, place)[rows], counted["residual [noise]"].to_numpy()[rows]
            phase_panel.plot(*points, ".", color=look.color, alpha=0.4, **style.DOT)
            draw_sector_means(phase_panel, counted, place, "residual [noise]", look)
        style.noise_band(phase_panel)
        model = {"model": Line2D([], [], color=style.INK, lw=0.8)}
        style.legend(phase_panel, [look.handle(False) for look in looks], loop_labels(place, loops), "loop", model)
    return figure.explain(
        "Left: measured force over displacement (noise removed). Black lines: model. Right: measured minus model, "
        f"in units of the noise of a row, and means over {SECTOR:g}° of the cycle (lines). 95 % of the points should "
        "be in the grey band.",
        _OUTLIERS * bool((table["outlier"] == "yes").any()),
        f"Only {MOST_LOOPS} loops of a direction are drawn." * any(len(loops) == MOST_LOOPS for _, loops in places),
    )


def _draw_forces(axes: Axes, place: Place, loops: dict[str, pd.DataFrame], looks: Sequence[style.Style]) -> None:
    """Draw force over displacement of the loops of a direction, with lines of the model and crosses at outliers.

    Args:
        axes: panel.
        place: direction or specimen of the loops.
        loops: rows of each loop by the name of its test.
        looks: colour, line style and marker of each loop.
    """
    motion, force = displacement_header(place), response_headers(place)[2]
    name, factor = place.display.force
    unit, to_figure = display_unit(name, factor, max(loop[force].abs().max() for loop in loops.values()) / factor)
    scale = to_figure / factor
    motion_name, resisting, _ = place.motion.words
    style.label_axes(axes, f"{motion_name} [{place.display.displacement.name}]", f"{place} {resisting} [{unit}]")
    for loop, look in zip(loops.values(), looks, strict=True):
        counted = loop[loop["outlier"] == "no"]
        drawn = counted.iloc[_drawn_rows(counted)]
        modelled = scale * drawn[f"model {force}"].to_numpy()
        cycles = drawn["time [s]"] * drawn["frequency [Hz]"]
        modelled[1:][np.diff(cycles) > 0.5] = np.nan  # no line from the first cycles to the last
        axes.plot(drawn[motion], scale * drawn[force], "o", color=look.color, alpha=0.5, **style.DOT)
        axes.plot(drawn[motion], modelled, color=style.INK, lw=0.8)
    rows = pd.concat(loops.values())
    outliers = rows[rows["outlier"] == "yes"]
    style.mark_outliers(axes, outliers[motion].to_numpy(), scale * outliers[force].to_numpy())


def loop_labels(place: Place, loops: dict[str, pd.DataFrame]) -> list[str]:
    """Legend labels of loops: amplitude and frequency, and also the name of the test if labels would repeat.

    Args:
        place: direction or specimen of the loops.
        loops: rows of each loop by the name of its test.

    Returns:
        Labels in the order of the loops.
    """
    labels = []
    for loop in loops.values():
        motion = loop[displacement_header(place)]
        amplitude = format_range(place.display.displacement.name, float(motion.max() - motion.min()) / 2.0)
        labels.append(f"{amplitude}, {format_range('Hz', float(loop['frequency [Hz]'].iloc[0]))}")
    if len(set(labels)) == len(labels):
        return labels
    return [f"{label}\n{shorten(name, 20)}" for label, name in zip(labels, loops, strict=True)]


def _drawn_rows(loop: pd.DataFrame) -> Array:
    """Indices of the rows of a loop to draw, (n,): about 240 at most, from the first two and last two cycles."""
    cycles = (loop["time [s]"] * loop["frequency [Hz]"]).to_numpy()
    rows = np.flatnonzero((cycles < cycles[0] + 2.0) | (cycles > cycles[-1] - 2.0))
    return rows[:: max(1, -(-rows.size // _MOST_ROWS))]
