"""Figures: what is drawn, with which units, how much of it, and that the same figure is the same file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import matplotlib
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from bushfit.effects.contract import Array
from bushfit.fitting.data_sets import LoopData, SweepData
from bushfit.geometry import Direction
from bushfit.model.covariance import Covariance
from bushfit.model.model import Model
from bushfit.model.result import Range, Result
from bushfit.prediction import Prediction, predict
from bushfit.report.artifacts import prediction_files
from bushfit.report.plots import fine_grid, loops_figure, prediction_figure, sweeps_figure, to_png

Swept = Callable[..., SweepData]
Looped = Callable[..., LoopData]
FREQUENCIES = np.arange(5.0, 156.0, 10.0)
AMPLITUDES = np.array([1e-4, 2e-4, 5e-4])
TORSION = np.radians([0.5, 1.0, 2.0])


def fitted(model: Model) -> Result:
    names = tuple(model.values)
    return Result(model, names, Covariance(names, np.diag([(0.02 * model.values[name]) ** 2 for name in names])))


def predicted(
    model: Model, direction: Direction, frequencies: Array = FREQUENCIES, amplitudes: Array = AMPLITUDES
) -> tuple[Prediction, Prediction]:
    """A prediction and its curves."""
    prediction = predict(fitted(model), direction, frequencies, amplitudes)
    return prediction, predict(fitted(model), direction, *fine_grid(prediction))


def lines(axes: Axes) -> list[Any]:
    """Lines of a model: neither points nor the zero of a residual."""
    return [line for line in axes.get_lines() if line.get_linestyle() != "None" and len(line.get_xdata()) > 2]


def points(axes: Axes) -> list[Any]:
    return [line for line in axes.get_lines() if line.get_linestyle() == "None"]


def labels(figure: Figure) -> list[str]:
    return [label for axes in figure.axes for label in (axes.get_xlabel(), axes.get_ylabel()) if label]


def legend(axes: Axes) -> list[str]:
    box = axes.get_legend()
    return [] if box is None else [text.get_text() for text in box.get_texts()]


def test_prediction_over_frequency_and_amplitude(paper_model: Model, swept: Swept) -> None:
    prediction, curves = predicted(paper_model, Direction.AXIAL)
    figure = prediction_figure(prediction, [swept(paper_model)], "CMP 15 961", curves=curves, note="A word more.")
    assert labels(figure) == [
        "frequency [Hz]",
        "axial stiffness |K| [N/mm]",
        "frequency [Hz]",
        "axial loss factor [-]",
        "amplitude [mm]",
        "axial stiffness |K| [N/mm]",
        "amplitude [mm]",
        "axial loss factor [-]",
    ]
    assert [len(lines(axes)) for axes in figure.axes] == [3, 3, 4, 4]
    assert legend(figure.axes[1]) == ["0.1 mm", "0.2 mm", "0.5 mm"]
    assert legend(figure.axes[3]) == ["155 Hz", "105 Hz", "55 Hz", "5 Hz"]
    note = " ".join(figure.get_supxlabel().split())
    assert "95 % band" in note
    assert "mean of the repeats" in note
    assert note.endswith("A word more.")
    line = lines(figure.axes[0])[0]
    spot = np.flatnonzero(np.isclose(line.get_xdata(), 5.0))[0]
    assert line.get_ydata()[spot] == pytest.approx(591.0, rel=1e-3)


def test_points_are_means_of_repeats_of_the_same_level_and_direction(paper_model: Model, swept: Swept) -> None:
    prediction, _ = predicted(paper_model, Direction.AXIAL, amplitudes=np.array([2e-4, 3e-4]))
    sweeps = [swept(paper_model), swept(paper_model, Direction.RADIAL)]
    axes = prediction_figure(prediction, sweeps, "").axes[0]
    (drawn,) = points(axes)
    data_set = sweeps[0]
    at = (data_set.amplitude == 2e-4) & (data_set.frequency == 55.0)
    middle = 1e-3 * np.abs(data_set.measured[at]).mean()
    assert drawn.get_ydata()[FREQUENCIES == 55.0][0] == pytest.approx(middle, rel=1e-12)
    radial = predicted(paper_model, Direction.TORSION, amplitudes=TORSION)[0]
    assert "measured" not in prediction_figure(radial, sweeps, "").get_supxlabel()


def test_points_lie_on_lines_with_the_rig_and_the_bushing_stands_apart(
    paper_model: Model, swept: Swept, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As `run` draws them: a rig that gives way makes the points softer, and that is no failed fit."""
    rigged = paper_model.with_effect("rig_compliance", {"rig_compliance.compliance": 2e-8})
    result = replace(fitted(rigged), measured=Range((5.0, 155.0), (1e-3, 0.2), (Direction.AXIAL,)))
    drawn: list[Figure] = []
    monkeypatch.setattr("bushfit.report.plots.to_png", lambda figure: drawn.append(figure) or b"")
    predictions = [
        predict(result, direction, FREQUENCIES, AMPLITUDES) for direction in (Direction.RADIAL, Direction.AXIAL)
    ]
    prediction_files(result, predictions, [swept(rigged, Direction.RADIAL)], {"png"})
    radial, axial = drawn
    for axes, share in ((radial.axes[0], 4.0), (radial.axes[2], 4.0)):
        plain, rig = ([line for line in lines(axes) if (line.get_linewidth() < 1.0) is thin] for thin in (False, True))
        assert len(plain) == len(rig) == len(points(axes))
        for own, seen, spots in zip(plain, rig, points(axes), strict=True):
            there = np.interp(spots.get_xdata(), seen.get_xdata(), seen.get_ydata())
            np.testing.assert_allclose(spots.get_ydata(), there, rtol=0.03)
            assert np.all(own.get_ydata() > (1.0 + share / 100.0) * seen.get_ydata())
    assert legend(radial.axes[1])[3:] == ["bushing", "with the rig"]
    note = " ".join(radial.get_supxlabel().split())
    assert "Thin lines: the same with what belongs to the rig" in note
    assert "Radial: not fitted; its band holds the scatter of the axial tests" in note
    assert "hin lines" not in axial.get_supxlabel()
    assert legend(axial.axes[1]) == ["0.1 mm", "0.2 mm", "0.5 mm"]


