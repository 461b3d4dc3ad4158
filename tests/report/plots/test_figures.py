"""Figures of predictions, fits, raw files, reductions and Maxwell arms, of few levels and of many."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from figures import (
    AMPLITUDES,
    FREQUENCIES,
    TORSION,
    Looped,
    Swept,
    fitted,
    gap,
    inside,
    labels,
    legend,
    lines,
    loops,
    note,
    points,
    prediction,
    sweeps,
    titles,
    whole,
)
from matplotlib.figure import Figure
from stepped import stepped
from tries import some

from bushfit.fitting.preparation import prepare_loops, prepare_sweeps
from bushfit.geometry import Direction
from bushfit.inspection.opening import inspect_file
from bushfit.inspection.record import Inspection
from bushfit.model.arms import model_arms
from bushfit.model.model import Model
from bushfit.model.result import Range, Result
from bushfit.prediction.stiffness import predict
from bushfit.reading.measurement import Loop, Sweep
from bushfit.reduction.steps import reduce
from bushfit.report.plots.appendix import complex_figure, ellipses_figure
from bushfit.report.plots.inspection import inspection_figure, reduction_figure
from bushfit.report.plots.master_curve import arms_figure
from bushfit.report.plots.prediction import prediction_figure
from bushfit.report.plots.style import to_image
from bushfit.report.tables import sweeps_table


def test_settings_of_the_user_do_not_matter(root: Path, tmp_path: Path) -> None:
    """A backend of a notebook, LaTeX, an unknown font and a misspelt key in matplotlibrc."""
    (tmp_path / "matplotlibrc").write_text("text.usetex: True\nfont.family: No Such Font\nno.such.key: 1\n")
    folders = [tmp_path / "own", tmp_path / "plain"]
    for folder, settings in zip(folders, ({"MPLBACKEND": "none", "MATPLOTLIBRC": str(tmp_path)}, {}), strict=True):
        command = "from bushfit.cli import main; main()"
        arguments = ("fit-static", root / "configs/cmp_15961.toml", "-q", "-o", folder)
        run = [sys.executable, "-c", command, *map(str, arguments)]
        done = subprocess.run(run, env={**os.environ, **settings}, check=True, capture_output=True)
        assert done.stderr == b""
    images = [(folder / "loops.png").read_bytes() for folder in folders]
    assert images[0] == images[1]
    (tmp_path / "matplotlibrc").write_bytes(b"lines.linewidth: 2\n# \xff\n")  # which stops matplotlib at its import
    environment = {**os.environ, "MATPLOTLIBRC": str(tmp_path)}
    done = subprocess.run([*run[:-1], str(tmp_path / "saved")], env=environment, check=False, capture_output=True)
    assert (done.returncode, done.stderr.count(b"rror: ")) == (2, 1)
    assert b"error: matplotlibrc" in done.stderr
    assert (tmp_path / "saved/static.json").exists()


def test_sweeps_have_a_row_a_direction_and_residuals(paper_model: Model, swept: Swept) -> None:
    wide = swept(paper_model, Direction.RADIAL, np.geomspace(0.1, 300.0, 12), np.geomspace(1e-5, 5e-4, 5), repeats=1)
    figure = whole(sweeps(paper_model, swept(paper_model), wide))
    assert labels(figure).count("frequency [Hz]") == 4
    assert labels(figure)[:2] == ["axial stiffness |K| [N/mm]", "axial loss factor [-]"]
    residuals = ["stiffness residual / noise", "loss residual / noise"]
    assert [" ".join(axes.get_ylabel().split()) for axes in figure.axes[2:4]] == residuals
    assert [len(lines(axes)) for axes in figure.axes] == [3, 3, 0, 0, 5, 5, 0, 0]
    assert sum(len(line.get_xdata()) for line in points(figure.axes[2])) == 3 * 3 * FREQUENCIES.size
    assert figure.axes[4].get_xscale() == figure.axes[6].get_xscale() == "log"
    assert figure.axes[4].get_xlim() == figure.axes[6].get_xlim()


def test_differences_are_measured_minus_model_everywhere(paper_model: Model, swept: Swept, looped: Looped) -> None:
    stiff = paper_model.with_values({name: 1.2 * paper_model.values[name] for name in ("mu", "m", "sigma_fmax")})
    residuals = sweeps(stiff, swept(paper_model)).axes[2]
    assert all(np.mean(line.get_ydata()) < -5.0 for line in points(residuals))
    phase = loops(stiff, looped(paper_model, 1e-3)).axes[1]
    (means,) = lines(phase)
    assert means.get_ydata()[0] < 0.0 < means.get_ydata()[len(means.get_ydata()) // 2], "at the upper turn, the lower"


def test_loops_show_model_and_residuals(paper_model: Model, looped: Looped) -> None:
    data_sets = [looped(paper_model, 1e-3), looped(paper_model, 5e-4, run_in=3)]
    figure = whole(loops(paper_model, *data_sets))
    over_phase = ["phase after the upper turn [deg]", "force residual / noise"]
    assert labels(figure) == ["displacement [mm]", "axial force [N]", *over_phase]
    assert [len(lines(axes)) for axes in figure.axes] == [2, 2]
    assert legend(figure.axes[1]) == ["1 mm, 0.1 Hz", "0.5 mm, 0.1 Hz", "model"]
    assert max(np.nanmax(line.get_ydata()) for line in lines(figure.axes[0])) == pytest.approx(458.0, rel=0.02)
    long = loops(paper_model, looped(paper_model, 1e-3, cycles=40))
    assert max(len(line.get_xdata()) for axes in long.axes for line in (*lines(axes), *points(axes))) <= 240
    (model_line,) = lines(long.axes[0])
    step = np.hypot(np.diff(model_line.get_xdata()), np.diff(model_line.get_ydata()) / 458.0)
    assert np.nanmax(step) < 0.2, "a stroke across the cycles that are left out"


def test_files_are_drawn_as_they_are_together_and_alone(root: Path) -> None:
    names = ("cmp_15961/loop_axial_1.csv", "arm_bushing/loop_axial_2.csv")
    others = ("cmp_15961/sweep_radial.csv", "cmp_15961_raw/stepped_sine_axial.csv")
    seen = [inspect_file(root / "data" / name, {}) for name in (*names, *others)]
    figure = whole(inspection_figure(seen))
    shown = {"time [s]", "displacement [mm]", "force [N]", "frequency [Hz]", "radial stiffness |K| [N/mm]"}
    assert shown <= set(labels(figure))
    assert sorted(titles(figure)) == sorted(f"{one.file.name}: {one.kind}, {one.direction}" for one in seen)
    for one in seen:
        whole(inspection_figure([one]))


def test_reduction(paper_model: Model) -> None:
    operating = [(f, 30.0 * a) for a in (1e-4, 4e-4) for f in (10.0, 30.0)]
    history = stepped(paper_model, operating, direction=Direction.TORSION)
    reduction = reduce([history])
    figure = whole(reduction_figure(reduction, [history], "$ raw $.csv"))
    levels = sorted({step.level for step in reduction.steps})
    assert legend(figure.axes[2]) == [f"{np.degrees(level):.3g} deg" for level in levels]
    assert titles(figure) == [], "the title names one history"
    shown = {"time [s]", "frequency [Hz]", "noise [%]", "distortion [%]", "rotation [deg]"}
    assert {*shown, "torsion stiffness |K| [N m/rad]"} <= set(labels(figure))
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
    np.testing.assert_allclose(lines(moduli)[1].get_ydata(), 1e-6 * arms[0].complex_modulus(omega).real)
    assert "represent the springpot" in note(figure)


def test_prediction_over_frequency_and_amplitude_and_means_of_repeats(paper_model: Model, swept: Swept) -> None:
    result = fitted(paper_model)
    figure = prediction(result, Direction.AXIAL, swept(paper_model), note="A further sentence.")
    shown = ("axial stiffness |K| [N/mm]", "axial loss factor [-]")
    assert labels(figure) == [each for x in ("frequency [Hz]", "amplitude [mm]") for y in shown for each in (x, y)]
    assert [len(lines(axes)) for axes in figure.axes] == [3, 3, 4, 4]
    assert legend(figure.axes[1]) == ["0.1 mm", "0.2 mm", "0.5 mm"]
    assert legend(figure.axes[3]) == ["155 Hz", "105 Hz", "55 Hz", "5 Hz"]
    for words in ("95 % band", "mean of the repeats", "A further sentence."):
        assert words in note(figure)
    line = lines(figure.axes[0])[0]
    spot = np.flatnonzero(np.isclose(line.get_xdata(), 5.0))[0]
    assert line.get_ydata()[spot] == pytest.approx(591.0, rel=1e-3)
    both = (swept(paper_model), swept(paper_model, Direction.RADIAL))
    (drawn,) = points(prediction(result, Direction.AXIAL, *both, amplitudes=np.array([2e-4, 3e-4])).axes[0])
    here = (both[0].amplitude == 2e-4) & (both[0].frequency == 55.0)
    mean = 1e-3 * np.abs(both[0].measured[here]).mean()
    assert drawn.get_ydata()[FREQUENCIES == 55.0][0] == pytest.approx(mean, rel=1e-12)
    assert "Points" not in note(prediction(result, Direction.TORSION, *both, amplitudes=TORSION))


def test_a_prediction_is_drawn_at_its_temperature(paper_model: Model) -> None:
    warm, kelvin = paper_model.with_effect("temperature", {"temperature.shift": 0.05}), 323.15
    grid = predict(Result(warm), Direction.AXIAL, FREQUENCIES, AMPLITUDES, temperature=kelvin)
    figure = prediction_figure(Result(warm), grid, None, "warm", temperature=kelvin)
    line = lines(figure.axes[0])[0]
    assert line.get_ydata()[[0, -1]] == pytest.approx(1e-3 * grid.stiffness.value[[0, FREQUENCIES.size - 1]], rel=1e-9)


def test_points_lie_on_lines_with_the_rig_and_the_bushing_stands_apart(paper_model: Model, swept: Swept) -> None:
    """As `run` draws them: a rig that gives way makes the points softer, and that is no failed fit."""
    rigged = paper_model.with_effect("rig_compliance", {"rig_compliance.compliance": 2e-8})
    result = replace(fitted(rigged), measured=Range((5.0, 155.0), (1e-3, 0.2), (Direction.AXIAL,)))
    radial = prediction(result, Direction.RADIAL, swept(rigged, Direction.RADIAL))
    for axes in (radial.axes[0], radial.axes[2]):
        plain, rig = ([line for line in lines(axes) if (line.get_linewidth() < 1.0) is thin] for thin in (False, True))
        assert len(plain) == len(rig) == len(points(axes))
        for bushing, with_rig, spots in zip(plain, rig, points(axes), strict=True):
            on_line = np.interp(spots.get_xdata(), with_rig.get_xdata(), with_rig.get_ydata())
            np.testing.assert_allclose(spots.get_ydata(), on_line, rtol=0.03)
            assert np.all(bushing.get_ydata() > 1.04 * with_rig.get_ydata())
    assert legend(radial.axes[1])[3:] == ["bushing", "with the rig"]
    assert "Thin lines: the model with the effects of the rig" in note(radial)
    axial = prediction(result, Direction.AXIAL)
    assert "hin lines" not in note(axial)
    assert legend(axial.axes[1]) == ["0.1 mm", "0.2 mm", "0.5 mm"]


def test_what_may_be_the_rigs_has_a_double_line_that_the_legend_names(paper_model: Model, swept: Swept) -> None:
    flexing = paper_model.with_effect("sleeve_compliance", {"sleeve_compliance.compliance": 2e-8})
    result = replace(fitted(flexing), unresolved=("sleeve_compliance",))
    figure = prediction(result, Direction.RADIAL, swept(flexing, Direction.RADIAL))
    for axes, count in zip(figure.axes[::2], (3, 4), strict=True):
        bushing, double, core = ([line for line in lines(axes) if line.get_linewidth() == w] for w in (1.3, 2.4, 0.7))
        assert len(bushing) == len(double) == len(core) == count
        for one, other, white in zip(bushing, double, core, strict=True):
            assert np.all(other.get_ydata() > 1.02 * one.get_ydata())
            np.testing.assert_array_equal(other.get_ydata(), white.get_ydata())
    assert legend(figure.axes[1])[3:] == ["bushing", "if it is the rig's"]
    assert "Double lines: the model if the unresolved effect belongs to the rig" in note(figure)


def test_storage_loss_and_ellipses(paper_model: Model, swept: Swept) -> None:
    result = fitted(paper_model)
    grid = predict(result, Direction.AXIAL, FREQUENCIES, AMPLITUDES)
    figure = whole(complex_figure(result, grid, sweeps_table(paper_model, [swept(paper_model)]), "axial"))
    storage, loss, cole_cole = figure.axes
    assert labels(figure)[1] == "storage stiffness [N/mm]"
    assert [len(points(axes)) for axes in (storage, loss, cole_cole)] == [3, 3, 3]
    x, y = lines(cole_cole)[0].get_data()
    expected = 1e-3 * paper_model.stiffness("axial", FREQUENCIES[-1], AMPLITUDES[0])
    assert (x[-1], y[-1]) == pytest.approx((expected.real, expected.imag), rel=1e-3)
    ellipses = ellipses_figure(result, "mount")
    assert ellipses is not None
    assert to_image(ellipses)
    assert [text.get_text() for text in ellipses.axes[0].texts] == ["+0.00"] * 10
    assert ellipses_figure(Result(paper_model), "not fitted") is None


#: A picture that is higher does not fit on three pages of A4 [inch].
HIGHEST = 33.0
LONG_NAME = "a file whose name tells all that is known of the test " * 3


def checked(figure: Figure) -> Figure:
    """The figure, once nothing leaves it and nothing in it is too small; warnings are errors while it is drawn."""
    assert to_image(inside(figure))
    width, height = figure.get_size_inches()
    assert height < HIGHEST
    for panel in (axes.get_position() for axes in figure.axes if axes.axison):
        assert panel.height * height > 0.5
        assert panel.width * width > 1.2
    return figure


@pytest.mark.parametrize("count", some([8, 40], {40}))
def test_sweeps_of_many_amplitudes(paper_model: Model, swept: Swept, count: int) -> None:
    """A line an amplitude, named by a legend as long as that can, else by a colour bar."""
    amplitudes = np.geomspace(2e-5, 1e-3, count)
    data_set = swept(paper_model, amplitudes=amplitudes, repeats=1)
    figure = checked(sweeps(paper_model, data_set))
    assert figure.axes[2].get_xlabel() == "frequency [Hz]"
    if count > 8:
        (bar,) = figure.axes[1].child_axes
        names = [tick.get_text() for tick in bar.get_yticklabels()]
        assert len(names) == 8
        assert (names[0], names[-1], bar.get_title()) == ("0.02 mm", "1 mm", "amplitude")
    else:
        assert len(legend(figure.axes[1])) == count
    checked(gap(paper_model, paper_model, [data_set]))
    checked(prediction(Result(paper_model), Direction.AXIAL, data_set, amplitudes=amplitudes))
    seen = Inspection(Path(f"{LONG_NAME}.csv"), "sweep", Direction.AXIAL, {}, (), {}, (), {}, data_set.sweep)
    left, right = checked(inspection_figure([seen])).axes
    assert len(points(left)) == count
    assert len(right.child_axes) == (count > 8)
    assert right.child_axes or len(legend(right)) == count


def test_one_level_at_several_temperatures_is_a_curve_each(paper_model: Model) -> None:
    """They are no repeats of one another: nothing is averaged over them, and each is named by its temperature."""
    frequency, amplitude = np.geomspace(5.0, 150.0, 12), np.full(12, 1e-7)
    warm = [
        Sweep(f"{celsius}.csv", Direction.AXIAL, frequency, amplitude, factor * (1e6 + 1e5j) * np.ones(12),
              stepped="frequency", temperature=273.15 + celsius)
        for celsius, factor in ((40.0, 1.0), (-10.0, 3.0), (20.0, 2.0))
    ]  # fmt: skip
    figure = checked(sweeps(paper_model, *prepare_sweeps(warm)))
    names = ["-10 °C, 0.1 um", "20 °C, 0.1 um", "40 °C, 0.1 um"]
    assert legend(figure.axes[1]) == names
    maps = checked(gap(paper_model, paper_model, prepare_sweeps(warm)))
    assert [tick.get_text() for tick in maps.axes[0].get_yticklabels()] == names
    stiffness = [line.get_ydata() for line in points(figure.axes[0])]
    assert np.array([np.mean(each) for each in stiffness]) == pytest.approx(np.array([3.0, 2.0, 1.0]) * abs(1e3 + 1e2j))


@pytest.mark.parametrize("frequencies", some([(40.0,), tuple(np.geomspace(5.0, 150.0, 30))], {(40.0,)}))
def test_sweeps_of_the_amplitude(paper_model: Model, frequencies: tuple[float, ...]) -> None:
    """Amplitudes across, logarithmic; a line and a row of the map for each frequency that was held."""
    frequency, amplitude = (axis.ravel() for axis in np.meshgrid(frequencies, np.geomspace(2e-5, 1e-3, 15)))
    stiffness = paper_model.stiffness("axial", frequency, amplitude)
    stiffness = stiffness * (1.0 + 0.01 * np.random.default_rng(2).standard_normal(frequency.size))
    data_sets = prepare_sweeps(
        [Sweep("sweep.csv", Direction.AXIAL, frequency, amplitude, stiffness, stepped="amplitude")]
    )
    figure = checked(sweeps(paper_model, *data_sets))
    assert figure.axes[2].get_xlabel() == "amplitude [mm]"
    assert figure.axes[2].get_xscale() == "log"
    assert len(lines(figure.axes[0])) == min(len(frequencies), 24)
    maps = checked(gap(paper_model, paper_model, data_sets))
    assert maps.axes[1].get_xlabel() == "amplitude [mm]"
    assert len(maps.axes[0].get_yticklabels()) == min(len(frequencies), 8), "each, or every third of 24 rows"


@pytest.mark.parametrize("count", some([2, 40], {40}))
def test_many_loops(paper_model: Model, looped: Looped, count: int) -> None:
    one = looped(paper_model, 1e-3, cycles=2).test
    data_sets = prepare_loops(
        [
            Loop(f"$ loop {k} $.csv", one.direction, one.time, scale * one.displacement, scale * one.force)
            for k, scale in enumerate(np.linspace(0.5, 2.0, count))
        ]
    )
    figure = checked(loops(paper_model, *data_sets))
    names = legend(figure.axes[1])
    assert names[-1] == "model"
    assert names[0].startswith("0.5 mm, 0.1 Hz")
    assert len(names) == min(count, 8) + 1
    assert ("Only 8 loops of a direction are drawn" in note(figure)) is (count > 8)
    for after in (paper_model, paper_model.with_values({"mu": 1.2 * paper_model.values["mu"]})):
        checked(gap(paper_model, after, data_sets))
