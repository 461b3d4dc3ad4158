"""Figures for reports: predictions as in the paper's Figs. 7 to 9, loops and sweeps with the model over them.

The one importer of matplotlib. Nothing here touches its global state, so figures may be made in any process or
thread. Levels differ in colour (of scales that survive colour blindness and grey print), line style and marker.
"""

from __future__ import annotations

import io
import textwrap
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import fontManager
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, ScalarFormatter

from bushfit.effects.contract import Array
from bushfit.fitting.terms import LoopTerm, SweepTerm
from bushfit.geometry import Direction
from bushfit.model import Model
from bushfit.prediction import Band, Prediction
from bushfit.results import Z95
from bushfit.sheets import display_units

_DPI = 150
_WIDTH, _ROW, _STRIP, _FRAME = (cm / 2.54 for cm in (16.0, 5.4, 2.6, 2.0))
_TEXT, _SMALL = 8.5, 7.5
_POINT: dict[str, Any] = {"ms": 4.2, "mec": "white", "mew": 0.4}
_LEGEND: dict[str, Any] = {"loc": "center left", "bbox_to_anchor": (1.01, 0.5), "frameon": False, "handlelength": 3.2}
_DOT: dict[str, Any] = {"ms": 2.4, "mew": 0}
_INK, _GREY = "#1a1a1a", "#595959"
#: Colours of what a figure tells apart: a scale each, so that no colour means two things. Loops stay off black.
_SCALES = {"amplitude": ("viridis", 0.0, 0.8), "frequency": ("inferno", 0.1, 0.76), "loop": ("plasma", 0.4, 0.85)}
_MARKERS = "os^Dv<p>"
_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (5, 1.5, 1, 1.5)), (0, (1.2, 1.2)), (0, (9, 2)))
#: A measured point belongs to a predicted level that is as near as this, relative and absolute.
_SAME = (0.01, 0.0)
#: An axis that spans more than this ratio is logarithmic.
_LOG_RATIO = 40.0
_FINE, _SECTORS, _MOST_ROWS = 60, 36, 1600
#: Fonts that help out for names beyond Latin, Greek and Cyrillic, where they are installed.
_WIDER_FONTS = {"Noto Sans CJK SC", "Noto Sans CJK JP", "WenQuanYi Zen Hei", "Microsoft YaHei", "SimHei", "PingFang SC"}
_RESIDUALS = "Residuals: model less measured in units of noise; 95 % of them should lie in the grey."
_MEANS = f"Lines there: means over {360 // _SECTORS} deg."


@dataclass(frozen=True, eq=False)
class _Points:
    """Stiffness over operating points: means of repeats, or a model's lines."""

    frequency: Array
    amplitude: Array
    stiffness: Band
    loss_factor: Band


class _Style(NamedTuple):
    color: Any
    dashes: Any
    marker: str

    def handle(self, marked: bool) -> Line2D:
        return Line2D([], [], color=self.color, ls=self.dashes, lw=1.3, marker=self.marker * marked, **_POINT)


def fine_grid(prediction: Prediction) -> tuple[Array, Array]:
    """Frequencies [Hz] and amplitudes [m or rad] that hold a prediction's own and enough between them for smooth
    lines: what `prediction_figure` takes as `curves`."""
    frequencies, amplitudes = (
        own if own.size < 2 else np.union1d(own, np.geomspace(own[0], own[-1], _FINE))
        for own in map(np.unique, (prediction.frequency, prediction.amplitude))
    )
    return frequencies, amplitudes


def prediction_figure(
    prediction: Prediction,
    measured: Sequence[SweepTerm],
    title: str,
    *,
    curves: Prediction | None = None,
    note: str = "",
) -> Figure:
    """Magnitude and loss factor over frequency per amplitude, and over amplitude per frequency (Figs. 7 to 9).

    Args:
        prediction: its amplitudes (up to six) and frequencies (up to four) become the lines.
        measured: sweeps to lay over; other directions and levels are left out.
        title: names the bushing.
        curves: the prediction on `fine_grid`, for smooth lines; without it they run straight from point to point.
        note: what else a reader must know, such as what the prediction leaves out.
    """
    lines = prediction if curves is None else curves
    mine = [term for term in measured if term.direction is prediction.direction]
    points = _means(mine)
    frequencies, amplitudes = np.unique(prediction.frequency), np.unique(prediction.amplitude)
    rows: list[tuple[str, Array]] = []
    if frequencies.size > 1 or amplitudes.size == 1:
        rows.append(("frequency", _spread(amplitudes, 6)))
    if amplitudes.size > 1:
        known = frequencies[[np.isclose(points.frequency, f, *_SAME).any() for f in frequencies]]
        rows.append(("amplitude", _spread(known if known.size > 1 else frequencies, 4)))
    figure = _figure(title, len(rows) * _ROW)
    pairs = zip(figure.subplots(len(rows), 2, squeeze=False), rows, strict=True)
    laid = [_draw(pair, prediction.direction, lines, points, *row) for pair, row in pairs]
    banded = np.any(lines.stiffness.high > lines.stiffness.low)
    shade = "; shaded: its 95 % band, where that is wider than the line" if banded else ""
    _explain(figure, f"Lines: model{shade}.", _points_note(mine) if any(laid) else "", note)
    return figure


