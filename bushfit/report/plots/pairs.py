"""Pairs of panels: stiffness magnitude (left) and loss factor (right) of one direction or specimen."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from bushfit.effects.contract import Array
from bushfit.geometry import Place
from bushfit.reading.measurement import loss_factor
from bushfit.report.plots import style
from bushfit.report.tables import response_headers
from bushfit.units import display_unit

#: Curves of more points than this are drawn with small dots.
_MANY_POINTS = 60
#: Number of points of a panel above which curves are thinned, and smallest number of points of a thinned curve.
_PANEL_POINTS, _CURVE_POINTS = 480, 24


class ResponsePair:
    """Two panels with the stiffness magnitude (left) and the loss factor (right) of a direction or specimen.

    Args:
        panels: left and right panel.
        place: direction or specimen of the tests.
        largest: largest stiffness or modulus to draw [SI], which determines the unit.
        x_label: label of the x axes, with unit.
        x: values along x, which decide between linear and logarithmic axes, (n,); None for linear.

    Attributes:
        panels: left and right panel.
        factor: factor from SI to the unit of the left panel.
    """

    def __init__(
        self, panels: Sequence[Axes], place: Place, largest: float, x_label: str, x: Array | None = None
    ) -> None:
        self.panels = panels
        unit, self.factor = display_unit(*place.display.stiffness, largest)
        quantity = response_headers(place)[1].partition(" [")[0]
        symbol = " |K|" if quantity == "stiffness" else ""
        style.label_axes(panels[0], x_label, f"{place} {quantity}{symbol} [{unit}]", x)
        style.label_axes(panels[1], x_label, f"{place} loss factor [-]", x)

    def values(self, stiffness: Array) -> tuple[Array, Array]:
        """Stiffness magnitude in the unit of the left panel, and loss factor, (n,) each, of complex stiffness [SI]."""
        return self.factor * np.abs(stiffness), loss_factor(stiffness)

    def plot(self, x: Array, stiffness: Array, *form: str, **options: Any) -> None:
        """Draw complex stiffnesses as lines or markers.

        Args:
            x: values along x in the unit of the panels, (n,).
            stiffness: complex stiffness [SI], (n,).
            form: format of the line, as matplotlib takes it.
            **options: properties of the line, as matplotlib takes them.
        """
        for axes, values in zip(self.panels, self.values(stiffness), strict=True):
            axes.plot(x, values, *form, **options)

    def draw_bands(self, x: Array, bands: Sequence[Array], look: style.Style, **options: Any) -> None:
        """Draw a predicted stiffness and loss factor as lines in their shaded 95 % bands.

        Args:
            x: values along x in the unit of the panels, (n,).
            bands: value, low and high end of the stiffness magnitude [SI], (3, n), and of the loss factor, (3, n).
            look: colour and line style.
            **options: further properties of the lines.
        """
        for axes, band, scale in zip(self.panels, bands, (self.factor, 1.0), strict=True):
            style.draw_band(axes, x, scale * band, look, **options)

    def draw_points(self, x: Array, stiffness: Array, look: style.Style, curves: int) -> None:
        """Draw the measured points of one curve: means of repeats, with bars from the smallest to the largest value.

        Args:
            x: values along x in the unit of the panels, (n,).
            stiffness: measured complex stiffness [SI], (n,).
            look: colour and marker of the points.
            curves: number of curves in a panel; the more there are, the more points are omitted.
        """
        for axes, values in zip(self.panels, self.values(stiffness), strict=True):
            repeats = pd.Series(values).groupby(x)
            step = stride(repeats.ngroups, curves)
            means, low, high = (points[::step] for points in (repeats.mean(), repeats.min(), repeats.max()))
            if repeats.ngroups < len(x):
                axes.vlines(means.index, low, high, color=look.color, lw=0.7, alpha=0.7)
            points = style.POINT if repeats.ngroups <= _MANY_POINTS else style.DOT | {"alpha": 0.5}
            axes.plot(means.index, means, look.marker, color=look.color, **points)


def stride(points: int, curves: int) -> int:
    """Step in which the points of a curve are drawn, so that a panel with this number of curves is not crowded."""
    return max(1, math.ceil(points / max(_CURVE_POINTS, _PANEL_POINTS // curves)))