def test_one_amplitude_or_one_frequency_leaves_one_row(paper_model: Model) -> None:
    for frequencies, amplitudes, along in (
        (FREQUENCIES, AMPLITUDES[:1], "frequency [Hz]"),
        (FREQUENCIES[:1], AMPLITUDES, "amplitude [mm]"),
        (FREQUENCIES[:1], AMPLITUDES[:1], "frequency [Hz]"),
    ):
        prediction, curves = predicted(paper_model, Direction.RADIAL, frequencies, amplitudes)
        figure = prediction_figure(prediction, [], "one", curves=curves)
        assert [axes.get_xlabel() for axes in figure.axes] == [along, along]
        to_png(figure)


def test_at_most_six_amplitudes_and_four_frequencies(paper_model: Model) -> None:
    prediction, curves = predicted(paper_model, Direction.AXIAL, amplitudes=np.geomspace(1e-5, 1e-3, 20))
    figure = prediction_figure(prediction, [], "many", curves=curves)
    assert [len(lines(axes)) for axes in figure.axes] == [6, 6, 4, 4]


def test_units_follow_direction_and_size(
    paper_model: Model, other_models: dict[str, Model], swept: Swept, looped: Looped
) -> None:
    prediction, _ = predicted(paper_model, Direction.TORSION, amplitudes=TORSION)
    figure = prediction_figure(prediction, [swept(paper_model, Direction.TORSION, amplitudes=TORSION)], "torsion")
    assert "torsion stiffness |K| [N m/rad]" in labels(figure)
    assert "amplitude [deg]" in labels(figure)
    assert legend(figure.axes[1]) == ["0.5 deg", "1 deg", "2 deg"]
    stiff = predicted(other_models["stiff and thin"], Direction.RADIAL)[0]
    assert "radial stiffness |K| [kN/mm]" in labels(prediction_figure(stiff, [], "stiff"))
    loops = labels(loops_figure(paper_model, [looped(paper_model, 0.1, direction=Direction.TORSION)], "torsion"))
    assert loops[:2] == ["rotation [deg]", "torsion moment [N m]"]


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
    to_png(figure)
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
    to_png(twins)


@pytest.mark.parametrize("run_in", [0, 5])
def test_long_loops_are_drawn_thin(paper_model: Model, run_in: int, looped: Looped) -> None:
    data_set = looped(paper_model, 1e-3, cycles=40, run_in=run_in)
    assert data_set.test.force.size > 40_000
    figure = loops_figure(paper_model, [data_set], "long")
    assert max(len(line.get_xdata()) for axes in figure.axes for line in (*lines(axes), *points(axes))) <= 1600
    model_line = lines(figure.axes[0])[0]
    step = np.hypot(np.diff(model_line.get_xdata()), np.diff(model_line.get_ydata()) / 458.0)
    assert np.nanmax(step) < 0.1, "a stroke across the cycles that are left out"


def test_same_figure_same_bytes_and_no_trace_of_when_or_with_what(paper_model: Model, swept: Swept) -> None:
    prediction, curves = predicted(paper_model, Direction.AXIAL)
    settings = dict(matplotlib.rcParams)
    pictures = {
        to_png(prediction_figure(prediction, [swept(paper_model)], "CMP 15 961", curves=curves)) for _ in range(2)
    }
    assert len(pictures) == 1
    assert pictures.pop()[:8] == b"\x89PNG\r\n\x1a\n"
    assert dict(matplotlib.rcParams) == settings
    picture = to_png(prediction_figure(prediction, [], "x"))
    assert not any(chunk in picture for chunk in (b"tEXt", b"iTXt", b"zTXt", b"tIME", b"Matplotlib"))


@pytest.mark.parametrize("title", ["price in $ and 50 %, a_b^c\\", "衬套 61 Shore A", "x" * 300, ""])
def test_any_name_can_be_a_title(paper_model: Model, title: str) -> None:
    prediction, _ = predicted(paper_model, Direction.AXIAL)
    assert to_png(prediction_figure(prediction, [], title))


def test_no_text_lies_on_another(paper_model: Model, swept: Swept, looped: Looped) -> None:
    prediction, curves = predicted(paper_model, Direction.AXIAL, amplitudes=np.geomspace(1e-5, 1e-3, 6))
    for figure in (
        prediction_figure(prediction, [swept(paper_model)], "CMP 15 961", curves=curves),
        sweeps_figure(paper_model, [swept(paper_model), swept(paper_model, Direction.RADIAL)], "CMP 15 961"),
        loops_figure(paper_model, [looped(paper_model, 1e-3), looped(paper_model, 5e-4)], "CMP 15 961"),
    ):
        figure.draw_without_rendering()
        boxes = [axes.get_tightbbox() for axes in figure.axes]
        assert not any(
            overlap(one, other) for number, one in enumerate(boxes) for other in boxes[:number] if one and other
        )
        canvas = figure.bbox
        assert all(box is not None and box.x0 >= 0 and box.x1 <= canvas.x1 + 1 for box in boxes)


def overlap(one: Bbox, other: Bbox) -> bool:
    common = Bbox.intersection(one, other)
    return common is not None and common.width > 1.0 and common.height > 1.0
