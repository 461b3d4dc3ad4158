"""Test files as they are: loops over displacement and time, sweeps over frequency, histories over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec

from bushfit.effects.contract import Array
from bushfit.inspection.record import Inspected
from bushfit.reading.measurement import Floats, Loop, Sweep
from bushfit.report.plots.style import GREY, POINT, ROW, dress, explain, legend, new_figure, readable, styles
from bushfit.units import for_people

_COLOR = "#3b528b"
#: Rows of a loop drawn as they are; of more, the least and largest of so many bins of time.
_MOST_ROWS, _BINS = 6000, 1500
_TITLE = 0.7 / 2.54
_MOST_LEVELS = 8


def inspection_figure(files: Sequence[Inspected]) -> Figure:
    """A row a file: a loop over displacement and over time, a sweep over frequency, a history over time."""
    figure = new_figure("Test files as they are", (ROW + _TITLE) * len(files))
    grid = figure.add_gridspec(len(files), 1)
    for row, seen in enumerate(files):
        place = grid[row, 0]
        name = seen.file.name.replace("$", r"\$")
        words = f"{seen.kind}, {seen.direction or 'direction unknown'}"
        words += ", force turned" * (seen.entry.get("force_sign") == -1)
        title = f"{name}: {words}" + (f", {len(seen.looked.odd)} odd" if seen.looked.odd else "")
        if isinstance(seen.measured, Sweep):
            first = _draw_sweep(figure, place, seen.measured)
        elif seen.measured is not None:
            first = _draw_history(figure, place, seen.measured, loop=seen.kind == "loop")
        first.set_title(title, fontsize=8.5, loc="left", color=GREY)
    if any(isinstance(seen.measured, Sweep) for seen in files):
        explain(figure, "Sweeps: every point as measured, lines through the means of the repeats.")
    return figure


def _draw_history(figure: Figure, place: SubplotSpec, history: Loop, *, loop: bool) -> Axes:
    units = history.direction.display
    (length, to_length), unit_force = units.displacement, units.force
    force, to_force = for_people(*unit_force, float(np.abs(history.force).max()))
    names = history.direction.motion.words
    grid = place.subgridspec(2, 2 if loop else 1, width_ratios=[1.0, 1.2] if loop else None)
    over_time = [figure.add_subplot(grid[0, -1])]
    over_time.append(figure.add_subplot(grid[1, -1], sharex=over_time[0]))
    motion, load = to_length * history.displacement, to_force * history.force
    for axes, values, label in zip(
        over_time, (motion, load), (f"{names[0]}\n[{length}]", f"{names[1]}\n[{force}]"), strict=True
    ):
        _draw_over_time(axes, history.time, values)
        dress(axes, "time [s]" if history.timed else "time rebuilt [s]", label)
    figure.align_ylabels(over_time)
    over_time[0].tick_params(labelbottom=False)
    over_time[0].set_xlabel("")
    if not loop:
        return over_time[0]
    axes = figure.add_subplot(grid[:, 0])
    step = max(1, -(-history.time.size // _MOST_ROWS))
    axes.plot(motion[::step], load[::step], ".", ms=1.2, mew=0, color=_COLOR, alpha=0.7)
    dress(axes, f"{names[0]} [{length}]", f"{names[1]} [{force}]")
    return axes


def _draw_over_time(axes: Axes, time: Floats, values: Floats) -> None:
    if time.size <= 2 * _BINS:
        axes.plot(time, values, lw=0.8, color=_COLOR)
        return
    first = np.unique(np.searchsorted(time, np.linspace(time[0], time[-1], _BINS + 1)[:-1]))
    low, high = np.minimum.reduceat(values, first), np.maximum.reduceat(values, first)
    axes.fill_between(time[first], low, high, step="post", color=_COLOR, lw=0.6)


def _draw_sweep(figure: Figure, place: SubplotSpec, sweep: Sweep) -> Axes:
    units = sweep.direction.display
    unit, length = units.displacement
    stiffness, factor = for_people(*units.stiffness, float(np.abs(sweep.stiffness).max()))
    grid = place.subgridspec(1, 2)
    pair = [figure.add_subplot(grid[0, column]) for column in range(2)]
    levels = np.unique(sweep.amplitude)
    levels = levels[np.unique(np.linspace(0, levels.size - 1, min(levels.size, _MOST_LEVELS)).round().astype(int))]
    drawn = styles(levels.size, "amplitude")
    kinds = (
        (factor * np.abs(sweep.stiffness), f"|K| [{stiffness}]"),
        (sweep.stiffness.imag / sweep.stiffness.real, "loss factor [-]"),
    )
    for axes, (values, label) in zip(pair, kinds, strict=True):
        for level, style in zip(levels, drawn, strict=True):
            at = sweep.amplitude == level
            frequency, mean = _means(sweep.frequency[at], values[at])
            axes.plot(frequency, mean, color=style.color, ls=style.dashes, lw=0.8)
            axes.plot(sweep.frequency[at], values[at], style.marker, color=style.color, alpha=0.75, **POINT)
        dress(axes, "frequency [Hz]", label)
        readable(axes, sweep.frequency)
    handles = [style.handle(True) for style in drawn]
    legend(pair[-1], handles, [f"{length * level:.3g} {unit}" for level in levels], "amplitude")
    return pair[0]


def _means(frequency: Array, values: Array) -> tuple[Array, Array]:
    distinct, place = np.unique(frequency, return_inverse=True)
    return distinct, np.bincount(place, weights=values) / np.bincount(place)
