"""Pictures of raw files: what is drawn, with which units, nothing clipped, and the same file for the same figure."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from stepped import stepped

from bushfit.geometry import Direction
from bushfit.inspection.opening import inspect
from bushfit.inspection.record import Inspected
from bushfit.model.model import Model
from bushfit.reading.measurement import Loop
from bushfit.reduction.steps import reduce
from bushfit.report.plots import inspection_figure, reduction_figure, to_png


def labels(figure: Figure) -> set[str]:
    return {
        " ".join(label.split()) for axes in figure.axes for label in (axes.get_xlabel(), axes.get_ylabel()) if label
    }


def colliding(figure: Figure) -> list[tuple[str, str]]:
    """Labels of y axes that run into each other or into a panel's title."""
    figure.draw_without_rendering()
    texts = [axes.yaxis.label for axes in figure.axes] + [axes._left_title for axes in figure.axes]
    boxes = [(text.get_text(), text.get_window_extent()) for text in texts if text.get_text()]
    return [(name, other) for (name, box), (other, beside) in combinations(boxes, 2) if box.overlaps(beside)]


def outside(figure: Figure) -> list[str]:
    """Texts that leave the canvas."""
    figure.draw_without_rendering()
    texts = [text for axes in figure.axes for text in (axes.xaxis.label, axes.yaxis.label, axes.title)]
    boxes = [(text.get_text(), text.get_window_extent()) for text in texts if text.get_text()]
    boxes += [("legend", box.get_window_extent()) for axes in figure.axes if (box := axes.get_legend())]
    canvas = figure.bbox
    return [
        name for name, box in boxes
        if box.x0 < -1 or box.x1 > canvas.x1 + 1 or box.y0 < -1 or box.y1 > canvas.y1 + 1
    ]  # fmt: skip


@pytest.mark.parametrize("direction", list(Direction))
def test_reduction(paper_model: Model, direction: Direction) -> None:
    turns = direction.is_rotation
    points = [(f, a * (30.0 if turns else 1.0)) for a in (1e-4, 4e-4) for f in (10.0, 30.0)]
    history = stepped(paper_model, points, direction=direction).history
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
    assert len({to_png(reduction_figure(reduction, [history], "$ raw $.csv")) for _ in range(2)}) == 1


def test_reduction_of_many_histories_draws_the_first(paper_model: Model) -> None:
    history = stepped(paper_model, [(10.0, 1e-4)]).history
    histories = [Loop(str(n), history.direction, history.time, history.displacement, history.force) for n in range(6)]
    figure = reduction_figure(reduce(histories), histories, "six")
    assert len(figure.axes) == 4 + 4
    assert "The first 4 of 6 histories" in " ".join(figure.get_supxlabel().split())
    assert outside(figure) == []


@pytest.fixture(scope="module")
def seen(root: object) -> list[Inspected]:
    names = (
        *("cmp_15961/loop_axial_1.csv", "cmp_15961/sweep_radial.csv"),
        *("cmp_15961_raw/stepped_sine_axial.csv", "arm_bushing/loop_axial_2.csv"),
    )
    return [inspect(root / "data" / name, {}) for name in names]


def test_inspection(seen: list[Inspected]) -> None:
    figure = inspection_figure(seen)
    assert outside(figure) == []
    assert colliding(figure) == []
    assert {"time [s]", "displacement [mm]", "force [N]", "frequency [Hz]", "|K| [N/mm]", "loss factor [-]"} <= labels(
        figure
    )
    titles = [axes.get_title(loc="left") for axes in figure.axes if axes.get_title(loc="left")]
    assert sorted(titles) == sorted(f"{one.file.name}: {one.kind}, {one.direction}" for one in seen)
    assert len({to_png(inspection_figure(seen)) for _ in range(2)}) == 1


def test_one_file_alone_is_whole(seen: list[Inspected]) -> None:
    for one in seen:
        assert outside(inspection_figure([one])) == []


def test_what_is_not_as_it_was_recorded_is_said(root: Path, tmp_path: Path) -> None:
    table = pd.read_csv(root / "data/cmp_15961/loop_axial_1.csv")
    turned, timeless = tmp_path / "turned_axial.csv", tmp_path / "timeless_axial.csv"
    table.assign(**{"force [N]": -table["force [N]"]}).to_csv(turned, index=False)
    table.drop(columns="time [s]").to_csv(timeless, index=False)
    figure = inspection_figure([inspect(turned, {}), inspect(timeless, {"frequency": "0.1 Hz", "waveform": "sine"})])
    titles = [axes.get_title(loc="left") for axes in figure.axes if axes.get_title(loc="left")]
    assert titles == ["turned_axial.csv: loop, axial, force turned, 1 odd", "timeless_axial.csv: loop, axial"]
    assert {"time [s]", "time rebuilt [s]"} <= labels(figure)
    assert outside(figure) == []
