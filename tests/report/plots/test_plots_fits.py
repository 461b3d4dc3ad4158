"""Figures of fits: sweeps and loops beside their model, with residuals."""

from __future__ import annotations

import numpy as np
import pytest
from figures import FREQUENCIES, Looped, Swept, labels, legend, lines, points

from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.report.plots.fits import loops_figure, sweeps_figure
from bushfit.report.plots.style import to_image


def test_sweeps_have_a_row_a_direction_and_residuals(paper_model: Model, swept: Swept) -> None:
    wide = swept(paper_model, Direction.RADIAL, np.geomspace(0.1, 300.0, 12), np.geomspace(1e-5, 5e-4, 5), repeats=1)
    figure = sweeps_figure(paper_model, [swept(paper_model), wide], "CMP 15 961")
    assert labels(figure).count("frequency [Hz]") == 4
    assert [axes.get_ylabel() for axes in figure.axes[:4]] == [
        "axial stiffness |K| [N/mm]",
        "axial loss factor [-]",
        "gain residual\n/ noise",
        "phase residual\n/ noise",
    ]
    assert [len(lines(axes)) for axes in figure.axes] == [3, 3, 0, 0, 5, 5, 0, 0]
    assert sum(len(line.get_xdata()) for line in points(figure.axes[2])) == 3 * 3 * FREQUENCIES.size
    to_image(figure)
    assert figure.axes[4].get_xscale() == figure.axes[6].get_xscale() == "log"
    assert figure.axes[4].get_xlim() == figure.axes[6].get_xlim()


def test_loops_show_model_and_residuals(paper_model: Model, looped: Looped) -> None:
    data_sets = [looped(paper_model, 1e-3), looped(paper_model, 5e-4, run_in=3)]
    figure = loops_figure(paper_model, data_sets, "CMP 15 961")
    assert labels(figure) == [
        "displacement [mm]",
        "axial force [N]",
        "phase after the upper turn [deg]",
        "residual / noise",
    ]
    assert [len(lines(axes)) for axes in figure.axes] == [2, 2]
    assert legend(figure.axes[1]) == ["1 mm, 0.1 Hz", "0.5 mm, 0.1 Hz", "model"]
    peak = max(np.nanmax(line.get_ydata()) for line in lines(figure.axes[0]))
    assert peak == pytest.approx(458.0, rel=0.02)
    twins = loops_figure(paper_model, [data_sets[0], data_sets[0]], "twins")
    assert legend(twins.axes[1])[0] == "1 mm, 0.1 Hz\n\\$ loop \\$.csv"
    to_image(twins)


@pytest.mark.parametrize("run_in", [0, 5])
def test_long_loops_are_drawn_thin(paper_model: Model, run_in: int, looped: Looped) -> None:
    data_set = looped(paper_model, 1e-3, cycles=40, run_in=run_in)
    assert data_set.test.force.size > 40_000
    figure = loops_figure(paper_model, [data_set], "long")
    assert max(len(line.get_xdata()) for axes in figure.axes for line in (*lines(axes), *points(axes))) <= 1600
    model_line = lines(figure.axes[0])[0]
    step = np.hypot(np.diff(model_line.get_xdata()), np.diff(model_line.get_ydata()) / 458.0)
    assert np.nanmax(step) < 0.1, "a stroke across the cycles that are left out"
