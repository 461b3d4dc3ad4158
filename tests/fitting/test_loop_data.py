"""Residuals of a loop: white where the model is right, scaled and weighted as they say."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import RigSettings, SimulateSettings
from bushfit.fitting.data_sets import LoopData, loop_data
from bushfit.model.model import Model


@pytest.fixture
def data_set(rig: Callable[..., Campaign], paper_noise: SimulateSettings, paper_model: Model) -> LoopData:
    """A loop of a rig whose gain is known: its rows are independent."""
    return loop_data(rig(paper_model, paper_noise, 1).loops, RigSettings(gain_error=0.0))[0]


def test_the_right_model_leaves_noise_alone(data_set: LoopData, paper_model: Model) -> None:
    residual = data_set.residual(paper_model)
    counted = data_set.drive.weight > 0.0
    assert residual.size == data_set.size == data_set.test.time.size
    assert data_set.counted == np.count_nonzero(counted) > 0.99 * data_set.size
    assert np.std(residual[counted]) == pytest.approx(1.0, abs=0.05)
    assert abs(np.corrcoef(residual[1:], residual[:-1])[0, 1]) < 0.06
    assert data_set.relative_noise == pytest.approx(3e-3, rel=0.1)
    weighed = data_set.relative(paper_model) / data_set.relative_noise * np.sqrt(data_set.drive.weight[counted])
    np.testing.assert_allclose(np.abs(residual[counted]), weighed, rtol=1e-9)
    assert np.array_equal(data_set.distance(paper_model), np.abs(residual))


def test_a_loop_is_an_operating_point_too(data_set: LoopData, paper_model: Model) -> None:
    assert data_set.frequency == pytest.approx([0.1], rel=1e-3)
    assert data_set.amplitude == pytest.approx([1e-3], rel=2e-3)
    closed = paper_model.stiffness("axial", data_set.frequency, data_set.amplitude)
    np.testing.assert_allclose(data_set.measured, closed, rtol=2e-3)


def test_of_a_loop_that_stands_on_its_first_harmonic_no_other_departs(data_set: LoopData, paper_model: Model) -> None:
    """A model 3 % too stiff departs by 3 % in the slope, and in nothing that was left out."""
    stiffer = paper_model.with_values({"mu": 1.03 * paper_model.values["mu"]})
    fundamental = data_set.fundamental()
    sizes = np.linalg.norm(fundamental.contrasts(), axis=1)
    assert np.flatnonzero(sizes).tolist() == [1, 2]
    assert 0.005 < fundamental.smooth_misfit(stiffer) < 0.04


def test_what_the_model_would_have_measured_has_no_residual(data_set: LoopData, paper_model: Model) -> None:
    assert np.max(np.abs(data_set.noise_free(paper_model).residual(paper_model))) < 1e-9


def test_rows_without_weight_count_for_nothing_and_are_still_shown(data_set: LoopData, paper_model: Model) -> None:
    weight = np.ones(data_set.size)
    weight[:500] = 0.0
    light = data_set.weighted(weight)
    assert light.counted == np.count_nonzero(data_set.drive.weight[500:])
    assert np.all(light.residual(paper_model)[:500] == 0.0)
    off = (data_set.force(paper_model) - data_set.drive.force) / data_set.drive.noise
    np.testing.assert_allclose(light.shown(paper_model)[:500], off[:500], rtol=1e-9)
    np.testing.assert_allclose(light.residual(paper_model)[500:], data_set.residual(paper_model)[500:], rtol=1e-12)
    assert light.relative(paper_model).size == light.counted
    half = data_set.weighted(np.full(data_set.size, 0.25))
    np.testing.assert_allclose(half.residual(paper_model), 0.5 * data_set.residual(paper_model), rtol=1e-12)


def test_answers_to_the_same_model_are_kept_and_cannot_be_written_over(data_set: LoopData, paper_model: Model) -> None:
    found = data_set.force(paper_model)
    assert np.array_equal(data_set.force(paper_model.with_values({})), found)
    other = data_set.force(paper_model.with_values({"mu": 2e6}))
    assert not np.array_equal(other, found)
    slopes = data_set.jacobian(paper_model, ["mu", "m"])
    assert data_set.jacobian(paper_model, ["mu", "m"]) is slopes
    with pytest.raises(ValueError, match="read-only"):
        slopes[0] = 0.0
    assert not np.array_equal(data_set.jacobian(paper_model, ["m", "mu"]), slopes)


def test_a_gain_error_of_the_rig_pulls_no_fit(
    rig: Callable[..., Campaign], paper_noise: SimulateSettings, paper_model: Model
) -> None:
    """The gain that each of eight loops asks for, all of gain 1: noise in the gain's own column would make it small.

    With the force as it was measured in that column, the mean is 6 % below 1 (Peelle's puzzle).
    """
    stated, asked = RigSettings(gain_error=5e-3), []
    for seed in range(8):
        (loop,) = loop_data(rig(paper_model, replace(paper_noise, force_noise=5e-3), seed).loops, stated)
        residual, column = loop.residual(paper_model), loop.moved(loop.measured, paper_model)
        asked.append(-(column @ residual) / (column @ column))
    print("mean gain asked for, less 1:", np.mean(asked))
    assert abs(np.mean(asked)) < 1e-3
    assert np.linalg.norm(column) == pytest.approx(1.0 / 5e-3, rel=0.15)  # no loop tells a gain better than its rig
