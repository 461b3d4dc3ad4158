"""A fit against its tests: sweeps and loops with the model over them, and what is left."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bushfit.effects.contract import Array
from bushfit.fitting.data_sets import LoopData, SweepData
from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.prediction import Band
from bushfit.report.plots.points import SECTORS, Points, means, over_sectors, turn, wild_points
from bushfit.report.plots.prediction import FINE, draw, points_note
from bushfit.report.plots.style import (
    DOT,
    INK,
    ROW,
    dress,
    explain,
    legend,
    mark_wild,
    new_figure,
    noise_band,
    readable,
    styles,
)
from bushfit.units import for_people

_STRIP = 2.6 / 2.54
_MOST_ROWS = 1600
_RESIDUALS = "Residuals: model less measured in units of noise; 95 % of them should lie in the grey."
_WILD = "Crosses: outliers, at the edge where they lie beyond it."
_MEANS = f"Lines there: means over {360 // SECTORS} deg."


def sweeps_figure(model: Model, data_sets: Sequence[SweepData], title: str) -> Figure:
    """Magnitude and loss factor over frequency, measured and modelled, a row per direction; their residuals below.

    The model keeps the effects of the rig, since sweeps hold them. At least one data set; the title names the bushing.
    """
    directions = list(dict.fromkeys(data_set.direction for data_set in data_sets))
    figure = new_figure(title, (ROW + _STRIP) * len(directions))
    grid = figure.subplots(2 * len(directions), 2, squeeze=False, height_ratios=[ROW, _STRIP] * len(directions))
    for direction, pair, strips in zip(directions, grid[::2], grid[1::2], strict=True):
        mine = [data_set for data_set in data_sets if data_set.direction is direction]
        points = means(mine)
        levels = np.unique(points.amplitude)
        draw(pair, direction, _model_lines(model, direction, points), points, "frequency", levels)
        for data_set in mine:
            for strip, residual in zip(strips, data_set.shown(model).reshape(2, -1), strict=True):
                for style, level in zip(styles(levels.size, "amplitude"), levels, strict=True):
                    at = (data_set.amplitude == level) & (data_set.weights > 0.0)
                    strip.plot(data_set.frequency[at], residual[at], style.marker, color=style.color, alpha=0.8, **DOT)
        for panel, strip, name in zip(pair, strips, ("gain", "phase"), strict=True):
            strip.sharex(panel)
            dress(strip, panel.get_xlabel(), f"{name} residual\n/ noise")
            readable(strip, points.frequency)
            panel.tick_params(labelbottom=False)
            panel.set_xlabel("")
            noise_band(strip)
        for data_set in mine:
            wild = data_set.weights == 0.0
            for strip, residual in zip(strips, data_set.shown(model).reshape(2, -1)[:, wild], strict=True):
                mark_wild(strip, data_set.frequency[wild], residual)
    note = _WILD if any((data_set.weights == 0.0).any() for data_set in data_sets) else ""
    explain(figure, "Lines: model.", points_note(data_sets), _RESIDUALS, note)
    return figure


def loops_figure(model: Model, data_sets: Sequence[LoopData], title: str) -> Figure:
    """Force over displacement, measured and modelled, and residuals over the phase of the cycle; a row per direction.

    The model keeps the effects of the rig, since loops hold them. At least one data set; of each at most 1600 rows,
    from the first and last two cycles, are drawn. The title names the bushing.
    """
    directions = list(dict.fromkeys(data_set.direction for data_set in data_sets))
    figure = new_figure(title, 1.25 * ROW * len(directions))
    grid = figure.subplots(len(directions), 2, squeeze=False, width_ratios=[1.15, 1.0])
    for direction, (loop_panel, phase_panel) in zip(directions, grid, strict=True):
        mine = [data_set for data_set in data_sets if data_set.direction is direction]
        units, turns = direction.display, direction.is_rotation
        unit, length = units.displacement
        force_unit, force = for_people(
            *units.force, max(float(np.abs(data_set.drive.force).max()) for data_set in mine)
        )
        motion_name, force_name = ("rotation", "moment") if turns else ("displacement", "force")
        dress(loop_panel, f"{motion_name} [{unit}]", f"{direction} {force_name} [{force_unit}]")
        dress(phase_panel, "phase after the upper turn [deg]", "residual / noise")
        for data_set, style in zip(mine, styles(len(mine), "loop"), strict=True):
            drive, rows = data_set.drive, _drawn_rows(data_set)
            phase, residual = drive.phase[rows], data_set.residual(model)
            motion, modelled = length * drive.displacement(phase), force * data_set.force(model)[rows]
            modelled[1:][np.diff(phase) > 0.5] = np.nan  # the cycles between, which are not drawn
            loop_panel.plot(motion, force * drive.force[rows], "o", color=style.color, alpha=0.5, **DOT)
            loop_panel.plot(motion, modelled, color=INK, lw=0.8)
            phase_panel.plot(turn(data_set)[rows], residual[rows], ".", color=style.color, alpha=0.4, **DOT)
            middle, mean, _ = over_sectors(data_set, residual)
            phase_panel.plot(middle, mean, color=style.color, ls=style.dashes, lw=1.4)
        noise_band(phase_panel)
        for data_set in mine:
            phase, wild_force = wild_points(data_set)
            mark_wild(loop_panel, length * data_set.drive.displacement(phase), force * wild_force)
        phase_panel.set(xlim=(0.0, 360.0), xticks=range(0, 361, 90))
        loops_legend(phase_panel, mine, Line2D([], [], color=INK, lw=0.8))
    note = _WILD if any(data_set.drive.outliers["force"].rows.size for data_set in data_sets) else ""
    explain(figure, "Left: measured force over the motion cleared of noise; black: model.", _RESIDUALS, _MEANS, note)
    return figure


def loops_legend(axes: Axes, data_sets: Sequence[LoopData], model: Line2D | None = None, **place: Any) -> None:
    """Names the loops of a panel by amplitude and frequency, and by file where that leaves twins."""
    unit, length = data_sets[0].direction.display.displacement
    labels = [f"{length * data_set.amplitude[0]:.3g} {unit}, {data_set.frequency[0]:.3g} Hz" for data_set in data_sets]
    if len(set(labels)) < len(labels):
        names = [data_set.test.name.replace("$", r"\$") for data_set in data_sets]
        labels = [f"{label}\n{name}" for label, name in zip(labels, names, strict=True)]
    handles = [style.handle(False) for style in styles(len(data_sets), "loop")]
    if model:
        handles, labels = [*handles, model], [*labels, "model"]
    legend(axes, handles, labels, "" if place else "loop", **place)


def _model_lines(model: Model, direction: Direction, points: Points) -> Points:
    """The model over the frequencies of each measured level."""
    levels = np.unique(points.amplitude)
    spans = [points.frequency[points.amplitude == level] for level in levels]
    frequency = np.concatenate([np.geomspace(span.min(), span.max(), FINE) for span in spans])
    amplitude = np.repeat(levels, FINE)
    stiffness = model.stiffness(direction, frequency, amplitude)
    magnitude, loss_factor = np.abs(stiffness), stiffness.imag / stiffness.real
    return Points(frequency, amplitude, Band(*3 * [magnitude]), Band(*3 * [loss_factor]))


def _drawn_rows(data_set: LoopData) -> Array:
    """Rows of the first and last two cycles, thinned to what an eye can tell apart; wild ones are drawn as crosses."""
    phase = data_set.drive.phase
    drawn = (phase < 2.0) | (phase > phase[-1] - 2.0)
    if phase.size == data_set.test.force.size:
        drawn[data_set.drive.outliers["force"].rows] = False
    rows = np.flatnonzero(drawn)
    return rows[:: max(1, -(-rows.size // _MOST_ROWS))]
