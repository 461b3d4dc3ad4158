"""Predictions over frequency and amplitude as in the paper's Figs. 7 to 9, with measured points laid over."""

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bushfit.effects.contract import Array
from bushfit.fitting.data_sets import SweepData
from bushfit.geometry import Place
from bushfit.model.model import Model
from bushfit.prediction.stiffness import Band, Prediction
from bushfit.reading.measurement import loss_factor
from bushfit.reading.runs import nominal
from bushfit.report.plots import style
from bushfit.report.plots.points import Axis, Kind, Points, curves_of, held_with, means
from bushfit.report.tables import IF_RIGS, spread, words
from bushfit.units import for_people, told

#: Points of a model's line: chosen, no corner is seen at the size of a panel.
FINE = 60
#: Most amplitudes over the frequency, and frequencies over the amplitude, as lines: more bands cover each other.
_MOST_AMPLITUDES, _MOST_FREQUENCIES = 6, 4
#: Width of a model's line [point].
_LINE = 1.3
#: Width of a line with the rig's effects [point].
_THIN = 0.6
#: Width of a double line, which shows the other reading, and of its white core [point].
_DOUBLE, _CORE = 2.4, 0.7
#: A measured point belongs to a predicted level if it, or the level it shares with other tests, is as near as this,
#: relative: a rig that misses its set point.
_SAME = 0.01
#: Relative error that a file states of a point, from which it is not drawn; chosen: such points hide the others.
_WORST_DRAWN = 0.05


def fine_grid(prediction: Prediction) -> tuple[Array, Array]:
    """Frequencies [Hz] and amplitudes [m or rad] of a prediction, and enough between them for smooth lines.

    A prediction there is what `prediction_figure` takes as `curves`.
    """
    frequencies, amplitudes = (
        own if own.size < 2 else np.union1d(own, np.geomspace(own[0], own[-1], FINE))
        for own in map(np.unique, (prediction.frequency, prediction.amplitude))
    )
    return frequencies, amplitudes


def prediction_figure(
    prediction: Prediction,
    measured: Sequence[SweepData],
    title: str,
    *,
    curves: Prediction | None = None,
    rig: Prediction | None = None,
    model: Model | None = None,
    note: str = "",
) -> Figure:
    """Magnitude and loss factor over frequency per amplitude, and over amplitude per frequency (Figs. 7 to 9).

    Up to six amplitudes and four frequencies become lines. Sweeps that held nothing have a row of their own.

    Args:
        measured: sweeps to lay over; other directions and levels are left out.
        curves: the prediction on `fine_grid`, for smooth lines; without it they run straight from point to point.
        rig: the same as these lines, with the rig's effects: drawn thin where points are laid over, which it meets.
        model: of the prediction, to meet sweeps that held nothing.
    """
    lines = prediction if curves is None else curves
    every = [data_set for data_set in measured if data_set.direction == prediction.direction]
    mine = [data_set for data_set in every if data_set.sweep.stepped]
    free = [data_set for data_set in every if model and not data_set.sweep.stepped]
    points = means(mine)

    def held_by(axis: Axis) -> Array:
        return np.concatenate([np.empty(0), *(each.sweep.held for each in mine if each.sweep.stepped == axis)])

    frequencies, amplitudes = np.unique(prediction.frequency), np.unique(prediction.amplitude)
    rows: list[tuple[Axis, Array]] = []
    if frequencies.size > 1 or amplitudes.size == 1:
        rows.append(("frequency", _lines(amplitudes, held_by("frequency"), _MOST_AMPLITUDES)))
    if amplitudes.size > 1:
        known = frequencies[[np.isclose(points.frequency, f, _SAME, 0.0).any() for f in frequencies]]
        levels = known if known.size > 1 else frequencies
        rows.append(("amplitude", _lines(levels, held_by("amplitude"), _MOST_FREQUENCIES)))
    height = len(rows) + bool(free)
    figure = style.new_figure(title, height * style.ROW)
    grid = figure.subplots(height, 2, squeeze=False)
    pairs = zip(grid[bool(free) :], rows, strict=True)
    drawn = [draw(pair, prediction.direction, lines, points, *row, rig, lines.if_rigs) for pair, row in pairs]
    laid = any(drawn)
    if free and model:
        draw_curves(grid[0], Kind(prediction.direction, None), model, free)
    banded = np.any(lines.stiffness.high > lines.stiffness.low)
    shade = "; shaded: its 95 % band, where that is wider than the line" if banded else ""
    through = " Thin lines: the same with what belongs to the rig, as the points were measured." if laid and rig else ""
    if lines.if_rigs:
        through += f" Double lines: the same {IF_RIGS}, and not the bushing's; the band spans both."
    if amplitudes.size > _MOST_AMPLITUDES:
        through += f" Over frequency some of the {amplitudes.size} amplitudes are drawn."
    return style.explained(figure, f"Lines: model{shade}.{through}", points_note(every) if laid or free else "", note)


