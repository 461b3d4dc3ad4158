"""Test files as they are: loops, sweeps and histories; and what raw histories, or a resonance test, are reduced to."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec

from bushfit.geometry import TRANSLATION
from bushfit.inspection.record import Inspected
from bushfit.reading.measurement import Loop, Sweep, loss_factor
from bushfit.reduction.resonance import LARGEST_ERROR, Resonance
from bushfit.reduction.result import Reduction
from bushfit.report.plots import style
from bushfit.report.plots.points import BINS, Kind, Repeats, held_with, ranges
from bushfit.report.plots.prediction import axis_label, pair_labels
from bushfit.report.tables import words
from bushfit.units import for_people, told

#: Colour of a history.
_COLOR = "#3b528b"
#: Most rows of a loop that are drawn over the displacement: more are not told apart.
_MOST_ROWS = 6000
#: A common scale over the range of a panel at most; chosen: it fills a third, as is said below the picture.
_ALIKE = 3
#: Height of a history, and of the panels of noise and distortion [cm].
_STRIP, _NOISE_ROW = 2.7, 4.2
#: Most histories that are drawn: with more the figure leaves the page.
_MOST_HISTORIES = 4


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
    return style.explained(figure, sweeps, scales if len(files) > 1 else "")


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
    labels = f"{names[0]}\n[{length}]", f"{names[1]}\n[{force}]"
    for axes, values, label in zip(over_time, (motion, load), labels, strict=True):
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
        style.label_axes(axes, axis_label(sweep.direction, axis), label, x)
    labels = [told(unit, length * level) for level in levels]
    if sweep.stepped:
        style.name_levels(pair[-1], labels, held, [True] * levels.size)
    return pair[0]


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
        _draw_strip(strip, history, reduction, looks)
        if len(histories) > 1:  # the title names one
            name = style.file_name(history.name, letters=100)  # as many as fit on a line
            strip.set_title(name, fontsize=style.SMALL, loc="left", color=style.GREY, pad=2)
    points = [figure.add_subplot(grid[len(shown), column]) for column in range(2)]
    _draw_points(points, reduction, steps, looks)
    quality = [figure.add_subplot(grid[len(shown) + 1, column], sharex=points[0]) for column in range(2)]
    _draw_quality(quality, steps, looks)
    left_out = f" The first {len(shown)} of {len(histories)} histories." if len(histories) > len(shown) else ""
    return style.explained(
        figure,
        f"Top: displacement over time; coloured: the steady cycles used, grey: ramps, pauses, transients.{left_out}",
        "Bars: twice the standard error. Noise: standard error of a point, relative to |K|.",
        "Distortion: overtones over the fundamental (THD), filled of the force, hollow of the displacement.",
    )


def _draw_strip(axes: Axes, history: Loop, reduction: Reduction, looks: dict[float, style.Style]) -> None:
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
        style.label_axes(axes, "", name, steps["frequency"].to_numpy())
        axes.tick_params(labelbottom=False)
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
        for axes, share, look_of in drawn:
            axes.plot(mine["frequency"], 100 * share, look.marker, color=look.color, **look_of)
    for axes, name in zip(pair, ("noise [%]", "distortion [%]"), strict=True):
        style.label_axes(axes, "frequency [Hz]", name, steps["frequency"].to_numpy())
        axes.set_ylim(bottom=0.0)


def resonance_figure(found: Resonance, title: str) -> Figure:
    """Transmissibility and amplitude reached, stiffness and loss factor with errors, each over the frequency."""
    figure = style.new_figure(title, 2 * style.ROW)
    (ratio, amplitude), (stiffness, loss) = figure.subplots(2, 2, sharex=True)
    (unit, length), _, stiffness_units = TRANSLATION.display
    stiffness_unit, factor = for_people(*stiffness_units, float(np.abs(found.stiffness).max()))
    color = style.styles(1, "amplitude")[0].color
    upper = (
        (ratio, np.abs(found.transmissibility), "transmissibility |T| [-]"),
        (amplitude, length * found.amplitude, f"amplitude reached [{unit}]"),
    )
    for axes, values, label in upper:
        axes.plot(found.frequency, values, "o", color=color, **style.DOT)
        style.label_axes(axes, "", label)
        style.logarithmic(axes, values, "y")
    ratio.plot(found.test.frequency, np.abs(found.test.transmissibility), color=style.GREY, lw=0.7, zorder=1)
    frequency, largest = found.peak
    ratio.annotate(f"{frequency:.1f} Hz", (frequency, largest), (4, 0), textcoords="offset points", **style.WORDS)
    magnitude, factors = factor * np.abs(found.stiffness), loss_factor(found.stiffness)
    lower = (
        (stiffness, magnitude, magnitude, f"stiffness |K| [{stiffness_unit}]"),
        (loss, factors, 1.0 + factors**2, "loss factor [-]"),
    )
    for axes, values, scale, label in lower:
        error = 2.0 * found.relative_error * scale
        axes.plot(found.frequency, values, "o", color=color, **style.DOT)
        low, high = axes.get_ylim()
        axes.vlines(found.frequency, values - error, values + error, color=color, lw=0.7, alpha=0.6)
        axes.set_ylim(low, high)
        style.label_axes(axes, "frequency [Hz]", label, found.test.frequency)
    least = f"Where the error of K is beyond {100 * LARGEST_ERROR:g} % there is no point."
    return style.explained(
        figure,
        "Grey line: mass over base acceleration as measured. Points: means of neighbouring rows.",
        "Bars: twice the standard error, large where the mass moves almost as the base does; they may leave the panel.",
        least * bool(found.left_out.size),
    )
