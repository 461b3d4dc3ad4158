"""SVG and the axes of a picture: every text is escaped, every style is an attribute.

Pages are shown where style sheets and scripts are forbidden, too: by Jenkins, in mail. There attributes still hold.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup, escape

from bushfit.effects.contract import Array
from bushfit.units import number

#: Colour of text and of axes; on white its contrast is 15 to 1.
INK = "#222222"
#: Colour of what explains; on white its contrast is 7 to 1.
GREY = "#595959"
#: Colour of grids.
_FAINT = "#dddddd"
#: Fonts of pictures, as of the page.
_FONTS = "system-ui, Segoe UI, Helvetica, Arial, sans-serif"
#: Ticks of an axis at about this count.
_TICKS = 5
#: Most ticks of a logarithmic axis with 1, 2 and 5 of each decade.
_MOST_TICKS = 7
#: Free space beyond the data on a linear axis, as a share of their span.
_MARGIN = 0.05
#: Digits of a tick.
_DIGITS = 4


def tag(name: str, *children: str, **attributes: object) -> Markup:
    """An element with its attributes, `_` in whose names stands for `-`; texts and values are escaped."""
    written = "".join(f' {key.rstrip("_").replace("_", "-")}="{escape(value)}"' for key, value in attributes.items())
    inside = "".join(escape(child) for child in children)
    return Markup(f"<{name}{written}>{inside}</{name}>" if inside else f"<{name}{written}/>")


def text(x: float, y: float, words: str, **attributes: object) -> Markup:
    """A line of text at a place."""
    return tag("text", words, x=_short(x), y=_short(y), **attributes)


def path(x: Array, y: Array, **attributes: object) -> Markup:
    """A line through points, given in pixels; nothing where there is none. What is not a number parts it."""
    there = np.isfinite(x) & np.isfinite(y)
    runs = np.split(np.arange(x.size), np.flatnonzero(np.diff(there)) + 1)
    drawn = ("L".join(f"{_short(x[at])} {_short(y[at])}" for at in run) for run in runs if run.size and there[run[0]])
    d = "".join(f"M{run}" for run in drawn)
    return tag("path", d=d, fill="none", **attributes) if d else Markup()


def dots(x: Array, y: Array, color: str, size: float) -> Markup:
    """Points, given in pixels, as strokes of no length with round ends: a third of the bytes of circles."""
    d = "".join(f"M{_short(float(a))} {_short(float(b))}h0" for a, b in zip(x, y, strict=True) if math.isfinite(a + b))
    attributes = {"stroke": color, "stroke_width": size, "stroke_linecap": "round", "data_of": "measured"}
    return tag("path", d=d, fill="none", **attributes) if d else Markup()


def picture(width: float, height: float, alt: str, *children: str, **attributes: object) -> Markup:
    """A whole picture, which those who do not see it are told of by `alt`."""
    return tag(
        "svg",
        *children,
        xmlns="http://www.w3.org/2000/svg",
        viewBox=f"0 0 {_short(width)} {_short(height)}",
        width=_short(width),
        height=_short(height),
        role="img",
        aria_label=alt,
        font_family=_FONTS,
        font_size=12,
        fill=INK,
        **attributes,
    )


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
    ) -> Axis:
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
        """Round values within, and how they are written."""
        if self.log:
            powers = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
            fine = [digit * 10.0**power for power in powers for digit in (1, 2, 5)]
            inside = [tick for tick in fine if self.low <= tick <= self.high]
            if len(inside) > _MOST_TICKS:
                decades = [tick for tick in inside if math.isclose(math.log10(tick) % 1.0, 0.0, abs_tol=1e-9)]
                inside = decades[:: math.ceil(len(decades) / _MOST_TICKS)]
            if len(inside) > 1:
                return [(tick, number(tick, _DIGITS)) for tick in inside]
        raw = (self.high - self.low) / _TICKS
        power = 10.0 ** math.floor(math.log10(raw))
        step = power * next(digit for digit in (1, 2, 5, 10) if digit * power >= raw * 0.999)
        inside = [step * count for count in range(math.ceil(self.low / step), math.floor(self.high / step) + 1)]
        return [(tick, number(round(tick / step) * step, _DIGITS)) for tick in inside]

    @property
    def described(self) -> str:
        """What turns pixels back into values, for the script of the page."""
        ends = (number(x, 9) for x in (self.low, self.high, self.first, self.last))
        return " ".join((*ends, "log" if self.log else "linear"))


def axes(x: Axis, y: Axis) -> list[Markup]:
    """Grid, ticks and labels of a panel."""
    drawn = []
    for tick, words in y.ticks:
        at = float(y(tick))
        drawn.append(path(np.array([x.first, x.last]), np.array([at, at]), stroke=_FAINT))
        drawn.append(text(x.first - 6, at + 4, words, text_anchor="end"))
    for tick, words in x.ticks:
        at = float(x(tick))
        drawn.append(path(np.array([at, at]), np.array([y.first, y.last]), stroke=_FAINT))
        drawn.append(text(at, y.first + 16, words, text_anchor="middle"))
    corner = np.array([x.first, x.first, x.last]), np.array([y.last, y.first, y.first])
    drawn.append(path(*corner, stroke=GREY))
    drawn.append(text((x.first + x.last) / 2, y.first + 34, x.label, text_anchor="middle", fill=GREY))
    middle = _short((y.first + y.last) / 2)
    drawn.append(text(0, 0, y.label, text_anchor="middle", fill=GREY, transform=f"translate(13 {middle}) rotate(-90)"))
    return drawn


def _short(value: float) -> str:
    """A number of pixels to a tenth."""
    return f"{value:.1f}".removesuffix(".0")
