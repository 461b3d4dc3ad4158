"""The two pictures of a page: a chart of lines, bands and points, and maps of cells."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup

from bushfit.effects.contract import Array
from bushfit.report.page.svg import GREY, Axis, axes, dots, path, picture, tag, text
from bushfit.report.tables import spread

#: Width of a picture [pixels]: two stand side by side on a screen, and on paper.
WIDTH = 460.0
#: Height of the panel of a chart [pixels].
_PANEL = 168.0
#: Left of a panel: ticks and the label of the axis [pixels].
_LEFT = 62.0
#: Right of a panel [pixels].
_RIGHT = 10.0
#: Below a panel: ticks and the label of the axis [pixels].
_BELOW = 42.0
#: Height of a line of text [pixels].
_LINE = 17.0
#: Width of a letter in a legend, and of its swatch [pixels].
_LETTER, _SWATCH = 6.4, 34.0
#: Colours of levels, from cold to warm, each with a contrast of 4 to 1 and more on white.
_COLORS = ("#2d1160", "#1f4e9c", "#0a7399", "#0d7f62", "#4b7f1b", "#85690a", "#b4500c", "#a11d4a")
#: Dashes of levels, one after the other: they tell lines apart in a print without colours.
DASHES = ("", "6 2", "2 2", "9 2 2 2", "4 4", "1 3", "12 3", "6 2 2 2")
#: Colour of limits.
LIMIT = "#b3121d"
#: Height of a row of cells, and the most that a map is high [pixels].
_CELL, _MOST_MAP = 15.0, 110.0
#: Where the colour of a cell changes, in % off; the first is that of what agrees.
EDGES = (0.5, 1.0, 2.0, 5.0, 10.0)
#: Colours from agreement outward, of what was measured above the model and below.
_ABOVE = ("#ececec", "#f9c4ab", "#ee8f6c", "#d1493e", "#9f1330", "#5d0a26")
_BELOW_MODEL = ("#ececec", "#bfdcec", "#7fb8d8", "#3984be", "#1f5290", "#0b2a56")
#: From this colour outward a cell below the model bears a bar: red and blue are one grey in a print without colours.
_BARRED = 2


def colors(count: int) -> list[str]:
    """So many colours, as far apart as there are."""
    return [_COLORS[place % len(_COLORS)] for place in ([0, 6] if count == 2 else spread(len(_COLORS), max(count, 1)))]


@dataclass(frozen=True, eq=False)
class Series:
    """What a legend names: a line, its band and points, each x and y, (n,)."""

    name: str
    color: str
    dashes: str = ""
    line: tuple[Array, Array] | None = None
    band: tuple[Array, Array, Array] | None = None
    points: tuple[Array, Array] | None = None

    def values(self, place: int) -> Iterator[Array]:
        """All x (0) or y (1) values."""
        for part in (self.line, self.points):
            if part is not None:
                yield part[place]
        if self.band is not None:
            yield from ((self.band[0],), self.band[1:])[place]


@dataclass(frozen=True)
class Rule:
    """A level line across a chart: its value, its name, whether it is a limit, and its dashes."""

    value: float
    name: str
    limit: bool = False
    dashes: str = ""


def chart(
    title: str,
    labels: tuple[str, str],
    series: Sequence[Series],
    alt: str,
    *,
    log: bool = False,
    rules: Sequence[Rule] = (),
    dot: float = 4.6,
    least: float = 0.0,
) -> Markup:
    """Lines, bands and points over x, which is logarithmic on request, under a legend; y spans `least` or more."""
    legend, lines = _legend(series, rules)
    top = _LINE * (1 + lines) + 12.0
    levels = np.array([rule.value for rule in rules])
    x = Axis.over(labels[0], (values for each in series for values in each.values(0)), _LEFT, WIDTH - _RIGHT, log=log)
    ys = [*(values for each in series for values in each.values(1)), levels]
    y = Axis.over(labels[1], ys, top + _PANEL, top, least=least)
    drawn = [_drawn(each, x, y, dot) for each in series]
    across = np.array([x.first, x.last])
    drawn += [
        path(across, y(np.full(2, rule.value)), stroke=LIMIT if rule.limit else GREY, **_dashed(rule.dashes))
        for rule in rules
    ]
    heading = text(4, 14, title, font_weight="bold", font_size=13)
    data = {"data_x": x.described, "data_y": y.described}
    return picture(WIDTH, top + _PANEL + _BELOW, alt, heading, *legend, *axes(x, y), *drawn, **data)


def _dashed(dashes: str) -> dict[str, Any]:
    """The attribute of a dashed line; none of a whole one."""
    return {"stroke_dasharray": dashes} if dashes else {}


def _drawn(series: Series, x: Axis, y: Axis, dot: float) -> Markup:
    """Band, line and points of a series."""
    parts = []
    if series.band is not None:
        along, low, high = series.band
        there = np.isfinite(along) & np.isfinite(low) & np.isfinite(high)
        around = (
            x(np.concatenate([along[there], along[there][::-1]])),
            y(np.concatenate([low[there], high[there][::-1]])),
        )
        d = "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(*around, strict=True))
        parts.append(tag("path", d=f"M{d}Z", fill=series.color, fill_opacity=0.18) if d else Markup())
    if series.line is not None:
        line = x(series.line[0]), y(series.line[1])
        parts.append(path(*line, stroke=series.color, stroke_width=1.5, data_of="model", **_dashed(series.dashes)))
    if series.points is not None:
        parts.append(dots(x(series.points[0]), y(series.points[1]), series.color, dot))
    return tag("g", *parts, data_series=series.name)


def _legend(series: Sequence[Series], rules: Sequence[Rule]) -> tuple[list[Markup], int]:
    """The entries of a legend under the title, and how many lines they take."""
    drawn, left, line = [], 4.0, 1
    entries = [(each.name, each) for each in series if each.name] + [(rule.name, rule) for rule in rules if rule.name]
    for name, each in entries:
        width = _SWATCH + _LETTER * len(name) + 10.0
        if left + width > WIDTH and left > 4.0:
            left, line = 4.0, line + 1
        at = 14.0 + _LINE * line
        across, level = np.array([left, left + _SWATCH - 8.0]), np.full(2, at - 4.0)
        color = each.color if isinstance(each, Series) else LIMIT if each.limit else GREY
        if isinstance(each, Rule) or each.line is not None:
            drawn.append(path(across, level, stroke=color, stroke_width=1.5, **_dashed(each.dashes)))
        if isinstance(each, Series) and each.points is not None:
            middle = tag("circle", cx=left + (_SWATCH - 8.0) / 2, cy=at - 4.0, r=2.5, fill=color)
            drawn.append(middle)
        drawn.append(text(left + _SWATCH - 4.0, at, name))
        left += width
    return drawn, line if entries else 0


@dataclass(frozen=True, eq=False)
class Cells:
    """A map: what it shows, its rows from below, what lies along x, and one or two sides, (rows, columns) in %."""

    name: str
    rows: Sequence[str]
    along: tuple[str, str, str]
    sides: Sequence[Array]


def maps(title: str, heads: Sequence[str], shown: Sequence[Cells], alt: str) -> Markup:
    """Maps below each other, before and after side by side, one scale for all."""
    left = 96.0
    width = (WIDTH - left - _RIGHT - 12.0 * (len(heads) - 1)) / len(heads)
    drawn = [text(4, 14, title, font_weight="bold", font_size=13)]
    starts = [left + side * (width + 12.0) for side in range(len(heads))]
    for start, head in zip(starts, heads, strict=True):
        drawn.append(text(start + width / 2, 34, head, text_anchor="middle", fill=GREY))
    top = 48.0
    for cells in shown:
        size = min(_CELL, _MOST_MAP / len(cells.rows))
        height = size * len(cells.rows)
        for start, values in zip(starts, cells.sides, strict=True):
            drawn += _cells(values, start, top, width / values.shape[1], size)
            low, name, high = cells.along
            drawn.append(text(start, top + height + 13, low, font_size=11))
            drawn.append(
                text(start + width / 2, top + height + 13, name, text_anchor="middle", font_size=11, fill=GREY)
            )
            drawn.append(text(start + width, top + height + 13, high, text_anchor="end", font_size=11))
        every = max(1, round(12.0 / size))
        for row, label in enumerate(cells.rows):
            if row % every == 0:
                at = top + height - (row + 0.5) * size + 4
                drawn.append(text(left - 6, at, label, text_anchor="end", font_size=11))
        drawn.append(text(4, top - 6, cells.name, font_weight="bold", font_size=11))
        top += height + 36.0
    return picture(WIDTH, top + 30.0, alt, *drawn, *_scale(top))


def _cells(values: Array, left: float, top: float, width: float, size: float) -> list[Markup]:
    """The cells of one map, each colour one path, and bars where the measurement is far below."""
    rows, _ = values.shape
    step = np.searchsorted(EDGES, np.abs(values), side="right") * np.where(values < 0.0, -1, 1)
    drawn = []
    for level in range(-len(EDGES), len(EDGES) + 1):
        found = np.argwhere(np.isfinite(values) & (step == level))
        boxes = [(left + column * width, top + (rows - 1 - row) * size) for row, column in found]
        if boxes:
            color = _ABOVE[level] if level >= 0 else _BELOW_MODEL[-level]
            d = "".join(f"M{x:.1f} {y:.1f}h{width:.1f}v{size:.1f}h-{width:.1f}z" for x, y in boxes)
            drawn.append(tag("path", d=d, fill=color, stroke="#ffffff", stroke_width=0.5))
        if boxes and level <= -_BARRED:
            d = "".join(f"M{x + width / 4:.1f} {y + size / 2:.1f}h{width / 2:.1f}" for x, y in boxes)
            drawn.append(tag("path", d=d, stroke="#ffffff", stroke_width=1.2))
    return drawn


def _scale(top: float) -> list[Markup]:
    """The scale of colours: below the model left, above right, edges numbered."""
    colors = (*_BELOW_MODEL[:0:-1], *_ABOVE)
    width = 24.0
    left = (WIDTH - width * len(colors)) / 2
    drawn = [
        tag("rect", x=left + place * width, y=top, width=width, height=10, fill=color)
        for place, color in enumerate(colors)
    ]
    ends = (*(-edge for edge in EDGES[::-1]), *EDGES)
    for place, edge in enumerate(ends, start=1):
        drawn.append(text(left + place * width, top + 22, f"{edge:g}", text_anchor="middle", font_size=10))
    drawn.append(text(left - 8, top + 9, "measured below", text_anchor="end", font_size=11, fill=GREY))
    drawn.append(text(left + width * len(colors) + 8, top + 9, "above, %", font_size=11, fill=GREY))
    return drawn
