"""Figures of test files as recorded, and of the reduction of raw histories and resonance tests."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec, SubplotSpec

from bushfit.geometry import TRANSLATION, Unit
from bushfit.inspection.record import Inspection
from bushfit.reading.measurement import Loop, Sweep, loss_factor
from bushfit.reduction.resonance import LARGEST_ERROR, Resonance
from bushfit.reduction.result import Reduction
from bushfit.report.plots import style
from bushfit.report.plots.measured import header_of
from bushfit.report.plots.pairs import ResponsePair
from bushfit.report.plots.response import extreme_rows
from bushfit.report.tables import shorten
from bushfit.units import display_unit

#: Colour of a history.
_COLOR = "#3b528b"
#: Largest number of rows of a loop that are drawn over the displacement.
_MOST_ROWS = 6000
#: Largest number of rows of a record that are drawn over time; a figure has fewer pixels.
_MOST_OVER_TIME = 3000
#: Height of a history, and of the panels of noise and distortion [cm].
_STRIP, _NOISE_ROW = 2.7, 4.2
#: Largest number of histories that are drawn in one figure.
_MOST_HISTORIES = 4


@style.fixed_settings()
def inspection_figure(files: Sequence[Inspection], first: int = 0, count: int = 5) -> style.Chart:
    """Figure of test files as recorded: loops over displacement and time, histories over time, sweeps over their steps.

    Args:
        files: all inspected files.
        first: index of the first file to draw.
        count: number of files to draw.

    Returns:
        Figure with a row of panels per file.
    """
    drawn_files, names = files[first : first + count], Counter(file.label for file in files)
    page = f", {first // count + 1} of {-(-len(files) // count)}" if len(files) > count else ""
    figure = style.Chart(f"Test files as recorded{page}", (style.ROW + 0.7) * len(drawn_files))
    grid = figure.add_gridspec(len(drawn_files), 2)
    for row, file in enumerate(drawn_files):
        name = f"{file.file.parent.name}/{file.label}" if names[file.label] > 1 else file.label
        title = f"{shorten(name, 48)}: {file.kind}, {file.direction or 'direction unknown'}"
        title += ", sign of the force reversed" * (any(warning.kind == "reversed_force" for warning in file.odd))
        title += f", {len(file.odd)} remarks" if file.odd else ""
        if isinstance(file.measured, Sweep):
            panel = _draw_sweep([figure.add_subplot(grid[row, column]) for column in (0, 1)], file.measured)
        elif file.measured is not None:
            loop = figure.add_subplot(grid[row, 0]) if file.kind == "loop" else None
            panel = _draw_history(figure, grid[row, 1] if loop else grid[row, :], file.measured, loop)
        panel.set_title(title, fontsize=style.TEXT, loc="left", color=style.GREY)
    swept = any(isinstance(file.measured, Sweep) for file in drawn_files)
    return figure.explain("Sweeps: points as measured, lines through the means of the repeats." * swept)


def _draw_history(figure: Figure, cell: SubplotSpec, history: Loop, loop: Axes | None) -> Axes:
    """Draw displacement and force over time, and the hysteresis loop in `loop` if given; return the leftmost panel.

    Args:
        figure: figure to draw in.
        cell: cell of the figure's grid for the panels over time.
        history: record to draw.
        loop: panel for the hysteresis loop; None for none.
    """
    (length, to_length), unit_force, _ = history.direction.display
    force, to_force = display_unit(*unit_force, float(np.abs(history.force).max()))
    names = history.direction.motion.words
    over_time = cell.subgridspec(2, 1, hspace=0.15).subplots(sharex=True, squeeze=False)[:, 0]
    motion, load = to_length * history.displacement, to_force * history.force
    labels = f"{names[0]}\n[{length}]", f"{names[1]}\n[{force}]"
    for axes, values, label in zip(over_time, (motion, load), labels, strict=True):
        rows = extreme_rows(values, _MOST_OVER_TIME)
        axes.plot(history.time[rows], values[rows], lw=0.8, color=_COLOR)
        style.label_axes(axes, "time [s]" if history.has_recorded_time else "time rebuilt [s]", label)
    figure.align_ylabels(over_time)
    over_time[0].set_xlabel("")
    if loop is None:
        return over_time[0]
    step = max(1, -(-history.time.size // _MOST_ROWS))
    loop.plot(motion[::step], load[::step], ".", ms=1.2, mew=0, color=_COLOR, alpha=0.7)
    style.label_axes(loop, f"{names[0]} [{length}]", f"{names[1]} [{force}]")
    return loop


def _draw_sweep(panels: Sequence[Axes], sweep: Sweep) -> Axes:
    """Draw stiffness and loss factor over the stepped quantity of a sweep; return the left panel."""
    place, length = sweep.direction, sweep.direction.display.displacement
    by_amplitude = sweep.stepped == "amplitude"
    fixed_quantity, unit = ("frequency", Unit("Hz", 1.0)) if by_amplitude else ("amplitude", length)
    x = sweep.step * (length.factor if by_amplitude else 1.0)
    x_label = header_of(place, "amplitude" if by_amplitude else "frequency")
    pair = ResponsePair(panels, place, float(np.abs(sweep.stiffness).max()), x_label, x)
    levels = np.unique(sweep.run_level)
    for level, look in zip(levels, style.styles(levels.size, fixed_quantity), strict=True):
        at_level = sweep.run_level == level
        means = pd.Series(sweep.stiffness[at_level]).groupby(x[at_level]).mean()
        pair.plot(means.index.to_numpy(), means.to_numpy(), color=look.color, ls=look.dashes, lw=0.8)
        pair.plot(x[at_level], sweep.stiffness[at_level], look.marker, color=look.color, alpha=0.75, **style.POINT)
    if sweep.stepped:
        style.name_levels(panels[-1], list(map(unit.text, levels)), fixed_quantity)
    return panels[0]


@style.fixed_settings()
def reduction_figure(reduction: Reduction, histories: Sequence[Loop], title: str) -> style.Chart:
    """Figure of raw time histories and the operating points that they were reduced to, with noise and distortion.

    Args:
        reduction: operating points of all histories.
        histories: histories as recorded; the first four are drawn, with the cycles used in colour.
        title: title of the figure.

    Returns:
        Figure with a strip per history above four panels.
    """
    drawn = histories[:_MOST_HISTORIES]
    heights = [_STRIP] * len(drawn) + [style.ROW, _NOISE_ROW]
    figure = style.Chart(title, sum(heights))
    grid = figure.add_gridspec(len(heights), 2, height_ratios=heights)
    levels = np.unique([step.level for step in reduction.steps])
    looks = dict(zip(levels, style.styles(len(levels), "amplitude"), strict=True))
    unit, factor = reduction.direction.display.displacement
    for row, history in enumerate(drawn):
        strip, rows = figure.add_subplot(grid[row, :]), extreme_rows(history.displacement, _MOST_OVER_TIME)
        time, motion = history.time[rows], factor * history.displacement[rows]
        strip.plot(time, motion, color="#c8c8c8", lw=0.4)
        for level, look in looks.items():
            used = np.zeros(time.shape, dtype=bool)
            for step in (step for step in reduction.steps if (step.name, step.level) == (history.name, level)):
                used |= (time >= step.start) & (time <= step.end)
            strip.plot(time, np.where(used, motion, np.nan), color=look.color, lw=0.4)
        style.label_axes(strip, "time [s]", f"{reduction.direction.motion.words[0]}\n[{unit}]")
        strip.margins(x=0.01)
        if len(histories) > 1:  # the title of the figure names a single history
            name = shorten(history.name, 100)  # one line
            strip.set_title(name, fontsize=style.SMALL, loc="left", color=style.GREY, pad=2)
    _draw_points(figure, grid, reduction, looks)
    left_out = f" The first {len(drawn)} of {len(histories)} histories." * (len(histories) > len(drawn))
    return figure.explain(
        f"Top: displacement over time; coloured: steady cycles used, grey: ramps, pauses, transients.{left_out}",
        "Bars: twice the standard error. Noise: standard error of a point relative to |K|.",
        "Distortion: harmonics relative to the fundamental; filled symbols: force, open symbols: displacement.",
    )


def _draw_points(figure: Figure, grid: GridSpec, reduction: Reduction, looks: dict[float, style.Style]) -> None:
    """Draw stiffness and loss factor of a reduction with bars of two standard errors, and below noise and distortion.

    Args:
        figure: figure to draw in.
        grid: grid of the figure, whose last two rows have the panels.
        reduction: operating points of the histories.
        looks: colour and marker by nominal amplitude [m, rad or 1].
    """
    steps = pd.DataFrame([vars(step) for step in reduction.steps]).sort_values("frequency", kind="stable")
    x, panels = steps["frequency"].to_numpy(), [figure.add_subplot(grid[-2, column]) for column in (0, 1)]
    quality = [figure.add_subplot(grid[-1, column], sharex=panels[0]) for column in (0, 1)]
    pair = ResponsePair(panels, reduction.direction, float(steps["stiffness"].abs().max()), "", x)
    for level, look in looks.items():
        rows = steps[steps["level"] == level]
        frequency, stiffness = rows["frequency"].to_numpy(), rows["stiffness"].to_numpy()
        magnitude, loss = pair.values(stiffness)
        errors = magnitude * rows["gain_error"], (1.0 + loss**2) * rows["phase_error"]
        pair.plot(frequency, stiffness, color=look.color, ls=look.dashes, lw=0.7, alpha=0.6)
        for axes, value, error in zip(panels, (magnitude, loss), errors, strict=True):
            axes.vlines(frequency, value - 2 * error, value + 2 * error, color=look.color, lw=0.9)
        pair.plot(frequency, stiffness, look.marker, color=look.color, **style.POINT)
        noise = 100.0 * np.hypot(rows["gain_error"], rows["phase_error"]) / 2**0.5
        force, motion = 100.0 * rows["force_distortion"], 100.0 * rows["displacement_distortion"]
        quality[0].plot(frequency, noise, look.marker, color=look.color, **style.POINT)
        quality[1].plot(frequency, force, look.marker, color=look.color, **style.POINT)
        quality[1].plot(frequency, motion, look.marker, color=look.color, ms=3.4, mfc="none", mew=0.7)
    for axes in panels:
        axes.tick_params(labelbottom=False)
    for axes, label in zip(quality, ("noise [%]", "distortion [%]"), strict=True):
        style.label_axes(axes, "frequency [Hz]", label, x)
        axes.set_ylim(bottom=0.0)
    handles = [look.handle(True) for look in looks.values()]
    style.legend(panels[-1], handles, list(map(reduction.direction.display.displacement.text, looks)), "amplitude")


@style.fixed_settings()
def resonance_figure(resonance: Resonance, title: str) -> style.Chart:
    """Figure of a resonance test: transmissibility, amplitude reached, stiffness and loss factor over frequency.

    Args:
        resonance: resonance test reduced to stiffness over frequency.
        title: title of the figure.

    Returns:
        Figure with four panels.
    """
    figure = style.Chart(title, 2 * style.ROW)
    (ratio, amplitude), (stiffness, loss) = figure.subplots(2, 2, sharex=True)
    (unit, length), _, stiffness_units = TRANSLATION.display
    stiffness_unit, factor = display_unit(*stiffness_units, float(np.abs(resonance.stiffness).max()))
    color = style.styles(1, "amplitude")[0].color
    magnitude, factors = factor * np.abs(resonance.stiffness), loss_factor(resonance.stiffness)
    error = 2.0 * resonance.relative_error
    quantities = (
        (ratio, "", "transmissibility |T| [-]", np.abs(resonance.transmissibility), None),
        (amplitude, "", f"amplitude reached [{unit}]", length * resonance.amplitude, None),
        (stiffness, "frequency [Hz]", f"stiffness |K| [{stiffness_unit}]", magnitude, error * magnitude),
        (loss, "frequency [Hz]", "loss factor [-]", factors, error * (1.0 + factors**2)),
    )
    for axes, x_label, label, values, half in quantities:
        axes.plot(resonance.frequency, values, "o", color=color, **style.DOT)
        style.label_axes(axes, x_label, label, resonance.test.frequency)
        if half is None:
            style.make_logarithmic(axes, values, "y")
        else:
            limits = axes.get_ylim()
            axes.vlines(resonance.frequency, values - half, values + half, color=color, lw=0.7, alpha=0.6)
            axes.set_ylim(limits)
    ratio.plot(resonance.test.frequency, np.abs(resonance.test.transmissibility), color=style.GREY, lw=0.7, zorder=1)
    frequency, largest = resonance.peak
    ratio.annotate(f"{frequency:.1f} Hz", (frequency, largest), (4, 0), textcoords="offset points", **style.WORDS)
    hidden = f"Points with an error of |K| beyond {100 * LARGEST_ERROR:g} % are not drawn."
    return figure.explain(
        "Grey line: transmissibility (acceleration of mass divided by base). Points: means of neighbouring rows.",
        "Bars: twice the standard error; the error is large where mass and base move almost equally.",
        hidden * bool(resonance.left_out.size),
    )