def _lines(levels: Array, held: Array, most: int) -> Array:
    """The levels that are drawn as lines: those that some test held, or else all; of more than fit some, evenly."""
    met = levels[[np.isclose(held, level, _SAME, 0.0).any() for level in levels]]
    chosen = met if met.size else levels
    return chosen[spread(chosen.size, most)]


def draw(
    pair: Sequence[Axes],
    direction: Place,
    lines: Prediction | Points,
    points: Points,
    axis: Axis,
    levels: Array,
    rig: Prediction | None = None,
    if_rigs: Prediction | None = None,
) -> bool:
    """Draw stiffness left and loss factor right, a line and its points per level, and say whether there were points.

    `levels` are what is held, (k,): amplitudes [m or rad] or frequencies [Hz]; `rig` is the model with what belongs to
    the rig, as thin lines where there are points; `if_rigs` the other reading of what is unresolved, as double lines.
    """
    held, units = held_with(axis), direction.display
    scales = {"frequency": ("Hz", 1.0), "amplitude": units.displacement}
    _, scale = scales[axis]
    x, where = scale * getattr(lines, axis), scale * getattr(points, axis)
    ends = x.min() * (1 - _SAME), x.max() * (1 + _SAME)
    inside = [(ends[0] <= own) & (own <= ends[1]) for own in (where, nominal(where))]
    marked = _spots(getattr(points, held), levels, np.any(inside, axis=0))
    laid = any(spots.any() for spots in marked)
    looks = style.styles(levels.size, held)
    stiffness_factor, names = pair_labels(direction, float(lines.stiffness.value.max()))
    kinds = (("stiffness", stiffness_factor), ("loss_factor", 1.0))
    for axes, name, (kind, factor) in zip(pair, names, kinds, strict=True):
        bands = (getattr(one, kind) for one in (lines, points))
        line, point = (Band(factor * band.value, factor * band.low, factor * band.high) for band in bands)
        for look, level, spots in zip(looks, levels, marked, strict=True):
            at = getattr(lines, held) == level
            stroke = "_" if at.sum() == 1 else ""  # a band of one point has no width
            axes.plot(x[at], line.value[at], color=look.color, ls=look.dashes, lw=_LINE, marker=stroke, ms=14.0)
            axes.fill_between(x[at], line.low[at], line.high[at], color=look.color, alpha=0.22, lw=0)
            if if_rigs is not None:
                other = factor * getattr(if_rigs, kind).value[at]
                axes.plot(x[at], other, color=look.color, lw=_DOUBLE)
                axes.plot(x[at], other, color="white", lw=_CORE)
            if spots.any():
                if rig is not None:
                    axes.plot(x[at], factor * getattr(rig, kind).value[at], color=look.color, lw=_THIN)
                axes.vlines(where[spots], point.low[spots], point.high[spots], color=look.color, lw=0.7, alpha=0.7)
                axes.plot(where[spots], point.value[spots], look.marker, color=look.color, **style.POINT)
        style.label_axes(axes, axis_label(direction, axis), name, x)
        style.least_span(axes, 0.04 * line.high.max() if kind == "stiffness" else 0.01)  # flat curves shall look flat
    unit, scale = for_people(*scales[held], float(levels.min()))  # one unit for all
    names_of_levels = [told(unit, scale * level) for level in levels]
    others = _other_lines(with_rig=laid and rig is not None, if_rigs=if_rigs is not None)
    style.name_levels(pair[-1], names_of_levels, held, [bool(spots.any()) for spots in marked], others)
    return laid


