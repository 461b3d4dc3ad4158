"""Several results over one grid: stiffness and loss factor with bands, and below how far each is off the first."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bushfit.comparison import Comparison, Contrast
from bushfit.effects.contract import Array
from bushfit.geometry import Place
from bushfit.prediction import Band
from bushfit.report.plots import style
from bushfit.report.plots.points import Axis, held_beside
from bushfit.report.plots.prediction import axis_label, pair_labels
from bushfit.units import number

#: Width of a line [point].
_LINE = 1.3
#: Dashes of the smallest and of the largest value that is held.
_DASHES = ("-", (0, (4, 1.5)))
#: Strength of a band: those of several results lie on each other.
_BAND = 0.18
#: Markers on a line, or fewer: they tell lines apart in grey print.
_MARKS = 5
#: Least span of the axis of relative differences [%], and of the differences of loss factor [-].
_LEAST_SPANS = (1.0, 0.005)


def comparison_figure(labels: Sequence[str], names: Sequence[str], comparisons: Sequence[Comparison]) -> Figure:
    """All results at every place they are compared at: two rows of panels a place, the differences below the values.

    Drawn over frequency at the smallest and the largest amplitude, or over amplitude where there is one frequency.
    """
    places = len(comparisons[0].contrasts)
    title = f"{', '.join(labels[1:])} against {labels[0]}"
    figure = style.new_figure(title, 2 * places * style.ROW)
    grid = figure.subplots(2 * places, 2, squeeze=False)
    looks = style.styles(len(labels), "loop")
    for i in range(places):
        contrasts = [found.contrasts[i] for found in comparisons]
        held = _draw_place(grid[2 * i : 2 * i + 2], contrasts, looks, labels[0])
        lines = [Line2D([], [], color=look.color, lw=_LINE, marker=look.marker, **style.POINT) for look in looks]
        dashes = [Line2D([], [], color=style.INK, lw=_LINE, ls=dash) for dash, _ in zip(_DASHES, held, strict=False)]
        besides = dict(zip(held, dashes, strict=True))
        called = [f"{label}: {style.file_name(name)}" for label, name in zip(labels, names, strict=True)]
        style.legend(grid[2 * i, 1], lines, called, "", besides=besides)
    style.explain(
        figure,
        "Shaded: 95 % bands. Lower panels: the band of each point by itself; "
        "compare.json and the terminal say what holds at all points at once.",
    )
    return figure


def _draw_place(
    panels: Iterable[Sequence[Axes]], contrasts: Sequence[Contrast], looks: list[style.Style], first: str
) -> list[str]:
    """Draw one place into its four panels; gives what its lines are held at, in words."""
    (top, bottom), place, shown = panels, contrasts[0].place, contrasts[0].reference
    axis: Axis = "frequency" if np.unique(shown.frequency).size > 1 else "amplitude"
    held, (length, length_factor) = held_beside(axis), place.display.displacement
    scales = {"frequency": ("Hz", 1.0), "amplitude": (length, length_factor)}
    along, values = scales[axis][1] * getattr(shown, axis), np.unique(getattr(shown, held))
    levels = [values[0], values[-1]][: values.size]
    spots = [getattr(shown, held) == level for level in levels]
    sides = [shown, *(each.other for each in contrasts)]
    factor, titles = pair_labels(place, max(float(side.stiffness.value.max()) for side in sides))
    for look, side in zip(looks, sides, strict=True):
        _draw(top[0], look, along, side.stiffness, spots, lambda of: factor * of)
        _draw(top[1], look, along, side.loss_factor, spots, np.asarray)
    for look, each in zip(looks[1:], contrasts, strict=True):
        _draw(bottom[0], look, along, each.stiffness, spots, lambda of: 100.0 * np.expm1(of))
        _draw(bottom[1], look, along, each.loss_factor, spots, np.asarray)
    _dress(top, place, axis, along, titles)
    resisted = place.motion.words[2]
    _dress(bottom, place, axis, along, (f"{resisted} less {first}'s [%]", f"loss factor less {first}'s [-]"))
    for axes, least in zip(bottom, _LEAST_SPANS, strict=True):
        axes.axhline(0.0, color=looks[0].color, lw=_LINE)
        style.least_span(axes, least)
    unit, scale = scales[held]
    return [f"{number(scale * level, 3)} {unit}" for level in levels]


def _draw(
    axes: Axes, look: style.Style, along: Array, band: Band, spots: Sequence[Array], shown: Callable[[Array], Array]
) -> None:
    """The lines of one result, one a value that is held, each with its band."""
    for at, dashes in zip(spots, _DASHES, strict=False):
        low, value, high = (shown(of[at]) for of in (band.low, band.value, band.high))
        each = max(int(at.sum()) // _MARKS, 1)
        drawn = {"color": look.color, "ls": dashes, "lw": _LINE, "marker": look.marker, "markevery": each}
        axes.plot(along[at], value, **drawn, **style.POINT)
        axes.fill_between(along[at], low, high, color=look.color, alpha=_BAND, lw=0)


def _dress(pair: Sequence[Axes], place: Place, axis: Axis, along: Array, titles: tuple[str, str]) -> None:
    """Give two panels their axes."""
    for axes, title in zip(pair, titles, strict=True):
        style.dress(axes, axis_label(place, axis), title)
        style.readable(axes, along)
