"""Common style of all figures: size, fonts, colours and legends, and their encoding as image files.

The user's matplotlibrc has no influence: `fixed_settings` draws with matplotlib's defaults.
"""

import io
import re
import textwrap
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import RLock
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from matplotlib import colormaps, rc_context, rc_params_from_file, rcParamsDefault
from matplotlib.axes import Axes
from matplotlib.backend_bases import get_registered_canvas_class
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.font_manager import fontManager
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from bushfit.caveat import Caveat
from bushfit.effects.contract import Array
from bushfit.errors import printable
from bushfit.model.covariance import Z95
from bushfit.report.tables import spread_indices

#: Width of a figure [cm]: the text of a page of A4.
_WIDTH = 16.0
#: Height of a panel with its labels [cm]: two in a row are a little wider than high.
ROW = 5.4
#: Heights [cm]: margin above a title and below an explanation, with the gap to the panels, and a line of each.
_MARGIN, _TITLE_LINE, _NOTE_LINE = 0.4, 0.42, 0.33
#: Settings of the style sheet, and its sizes of the labels of axes, and of ticks, legends and explanations [point].
_STYLE = rc_params_from_file(Path(__file__).with_name("bushfit.mplstyle"), use_default_template=False)
TEXT, SMALL = _STYLE["axes.labelsize"], _STYLE["legend.fontsize"]
#: Marker options of a measured point, and of one of thousands of points.
POINT: dict[str, Any] = {"ms": 4.2, "mec": "white", "mew": 0.4}
DOT: dict[str, Any] = {"ms": 2.4, "mew": 0}
#: Width of a line [point].
LINE = 1.3
#: Colours: text and neutral lines, explanations, shaded bands, and outliers.
INK, GREY, SHADE, RED = "#1a1a1a", "#595959", "#ebebeb", "#c1121f"
#: Font options of axis names and of smaller text.
NAMES: dict[str, Any] = {"fontsize": TEXT, "color": INK}
WORDS: dict[str, Any] = {"fontsize": SMALL, "color": INK}
#: Resolution of a picture [dots per inch]: sharp in a report, and small enough to be mailed.
_DPI = 150
#: Compression level of a PNG: a higher level takes longer and saves little.
_COMPRESSION = 3
#: Metadata keys, by format, that are omitted: they would contain date and version.
_OMITTED_METADATA = {"png": ["Software"], "svg": ["Creator", "Date"], "pdf": ["Creator", "Producer", "CreationDate"]}
#: Largest number of lines in a legend: more do not fit beside a panel.
MOST_NAMED = 8
#: Colour map of each kind of level, and the part of the map in use: each colour has one meaning.
_SCALES = {
    "amplitude": ("viridis", 0.0, 0.8),
    "frequency": ("inferno", 0.1, 0.76),
    "loop": ("plasma", 0.4, 0.85),
    "temperature": ("turbo", 0.05, 0.95),
}
#: Markers (eight) and line styles (five) of successive levels: their combinations repeat after forty levels.
_MARKERS = "os^Dv<p>"
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (5, 1.5, 1, 1.5)), (0, (1.2, 1.2)), (0, (9, 2)))
#: Largest number of intervals between the ticks of an axis.
_MOST_TICKS = 6
#: Ratio of largest to smallest value above which an axis is logarithmic (about a decade and a half; a choice).
_LOG_RATIO = 40.0
#: Largest number of letters in a line of the title and of the explanation, by the width of a figure, and of the y label
#: of a panel, by its height.
_TITLE_LETTERS, _NOTE_LETTERS, _LABEL_LETTERS = 64, 112, 27
#: Largest number of letters of the warnings below a figure: about five lines.
_MOST_LETTERS = 600
#: Fonts for names beyond Latin, Greek and Cyrillic, if they are installed.
_WIDER_FONTS = {"Noto Sans CJK SC", "Noto Sans CJK JP", "WenQuanYi Zen Hei", "Microsoft YaHei", "SimHei", "PingFang SC"}
#: Settings of all figures: matplotlib's defaults without those that choose a window system, and bushfit's own. Settings
#: are faster than calls for each panel, which rebuild its ticks.
_SETTINGS: dict[Any, Any] = {
    key: value for key, value in rcParamsDefault.items() if key.partition(".")[0] not in ("backend", "interactive")
} | {
    **_STYLE,
    # one font to search for, not the fourteen of "sans-serif", and installed ones for names in further scripts
    "font.family": ["DejaVu Sans", *sorted({font.name for font in fontManager.ttflist} & _WIDER_FONTS)],
}
#: Lines of a legend by their labels; several lines are drawn on each other.
LegendLines = Mapping[str, Line2D | tuple[Line2D, ...]]
#: matplotlib's settings belong to the process: one figure at a time changes them.
_LOCK = RLock()


