"""A fit against its tests: sweeps and loops with the model over them, and what is left."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bushfit.effects.contract import Array
from bushfit.fitting.data_sets import LoopData, SweepData
from bushfit.geometry import Place
from bushfit.model.model import Model
from bushfit.prediction.stiffness import Band
from bushfit.report.plots import style
from bushfit.report.plots.points import (
    SECTORS,
    Axis,
    Kind,
    Points,
    by_direction,
    by_kind,
    curves_of,
    held_with,
    means,
    over_sectors,
    phase_after_turn,
)
from bushfit.report.plots.prediction import FINE, draw, draw_curves, points_note
from bushfit.units import for_people, told

#: Height of a panel of residuals [cm].
_STRIP = 2.6
#: Most rows of a loop that are drawn: a panel is some 400 pixels wide, and a loop crosses it several times.
_MOST_ROWS = 1600
_RESIDUALS = "Residuals: model less measured in units of noise; 95 % of them should lie in the grey."
_OUTLIERS = "Crosses: outliers, at the edge where they lie beyond it."


def sweeps_figure(model: Model, data_sets: Sequence[SweepData], title: str) -> Figure:
    """Magnitude and loss factor of sweeps over what they step through, measured and modelled; their residuals below.

    A row of panels per place and kind of sweep; along x lies what is stepped, or the frequency where nothing was held.
    The model keeps the effects of the rig, since sweeps hold them.
    """
    kinds = by_kind(data_sets)
    figure = style.new_figure(title, (style.ROW + _STRIP) * len(kinds))
    grid = figure.subplots(2 * len(kinds), 2, squeeze=False, height_ratios=[style.ROW, _STRIP] * len(kinds))
    for (kind, mine), pair, strips in zip(kinds.items(), grid[::2], grid[1::2], strict=True):
        if curves_of(mine, kind):
            draw_curves(pair, kind, model, mine)
        else:
            points, held = means(mine), held_with(kind.axis)
            levels = np.unique(getattr(points, held))
            as_measured = means([sweep.noise_free(model) for sweep in mine]) if model.knows_circumstances else None
            lines = as_measured or _model_lines(model, kind.place, points, kind.axis)
            draw(pair, kind.place, lines, points, kind.axis, levels)
        _draw_residuals(pair, strips, model, mine, kind)
    outlying = any((data_set.weights == 0.0).any() for data_set in data_sets)
    return style.explained(figure, "Lines: model.", points_note(data_sets), _RESIDUALS, _OUTLIERS * outlying)


def _draw_residuals(
    pair: Sequence[Axes], strips: Sequence[Axes], model: Model, data_sets: Sequence[SweepData], kind: Kind
) -> None:
    """The residuals of one kind of sweeps, of the gain left and of the phase right, below the panels `pair`."""
    scale = kind.place.display.displacement.factor if kind.axis == "amplitude" else 1.0
    x = [scale * getattr(data_set, kind.axis) for data_set in data_sets]
    for part, (panel, strip, name) in enumerate(zip(pair, strips, ("gain", "phase"), strict=True)):
        residuals = [data_set.shown(model).reshape(2, -1)[part] for data_set in data_sets]
        for look, place, at in _looks(data_sets, kind):
            marker = style.DOT | {"color": look.color, "alpha": 0.8}
            strip.plot(x[place][at], residuals[place][at], look.marker, **marker)
        strip.sharex(panel)
        reach = np.concatenate(x)
        style.label_axes(strip, panel.get_xlabel(), f"{name} residual\n/ noise", reach)
        if kind.axis == "amplitude" and reach.max() > 3.0 * reach.min():  # half a decade
            style.logarithmic(strip, reach)
        panel.tick_params(labelbottom=False)
        panel.set_xlabel("")
        style.noise_band(strip)
        for place, data_set in enumerate(data_sets):
            outlying = data_set.weights == 0.0
            style.mark_outliers(strip, x[place][outlying], residuals[place][outlying])


def _looks(data_sets: Sequence[SweepData], kind: Kind) -> Iterator[tuple[style.Style, int, Array]]:
    """How the points of each level are drawn, or of each curve: style, number of the test, which of its points."""
    if curves := curves_of(data_sets, kind):
        for curve, look in zip(curves, style.styles(len(curves), kind.palette), strict=True):
            yield look._replace(marker="o"), curve.test, curve.points & (data_sets[curve.test].weights > 0.0)
        return
    held = held_with(kind.axis)
    levels = np.unique(np.concatenate([getattr(data_set.with_weight(), held) for data_set in data_sets]))
    for place, data_set in enumerate(data_sets):
        for look, level in zip(style.styles(levels.size, held), levels, strict=True):
            yield look, place, (getattr(data_set, held) == level) & (data_set.weights > 0.0)


def loops_figure(model: Model, data_sets: Sequence[LoopData], title: str) -> Figure:
    """Force over displacement, measured and modelled, and residuals over the phase of the cycle; a row per direction.

    Of each loop at most 1600 rows, from the first and last two cycles, are drawn. The model keeps the effects of the
    rig, since loops hold them.
    """
    directions = by_direction(data_sets)
    figure = style.new_figure(title, 1.25 * style.ROW * len(directions))  # a hysteresis loop wants a square
    grid = figure.subplots(len(directions), 2, squeeze=False, width_ratios=[1.15, 1.0])
    for (direction, mine), (loop_panel, phase_panel) in zip(directions.items(), grid, strict=True):
        _draw_loops(loop_panel, model, direction, mine)
        style.label_axes(phase_panel, "phase after the upper turn [deg]", "residual / noise")
        for data_set, look in zip(mine, style.styles(len(mine), "loop"), strict=True):
            rows, residual = _drawn_rows(data_set), data_set.misfit(model)
            dots: dict[str, Any] = {"color": look.color, "alpha": 0.4, **style.DOT}
            phase_panel.plot(phase_after_turn(data_set)[rows], residual[rows], ".", **dots)
            middle, shares = over_sectors(data_set)
            phase_panel.plot(middle, shares @ residual, color=look.color, ls=look.dashes, lw=1.4)
        style.noise_band(phase_panel)
        phase_panel.set(xlim=(0.0, 360.0), xticks=range(0, 361, 90))
        loops_legend(phase_panel, mine, besides={"model": Line2D([], [], color=style.INK, lw=0.8)})
    note = _OUTLIERS if any(data_set.drive.outliers["force"].rows.size for data_set in data_sets) else ""
    return style.explained(
        figure,
        "Left: measured force over the motion cleared of noise; black: model.",
        _RESIDUALS,
        f"Lines there: means over {360 // SECTORS} deg.",
        note,
    )


def _draw_loops(axes: Axes, model: Model, direction: Place, data_sets: Sequence[LoopData]) -> None:
    (unit, length), force_units, _ = direction.display
    largest = max(float(np.abs(data_set.drive.force).max()) for data_set in data_sets)
    force_unit, factor = for_people(*force_units, largest)
    motion_name, force_name, _ = direction.motion.words
    style.label_axes(axes, f"{motion_name} [{unit}]", f"{direction} {force_name} [{force_unit}]")
    for data_set, look in zip(data_sets, style.styles(len(data_sets), "loop"), strict=True):
        drive, rows = data_set.drive, _drawn_rows(data_set)
        phase = drive.phase[rows]
        motion, modelled = length * drive.displacement(phase), factor * data_set.force(model)[rows]
        modelled[1:][np.diff(phase) > 0.5] = np.nan  # the cycles between, which are not drawn
        axes.plot(motion, factor * drive.force[rows], "o", color=look.color, alpha=0.5, **style.DOT)
        axes.plot(motion, modelled, color=style.INK, lw=0.8)
    for data_set in data_sets:
        loop, rows = data_set.test, data_set.drive.outliers["force"].rows
        phase = (loop.time[rows] - loop.time[0]) * data_set.drive.frequency
        style.mark_outliers(axes, length * data_set.drive.displacement(phase), factor * loop.force[rows])


def loops_legend(axes: Axes, data_sets: Sequence[LoopData], **words: Any) -> None:
    """Name the loops of a panel; `words` are what else `legend` takes."""
    handles = [look.handle(False) for look in style.styles(len(data_sets), "loop")]
    style.legend(axes, handles, loop_labels(data_sets), **({"title": "loop"} | words))


def loop_labels(data_sets: Sequence[LoopData]) -> list[str]:
    """Each loop of a direction by amplitude and frequency, and by file on a second line where that leaves twins."""
    unit, length = data_sets[0].direction.display.displacement
    labels = [f"{told(unit, length * each.amplitude[0])}, {told('Hz', each.frequency[0])}" for each in data_sets]
    if len(set(labels)) == len(labels):
        return labels
    return [f"{label}\n{style.file_name(each.test.name)}" for label, each in zip(labels, data_sets, strict=True)]


def _model_lines(model: Model, direction: Place, points: Points, axis: Axis) -> Points:
    """The model over what was stepped through at each value that was held meanwhile, as far as it was measured."""
    along, held = getattr(points, axis), getattr(points, held_with(axis))
    levels = np.unique(held)
    spans = [along[held == level] for level in levels]
    stepped = np.concatenate([np.geomspace(span.min(), span.max(), FINE) for span in spans])
    at_level = np.repeat(levels, FINE)
    frequency, amplitude = (stepped, at_level) if axis == "frequency" else (at_level, stepped)
    stiffness = model.stiffness(direction, frequency, amplitude)
    magnitude, loss_factor = np.abs(stiffness), stiffness.imag / stiffness.real
    return Points(frequency, amplitude, Band(*3 * [magnitude]), Band(*3 * [loss_factor]))


def _drawn_rows(data_set: LoopData) -> Array:
    """Rows of the first and last two cycles, thinned to what an eye can tell apart, without the outliers."""
    phase = data_set.drive.phase
    drawn = (phase < 2.0) | (phase > phase[-1] - 2.0)
    if phase.size == data_set.test.force.size:
        drawn[data_set.drive.outliers["force"].rows] = False
    rows = np.flatnonzero(drawn)
    return rows[:: max(1, -(-rows.size // _MOST_ROWS))]
