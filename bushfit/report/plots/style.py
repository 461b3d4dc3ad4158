"""What all figures share: size, type, colours, legends, and the way to a PNG."""

from __future__ import annotations

import io
import textwrap
import warnings
from collections.abc import Sequence
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
from bushfit.model.covariance import Z95

#: Inches: a figure's width, a panel's height, what title and explanation take.
WIDTH, ROW, FRAME = (cm / 2.54 for cm in (16.0, 5.4, 2.0))
TEXT, SMALL = 8.5, 7.5
POINT: dict[str, Any] = {"ms": 4.2, "mec": "white", "mew": 0.4}
DOT: dict[str, Any] = {"ms": 2.4, "mew": 0}
INK, GREY, WILD = "#1a1a1a", "#595959", "#c1121f"
_DPI = 150
_LEGEND: dict[str, Any] = {"loc": "center left", "bbox_to_anchor": (1.01, 0.5), "frameon": False, "handlelength": 3.2}
#: Colours of what a figure tells apart: a scale each, so that no colour means two things. Loops stay off black.
_SCALES = {"amplitude": ("viridis", 0.0, 0.8), "frequency": ("inferno", 0.1, 0.76), "loop": ("plasma", 0.4, 0.85)}
_MARKERS = "os^Dv<p>"
_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (5, 1.5, 1, 1.5)), (0, (1.2, 1.2)), (0, (9, 2)))
#: An axis that spans more than this ratio is logarithmic.
_LOG_RATIO = 40.0
_TITLE_LETTERS, _NOTE_LETTERS = 84, 112
#: Fonts that help out for names beyond Latin, Greek and Cyrillic, where they are installed.
_WIDER_FONTS = {"Noto Sans CJK SC", "Noto Sans CJK JP", "WenQuanYi Zen Hei", "Microsoft YaHei", "SimHei", "PingFang SC"}


class Style(NamedTuple):
    """How one level is drawn."""

    color: Any
    dashes: Any
    marker: str

    def handle(self, marked: bool) -> Line2D:
        """The line of a legend."""
        return Line2D([], [], color=self.color, ls=self.dashes, lw=1.3, marker=self.marker * marked, **POINT)


def styles(count: int, what: str) -> list[Style]:
    """A style for each of so many amplitudes, frequencies or loops."""
    name, first, last = _SCALES[what]
    colors = colormaps[name](np.linspace(first, last, count))
    return [Style(c, _DASHES[i % len(_DASHES)], _MARKERS[i % len(_MARKERS)]) for i, c in enumerate(colors)]


def new_figure(title: str, height: float) -> Figure:
    """As wide as a report's page, under a title of any letters."""
    figure = Figure(figsize=(WIDTH, height + FRAME), dpi=_DPI, layout=ConstrainedLayoutEngine(wspace=0.05))
    text = textwrap.fill(title, _TITLE_LETTERS)
    figure.suptitle(text, fontsize=TEXT + 1.5, weight="bold", family=fonts(), parse_math=False)
    return figure


def fonts() -> list[str]:
    """For text that may hold any letters."""
    return ["DejaVu Sans", *sorted({font.name for font in fontManager.ttflist} & _WIDER_FONTS)]


def dress(axes: Axes, x_label: str, y_label: str) -> None:
    """Labels, ticks and a grid that stays behind."""
    axes.set_xlabel(x_label, fontsize=TEXT, color=INK)
    axes.set_ylabel(y_label, fontsize=TEXT, color=INK)
    axes.tick_params(labelsize=SMALL, colors=INK)
    axes.grid(color="#d9d9d9", lw=0.5)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.yaxis.set_major_formatter(ScalarFormatter(useOffset=False))


def readable(axes: Axes, values: Array) -> None:
    """A logarithmic x axis where the values span decades."""
    if values.max() > _LOG_RATIO * values.min():
        logarithmic(axes, values)


def logarithmic(axes: Axes, values: Array) -> None:
    """A logarithmic x axis with plain numbers."""
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 3) if values.max() < _LOG_RATIO**2 * values.min() else (1,)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())


def least_span(axes: Axes, least: float) -> None:
    """Keeps what is constant from filling the panel with rounding errors."""
    low, high = axes.get_ylim()
    if high - low < least:
        axes.set_ylim((low + high - least) / 2.0, (low + high + least) / 2.0)


def noise_band(axes: Axes) -> None:
    """Grey where 95 % of the residuals should lie."""
    axes.axhspan(-Z95, Z95, color="#ebebeb", lw=0, zorder=0)
    axes.axhline(0.0, color=GREY, lw=0.6, zorder=1)
    least_span(axes, 7.0)


def mark_wild(axes: Axes, x: Array, y: Array) -> None:
    """Crosses at points that lie far off, drawn at the edge where they lie beyond it."""
    low, high = axes.get_ylim()
    if x.size:
        axes.plot(x, np.clip(y, low, high), "x", color=WILD, ms=4.5, mew=1.2, zorder=5, clip_on=False)
    axes.set_ylim(low, high)


def legend(axes: Axes, handles: Sequence[Line2D], labels: Sequence[str], title: str, **place: Any) -> None:
    """Right of the panel, or where `place` says in matplotlib's words."""
    axes.legend(handles, labels, fontsize=SMALL, title_fontsize=SMALL, **(_LEGEND | {"title": title} | place))


def explain(figure: Figure, *sentences: str) -> None:
    """Below the panels: what lines, shades and points are."""
    text = textwrap.fill(" ".join(filter(None, sentences)), _NOTE_LETTERS)
    figure.supxlabel(text, x=0.01, ha="left", fontsize=SMALL, color=GREY, parse_math=False)


def to_png(figure: Figure) -> bytes:
    """The figure as PNG, the same bytes for the same figure: no date, no version."""
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        figure.savefig(buffer, format="png", dpi=_DPI, facecolor="white", metadata={"Software": None})
    return buffer.getvalue()
