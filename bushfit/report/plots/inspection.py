"""Test files as they are: loops over displacement and time, sweeps over frequency, histories over time."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec

from bushfit.inspection.record import Inspected
from bushfit.reading.measurement import Loop, Sweep
from bushfit.report.plots import style
from bushfit.report.plots.points import BINS, Kind, Repeats, held_with, ranges
from bushfit.report.plots.prediction import axis_label
from bushfit.report.tables import words
from bushfit.units import for_people, told

#: Colour of a history.
_COLOR = "#3b528b"
#: Most rows of a loop that are drawn over the displacement: more are not told apart.
_MOST_ROWS = 6000
#: A common scale over the range of a panel at most; chosen: it fills a third, as is said below the picture.
_ALIKE = 3


def inspection_figure(every: Sequence[Inspected], first: int = 0, count: int = 5) -> Figure:
    """A row a file: a loop over displacement and over time, a sweep over frequency, a history over time.

    Args:
        every: all files that were inspected; drawn are so many of them, from the `first` on.
    """
    files, known = every[first : first + count], Counter(seen.label for seen in every)
    page = f", {first // count + 1} of {-(-len(every) // count)}" if len(every) > count else ""
    figure = style.new_figure(f"Test files as they are{page}", (style.ROW + 0.7) * len(files))
    grid = figure.add_gridspec(len(files), 1)
    for row, seen in enumerate(files):
        place = grid[row, 0]
        called = f"{seen.file.parent.name}/{seen.label}" if known[seen.label] > 1 else seen.label
        name = style.file_name(called, letters=48)  # what is said of the file stands on the same line
        words = f"{seen.kind}, {seen.direction or 'direction unknown'}"
        words += ", force turned" * (seen.entry.get("force_sign") == -1)
        title = f"{name}: {words}" + (f", {len(seen.odd)} odd" if seen.odd else "")
        if isinstance(seen.measured, Sweep):
            panel = _draw_sweep(place, seen.measured)
        elif seen.measured is not None:
            panel = _draw_history(figure, place, seen.measured, loop=seen.kind == "loop")
        panel.set_title(title, fontsize=8.5, loc="left", color=style.GREY)
    _scale_alike(figure.axes[:])
    swept = any(isinstance(seen.measured, Sweep) for seen in files)
    sweeps = "Sweeps: every point as measured, lines through the means of the repeats." if swept else ""
    scales = "Panels of one direction have the same scales where each fills a third of them."
    style.explain(figure, sweeps, scales if len(files) > 1 else "")
    return figure


def _scale_alike(panels: Sequence[Axes]) -> None:
    """Give panels of one direction that show the same the same scales, where all stay readable in them."""
    alike: dict[tuple[object, ...], list[Axes]] = {}
    for axes in panels:
        alike.setdefault((axes.get_label(), axes.get_xlabel(), axes.get_ylabel()), []).append(axes)
    for group in alike.values():
        ends = np.array([(axes.get_xlim(), axes.get_ylim()) for axes in group])  # (panels, axes, ends)
        low, high = ends[..., 0].min(axis=0), ends[..., 1].max(axis=0)
        if np.all(high - low <= _ALIKE * np.ptp(ends, axis=-1)):
            for axes in group:
                axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))


def _draw_history(figure: Figure, place: SubplotSpec, history: Loop, *, loop: bool) -> Axes:
    """Both channels over time, long ones as the range in each bin, and force over displacement where it is a loop; the
    first panel is returned."""
    (length, to_length), unit_force, _ = history.direction.display
    force, to_force = for_people(*unit_force, float(np.abs(history.force).max()))
    names = history.direction.motion.words
    grid = place.subgridspec(2, 2 if loop else 1, width_ratios=[1.0, 1.2] if loop else None)
    over_time = [figure.add_subplot(grid[0, -1])]
    over_time.append(figure.add_subplot(grid[1, -1], sharex=over_time[0]))
    motion, load = to_length * history.displacement, to_force * history.force
    for axes, values, label in zip(
        over_time, (motion, load), (f"{names[0]}\n[{length}]", f"{names[1]}\n[{force}]"), strict=True
    ):
        if history.time.size <= 2 * BINS:
            axes.plot(history.time, values, lw=0.8, color=_COLOR)
        else:
            axes.fill_between(*ranges(history.time, values), step="post", color=_COLOR, lw=0.6)
        axes.set_label(str(history.direction))
        style.label_axes(axes, "time [s]" if history.timed else "time rebuilt [s]", label)
    figure.align_ylabels(over_time)
    over_time[0].tick_params(labelbottom=False)
    over_time[0].set_xlabel("")
    if not loop:
        return over_time[0]
    axes = figure.add_subplot(grid[:, 0], label=str(history.direction))
    step = max(1, -(-history.time.size // _MOST_ROWS))
    axes.plot(motion[::step], load[::step], ".", ms=1.2, mew=0, color=_COLOR, alpha=0.7)
    style.label_axes(axes, f"{names[0]} [{length}]", f"{names[1]} [{force}]")
    return axes


def _draw_sweep(place: SubplotSpec, sweep: Sweep) -> Axes:
    """Stiffness and loss factor over what the sweep steps through; the first panel is returned."""
    units = sweep.direction.display
    stiffness, factor = for_people(*units.stiffness, float(np.abs(sweep.stiffness).max()))
    pair = place.subgridspec(1, 2).subplots(squeeze=False)[0]
    axis = Kind(sweep.direction, sweep.stepped).axis
    held = held_with(axis)
    scales = {"frequency": ("Hz", 1.0), "amplitude": units.displacement}
    (_, x_factor), (unit, length) = scales[axis], scales[held]
    x, at_level = x_factor * getattr(sweep, axis), sweep.held
    levels = np.unique(at_level)
    drawn = style.styles(levels.size, held)
    kinds = (
        (factor * np.abs(sweep.stiffness), f"{words(sweep.direction)[2].replace('stiffness', '|K|')} [{stiffness}]"),
        (sweep.stiffness.imag / sweep.stiffness.real, "loss factor [-]"),
    )
    for axes, (values, label) in zip(pair, kinds, strict=True):
        for level, look in zip(levels, drawn, strict=True):
            at = at_level == level
            points = Repeats.at(x[at], at_level[at])
            axes.plot(points.along, points.mean(values[at]), color=look.color, ls=look.dashes, lw=0.8)
            axes.plot(x[at], values[at], look.marker, color=look.color, alpha=0.75, **style.POINT)
        axes.set_label(str(sweep.direction))
        style.label_axes(axes, axis_label(sweep.direction, axis), label)
        style.log_if_wide(axes, x)
    labels = [told(unit, length * level) for level in levels]
    if sweep.stepped:
        style.name_levels(pair[-1], labels, held, [True] * levels.size)
    return pair[0]
