"""Figures of inspect and reduce: each point, bar and cycle is drawn where it was measured."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from figures import labels, legend, points, whole

from bushfit.geometry import Direction
from bushfit.inspection.opening import read_history
from bushfit.inspection.record import Inspection
from bushfit.reduction.steps import reduce
from bushfit.report.plots.inspection import inspection_figure, reduction_figure


@pytest.mark.parametrize(
    ("stepped", "held", "levels", "scale"),
    [("amplitude", "frequency", ["35 Hz", "5 Hz"], 1e3), ("frequency", "amplitude", ["0.1 mm", "0.2 mm", "0.5 mm"], 1)],
)
def test_a_sweep_is_drawn_over_its_steps(paper_model, swept, stepped, held, levels, scale):
    sweep = replace(swept(paper_model, frequencies=np.array([5.0, 35.0])).sweep, stepped=stepped)
    seen = Inspection(Path("x.csv"), "sweep", Direction.AXIAL, {}, (), {}, (), {}, sweep)
    figure = whole(inspection_figure([seen]))
    assert {name.split()[0] for name in labels(figure)[::2]} == {stepped}
    assert legend(figure.axes[1]) == levels
    for row, level in enumerate(np.unique(getattr(sweep, held))):
        rows = getattr(sweep, held) == level
        drawn = points(figure.axes[0])[row]
        np.testing.assert_allclose(drawn.get_xdata(), scale * getattr(sweep, stepped)[rows])
        np.testing.assert_allclose(drawn.get_ydata(), 1e-3 * np.abs(sweep.stiffness[rows]))


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