@contextmanager
def fixed_settings(**settings: Any) -> Iterator[None]:
    """Context, or decorator of a function that makes a figure, without influence of the user's matplotlibrc.

    Args:
        settings: settings of matplotlib that differ from the settings of all figures.
    """
    merged: dict[Any, Any] = {**_SETTINGS, **settings}
    with _LOCK, rc_context(merged), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        yield


class Chart(Figure):
    """Figure 16 cm wide, the text width of an A4 page, with a title above its panels and an explanation below them.

    Args:
        title: title of the figure.
        height: height of the panels with their labels [cm].

    Attributes:
        heading, footer: matplotlib texts above and below the panels.
        caption: the sentences given to `explain`, without its note, in one line, for use in a page.
    """

    def __init__(self, title: str, height: float) -> None:
        self._title, self._panel_height = printable(title, lines=True), height
        super().__init__(figsize=(_WIDTH / 2.54, height / 2.54), dpi=_DPI, facecolor="white")

    def explain(self, *sentences: str, note: str = "") -> Self:
        """Compute the layout of the panels, and add title and explanation above and below them.

        Args:
            sentences: explanation of lines, shaded bands and points; empty ones are omitted.
            note: further sentences below the figure that are not part of `caption`.

        Returns:
            The figure itself, ready to be written in any format.
        """
        self.tight_layout(pad=0.5, h_pad=0.9, w_pad=1.2)
        self.caption = printable(" ".join(filter(None, sentences)), lines=True)
        title = textwrap.wrap(self._title, _TITLE_LETTERS)
        lines = textwrap.wrap(f"{self.caption} {printable(note, lines=True)}", _NOTE_LETTERS)
        self._margins = _MARGIN + _TITLE_LINE * len(title), _MARGIN + _NOTE_LINE * len(lines)
        height = self._panel_height + sum(self._margins)
        self.heading = self.suptitle("\n".join(title), y=1.0 - 0.25 / height, fontsize=TEXT + 1.5, weight="bold")
        below_panels: dict[str, Any] = {"x": 0.01, "y": 0.2 / height, "ha": "left", "fontsize": SMALL, "color": GREY}
        self.footer = self.supxlabel("\n".join(lines), **below_panels)
        self._panel_ends = self.subplotpars.bottom, self.subplotpars.top
        self.arrange(texts=True)
        return self

    def arrange(self, *, texts: bool) -> None:
        """Show or hide title and explanation, and fit the height of the figure; the panels keep size and distances."""
        above, below = self._margins if texts else (0.0, 0.0)
        height = above + self._panel_height + below
        self.set_figheight(height / 2.54)
        bottom, top = ((below + end * self._panel_height) / height for end in self._panel_ends)
        self.subplots_adjust(bottom=bottom, top=top)
        for text in (self.heading, self.footer):
            text.set_visible(texts)


class Style(NamedTuple):
    """Line style of one curve (of an amplitude, frequency, temperature or loop) in a figure.

    Args:
        color, dashes, marker: colour, line style and marker, as matplotlib takes them.
    """

    color: Any
    dashes: Any
    marker: str

    def handle(self, marked: bool) -> Line2D:
        """Make the legend entry of this style: a line, and its marker if `marked` is true."""
        return Line2D([], [], color=self.color, ls=self.dashes, lw=LINE, marker=self.marker * marked, **POINT)


def styles(count: int, palette: str) -> list[Style]:
    """Line styles for curves; they differ only in colour if there are too many curves for a legend.

    Args:
        count: number of curves.
        palette: colour scale, named after the quantity that distinguishes the curves: "amplitude", "frequency",
            "temperature" or "loop".
    """
    name, first, last = _SCALES[palette]
    colors = colormaps[name](np.linspace(first, last, count))
    if count > MOST_NAMED and palette != "loop":
        return [Style(color, DASHES[0], _MARKERS[0]) for color in colors]
    return [Style(c, DASHES[i % len(DASHES)], _MARKERS[i % len(_MARKERS)]) for i, c in enumerate(colors)]


