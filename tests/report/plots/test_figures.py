"""Figures of predictions, fits, raw files, reductions and Maxwell arms, and what all figures share."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from figures import (
    AMPLITUDES,
    FREQUENCIES,
    TORSION,
    Looped,
    Swept,
    fitted,
    inside,
    labels,
    legend,
    lines,
    note,
    points,
    predicted,
    titles,
    whole,
)
from matplotlib.figure import Figure
from stepped import stepped
from tries import some

from bushfit.fitting.data_sets import sweep_data
from bushfit.geometry import Direction
from bushfit.inspection.opening import inspect
from bushfit.inspection.record import Inspected
from bushfit.jobs.grid import default_grid
from bushfit.model.arms import model_arms
from bushfit.model.model import Model
from bushfit.model.result import Range, Result
from bushfit.prediction.stiffness import predict
from bushfit.reading.measurement import Sweep
from bushfit.reduction.steps import reduce
from bushfit.report.artifacts import prediction_contents
from bushfit.report.plots.arms import arms_figure
from bushfit.report.plots.fits import loops_figure, sweeps_figure
from bushfit.report.plots.inspection import inspection_figure
from bushfit.report.plots.prediction import prediction_figure
from bushfit.report.plots.reduction import reduction_figure
from bushfit.report.plots.style import label_axes


@pytest.mark.parametrize(
    "backend", some(["module://matplotlib_inline.backend_inline", "no such backend"], {"no such backend"})
)
def test_a_backend_that_is_not_installed_does_not_matter(root: Path, tmp_path: Path, backend: str) -> None:
    """As a notebook sets it for every command that is run from a cell."""
    command = "from bushfit.cli import main; main()"
    arguments = ("fit-static", root / "configs/cmp_15961.toml", "-o", tmp_path / "results")
    environment = {**os.environ, "MPLBACKEND": backend}
    subprocess.run([sys.executable, "-c", command, *arguments], env=environment, check=True)
    assert (tmp_path / "results/loops.png").is_file()


def test_the_name_of_a_panel_is_in_lines_no_higher_than_the_panel() -> None:
    axes = Figure().add_subplot()
    for label, parts in (
        ("axial stiffness |K| [N/mm]", ["axial stiffness |K| [N/mm]"]),
        ("torsion stiffness |K| [N m/deg]", ["torsion stiffness |K|", "[N\u00a0m/deg]"]),
        ("DMA, second specimen modulus [MPa]", ["DMA, second specimen", "modulus [MPa]"]),
    ):
        label_axes(axes, "", label)
        assert axes.get_ylabel().splitlines() == parts


def test_sweeps_have_a_row_a_direction_and_residuals(paper_model: Model, swept: Swept) -> None:
    wide = swept(paper_model, Direction.RADIAL, np.geomspace(0.1, 300.0, 12), np.geomspace(1e-5, 5e-4, 5), repeats=1)
    figure = whole(sweeps_figure(paper_model, [swept(paper_model), wide], "CMP 15 961"))
    assert labels(figure).count("frequency [Hz]") == 4
    residuals = ["gain residual / noise", "phase residual / noise"]
    assert labels(figure)[:2] == ["axial stiffness |K| [N/mm]", "axial loss factor [-]"]
    assert [" ".join(axes.get_ylabel().split()) for axes in figure.axes[2:4]] == residuals
    assert [len(lines(axes)) for axes in figure.axes] == [3, 3, 0, 0, 5, 5, 0, 0]
    assert sum(len(line.get_xdata()) for line in points(figure.axes[2])) == 3 * 3 * FREQUENCIES.size
    assert figure.axes[4].get_xscale() == figure.axes[6].get_xscale() == "log"
    assert figure.axes[4].get_xlim() == figure.axes[6].get_xlim()


def test_loops_show_model_and_residuals(paper_model: Model, looped: Looped) -> None:
    data_sets = [looped(paper_model, 1e-3), looped(paper_model, 5e-4, run_in=3)]
    figure = whole(loops_figure(paper_model, data_sets, "CMP 15 961"))
    over_phase = ["phase after the upper turn [deg]", "residual / noise"]
    assert labels(figure) == ["displacement [mm]", "axial force [N]", *over_phase]
    assert [len(lines(axes)) for axes in figure.axes] == [2, 2]
    assert legend(figure.axes[1]) == ["1 mm, 0.1 Hz", "0.5 mm, 0.1 Hz", "model"]
    peak = max(np.nanmax(line.get_ydata()) for line in lines(figure.axes[0]))
    assert peak == pytest.approx(458.0, rel=0.02)
    twins = loops_figure(paper_model, [data_sets[0], data_sets[0]], "twins")
    assert legend(twins.axes[1])[0] == "1 mm, 0.1 Hz\n\\$ loop \\$.csv"


@pytest.mark.parametrize("run_in", [0, 5])
def test_long_loops_are_drawn_thin(paper_model: Model, run_in: int, looped: Looped) -> None:
    data_set = looped(paper_model, 1e-3, cycles=40, run_in=run_in)
    assert data_set.test.force.size > 40_000
    figure = loops_figure(paper_model, [data_set], "long")
    assert max(len(line.get_xdata()) for axes in figure.axes for line in (*lines(axes), *points(axes))) <= 1600
    model_line = lines(figure.axes[0])[0]
    step = np.hypot(np.diff(model_line.get_xdata()), np.diff(model_line.get_ydata()) / 458.0)
    assert np.nanmax(step) < 0.1, "a stroke across the cycles that are left out"


@pytest.fixture(scope="module")
def seen(root: Path) -> list[Inspected]:
    loops = ("cmp_15961/loop_axial_1.csv", "arm_bushing/loop_axial_2.csv")
    others = ("cmp_15961/sweep_radial.csv", "cmp_15961_raw/stepped_sine_axial.csv")
    return [inspect(root / "data" / name, {}) for name in (*loops, *others)]


def test_files_are_drawn_as_they_are_together_and_alone(seen: list[Inspected]) -> None:
    figure = whole(inspection_figure(seen))
    shown = {"time [s]", "displacement [mm]", "force [N]", "frequency [Hz]", "|K| [N/mm]", "loss factor [-]"}
    assert shown <= set(labels(figure))
    assert sorted(titles(figure)) == sorted(f"{one.file.name}: {one.kind}, {one.direction}" for one in seen)
    for one in seen:
        whole(inspection_figure([one]))


def test_files_of_one_direction_are_drawn_alike_and_pictures_say_which_they_are(root: Path) -> None:
    """Loops to 1 and 2 mm in the same scales, with their folders where names repeat; others each in their own."""
    names = ("practice/case_000", "arm_bushing")
    every = [inspect(root / f"data/{name}/loop_axial_{number}.csv", {}) for name in names for number in (1, 2)]
    for page, name in enumerate(names):
        figure = inside(inspection_figure(every, 2 * page, 2))
        loops = [axes for axes in figure.axes if axes.get_xlabel() == "displacement [mm]"]
        assert figure.get_suptitle() == f"Test files as they are, {page + 1} of 2"
        assert [title.split("/")[0] for title in titles(figure)] == [name.split("/")[-1]] * 2
        for ends in ([axes.get_xlim() for axes in loops], [axes.get_ylim() for axes in loops]):
            assert (ends[0] == ends[1]) is (page == 0)


def test_what_is_not_as_it_was_recorded_is_said(root: Path, tmp_path: Path) -> None:
    table = pd.read_csv(root / "data/cmp_15961/loop_axial_1.csv")
    turned, timeless = tmp_path / "turned_axial.csv", tmp_path / "timeless_axial.csv"
    table.assign(**{"force [N]": -table["force [N]"]}).to_csv(turned, index=False)
    table.drop(columns="time [s]").to_csv(timeless, index=False)
    sine = {"frequency": "0.1 Hz", "waveform": "sine"}
    figure = inside(inspection_figure([inspect(turned, {}), inspect(timeless, sine)]))
    first = "turned_axial.csv: loop, axial, force turned, 1 odd"
    assert titles(figure) == [first, "timeless_axial.csv: loop, axial"]
    assert {"time [s]", "time rebuilt [s]"} <= set(labels(figure))


@pytest.mark.parametrize("direction", some(list(Direction), {Direction.TORSION}))
def test_reduction(paper_model: Model, direction: Direction) -> None:
    turns = direction.is_rotation
    operating = [(f, a * (30.0 if turns else 1.0)) for a in (1e-4, 4e-4) for f in (10.0, 30.0)]
    history = stepped(paper_model, operating, direction=direction)
    reduction = reduce([history])
    figure = whole(reduction_figure(reduction, [history], "$ raw $.csv"))
    unit, length = ("deg", 180.0 / np.pi) if turns else ("mm", 1e3)
    levels = sorted({step.level for step in reduction.steps})
    assert legend(figure.axes[2]) == [f"{length * level:.3g} {unit}" for level in levels]
    assert titles(figure) == [], "the title names one history"
    stiffness = f"{direction} stiffness |K| [{'N m/rad' if turns else 'N/mm'}]"
    moved = "rotation [deg]" if turns else "displacement [mm]"
    assert {"time [s]", "frequency [Hz]", "noise [%]", "distortion [%]", stiffness, moved} <= set(labels(figure))
    drawn = np.concatenate([line.get_ydata() for line in points(figure.axes[2])])
    np.testing.assert_allclose(np.sort(drawn), np.sort([step.loss_factor for step in reduction.steps]))


def test_arms_are_drawn_over_what_they_stand_for(paper_model: Model) -> None:
    model = paper_model.with_effect("second_springpot", {"second_springpot.m": 2e3})
    arms = model_arms(model, (5.0, 155.0), 0.01)
    figure = whole(arms_figure(model, arms, "CMP 15 961"))
    assert labels(figure) == ["frequency [Hz]", "modulus [MPa]", "frequency [Hz]", "error of the modulus [%]"]
    moduli, errors = figure.axes
    assert (len(lines(moduli)), len(lines(errors))) == (8, 2)
    for part, line in zip(arms, lines(errors), strict=True):
        assert 0.95 * part.error < line.get_ydata().max() / 100.0 <= part.error * 1.01
        assert line.get_xdata().min() >= 5.0
    omega = 2.0 * np.pi * lines(moduli)[1].get_xdata()
    np.testing.assert_allclose(lines(moduli)[1].get_ydata(), 1e-6 * arms[0].at(omega).real)
    assert "in place of the springpot" in note(figure)


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
