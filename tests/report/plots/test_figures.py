"""Figures of predictions, fits, raw files, reductions and Maxwell arms: each point is drawn where it was measured."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from figures import (
    gap,
    legend,
    lines,
    loops,
    points,
    prediction,
    sweeps,
    whole,
)
from matplotlib.colors import to_rgba
from tries import some

from bushfit.geometry import Direction
from bushfit.inspection.opening import read_history
from bushfit.inspection.record import Inspection
from bushfit.model.result import Result
from bushfit.reading.finding import find_table
from bushfit.reading.headers import RESONANCE_COLUMNS
from bushfit.reading.resonance import read_resonance
from bushfit.reduction.resonance import reduce_resonance
from bushfit.reduction.steps import reduce
from bushfit.report.plots.inspection import inspection_figure, reduction_figure, resonance_figure

LONG_NAME = "a file whose name tells all that is known of the test " * 3


def test_differences_are_measured_minus_model_everywhere(paper_model, stiff, swept, looped):
    residuals = sweeps(stiff, swept(paper_model)).axes[2]
    assert all(np.mean(line.get_ydata()) < -5.0 for line in points(residuals))
    line = lines(sweeps(stiff, swept(paper_model)).axes[0])[0]
    wanted = 1e-3 * np.abs(stiff.stiffness("axial", line.get_xdata(), 1e-4))
    np.testing.assert_allclose(line.get_ydata(), wanted, rtol=1e-6)
    phase = loops(stiff, looped(paper_model, 1e-3)).axes[1]
    (means,) = lines(phase)
    assert means.get_ydata()[0] < 0.0 < means.get_ydata()[len(means.get_ydata()) // 2], "at the upper turn, the lower"


@pytest.mark.parametrize("count", some([8, 40], {40}))
def test_sweeps_of_many_amplitudes(paper_model, swept, count):
    """A line an amplitude, named by a legend as long as that can, else by a colour bar."""
    amplitudes = np.geomspace(2e-5, 1e-3, count)
    data_set = swept(paper_model, amplitudes=amplitudes, repeats=1)
    figure = whole(sweeps(paper_model, data_set), apart=False)
    assert figure.axes[2].get_xlabel() == "frequency [Hz]"
    if count > 8:
        (bar,) = figure.axes[1].child_axes
        names = [tick.get_text() for tick in bar.get_yticklabels()]
        assert len(names) == 8
        assert (names[0], names[-1], bar.get_title()) == ("0.02 mm", "1 mm", "amplitude")
        drawn = points(figure.axes[0])[0].get_color()
        np.testing.assert_allclose(bar._colorbar.mappable.to_rgba(0), to_rgba(drawn), err_msg="of the smallest")
    else:
        assert len(legend(figure.axes[1])) == count
    whole(gap(paper_model, paper_model, [data_set]), apart=False)
    whole(prediction(Result(paper_model), Direction.AXIAL, data_set, amplitudes=amplitudes), apart=False)
    seen = Inspection(Path(f"{LONG_NAME}.csv"), "sweep", Direction.AXIAL, {}, (), {}, (), {}, data_set.test)
    left, right = whole(inspection_figure([seen]), apart=False).axes
    assert len(points(left)) == count
    assert len(right.child_axes) == (count > 8)
    assert right.child_axes or len(legend(right)) == count


def test_a_resonance_shows_the_amplitudes_reached_in_mm(root):
    table = find_table(root / "data/measured/epdm_70/shaker_1g_573g.csv", RESONANCE_COLUMNS)
    found = reduce_resonance(read_resonance(table, Direction.AXIAL), 0.5878)
    (reached,) = points(whole(resonance_figure(found, "x")).axes[1])
    np.testing.assert_allclose(reached.get_ydata(), 1e3 * found.amplitude)


def test_a_reduction_shows_the_cycles_used_and_twice_the_standard_error(root):
    history, _ = read_history(root / "data/cmp_15961_raw/stepped_sine_axial.csv", {"direction": "axial"})
    reduction = reduce([history])
    figure = whole(reduction_figure(reduction, [history], "x"))
    strip, magnitude, loss, noise, distortion = figure.axes
    table = pd.DataFrame([vars(step) for step in reduction.steps]).sort_values(["level", "frequency"])
    for (_, steps), line in zip(table.groupby("level"), strip.get_lines()[1:], strict=True):
        times = line.get_xdata()[np.isfinite(line.get_ydata())]
        assert all(
            ((times > start) & (times < end)).any() for start, end in zip(steps["start"], steps["end"], strict=True)
        )
    stiffness, tangent = 1e-3 * table["stiffness"].abs(), np.tan(np.angle(table["stiffness"]))
    errors = stiffness * table["gain_error"], (1.0 + tangent**2) * table["phase_error"]
    for axes, value, error in zip((magnitude, loss), (stiffness, tangent), errors, strict=True):
        bars = np.array([bar for lines in axes.collections for bar in lines.get_segments()])[:, :, 1]
        np.testing.assert_allclose(bars, np.column_stack([value - 2.0 * error, value + 2.0 * error]), rtol=1e-6)
    drawn = [np.concatenate([line.get_ydata() for line in points(axes)]) for axes in (noise, distortion)]
    np.testing.assert_allclose(drawn[0], 100.0 * np.sqrt(0.5 * (table["gain_error"] ** 2 + table["phase_error"] ** 2)))
    both = 100.0 * table[["force_distortion", "displacement_distortion"]].to_numpy()
    np.testing.assert_allclose(np.sort(drawn[1]), np.sort(both.ravel()))