def _other_lines(*, with_rig: bool, if_rigs: bool) -> dict[str, Line2D | tuple[Line2D, ...]]:
    """What a legend names beside the levels, where other lines than the bushing's are drawn."""
    lines: dict[str, Line2D | tuple[Line2D, ...]] = {}
    if with_rig or if_rigs:
        lines["bushing"] = Line2D([], [], color=style.INK, lw=_LINE)
    if with_rig:
        lines["with the rig"] = Line2D([], [], color=style.INK, lw=_THIN, marker="o", **style.POINT)
    if if_rigs:
        double = ((style.INK, _DOUBLE), ("white", _CORE))
        lines[IF_RIGS] = tuple(Line2D([], [], color=color, lw=width) for color, width in double)
    return lines


def _spots(held: Array, levels: Array, inside: Array) -> list[Array]:
    """Whether each point is near a level and nearest to it, an (n,) per level; only those that are inside count.

    A point that is near none goes by what it shares with other points.
    """
    alone = np.abs(held[:, None] / levels - 1.0).min(axis=1) > _SAME
    off = np.abs(np.where(alone, nominal(held), held)[:, None] / levels - 1.0)
    nearest = off == np.min(off, axis=1, keepdims=True)
    return list((inside[:, None] & nearest & (off <= _SAME)).T)


def pair_labels(place: Place, largest: float) -> tuple[float, tuple[str, str]]:
    """The factor from SI in which stiffness (or modulus) up to `largest` is drawn, and the labels of the panels of
    stiffness and loss factor of a place."""
    unit, factor = for_people(*place.display.stiffness, largest)
    resisted = words(place)[2]
    magnitude = " |K|" if resisted == "stiffness" else ""
    return factor, (f"{place} {resisted}{magnitude} [{unit}]", f"{place} loss factor [-]")


def axis_label(place: Place, axis: Axis) -> str:
    """The label of an axis with what sweeps step through at a place."""
    return "frequency [Hz]" if axis == "frequency" else f"{words(place)[0]} [{place.display.displacement.name}]"


def draw_curves(pair: Sequence[Axes], kind: Kind, model: Model, data_sets: Sequence[SweepData]) -> None:
    """Draw the curves of sweeps whose levels tests do not share: points as measured, the model at the same points."""
    factor, names = pair_labels(kind.place, max(float(np.abs(data_set.measured).max()) for data_set in data_sets))
    scale = kind.place.display.displacement.factor if kind.axis == "amplitude" else 1.0
    curves = curves_of(data_sets, kind)
    looks = [look._replace(marker="o") for look in style.styles(len(curves), kind.palette)]
    modelled = [data_set.stiffness(model) for data_set in data_sets]
    quantities: tuple[tuple[Callable[[Array], Array], float], ...] = ((np.abs, factor), (loss_factor, 1.0))
    for axes, name, (quantity, size) in zip(pair, names, quantities, strict=True):
        for curve, look in zip(curves, looks, strict=True):
            data_set, along = data_sets[curve.test], scale * getattr(data_sets[curve.test], kind.axis)
            rising = np.argsort(along, kind="stable")
            rising = rising[curve.points[rising]]
            known = rising[_known(data_set)[rising]]
            points = style.POINT if known.size <= FINE else style.DOT | {"alpha": 0.5}
            axes.plot(along[known], size * quantity(data_set.measured)[known], "o", color=look.color, **points)
            line = size * quantity(modelled[curve.test])[rising]
            axes.plot(along[rising], line, color=look.color, ls=look.dashes, lw=_LINE)
        style.label_axes(axes, axis_label(kind.place, kind.axis), name)
    labels = [style.file_name(curve.name, 26) for curve in curves]
    style.legend(pair[-1], [look.handle(True) for look in looks], labels, "test")


def _known(data_set: SweepData) -> Array:
    """Whether each point of a sweep carries weight, and is known well enough to be drawn, (n,) bool."""
    stated = data_set.sweep.relative_error
    return (data_set.weights > 0.0) & (True if stated is None else stated[data_set.order] < _WORST_DRAWN)


def points_note(data_sets: Sequence[SweepData]) -> str:
    """A sentence on what the points of sweeps are."""
    repeated = any(np.unique(data_set.repeat).size > 1 for data_set in data_sets)
    hidden = sum(int(np.count_nonzero(~_known(data_set))) for data_set in data_sets if not data_set.sweep.stepped)
    unsure = f"; {hidden} with a stated error above {100 * _WORST_DRAWN:g} % are not drawn" if hidden else ""
    bars = ", mean of the repeats, with bars from the lowest to the highest" if repeated else ""
    return f"Points: measured{bars}{unsure}."
