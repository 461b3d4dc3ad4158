"""Predictions to draw, and what a figure shows: its lines, points and texts, and whether these have room."""

from collections.abc import Sequence
from itertools import combinations
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from bushfit.effects.contract import Array
from bushfit.fitting.preparation import MeasuredLoop, MeasuredSweep, MeasuredTest
from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.prediction.stiffness import predict
from bushfit.report.diagnosed import gap_table
from bushfit.report.plots.fits import loops_figure, sweeps_figure
from bushfit.report.plots.gap import gap_figure
from bushfit.report.plots.prediction import prediction_figure
from bushfit.report.plots.style import fixed_settings
from bushfit.report.tables import loops_table, sweeps_table

FREQUENCIES = np.arange(5.0, 156.0, 10.0)
AMPLITUDES = np.array([1e-4, 2e-4, 5e-4])
TORSION = np.radians([0.5, 1.0, 2.0])
#: A picture that is higher does not fit on three pages of A4 [inch].
HIGHEST = 33.0


def sweeps(model: Model, *data_sets: MeasuredSweep) -> Figure:
    return sweeps_figure(Result(model), sweeps_table(model, data_sets), "CMP 15 961")


def loops(model: Model, *data_sets: MeasuredLoop) -> Figure:
    return loops_figure(Result(model), loops_table(model, data_sets), "CMP 15 961")


def prediction(
    result: Result, direction: Direction, *data_sets: MeasuredSweep, amplitudes: Array = AMPLITUDES, note: str = ""
) -> Figure:
    grid = predict(result, direction, FREQUENCIES, amplitudes)
    table = sweeps_table(result.model, data_sets) if data_sets else None
    return prediction_figure(result, grid, table, "CMP 15 961", note)


def gap(
    before: Model,
    after: Model,
    data_sets: Sequence[MeasuredTest],
    corrected: Sequence[MeasuredTest] = (),
    test: str = "",
) -> Figure:
    """The gap of two models of the same tests, or of tests that are corrected in the second."""
    sides = [
        SimpleNamespace(model=before, data_sets=data_sets),
        SimpleNamespace(model=after, data_sets=corrected or data_sets),
    ]
    found = SimpleNamespace(before=sides[0], after=sides[1], result=Result(after))
    added = [name for name in after.effects if name not in before.effects] or [test] * bool(test)
    document = {
        "verdict": "named",
        "summary": "something closes the gap",
        "effects": [{"name": name, "test": test or None} for name in added],
        "gap": {"calibration": {"before": 5.0, "after": 1.0}, "heldout": {"before": 6.0, "after": 1.1}},
    }
    return gap_figure(gap_table(cast("Any", found)), Result(after), document, "mount")


def lines(axes: Axes) -> list[Any]:
    """Lines of a model: neither points nor the zero of a residual."""
    return [line for line in axes.get_lines() if line.get_linestyle() != "None" and len(line.get_xdata()) > 2]


def points(axes: Axes) -> list[Any]:
    return [line for line in axes.get_lines() if line.get_linestyle() == "None"]


def legend(axes: Axes) -> list[str]:
    box = axes.get_legend()
    return [] if box is None else [text.get_text() for text in box.get_texts()]


@fixed_settings()
def whole(figure: Figure, *, apart: bool = True) -> Figure:
    """The figure, once it is seen that nothing leaves it, no panel is too small, and none, with its texts, lies on
    another; `apart` is False for the panels of figures with many levels."""
    figure.draw_without_rendering()
    panels = [box for axes in figure.axes if (box := axes.get_tightbbox())]
    for box in (*panels, *(box.get_window_extent() for axes in figure.axes if (box := axes.get_legend()))):
        assert min(box.x0, box.y0) >= -1
        assert max(box.x1 - figure.bbox.x1, box.y1 - figure.bbox.y1) <= 1
    width, height = figure.get_size_inches()
    assert height < HIGHEST
    for place in (axes.get_position() for axes in figure.axes if axes.axison):
        assert (place.height * height > 0.5, place.width * width > 1.2) == (True, True)
    common = [Bbox.intersection(*pair) for pair in combinations(panels, 2)] if apart else []
    assert not [box for box in common if box is not None and min(box.width, box.height) > 1.0]
    return figure
