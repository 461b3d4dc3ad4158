"""Raw stepped-sine histories and the sweep they were reduced to."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bushfit.reading.measurement import Loop
from bushfit.reduction.result import Reduction
from bushfit.report.plots.points import ranges
from bushfit.report.plots.style import (
    CM,
    GREY,
    POINT,
    ROW,
    SMALL,
    Style,
    dress,
    explain,
    file_name,
    legend,
    new_figure,
    readable,
    styles,
)
from bushfit.units import for_people

#: Height of a history [inch].
_STRIP = 2.7 / CM
#: Height of the panels of noise and distortion [inch].
_NOISE_ROW = 4.2 / CM
#: Most histories that are drawn: with more the figure leaves the page.
_MOST_HISTORIES = 4
#: Most letters of a history's name above its panel, as many as fit on a line.
_NAME_LETTERS = 100
#: Colour of what was not used.
_UNUSED = "#c8c8c8"


def reduction_figure(reduction: Reduction, histories: Sequence[Loop], title: str) -> Figure:
    """Each history with the cycles used; stiffness and loss factor over frequency; noise and harmonic distortion.

    Of more than four histories the first four are drawn.
    """
    shown = histories[:_MOST_HISTORIES]
    figure = new_figure(title, _STRIP * len(shown) + ROW + _NOISE_ROW)
    grid = figure.add_gridspec(len(shown) + 2, 2, height_ratios=[_STRIP] * len(shown) + [ROW, _NOISE_ROW])
    levels = sorted({step.level for step in reduction.steps})
    looks = dict(zip(levels, styles(len(levels), "amplitude"), strict=True))
    for row, history in enumerate(shown):
        strip = figure.add_subplot(grid[row, :])
        _draw_history(strip, history, reduction, looks)
        if len(histories) > 1:  # the title names one
            strip.set_title(file_name(history.name, _NAME_LETTERS), fontsize=SMALL, loc="left", color=GREY, pad=2)
    points = [figure.add_subplot(grid[len(shown), column]) for column in range(2)]
    _draw_points(points, reduction, looks)
    quality = [figure.add_subplot(grid[len(shown) + 1, column], sharex=points[0]) for column in range(2)]
    _draw_quality(quality, reduction, looks)
    left_out = f" The first {len(shown)} of {len(histories)} histories." if len(histories) > len(shown) else ""
    explain(
        figure,
        f"Top: displacement over time; coloured: the steady cycles used, grey: ramps, pauses, transients.{left_out}",
        "Bars: twice the standard error. Noise: standard error of a point, relative to |K|.",
        "Distortion: overtones over the fundamental (THD), filled of the force, hollow of the displacement.",
    )
    return figure


def _draw_history(axes: Axes, history: Loop, reduction: Reduction, looks: dict[float, Style]) -> None:
    """Displacement over time; what was used has the colour of its level."""
    unit, factor = reduction.direction.display.displacement
    time, low, high = ranges(history.time, factor * history.displacement)
    axes.fill_between(time, low, high, color=_UNUSED, lw=0.4, step="post")
    for level, look in looks.items():
        mine = [step for step in reduction.steps if step.name == history.name and step.level == level]
        inside = [(time >= step.start) & (time <= step.end) for step in mine]
        used = np.any([np.zeros(time.shape, dtype=bool), *inside], axis=0)
        axes.fill_between(time, low, high, where=used, color=look.color, lw=0.4, step="post")
    dress(axes, "time [s]", f"{reduction.direction.motion.words[0]}\n[{unit}]")
    axes.margins(x=0.01)


def _draw_points(pair: Sequence[Axes], reduction: Reduction, looks: dict[float, Style]) -> None:
    """Stiffness and loss factor over frequency, with bars of twice the standard error."""
    (unit, length), _, stiffness_units = reduction.direction.display
    steps = reduction.steps
    stiffness_unit, factor = for_people(*stiffness_units, max(abs(step.stiffness) for step in steps))
    for level, look in looks.items():
        mine = [step for step in steps if step.level == level]
        frequency = np.array([step.frequency for step in mine])
        order = np.argsort(frequency, kind="stable")
        magnitude = factor * np.abs([step.stiffness for step in mine])
        loss_factor = np.array([step.loss_factor for step in mine])
        errors = (
            magnitude * np.array([step.gain_error for step in mine]),
            (1.0 + loss_factor**2) * np.array([step.phase_error for step in mine]),
        )
        for axes, value, error in zip(pair, (magnitude, loss_factor), errors, strict=True):
            axes.plot(frequency[order], value[order], color=look.color, ls=look.dashes, lw=0.7, alpha=0.6)
            axes.vlines(frequency, value - 2 * error, value + 2 * error, color=look.color, lw=0.9)
            axes.plot(frequency, value, look.marker, color=look.color, **POINT)
    names = f"{reduction.direction} stiffness |K| [{stiffness_unit}]", f"{reduction.direction} loss factor [-]"
    for axes, name in zip(pair, names, strict=True):
        dress(axes, "", name)
        axes.tick_params(labelbottom=False)
        readable(axes, np.array([step.frequency for step in steps]))
    handles = [look.handle(True) for look in looks.values()]
    legend(pair[-1], handles, [f"{length * level:.4g} {unit}" for level in looks], "amplitude")


def _draw_quality(pair: Sequence[Axes], reduction: Reduction, looks: dict[float, Style]) -> None:
    """Noise and distortion of the points over frequency."""
    for level, look in looks.items():
        mine = [step for step in reduction.steps if step.level == level]
        frequency = np.array([step.frequency for step in mine])
        noise = np.array([np.hypot(step.gain_error, step.phase_error) / 2**0.5 for step in mine])
        pair[0].plot(frequency, 100 * noise, look.marker, color=look.color, **POINT)
        pair[1].plot(frequency, [100 * step.force_distortion for step in mine], look.marker, color=look.color, **POINT)
        hollow = [100 * step.displacement_distortion for step in mine]
        pair[1].plot(frequency, hollow, look.marker, color=look.color, ms=3.4, mfc="none", mew=0.7)
    for axes, name in zip(pair, ("noise [%]", "distortion [%]"), strict=True):
        dress(axes, "frequency [Hz]", name)
        axes.set_ylim(bottom=0.0)
        readable(axes, np.array([step.frequency for step in reduction.steps]))
