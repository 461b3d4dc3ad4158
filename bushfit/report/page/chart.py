"""A chart of lines, bands and points for the page of a batch.

They are SVG of the page's own, in the templates chart.html and maps.html, not matplotlib's: every run writes a page,
also where no other picture is asked for. matplotlib would take 0.3 s to load and 0.05 s a chart, each five times as
large. Colours are attributes, since pages are shown where style sheets and scripts are forbidden: by Jenkins, in mail.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from markupsafe import Markup

from bushfit.effects.contract import Array
from bushfit.report.page import filled
from bushfit.report.tables import spread
from bushfit.units import number

#: Width of a picture [pixels]: two stand side by side on a screen, and on paper.
_WIDTH = 460.0
#: Height of the panel of a chart, and the room left, right and below for ticks and labels [pixels].
_PANEL, _LEFT, _RIGHT, _BELOW = 168.0, 62.0, 10.0, 42.0
#: Height of a line of text, width of a letter, and of the stroke before a name in a legend [pixels].
_LINE, _LETTER, _SWATCH = 17.0, 6.4, 34.0
#: Room right of a chart for the axis of angles [pixels].
_ANGLES = 44.0
#: Most ticks of a logarithmic axis with 1, 2 and 5 of each decade.
_MOST_TICKS = 7
#: Free space beyond the data on a linear axis, as a share of their span.
_MARGIN = 0.05
#: Colours of levels, from cold to warm, each with a contrast of 4 to 1 and more on white.
_COLORS = ("#2d1160", "#1f4e9c", "#0a7399", "#0d7f62", "#4b7f1b", "#85690a", "#b4500c", "#a11d4a")
#: Dashes of levels, one after the other: they tell lines apart in a print without colours.
DASHES = ("", "6 2", "2 2", "9 2 2 2", "4 4", "1 3", "12 3", "6 2 2 2")
#: Colour of limits, and of other level lines.
LIMIT, _GREY = "#b3121d", "#595959"


def colors(count: int) -> list[str]:
    """So many colours, as far apart as there are."""
    return [_COLORS[place % len(_COLORS)] for place in ([0, 6] if count == 2 else spread(len(_COLORS), max(count, 1)))]


@dataclass(frozen=True, eq=False)
class Series:
    """What a legend names: a line, its band (x, low, high) and points, each x and y, (n,)."""

    name: str
    color: str
    dashes: str = ""
    line: tuple[Array, Array] | None = None
    band: tuple[Array, Array, Array] | None = None
    points: tuple[Array, Array] | None = None

    def values(self, which: int) -> Iterator[Array]:
        """All x (0) or y (1) values."""
        for x, *ys in filter(None, (self.line, self.points, self.band)):
            yield from ([x], ys)[which]


@dataclass(frozen=True)
class Rule:
    """A level line across a chart: its value, its name, its dashes and colour."""

    value: float
    name: str
    dashes: str = ""
    color: str = _GREY


@dataclass(frozen=True)
class Axis:
    """Values from `low` to `high` along the pixels from `first` to `last`."""

    label: str
    low: float
    high: float
    first: float
    last: float
    log: bool = False

    @classmethod
    def over(
        cls, label: str, values: Iterable[Array], first: float, last: float, *, log: bool = False, least: float = 0.0
    ) -> Self:
        """An axis that holds all these values, with a margin; a linear one spans `least` or more."""
        known = np.concatenate([np.empty(0), *(np.ravel(each) for each in values)])
        known = known[np.isfinite(known) & ((known > 0.0) | (not log))]
        low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
        if log and high > low:
            margin = (high / low) ** (_MARGIN / 2.0)
            return cls(label, low / margin, high * margin, first, last, log=True)
        margin = max(_MARGIN * (high - low), (least - high + low) / 2.0) or 0.1 * abs(high) or 1.0
        return cls(label, low - margin, high + margin, first, last)

    def __call__(self, values: Array | float) -> Array:
        """Pixels of values."""
        ends = (math.log(self.low), math.log(self.high)) if self.log else (self.low, self.high)
        with np.errstate(divide="ignore", invalid="ignore"):
            at = np.log(values) if self.log else np.asarray(values, dtype=float)
        return np.asarray(self.first + (self.last - self.first) * (at - ends[0]) / (ends[1] - ends[0]))

    @property
    def ticks(self) -> list[tuple[float, str]]:
        """Pixels of round values within, and how they are written."""
        return [(float(self(value)), number(value, 4)) for value in self._round_values()]

    @property
    def angles(self) -> list[tuple[float, str]]:
        """The same of loss angles in round degrees, along an axis of loss factors, their tangents."""
        low, high = (math.degrees(math.atan(end)) for end in (self.low, self.high))
        degrees = Axis("", low, high, self.first, self.last)._round_values()
        return [(float(self(math.tan(math.radians(angle)))), number(angle, 4)) for angle in degrees]

    def _round_values(self) -> list[float]:
        values = list[float]()
        if self.log:  # 1, 2 and 5 of each decade within, or the decades alone where these are too many
            powers = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
            every = [(digit, digit * 10.0**power) for power in powers for digit in (1, 2, 5)]
            fine = [(digit, value) for digit, value in every if self.low <= value <= self.high]
            whole = [value for digit, value in fine if digit == 1]
            many = len(fine) > _MOST_TICKS
            values = whole[:: math.ceil(len(whole) / _MOST_TICKS)] if many else [value for _, value in fine]
        if len(values) < 2:
            raw = (self.high - self.low) / 5  # as many ticks, or a few more
            power = 10.0 ** math.floor(math.log10(raw))
            step = power * next(digit for digit in (1, 2, 5, 10) if digit * power >= raw * 0.999)
            values = [step * count for count in range(math.ceil(self.low / step), math.floor(self.high / step) + 1)]
        return values

    @property
    def described(self) -> str:
        """What turns pixels back into values, for the script of the page."""
        ends = (number(x, 9) for x in (self.low, self.high, self.first, self.last))
        return " ".join((*ends, "log" if self.log else "linear"))


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
    angles: bool = False,
) -> Markup:
    """Lines, bands and points over x, which is logarithmic on request, under a legend; y spans `least` or more.

    `alt` tells of the picture those who do not see it; `dot` is the width of a point [pixels]. With `angles`, loss
    factors have the axis of their loss angles [deg] on the right.
    """
    legend, lines = _legend(series, rules)
    top = _LINE * (1 + lines) + 12.0
    levels = np.array([rule.value for rule in rules])
    right = _WIDTH - (_ANGLES if angles else _RIGHT)
    x = Axis.over(labels[0], (own for each in series for own in each.values(0)), _LEFT, right, log=log)
    ys = [*(own for each in series for own in each.values(1)), levels]
    y = Axis.over(labels[1], ys, top + _PANEL, top, least=least)
    drawn = []
    for each in series:
        line = stroke(x(each.line[0]), y(each.line[1])) if each.line else ""
        band = outline(x(each.band[0]), y(each.band[1]), y(each.band[2])) if each.band else ""
        at = zip(x(each.points[0]), y(each.points[1]), strict=True) if each.points else ()
        # points are strokes of no length, which have round ends: a third of the bytes of circles
        drawn.append((each, line, band, "".join(f"M{_pair(a, b)}h0" for a, b in at if math.isfinite(a + b))))
    size = {"width": _WIDTH, "height": top + _PANEL + _BELOW}
    axes = {"x": x, "y": y, "legend": legend, "drawn": drawn, "rules": rules, "dot": dot, "angles": angles}
    return Markup(filled("chart.html", {"title": title, "alt": alt, **size, **axes}))


def _legend(series: Sequence[Series], rules: Sequence[Rule]) -> tuple[list[tuple[Any, ...]], int]:
    """The entries of a legend under the title, and how many lines they take.

    Of each its left end and height [pixels], name, colour, dashes, whether it has a line, and whether points.
    """
    entries = [(each.name, each.color, each.dashes, bool(each.line), bool(each.points)) for each in series if each.name]
    entries += [(rule.name, rule.color, rule.dashes, True, False) for rule in rules if rule.name]
    placed, left, line = [], 4.0, 1
    for entry in entries:
        width = _SWATCH + _LETTER * len(entry[0]) + 10.0
        if left + width > _WIDTH and left > 4.0:
            left, line = 4.0, line + 1
        placed.append((left, 14.0 + _LINE * line, *entry))
        left += width
    return placed, line if entries else 0


def stroke(x: Array, y: Array) -> str:
    """A line through pixels, as SVG writes its path; what is not a number parts it."""
    there = np.isfinite(x) & np.isfinite(y)
    runs = np.split(np.arange(x.size), np.flatnonzero(np.diff(there)) + 1)
    drawn = ("L".join(_pair(x[at], y[at]) for at in run) for run in runs if run.size and there[run[0]])
    return "".join(f"M{run}" for run in drawn)


def outline(x: Array, low: Array, high: Array) -> str:
    """The outline of what lies between two lines."""
    there = np.isfinite(x) & np.isfinite(low) & np.isfinite(high)
    ends = np.concatenate([low[there], high[there][::-1]])
    around = zip(np.concatenate([x[there], x[there][::-1]]), ends, strict=True)
    d = "L".join(f"{a:.1f} {b:.1f}" for a, b in around)
    return f"M{d}" if d else ""


def _pair(x: float, y: float) -> str:
    """A place to a tenth of a pixel."""
    return f"{x:.1f} {y:.1f}".replace(".0 ", " ").removesuffix(".0")


def span_of(values: Array) -> str:
    """Least and largest of the values that are known, in words."""
    known = values[np.isfinite(values)]
    return f"{number(float(known.min()), 3)} to {number(float(known.max()), 3)}" if known.size else "nothing"