def sweeps_figure(model: Model, terms: Sequence[SweepTerm], title: str) -> Figure:
    """Magnitude and loss factor over frequency, measured and modelled, a row per direction; their residuals below.

    The model keeps the effects of the rig, since sweeps hold them. At least one term; the title names the bushing.
    """
    directions = list(dict.fromkeys(term.direction for term in terms))
    figure = _figure(title, (_ROW + _STRIP) * len(directions))
    grid = figure.subplots(2 * len(directions), 2, squeeze=False, height_ratios=[_ROW, _STRIP] * len(directions))
    for direction, pair, strips in zip(directions, grid[::2], grid[1::2], strict=True):
        mine = [term for term in terms if term.direction is direction]
        points = _means(mine)
        levels = np.unique(points.amplitude)
        _draw(pair, direction, _model_lines(model, direction, points), points, "frequency", levels)
        for term in mine:
            for strip, residual in zip(strips, term.residual(model).reshape(2, -1), strict=True):
                for style, level in zip(_styles(levels.size, "amplitude"), levels, strict=True):
                    at = term.amplitude == level
                    strip.plot(term.frequency[at], residual[at], style.marker, color=style.color, alpha=0.8, **_DOT)
        for panel, strip, name in zip(pair, strips, ("gain", "phase"), strict=True):
            strip.sharex(panel)
            _style(strip, panel.get_xlabel(), f"{name} residual\n/ noise")
            _readable(strip, points.frequency)
            panel.tick_params(labelbottom=False)
            panel.set_xlabel("")
            _noise_band(strip)
    _explain(figure, "Lines: model.", _points_note(terms), _RESIDUALS)
    return figure


def loops_figure(model: Model, terms: Sequence[LoopTerm], title: str) -> Figure:
    """Force over displacement, measured and modelled, and residuals over the phase of the cycle; a row per direction.

    The model keeps the effects of the rig, since loops hold them. At least one term; of each at most 1600 rows, from
    the first and last two cycles, are drawn. The title names the bushing.
    """
    directions = list(dict.fromkeys(term.direction for term in terms))
    figure = _figure(title, 1.25 * _ROW * len(directions))
    grid = figure.subplots(len(directions), 2, squeeze=False, width_ratios=[1.15, 1.0])
    for direction, (loop_panel, phase_panel) in zip(directions, grid, strict=True):
        mine = [term for term in terms if term.direction is direction]
        units, turns = display_units(direction), direction is Direction.TORSION
        unit, length = units["length"]
        force_unit, force = _prefixed(units["force"], max(float(np.abs(term.drive.force).max()) for term in mine))
        motion_name, force_name = ("rotation", "moment") if turns else ("displacement", "force")
        _style(loop_panel, f"{motion_name} [{unit}]", f"{direction} {force_name} [{force_unit}]")
        _style(phase_panel, "phase after the upper turn [deg]", "residual / noise")
        styles = _styles(len(mine), "loop")
        for term, style in zip(mine, styles, strict=True):
            drive, rows = term.drive, _drawn_rows(term)
            phase, residual = drive.phase[rows], term.residual(model)
            motion, modelled = length * drive.displacement(phase), force * term.force(model)[rows]
            modelled[1:][np.diff(phase) > 0.5] = np.nan  # the cycles between, which are not drawn
            loop_panel.plot(motion, force * drive.force[rows], "o", color=style.color, alpha=0.5, **_DOT)
            loop_panel.plot(motion, modelled, color=_INK, lw=0.8)
            turn = 360.0 * ((drive.phase + np.angle(drive.coefficients[1]) / (2.0 * np.pi)) % 1.0)
            phase_panel.plot(turn[rows], residual[rows], ".", color=style.color, alpha=0.4, **_DOT)
            sector = (turn * (_SECTORS / 360.0)).astype(int) % _SECTORS
            filled, count = np.unique(sector, return_counts=True)
            mean = np.bincount(sector, residual)[filled] / count
            phase_panel.plot((filled + 0.5) * (360.0 / _SECTORS), mean, color=style.color, ls=style.dashes, lw=1.4)
        _noise_band(phase_panel)
        phase_panel.set(xlim=(0.0, 360.0), xticks=range(0, 361, 90))
        labels = [f"{length * term.amplitude[0]:.3g} {unit}, {term.frequency[0]:.3g} Hz" for term in mine]
        if len(set(labels)) < len(labels):
            names = [term.loop.name.replace("$", r"\$") for term in mine]
            labels = [f"{label}\n{name}" for label, name in zip(labels, names, strict=True)]
        handles = [*(style.handle(False) for style in styles), Line2D([], [], color=_INK, lw=0.8)]
        _legend(phase_panel, handles, [*labels, "model"], "loop")
    _explain(figure, "Left: measured force over the motion cleared of noise; black: model.", _RESIDUALS, _MEANS)
    return figure


