"""Which values of the five parameters go together: confidence ellipses of each pair, by the fit's covariance."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from markupsafe import Markup
from scipy.special import fdtri

from bushfit.model.model import FIVE
from bushfit.model.result import Result
from bushfit.report.page import filled
from bushfit.report.parameters import Row, parameter_rows

#: Side of a cell, the way from one to the next, and the room left for the ends of intervals [pixels].
_CELL, _PITCH, _LEFT, _TOP = 76.0, 80.0, 52.0, 26.0
#: Half a cell is so many times an ellipse that touches both edges.
_ROOM = 1.12
#: Corners of an ellipse as it is drawn.
_CORNERS = 48
#: Way from the middle of a cell to the ends of an interval of well known errors, as a share of its side.
_END = 0.5 * 1.96 / (2.45 * _ROOM)


def corner(result: Result) -> Markup | None:
    """Ellipses that hold two parameters at once with 95 %, in the coordinates of the fit; None of fewer than two.

    Notes: a strictly positive parameter is fitted by its logarithm, in which the ellipse is one; its radius is
    sqrt(2 F(0.95; 2, nu)) standard errors, nu the degrees of freedom of the errors (Satterthwaite).
    """
    rows = [row for row in parameter_rows(replace(result, profile={})) if row.name in FIVE]
    known = [row.name for row in rows if row.error and result.covariance.stderr(row.name)]
    if len(known) < 2:
        return None
    correlation = {frozenset(pair): size for *pair, size in result.covariance.correlations()}
    cells, told = [], []
    for down, low in enumerate(rows):
        for across, left in enumerate(rows[:down]):
            at = _LEFT + _PITCH * across, _TOP + _PITCH * down
            if low.name in known and left.name in known:
                size = correlation[frozenset((left.name, low.name))]
                cells.append((*at, *_drawn(result, (left.name, low.name), size, *at), f"{size:+.2f}", abs(size) > 0.9))
                told.append(f"{left.name}/{low.name} {size:+.2f}")
            else:
                cells.append((*at, "", "", "", False))
    unknown = [f"{row.name}: {' '.join(words)}" for row in rows if (words := _untold(row, result))]
    diagonal = []
    for n, row in enumerate(rows):
        lines = filter(None, (row.value, f"± {row.error}" if row.error else "", row.unit.replace("-", "")))
        diagonal.append((_LEFT + _PITCH * n, _TOP + _PITCH * n, row.name, [*lines], _untold(row, result)))
    alt = f"95 % confidence ellipses of pairs of parameters; correlations {', '.join(told)}"
    context = {
        "title": "Which values go together",
        "alt": "; ".join([alt, *unknown]),
        "width": _LEFT + _PITCH * len(FIVE),
        "height": _TOP + _PITCH * len(rows) + 18.0,
        "cells": cells,
        "side": _CELL,
        "pitch": _PITCH,
        "diagonal": diagonal,
        "ends": [*_ends(rows)],
    }
    return Markup(filled("corner.html", context))


def _untold(row: Row, result: Result) -> Sequence[str]:
    """In short lines what the tests do not tell of a parameter; none where they tell its value."""
    if not row.error:
        return row.state or "at least value", "no information"
    wide = result.covariance.half(row.name) >= abs(result.model.values[row.name])
    return ("unknown by", "100 % or more") if wide else ()


def _drawn(result: Result, pair: tuple[str, str], correlation: float, left: float, top: float) -> tuple[str, str]:
    """The ellipse of a pair in its cell, and the 95 % intervals of either alone."""
    covariance = result.covariance
    chosen = np.array(covariance.names)[:, None] == np.array(pair)
    radius = np.sqrt(2.0 * fdtri(2.0, covariance.freedom(chosen).min(), 0.95))
    scale = _CELL / 2.0 / (_ROOM * radius)
    angle = np.linspace(0.0, 2.0 * np.pi, _CORNERS, endpoint=False)
    x, y = np.cos(angle), correlation * np.cos(angle) + np.sqrt(max(1.0 - correlation**2, 0.0)) * np.sin(angle)
    middle = left + _CELL / 2.0, top + _CELL / 2.0
    corners = zip(middle[0] + scale * radius * x, middle[1] - scale * radius * y, strict=True)
    outline = "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in corners) + "Z"
    half = [scale * covariance.half(name) / (covariance.stderr(name) or np.inf) for name in pair]
    rules = [f"M{middle[0] + side * half[0]:.1f} {top:.1f}v{_CELL:.1f}" for side in (-1.0, 1.0)]
    rules += [f"M{left:.1f} {middle[1] + side * half[1]:.1f}h{_CELL:.1f}" for side in (-1.0, 1.0)]
    return outline, "".join(rules)


def _ends(rows: Sequence[Row]) -> Iterator[tuple[float, float, str, str]]:
    """Where the ends of the intervals stand beside the cells: below the columns, left of the rows."""
    for n, row in enumerate(rows):
        low, _, high = row.interval.partition(" to ")
        place = _PITCH * n + _CELL / 2.0
        for sign, end, anchor in ((-1.0, low, "start"), (1.0, high, "end")):
            if n < len(rows) - 1:
                yield _LEFT + place + 0.5 * sign * _CELL, _TOP + _PITCH * len(rows) + 10.0, end, anchor
            if n:
                yield _LEFT - 5.0, _TOP + place - _END * sign * _CELL + 4.0, end, "end"
