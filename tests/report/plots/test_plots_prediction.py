"""Figures of predictions: what is drawn, with which units, and how much of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from figures import (
    AMPLITUDES,
    FREQUENCIES,
    TORSION,
    Looped,
    Swept,
    fitted,
    labels,
    legend,
    lines,
    note,
    points,
    predicted,
    whole,
)

from bushfit.fitting.data_sets import sweep_data
from bushfit.geometry import Direction
from bushfit.jobs.grid import default_grid
from bushfit.model.model import Model
from bushfit.model.result import Range, Result
from bushfit.prediction import predict
from bushfit.reading.measurement import Sweep
from bushfit.report.artifacts import prediction_contents
from bushfit.report.plots.fits import loops_figure
from bushfit.report.plots.prediction import prediction_figure


def test_prediction_over_frequency_and_amplitude(paper_model: Model, swept: Swept) -> None:
    prediction, curves = predicted(paper_model, Direction.AXIAL)
    figure = prediction_figure(prediction, [swept(paper_model)], "CMP 15 961", curves=curves, note="A word more.")
    shown = ("axial stiffness |K| [N/mm]", "axial loss factor [-]")
    assert labels(figure) == [each for x in ("frequency [Hz]", "amplitude [mm]") for y in shown for each in (x, y)]
    assert [len(lines(axes)) for axes in figure.axes] == [3, 3, 4, 4]
    assert legend(figure.axes[1]) == ["0.1 mm", "0.2 mm", "0.5 mm"]
    assert legend(figure.axes[3]) == ["155 Hz", "105 Hz", "55 Hz", "5 Hz"]
    for words in ("95 % band", "mean of the repeats", "A word more."):
        assert words in note(figure)
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
    assert "measured" not in note(prediction_figure(radial, sweeps, ""))


def test_points_of_a_level_that_each_file_reached_a_little_differently_are_all_drawn(paper_model: Model) -> None:
    levels = np.array([0.02, 0.05, 0.1, 0.2, 0.5, 1.0]) * 1e-3
    files = [
        Sweep(
            f"{f:g} Hz", Direction.AXIAL, np.full(6, f), at, paper_model.stiffness("axial", f, at), stepped="amplitude"
        )
        for f, at in ((1.0, 0.98 * levels), (10.0, levels), (50.0, 1.02 * levels))
    ]
    prediction = predict(
        Result(paper_model), Direction.AXIAL, *default_grid(Result(paper_model), Direction.AXIAL, files)
    )
    for axes in prediction_figure(prediction, sweep_data(files), "").axes:
        assert sum(len(line.get_xdata()) for line in points(axes)) == 18


def test_points_lie_on_lines_with_the_rig_and_the_bushing_stands_apart(paper_model: Model, swept: Swept) -> None:
    """As `run` draws them: a rig that gives way makes the points softer, and that is no failed fit."""
    rigged = paper_model.with_effect("rig_compliance", {"rig_compliance.compliance": 2e-8})
    result = replace(fitted(rigged), measured=Range((5.0, 155.0), (1e-3, 0.2), (Direction.AXIAL,)))
    predictions = [
        predict(result, direction, FREQUENCIES, AMPLITUDES) for direction in (Direction.RADIAL, Direction.AXIAL)
    ]
    pictures = prediction_contents(result, predictions, [swept(rigged, Direction.RADIAL)]).pictures
    radial, axial = (picture() for picture in pictures.values())
    for axes, share in ((radial.axes[0], 4.0), (radial.axes[2], 4.0)):
        plain, rig = ([line for line in lines(axes) if (line.get_linewidth() < 1.0) is thin] for thin in (False, True))
        assert len(plain) == len(rig) == len(points(axes))
        for own, seen, spots in zip(plain, rig, points(axes), strict=True):
            there = np.interp(spots.get_xdata(), seen.get_xdata(), seen.get_ydata())
            np.testing.assert_allclose(spots.get_ydata(), there, rtol=0.03)
            assert np.all(own.get_ydata() > (1.0 + share / 100.0) * seen.get_ydata())
    assert legend(radial.axes[1])[3:] == ["bushing", "with the rig"]
    assert "Thin lines: the same with what belongs to the rig" in note(radial)
    assert "Radial: not fitted; its band holds the scatter of the axial tests" in note(radial)
    assert "hin lines" not in note(axial)
    assert legend(axial.axes[1]) == ["0.1 mm", "0.2 mm", "0.5 mm"]


def test_what_may_be_the_rigs_has_a_double_line_that_the_legend_names(paper_model: Model, swept: Swept) -> None:
    flexing = paper_model.with_effect("sleeve_compliance", {"sleeve_compliance.compliance": 2e-8})
    result = replace(fitted(flexing), unresolved=("sleeve_compliance",))
    curves = predict(result, Direction.RADIAL, FREQUENCIES, AMPLITUDES)
    figure = prediction_figure(curves, [swept(flexing, Direction.RADIAL)], "")
    for axes, count in zip(figure.axes[::2], (3, 4), strict=True):
        drawn = ([line for line in lines(axes) if line.get_linewidth() == width] for width in (1.3, 2.4, 0.7))
        own, double, core = drawn
        assert len(own) == len(double) == len(core) == count
        for bushing, other, white in zip(own, double, core, strict=True):
            assert np.all(other.get_ydata() > 1.02 * bushing.get_ydata())
            np.testing.assert_array_equal(other.get_ydata(), white.get_ydata())
    assert legend(figure.axes[1])[3:] == ["bushing", "if it is the rig's"]
    assert "Double lines: the same if it is the rig's" in note(figure)


def test_one_amplitude_or_one_frequency_leaves_one_row_and_many_leave_six_and_four_lines(paper_model: Model) -> None:
    for frequencies, amplitudes, along in (
        (FREQUENCIES, AMPLITUDES[:1], "frequency [Hz]"),
        (FREQUENCIES[:1], AMPLITUDES, "amplitude [mm]"),
        (FREQUENCIES[:1], AMPLITUDES[:1], "frequency [Hz]"),
    ):
        prediction, curves = predicted(paper_model, Direction.RADIAL, frequencies, amplitudes)
        figure = prediction_figure(prediction, [], "one", curves=curves)
        assert [axes.get_xlabel() for axes in whole(figure).axes] == [along, along]
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