def to_png(figure: Figure) -> bytes:
    """The figure as PNG, the same bytes for the same figure: no date, no version."""
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        figure.savefig(buffer, format="png", dpi=_DPI, facecolor="white", metadata={"Software": None})
    return buffer.getvalue()


def _draw(
    pair: Sequence[Axes], direction: Direction, lines: Prediction | _Points, points: _Points, along: str, levels: Array
) -> bool:
    """Stiffness left, loss factor right, a line and its points per level; returns whether there were points."""
    other = "amplitude" if along == "frequency" else "frequency"
    units = display_units(direction)
    scales = {"frequency": ("Hz", 1.0), "amplitude": units["length"]}
    unit, scale = scales[along]
    x, where = scale * getattr(lines, along), scale * getattr(points, along)
    inside = (where >= x.min() * (1 - _SAME[0])) & (where <= x.max() * (1 + _SAME[0]))
    marked = [inside & np.isclose(getattr(points, other), level, *_SAME) for level in levels]
    styles = _styles(levels.size, other)
    stiffness_unit, factor = _prefixed(units["stiffness"], float(lines.stiffness.value.max()))
    kinds = (
        ("stiffness", factor, f"{direction} stiffness |K| [{stiffness_unit}]"),
        ("loss_factor", 1.0, f"{direction} loss factor [-]"),
    )
    for axes, (kind, factor, name) in zip(pair, kinds, strict=True):
        bands: tuple[Band, Band] = getattr(lines, kind), getattr(points, kind)
        line, point = (factor * np.stack((band.value, band.low, band.high)) for band in bands)
        for style, level, spots in zip(styles, levels, marked, strict=True):
            at = getattr(lines, other) == level
            value, low, high = line[:, at]
            axes.plot(
                x[at], value, color=style.color, ls=style.dashes, lw=1.3, marker="" if at.sum() > 1 else "_", ms=14
            )
            axes.fill_between(x[at], low, high, color=style.color, alpha=0.22, lw=0)
            if spots.any():
                mean, low, high = point[:, spots]
                axes.vlines(where[spots], low, high, color=style.color, lw=0.7, alpha=0.7)
                axes.plot(where[spots], mean, style.marker, color=style.color, **_POINT)
        _style(axes, f"{along} [{unit}]", name)
        _readable(axes, x)
        _least_span(axes, 0.04 * line.max() if kind == "stiffness" else 0.01)
    unit, scale = scales[other]
    handles = [style.handle(bool(spots.any())) for style, spots in zip(styles, marked, strict=True)]
    labels = [f"{scale * level:.3g} {unit}" for level in levels]
    order = slice(None, None, 1 if other == "amplitude" else -1)  # as the lines lie, the stiffest on top
    _legend(pair[-1], handles[order], labels[order], other)
    return any(spots.any() for spots in marked)


def _means(terms: Sequence[SweepTerm]) -> _Points:
    """Mean, least and largest of the repeats of each operating point."""
    amplitude, frequency, stiffness = (
        np.concatenate([np.empty(0), *(getattr(term, name) for term in terms)])
        for name in ("amplitude", "frequency", "measured")
    )
    spots, group = np.unique(np.stack((amplitude, frequency)), axis=1, return_inverse=True)
    order = np.argsort(group, axis=None, kind="stable")
    starts = np.flatnonzero(np.diff(group.ravel()[order], prepend=-1))
    parts = [stiffness[rows] for rows in np.split(order, starts[1:])] if starts.size else []

    def band(quantity: Callable[[Array], Array]) -> Band:
        return Band(*(np.array([summary(quantity(part)) for part in parts]) for summary in (np.mean, np.min, np.max)))

    return _Points(spots[1], spots[0], band(np.abs), band(lambda part: part.imag / part.real))