def label_axes(axes: Axes, x_label: str, y_label: str, x: Array | None = None) -> None:
    """Give a panel its labels, few ticks, and a logarithmic x axis if it spans decades.

    Args:
        axes: panel.
        x_label, y_label: labels of the axes, with units.
        x: values along x, which decide between a linear and a logarithmic axis, (n,); None for linear.
    """
    axes.set_xlabel(x_label)
    label_left(axes, y_label)
    if axes.get_xscale() == "linear":
        axes.locator_params("x", nbins=_MOST_TICKS)
    if axes.get_yscale() == "linear":
        axes.locator_params("y", nbins=_MOST_TICKS)
    axes.spines[:].set_in_layout(False)  # ticks and labels determine the layout
    if x is not None and x.max() > _LOG_RATIO * x.min():
        make_logarithmic(axes, x)


def label_left(axes: Axes, label: str, **options: Any) -> None:
    """Set the label of the y axis of a panel, wrapped to the height of the panel.

    Args:
        axes: panel.
        label: text of the label.
        **options: properties of the text, as matplotlib takes them.
    """
    whole = re.sub(r"\[.*?\]", lambda unit: unit[0].replace(" ", "\u00a0"), printable(label, lines=True))
    lines = [part for line in whole.splitlines() for part in textwrap.wrap(line, _LABEL_LETTERS)]
    axes.set_ylabel("\n".join(lines), **options)


def make_logarithmic(axes: Axes, values: Array, axis_name: Literal["x", "y"] = "x") -> None:
    """Make an axis logarithmic, with ticks as plain numbers such as 0.1, 1 and 10, and as powers from 10,000.

    Args:
        axes: panel.
        values: positive values along the axis, whose range determines the ticks, (n,).
        axis_name: "x" or "y".
    """
    axis = {"x": axes.xaxis, "y": axes.yaxis}[axis_name]
    axes.set(**{f"{axis_name}scale": "log"})
    subs = (1, 3) if values.max() < 10.0 * _LOG_RATIO * values.min() else (1,)
    axis.set_major_locator(LogLocator(subs=subs, numticks=_MOST_TICKS - 1))
    axis.set_major_formatter(FuncFormatter(_tick_label))
    axis.set_minor_formatter(NullFormatter())


def _tick_label(value: float, _: int) -> str:
    """Label of a tick: "0.1", "300", and "10⁴" or "3·10⁴" from 10,000."""
    mantissa, power = f"{value:.0e}".split("e")
    short = f"{mantissa}·10{'⁰¹²³⁴⁵⁶⁷⁸⁹'[int(power) % 10]}".removeprefix("1·")
    return short if value >= 1e4 else f"{value:g}"


def widen_span(axes: Axes, minimum: float) -> None:
    """Widen the limits of a y axis to a span of at least `minimum`, so that rounding errors do not fill the panel."""
    low, high = axes.get_ylim()
    if high - low < minimum:
        axes.set_ylim((low + high - minimum) / 2.0, (low + high + minimum) / 2.0)


def noise_band(axes: Axes) -> None:
    """Shade the band of 95 % of standard normal residuals, from -1.96 to 1.96, in a panel of residuals / noise."""
    axes.axhspan(-Z95, Z95, color=SHADE, lw=0, zorder=0)
    axes.axhline(0.0, color=GREY, lw=0.6, zorder=1)
    widen_span(axes, 7.0)


def draw_band(axes: Axes, x: Array, band: Array, look: Style, **options: Any) -> None:
    """Draw a predicted quantity as a line in its shaded 95 % band.

    Args:
        axes: panel.
        x: values along x in the unit of the panel, (n,).
        band: value, low and high end in the unit of the panel, (3, n).
        look: colour and line style.
        **options: further properties of the line.
    """
    value, low, high = band
    axes.plot(x, value, color=look.color, ls=look.dashes, **options)
    axes.fill_between(x, low, high, color=look.color, alpha=0.22, lw=0)


def mark_outliers(axes: Axes, x: Array, y: Array) -> None:
    """Draw crosses at outliers; those outside the limits of the panel are drawn at its edge.

    Args:
        axes: panel.
        x, y: coordinates of the outliers in the units of the panel, (n,) each.
    """
    low, high = axes.get_ylim()
    if x.size:
        axes.plot(x, np.clip(y, low, high), "x", color=RED, ms=4.5, mew=1.2, zorder=5, clip_on=False)
    axes.set_ylim(low, high)


