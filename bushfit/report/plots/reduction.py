"""Raw stepped-sine histories and the sweep they were reduced to."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bushfit.reading.measurement import Loop, loss_factor
from bushfit.reduction.result import Reduction
from bushfit.report.plots import style
from bushfit.report.plots.points import ranges
from bushfit.report.plots.prediction import pair_labels
from bushfit.units import told

#: Height of a history, and of the panels of noise and distortion [cm].
_STRIP, _NOISE_ROW = 2.7, 4.2
#: Most histories that are drawn: with more the figure leaves the page.
_MOST_HISTORIES = 4


def reduction_figure(reduction: Reduction, histories: Sequence[Loop], title: str) -> Figure:
    """Each history with the cycles used; stiffness and loss factor over frequency; noise and harmonic distortion.

    Of more than four histories the first four are drawn.
    """
    shown = histories[:_MOST_HISTORIES]
    figure = style.new_figure(title, _STRIP * len(shown) + style.ROW + _NOISE_ROW)
    grid = figure.add_gridspec(len(shown) + 2, 2, height_ratios=[_STRIP] * len(shown) + [style.ROW, _NOISE_ROW])
    steps = pd.DataFrame([vars(step) for step in reduction.steps]).sort_values("frequency", kind="stable")
    levels = np.unique(steps["level"])
    looks = dict(zip(levels, style.styles(len(levels), "amplitude"), strict=True))
    for row, history in enumerate(shown):
        strip = figure.add_subplot(grid[row, :])
        _draw_history(strip, history, reduction, looks)
        if len(histories) > 1:  # the title names one
            name = style.file_name(history.name, letters=100)  # as many as fit on a line
            strip.set_title(name, fontsize=style.SMALL, loc="left", color=style.GREY, pad=2)
    points = [figure.add_subplot(grid[len(shown), column]) for column in range(2)]
    _draw_points(points, reduction, steps, looks)
    quality = [figure.add_subplot(grid[len(shown) + 1, column], sharex=points[0]) for column in range(2)]
    _draw_quality(quality, steps, looks)
    left_out = f" The first {len(shown)} of {len(histories)} histories." if len(histories) > len(shown) else ""
    style.explain(
        figure,
        f"Top: displacement over time; coloured: the steady cycles used, grey: ramps, pauses, transients.{left_out}",
        "Bars: twice the standard error. Noise: standard error of a point, relative to |K|.",
        "Distortion: overtones over the fundamental (THD), filled of the force, hollow of the displacement.",
    )
    return figure


def _draw_history(axes: Axes, history: Loop, reduction: Reduction, looks: dict[float, style.Style]) -> None:
    """Displacement over time; what was used has the colour of its level."""
    unit, factor = reduction.direction.display.displacement
    time, low, high = ranges(history.time, factor * history.displacement)
    axes.fill_between(time, low, high, color="#c8c8c8", lw=0.4, step="post")
    for level, look in looks.items():
        mine = [step for step in reduction.steps if step.name == history.name and step.level == level]
        inside = [(time >= step.start) & (time <= step.end) for step in mine]
        used = np.any([np.zeros(time.shape, dtype=bool), *inside], axis=0)
        axes.fill_between(time, low, high, where=used, color=look.color, lw=0.4, step="post")
    style.label_axes(axes, "time [s]", f"{reduction.direction.motion.words[0]}\n[{unit}]")
    axes.margins(x=0.01)


def _draw_points(
    pair: Sequence[Axes], reduction: Reduction, steps: pd.DataFrame, looks: dict[float, style.Style]
) -> None:
    """Stiffness and loss factor over frequency, with bars of twice the standard error."""
    unit, length = reduction.direction.display.displacement
    factor, names = pair_labels(reduction.direction, steps["stiffness"].abs().max())
    for level, look in looks.items():
        mine = steps[steps["level"] == level]
        frequency, magnitude = mine["frequency"], (factor * mine["stiffness"].abs()).to_numpy()
        factors = loss_factor(mine["stiffness"].to_numpy())
        errors = magnitude * mine["gain_error"], (1.0 + factors**2) * mine["phase_error"]
        for axes, value, error in zip(pair, (magnitude, factors), errors, strict=True):
            axes.plot(frequency, value, color=look.color, ls=look.dashes, lw=0.7, alpha=0.6)
            axes.vlines(frequency, value - 2 * error, value + 2 * error, color=look.color, lw=0.9)
            axes.plot(frequency, value, look.marker, color=look.color, **style.POINT)
    for axes, name in zip(pair, names, strict=True):
        style.label_axes(axes, "", name)
        axes.tick_params(labelbottom=False)
        style.log_if_wide(axes, steps["frequency"].to_numpy())
    handles = [look.handle(True) for look in looks.values()]
    style.legend(pair[-1], handles, [told(unit, length * level) for level in looks], "amplitude")


def _draw_quality(pair: Sequence[Axes], steps: pd.DataFrame, looks: dict[float, style.Style]) -> None:
    for level, look in looks.items():
        mine = steps[steps["level"] == level]
        noise = np.hypot(mine["gain_error"], mine["phase_error"]) / 2**0.5
        hollow = {"ms": 3.4, "mfc": "none", "mew": 0.7}
        drawn = (
            (pair[0], noise, style.POINT),
            (pair[1], mine["force_distortion"], style.POINT),
            (pair[1], mine["displacement_distortion"], hollow),
        )
        for axes, share, words in drawn:
            axes.plot(mine["frequency"], 100 * share, look.marker, color=look.color, **words)
    for axes, name in zip(pair, ("noise [%]", "distortion [%]"), strict=True):
        style.label_axes(axes, "frequency [Hz]", name)
        axes.set_ylim(bottom=0.0)
        style.log_if_wide(axes, steps["frequency"].to_numpy())