def _model_lines(model: Model, direction: Direction, points: _Points) -> _Points:
    """The model over the frequencies of each measured level."""
    levels = np.unique(points.amplitude)
    spans = [points.frequency[points.amplitude == level] for level in levels]
    frequency = np.concatenate([np.geomspace(span.min(), span.max(), _FINE) for span in spans])
    amplitude = np.repeat(levels, _FINE)
    stiffness = model.stiffness(direction, frequency, amplitude)
    magnitude, loss_factor = np.abs(stiffness), stiffness.imag / stiffness.real
    return _Points(frequency, amplitude, Band(*3 * [magnitude]), Band(*3 * [loss_factor]))


def _drawn_rows(term: LoopTerm) -> Array:
    """Rows of the first and last two cycles, thinned to what an eye can tell apart."""
    phase = term.drive.phase
    rows = np.flatnonzero((phase < 2.0) | (phase > phase[-1] - 2.0))
    return rows[:: max(1, -(-rows.size // _MOST_ROWS))]


def _prefixed(unit_and_factor: tuple[str, float], largest: float) -> tuple[str, float]:
    """With k or M for numbers of five digits and more."""
    unit, factor = unit_and_factor
    for prefix, power in (("M", 1e6), ("k", 1e3)):
        if factor * largest >= 10.0 * power:
            return prefix + unit, factor / power
    return unit, factor


def _points_note(terms: Sequence[SweepTerm]) -> str:
    repeated = any(np.unique(term.sweep.repeat).size > 1 for term in terms)
    return f"Points: measured{', mean of the repeats, with bars from the lowest to the highest' if repeated else ''}."


def _spread(levels: Array, most: int) -> Array:
    """At most that many levels, evenly picked from first to last."""
    return levels[np.unique(np.linspace(0, levels.size - 1, min(most, levels.size)).round().astype(int))]


def _styles(count: int, what: str) -> list[_Style]:
    name, first, last = _SCALES[what]
    colors = colormaps[name](np.linspace(first, last, count))
    return [_Style(c, _DASHES[i % len(_DASHES)], _MARKERS[i % len(_MARKERS)]) for i, c in enumerate(colors)]


def _figure(title: str, height: float) -> Figure:
    figure = Figure(figsize=(_WIDTH, height + _FRAME), dpi=_DPI, layout=ConstrainedLayoutEngine(wspace=0.05))
    fonts = ["DejaVu Sans", *sorted({font.name for font in fontManager.ttflist} & _WIDER_FONTS)]
    figure.suptitle(textwrap.fill(title, 84), fontsize=_TEXT + 1.5, weight="bold", family=fonts, parse_math=False)
    return figure


def _style(axes: Axes, x_label: str, y_label: str) -> None:
    axes.set_xlabel(x_label, fontsize=_TEXT, color=_INK)
    axes.set_ylabel(y_label, fontsize=_TEXT, color=_INK)
    axes.tick_params(labelsize=_SMALL, colors=_INK)
    axes.grid(color="#d9d9d9", lw=0.5)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.yaxis.set_major_formatter(ScalarFormatter(useOffset=False))


def _readable(axes: Axes, values: Array) -> None:
    """A logarithmic x axis where the values span decades, with plain numbers."""
    if values.max() > _LOG_RATIO * values.min():
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(subs=(1, 3) if values.max() < _LOG_RATIO**2 * values.min() else (1,)))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())


def _least_span(axes: Axes, least: float) -> None:
    """Keeps what is constant from filling the panel with rounding errors."""
    low, high = axes.get_ylim()
    if high - low < least:
        axes.set_ylim((low + high - least) / 2.0, (low + high + least) / 2.0)


def _noise_band(axes: Axes) -> None:
    axes.axhspan(-Z95, Z95, color="#ebebeb", lw=0, zorder=0)
    axes.axhline(0.0, color=_GREY, lw=0.6, zorder=1)
    _least_span(axes, 7.0)


def _legend(axes: Axes, handles: Sequence[Line2D], labels: Sequence[str], title: str) -> None:
    axes.legend(handles, labels, title=title, fontsize=_SMALL, title_fontsize=_SMALL, **_LEGEND)


def _explain(figure: Figure, *sentences: str) -> None:
    """Below the panels: what lines, shades and points are."""
    text = textwrap.fill(" ".join(filter(None, sentences)), 112)
    figure.supxlabel(text, x=0.01, ha="left", fontsize=_SMALL, color=_GREY, parse_math=False)
