"""Many levels, loops or quantities, and long names: every picture stays on its page and says what it leaves unnamed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import pytest
from figures import Looped, Swept, inside, legend, points
from matplotlib.figure import Figure
from tries import some

from bushfit.effects.contract import Array
from bushfit.fitting.data_sets import DataSet, SweepData, loop_data, sweep_data
from bushfit.geometry import Direction
from bushfit.inspection.record import Inspected
from bushfit.jobs.grid import default_grid
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.prediction.stiffness import predict
from bushfit.reading.measurement import Loop, Stepped, Sweep
from bushfit.reduction.steps import Reduction, Step
from bushfit.report.plots.fits import loops_figure, sweeps_figure
from bushfit.report.plots.gap import gap_figure
from bushfit.report.plots.inspection import inspection_figure
from bushfit.report.plots.misfit import map_rows
from bushfit.report.plots.prediction import fine_grid, prediction_figure
from bushfit.report.plots.reduction import reduction_figure
from bushfit.report.plots.style import to_image

#: A picture that is higher does not fit on three pages of A4 [inch].
HIGHEST = 33.0
LONG_NAME = "a file whose name tells all that is known of the test " * 3


def checked(figure: Figure) -> Figure:
    """The figure, once nothing leaves it and nothing in it is too small; warnings are errors while it is drawn."""
    assert to_image(inside(figure))
    width, height = figure.get_size_inches()
    assert height < HIGHEST
    for panel in (axes.get_position() for axes in figure.axes if not hasattr(axes, "_colorbar")):
        assert panel.height * height > 0.5
        assert panel.width * width > 1.2
    return figure


def measured(model: Model, frequency: Array, amplitude: Array, stepped: Stepped | None) -> list[SweepData]:
    """An axial sweep of a model at these operating points, 1 % noise."""
    stiffness = model.stiffness("axial", frequency, amplitude)
    stiffness = stiffness * (1.0 + 0.01 * np.random.default_rng(2).standard_normal(frequency.size))
    return sweep_data([Sweep("sweep.csv", Direction.AXIAL, frequency, amplitude, stiffness, stepped=stepped)])


def grid(frequencies: Iterable[float], amplitudes: Iterable[float], scatter: float) -> list[Array]:
    """Frequency and amplitude of operating points at which each amplitude was missed by a little."""
    frequency, amplitude = (axis.ravel() for axis in np.meshgrid(list(frequencies), list(amplitudes)))
    return [frequency, amplitude * (1.0 + scatter * np.random.default_rng(1).standard_normal(amplitude.size))]


def check_gaps(model: Model, data_sets: Sequence[DataSet], words: str) -> None:
    """One column where both models respond alike, and two."""
    for after in (model, model.with_values({"mu": 1.2 * model.values["mu"]})):
        checked(gap_figure(model, after, data_sets, words, words))


@pytest.mark.parametrize("count", some([2, 8, 40, 300], {40}))
def test_sweeps_of_many_amplitudes(paper_model: Model, swept: Swept, count: int) -> None:
    """A line an amplitude, named by a legend as long as that can, else by a colour bar."""
    data_sets = [swept(paper_model, amplitudes=np.geomspace(2e-5, 1e-3, count), repeats=1)]
    figure = checked(sweeps_figure(paper_model, data_sets, "mount"))
    assert figure.axes[2].get_xlabel() == "frequency [Hz]"
    if count > 8:
        names = [tick.get_text() for tick in figure.axes[-1].get_yticklabels()]
        assert len(names) == 8
        assert (names[0], names[-1], figure.axes[-1].get_title()) == ("0.02 mm", "1 mm", "amplitude")
    else:
        assert len(legend(figure.axes[1])) == count
    checked(gap_figure(paper_model, paper_model, data_sets, "mount", ""))
    prediction = predict(Result(paper_model), Direction.AXIAL, [5.0, 50.0], np.geomspace(2e-5, 1e-3, count))
    curves = predict(Result(paper_model), Direction.AXIAL, *fine_grid(prediction))
    checked(prediction_figure(prediction, data_sets, "mount", curves=curves))
    seen = Inspected(Path(f"{LONG_NAME}.csv"), "sweep", Direction.AXIAL, {}, (), {}, (), {}, data_sets[0].sweep)
    (left, right, *bar) = checked(inspection_figure([seen])).axes
    assert len(points(left)) == count
    assert len(bar) == (count > 8)
    assert bar or len(legend(right)) == count


def test_one_level_at_several_temperatures_is_a_curve_each(paper_model: Model) -> None:
    """They are no repeats of one another: nothing is averaged over them, and each is named by its temperature."""
    frequency, amplitude = np.geomspace(5.0, 150.0, 12), np.full(12, 1e-7)
    sweeps = [
        Sweep(f"{celsius}.csv", Direction.AXIAL, frequency, amplitude, factor * (1e6 + 1e5j) * np.ones(12),
              stepped="frequency", temperature=273.15 + celsius)
        for celsius, factor in ((40.0, 1.0), (-10.0, 3.0), (20.0, 2.0))
    ]  # fmt: skip
    figure = checked(sweeps_figure(paper_model, sweep_data(sweeps), "warm"))
    names = ["-10 degC, 0.1 um", "20 degC, 0.1 um", "40 degC, 0.1 um"]
    assert legend(figure.axes[1]) == names
    gap = checked(gap_figure(paper_model, paper_model, sweep_data(sweeps), "warm", ""))
    assert [tick.get_text() for tick in gap.axes[0].get_yticklabels()] == names
    stiffness = [line.get_ydata() for line in figure.axes[0].lines if line.get_marker() == "o"]
    assert [np.unique(np.round(each)).size for each in stiffness] == [1, 1, 1]
    assert np.array([np.mean(each) for each in stiffness]) == pytest.approx(np.array([3.0, 2.0, 1.0]) * abs(1e3 + 1e2j))


@pytest.mark.parametrize(
    "frequencies", some([(40.0,), tuple(np.geomspace(5.0, 150.0, 30)), (10.0, 40.0, 100.0)], {(40.0,)})
)
def test_sweeps_of_the_amplitude(paper_model: Model, frequencies: tuple[float, ...]) -> None:
    """Amplitudes across, logarithmic; a line and a row of the map for each frequency that was held."""
    points_at = grid(frequencies, np.geomspace(2e-5, 1e-3, 15), 0.01)
    data_sets = measured(paper_model, *points_at, "amplitude")
    figure = checked(sweeps_figure(paper_model, data_sets, "strain"))
    assert figure.axes[2].get_xlabel() == "amplitude [mm]"
    assert figure.axes[2].get_xscale() == "log"
    assert len([line for line in figure.axes[0].lines if line.get_linestyle() != "None"]) == len(frequencies)
    gap = checked(gap_figure(paper_model, paper_model, data_sets, "strain", ""))
    assert gap.axes[1].get_xlabel() == "amplitude [mm]"
    assert len(gap.axes[0].get_yticklabels()) == min(len(frequencies), 8), "each, or every third of 24 rows"
    result = Result(paper_model)
    prediction = predict(
        result, Direction.AXIAL, *default_grid(result, Direction.AXIAL, [data_set.sweep for data_set in data_sets])
    )
    checked(prediction_figure(prediction, data_sets, "strain", model=paper_model))


def test_rows_of_a_map_are_the_amplitudes_as_long_as_they_fit() -> None:
    few = np.repeat(np.geomspace(1e-5, 1e-3, 24), 3)
    assert map_rows(few) is few
    many = map_rows(np.geomspace(1e-5, 1e-3, 300))
    assert np.unique(many).size == 24
    assert np.all(np.diff(many) >= 0.0)


@pytest.mark.parametrize("count", some([2, 8, 40, 300], {40}))
def test_many_loops(paper_model: Model, looped: Looped, count: int) -> None:
    one = looped(paper_model, 1e-3, cycles=2).test
    data_sets = loop_data(
        [
            Loop(f"loop {k}.csv", one.direction, one.time, scale * one.displacement, scale * one.force)
            for k, scale in enumerate(np.linspace(0.5, 2.0, count))
        ]
    )
    names = legend(checked(loops_figure(paper_model, data_sets, "mount")).axes[1])
    assert names[-1] == "model"
    assert len(names) == min(count, 8) + (count > 8) + 1
    assert (f"and {count - 8} more" in names) is (count > 8)
    check_gaps(paper_model, data_sets, "mount")


@pytest.mark.parametrize(("levels", "histories"), [(8, 40), pytest.param(300, 2, marks=pytest.mark.slow)])
def test_reduction_of_many_levels(levels: int, histories: int) -> None:
    time = np.linspace(0.0, 2.0 * levels, 4000)
    motion = 1e-3 * np.sin(20.0 * time)
    records = [Loop(f"{LONG_NAME}{k}", Direction.AXIAL, time, motion, 1e6 * motion) for k in range(histories)]
    steps = tuple(
        Step(record.name, 2.0 * k, 2.0 * k + 1.0, 10, 12, 50.0, f, a, 1e6 + 1e5j, 3e-3, 3e-3, 0.01, 0.02, f, a)
        for record in records
        for k, a in enumerate(np.geomspace(1e-5, 1e-3, levels))
        for f in (5.0, 50.0)
    )
    figure = checked(reduction_figure(Reduction(Direction.AXIAL, steps, ()), records, "raw.csv"))
    (box,) = (axes for axes in figure.axes if axes.get_legend())
    assert len(legend(box)) == min(levels, 8) + (levels > 8)
