"""The picture of a batch says what is out of limits, for ten bushings as for thousands."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from figures import note, points, titles

from bushfit.report.plots.batch import Panel, batch_figure
from bushfit.report.plots.style import to_image


def panel(count: int) -> Panel:
    values = np.random.default_rng(3).normal(1.0, 0.02, count)
    values[[1, 4]] = 1.5, np.nan
    if count > 100:
        values[50] = 40.0
    return Panel("mu [MPa]", values, (-np.inf, 1.2), [int(k) for k in np.flatnonzero(values > 1.2)])


@pytest.mark.parametrize("count", [10, 20_000])
def test_medians_limits_and_names(count: int) -> None:
    one = panel(count)
    names = [f"$name {n}" for n in range(count)]
    panels = [one, Panel("alpha [-]", np.full(count, 0.24))]
    figure = batch_figure(panels, "x", names)
    assert to_image(figure) == to_image(batch_figure(panels, "x", names))
    axes, other = figure.axes[:2]
    heights = {float(line.get_ydata()[0]) for line in axes.lines if len(set(np.atleast_1d(line.get_ydata()))) == 1}
    assert {float(np.nanmedian(one.values)), 1.2} <= heights
    low, high = axes.get_ylim()
    assert low < 1.0 < 1.2 < high
    assert high < 2.0, "one far out must not squash the rest"
    assert f"{len(one.missed)} out" in titles(figure)[0]
    named = {text.get_text().partition(":")[0] for text in axes.texts}
    assert named == {f"$name {k}" for k in one.missed}
    assert sum(len(line.get_xdata()) for line in points(axes)) == count - 1, "each bushing that has a value, once"
    assert other.get_ylim()[0] < 0.24 < other.get_ylim()[1]


def test_triangles_have_a_name_and_the_value_that_the_panel_does_not_show() -> None:
    values = np.array([1.0, 1.01, 0.99, 1.02, 0.98, 4012.0, 1.0, 30.0, 0.97, 20.0])
    figure = batch_figure([Panel("mu [MPa]", values)], "x", [f"b{n}" for n in range(10)])
    to_image(figure)
    axes = figure.axes[0]
    assert {text.get_text() for text in axes.texts} == {"b5: 4010", "b7: 30", "b9: 20"}
    boxes = [text.get_window_extent() for text in axes.texts]
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2)), "names must not cover each other"


def test_a_panel_shows_no_less_than_what_is_known() -> None:
    rounding = 1e-8 * np.arange(6.0)
    values, half = 0.010974926 + rounding, 2e-4
    ends = np.stack((values - half, values + half))
    names = [f"b{n}" for n in range(6)]
    figure = batch_figure([Panel("a [-]", values, intervals=ends), Panel("b [-]", values)], "x", names)
    to_image(figure)
    known, unknown = figure.axes[:2]
    assert np.ptp(known.get_ylim()) > 2.0 * half
    bars = [line for found in known.collections for line in found.get_segments()]
    np.testing.assert_allclose(np.array(bars)[:, :, 1].T, ends)
    assert unknown.collections[:] == []
    for axes in (known, unknown):
        assert all(len(label.get_text()) < 9 for label in axes.get_yticklabels())
    assert "95 % intervals" in note(figure)
