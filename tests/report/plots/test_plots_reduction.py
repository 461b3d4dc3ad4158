"""Figures of reduced histories: what is drawn, with which units, nothing clipped."""

from __future__ import annotations

import numpy as np
import pytest
from rawfigures import colliding, labels, outside
from stepped import stepped

from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.reading.measurement import Loop
from bushfit.reduction.steps import reduce
from bushfit.report.plots.reduction import reduction_figure
from bushfit.report.plots.style import to_image


@pytest.mark.parametrize("direction", list(Direction))
def test_reduction(paper_model: Model, direction: Direction) -> None:
    turns = direction.is_rotation
    points = [(f, a * (30.0 if turns else 1.0)) for a in (1e-4, 4e-4) for f in (10.0, 30.0)]
    history = stepped(paper_model, points, direction=direction)
    reduction = reduce([history])
    figure = reduction_figure(reduction, [history], "$ raw $.csv")
    assert outside(figure) == []
    assert colliding(figure) == []
    shown = labels(figure)
    legend = figure.axes[2].get_legend()
    assert legend is not None
    unit, length = ("deg", 180.0 / np.pi) if turns else ("mm", 1e3)
    levels = sorted({step.level for step in reduction.steps})
    assert [text.get_text() for text in legend.get_texts()] == [f"{length * level:.4g} {unit}" for level in levels]
    assert all(axes.get_title(loc="left") == "" for axes in figure.axes), "the title names one history"
    assert {"time [s]", "frequency [Hz]", "noise [%]", "distortion [%]"} <= shown
    assert f"{direction} stiffness |K| [{'N m/rad' if turns else 'N/mm'}]" in shown
    assert ("rotation [deg]" if turns else "displacement [mm]") in shown
    loss = figure.axes[2]
    drawn = np.concatenate([line.get_ydata() for line in loss.get_lines() if line.get_linestyle() == "None"])
    np.testing.assert_allclose(np.sort(drawn), np.sort([step.loss_factor for step in reduction.steps]))
    assert len({to_image(reduction_figure(reduction, [history], "$ raw $.csv")) for _ in range(2)}) == 1


def test_reduction_of_many_histories_draws_the_first(paper_model: Model) -> None:
    history = stepped(paper_model, [(10.0, 1e-4)])
    histories = [Loop(str(n), history.direction, history.time, history.displacement, history.force) for n in range(6)]
    figure = reduction_figure(reduce(histories), histories, "six")
    assert len(figure.axes) == 4 + 4
    assert "The first 4 of 6 histories" in " ".join(figure.get_supxlabel().split())
    assert outside(figure) == []