def legend(
    axes: Axes, handles: Sequence[Line2D], labels: Sequence[str], title: str, extra_lines: LegendLines | None = None
) -> None:
    """Add a legend right of a panel.

    Args:
        axes: panel.
        handles, labels: lines and their labels; of more than eight, eight are named and the others are counted.
        title: title of the legend.
        extra_lines: further lines by their labels.
    """
    named = [(handles[index], labels[index]) for index in spread_indices(len(handles), MOST_NAMED)]
    if omitted := len(handles) - len(named):
        named.append((Line2D([], [], ls=""), f"and {omitted} more"))
    named += [(line, text) for text, line in (extra_lines or {}).items()]
    axes.legend(*zip(*named, strict=True), title=title, loc="center left", bbox_to_anchor=(1.01, 0.5), handlelength=3.2)


def name_levels(
    axes: Axes,
    levels: Sequence[str],
    quantity: str,
    marked: Sequence[bool] = (),
    extra_lines: LegendLines | None = None,
) -> None:
    """Add a legend of the curves of a panel by their amplitude, frequency or temperature; a colour bar for over eight.

    Args:
        axes: panel.
        levels: amplitude, frequency or temperature of each curve as a text, in ascending order, (k,).
        quantity: "amplitude", "frequency" or "temperature": title, and name of the colour scale.
        marked: True for each curve that has measured points, (k,); empty if all have.
        extra_lines: further lines by their labels.
    """
    if len(levels) <= MOST_NAMED:
        looks, order = styles(len(levels), quantity), 1 if quantity == "amplitude" else -1
        handles = [look.handle(points) for look, points in zip(looks, marked or [True] * len(looks), strict=True)]
        legend(axes, handles[::order], levels[::order], quantity, extra_lines)
    else:
        color_bar(axes, levels, quantity)


def color_bar(axes: Axes, levels: Sequence[str], quantity: str) -> None:
    """Add a colour bar right of a panel, with a field for each level and labels for at most eight of them.

    Args:
        axes: panel.
        levels: amplitude, frequency or temperature of each field as a text, in ascending order, (k,).
        quantity: "amplitude", "frequency" or "temperature": title, and name of the colour scale.
    """
    looks, edges = styles(len(levels), quantity), np.arange(len(levels) + 1) - 0.5
    colors = ScalarMappable(BoundaryNorm(edges, len(levels)), ListedColormap([look.color for look in looks]))
    bar = axes.figure.colorbar(colors, cax=axes.inset_axes((1.04, 0.0, 0.05, 1.0)), drawedges=False)
    ticks = spread_indices(len(levels), MOST_NAMED)
    bar.set_ticks(ticks.tolist(), labels=[levels[tick] for tick in ticks], **WORDS)
    bar.ax.tick_params(length=2, which="both")
    bar.minorticks_off()
    bar.ax.set_title(quantity, **WORDS)
    bar.outline.set(edgecolor=GREY, linewidth=0.6)


def warnings_note(warnings: Sequence[Caveat]) -> str:
    """Join the first warnings, up to about 600 letters, into the note below a figure; the others are counted."""
    ends = np.cumsum([len(warning.text) for warning in warnings])
    count = max(int(np.searchsorted(ends, _MOST_LETTERS)), 1)
    more = len(warnings) - count
    texts = [warning.text[0].upper() + warning.text[1:] for warning in warnings[:count]]
    return ". ".join([*texts, *([f"And {more} more warnings, in the model file and the report"] if more > 0 else [])])


def to_image(figure: Figure, form: str = "png", *, outlines: bool = True) -> bytes:
    """Encode a figure as PNG, SVG or PDF, reproducibly: without date and version.

    Args:
        figure: figure to draw.
        form: "png", "svg" or "pdf".
        outlines: True to draw the texts of an SVG as outlines, which look the same everywhere; False to keep
            them as text, which is shorter.

    Returns:
        Content of the image file.
    """
    buffer = io.BytesIO()
    figure.set_dpi(_DPI)  # SVG and PDF change the resolution of the figure
    with fixed_settings(**{"svg.fonttype": "path" if outlines else "none"}):
        canvas = get_registered_canvas_class(form)(figure)
        options = {"pil_kwargs": {"compress_level": _COMPRESSION}} if form == "png" else {}
        getattr(canvas, f"print_{form}")(buffer, metadata=dict.fromkeys(_OMITTED_METADATA[form]), **options)
    return buffer.getvalue()
