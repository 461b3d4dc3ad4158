"""The figure of the gap before and after: one scale, right signs and sizes."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from figures import gap, legend, whole
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from bushfit.fitting.preparation import MeasuredTest
from bushfit.geometry import Direction
from bushfit.model.model import Model

Heavier = Callable[[float], Model]


@pytest.fixture
def heavier(paper_model) -> Heavier:
    """The paper's model with a mass [kg] moving along."""

    def model(mass: float) -> Model:
        return paper_model.with_effect("inertia", {"inertia.mass": mass})

    return model


@pytest.fixture
def campaign(heavier, swept, looped) -> list[MeasuredTest]:
    """Two directions and two loops of a bushing with a mass that the paper's model lacks."""
    truth = heavier(0.1)
    return [swept(truth), swept(truth, Direction.RADIAL), looped(truth, 1e-3), looped(truth, 2e-3)]


def maps(figure: Figure) -> list[Axes]:
    return [axes for axes in figure.axes if cells(axes)]


def cells(axes: Axes) -> list[PolyCollection]:
    """The coloured cells of a map."""
    return [found for found in axes.collections if type(found) is PolyCollection and found.get_array() is not None]


def headings(figure: Figure) -> list[str]:
    return [axes.get_title() for axes in figure.axes if axes.get_title()]


def test_one_symmetric_scale_and_cells_that_are_measured_minus_model_in_percent(
    paper_model, stiff, heavier, campaign, swept
):
    figure = gap(paper_model, heavier(0.1), campaign)
    coloured = [found for axes in maps(figure) for found in cells(axes)]
    norm, cmap = coloured[0].norm, coloured[0].cmap
    assert all(found.norm is norm and found.cmap == cmap for found in coloured)
    np.testing.assert_allclose(norm.boundaries, -norm.boundaries[::-1])
    np.testing.assert_allclose(cmap(norm([0.0, -0.4, 0.4]))[:, :3], 0.92)  # nothing measured is white
    below, above = cmap(norm([-4.0, 4.0]))
    assert below[2] > below[0], "blue below"
    assert above[0] > above[2], "red above"
    data_set = swept(paper_model)
    axes = maps(gap(stiff, paper_model, [data_set]))
    storage = values(axes[0])
    assert (storage < 0).all(), "the measurement lies below a model that is too stiff"
    here = (data_set.amplitude == 2e-4) & (data_set.frequency == 55.0)
    assert here.sum() == 3
    assert storage[16 + 5] == pytest.approx(-100.0 * data_set.relative_difference(stiff)[0][here].mean())
    assert np.std(values(axes[1])) < 2.0
    assert sum(len(found.get_segments()) for found in axes[0].collections if hasattr(found, "get_segments")) >= 48


def values(axes: Axes) -> Any:
    return np.concatenate([np.asarray(found.get_array()) for found in cells(axes)])


def test_loops_are_means_in_percent_of_half_the_force_range(paper_model, stiff, looped):
    data_set = looped(paper_model, 1e-3)
    figure = whole(gap(paper_model, paper_model, [data_set]))
    (axes,) = figure.axes
    assert headings(figure)[0].startswith("nothing added\n")
    assert len(axes.get_lines()[0].get_xdata()) == 36
    assert legend(axes) == ["1 mm, 0.1 Hz"]
    after_turn = gap(stiff, paper_model, [data_set]).axes[0].get_lines()[0].get_ydata()[0]
    assert after_turn == pytest.approx(-20.0, abs=1.5), "20 % below at the upper turn"
