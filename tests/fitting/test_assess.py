"""What a solution is worth: covariance, quality, reach of the tests, and whether the model misses the data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bushfit.campaign.campaign import Campaign
from bushfit.fitting.assess import Stage, covariance, lack_of_fit, measured_range, misfit, quality
from bushfit.fitting.coordinates import jacobian
from bushfit.fitting.data import Data
from bushfit.fitting.data_sets import LoopData
from bushfit.geometry import Direction
from bushfit.model.model import FIVE, Model
from bushfit.model.result import Result


def test_the_covariance_of_one_stage_is_no_less_than_that_of_least_squares(measured: Data, result: Result) -> None:
    """The noise is estimated too, which can only add to the inverse of J J^T."""
    model, data_sets = result.model, measured.chosen(None)
    found = covariance(model, [Stage(FIVE, data_sets)])
    slope = jacobian(model, data_sets, FIVE)
    values = np.array([model.values[name] for name in FIVE])
    plain = np.sqrt(np.diag(np.linalg.inv(slope @ slope.T))) * values
    stated = np.array([found.stderr(name) for name in FIVE])
    assert np.all(stated >= plain * (1.0 - 1e-6))
    known = [replace(each, gain_error=0.0) if isinstance(each, LoopData) else each for each in data_sets]
    certain = covariance(model, [Stage(FIVE, known)])  # of gain
    np.testing.assert_allclose([certain.stderr(name) for name in FIVE], plain, rtol=0.1)


def test_quality_and_reach_are_those_of_the_data(measured: Data, result: Result) -> None:
    data_sets = measured.chosen(None)
    found = quality(result.model, data_sets, 5)
    assert found.points == sum(data_set.counted for data_set in data_sets)
    assert found.reduced_chi_square == pytest.approx(1.0, abs=0.1)
    assert found.nrmse == pytest.approx(found.noise, rel=0.15)
    reach = measured_range(result.model, data_sets)
    assert reach.frequency == pytest.approx((0.1, 155.0), rel=1e-3)
    assert reach.strain == pytest.approx((0.0062, 0.062), rel=0.01)
    assert reach.directions == (Direction.AXIAL,)


def test_a_model_that_misses_the_data_is_told_and_one_that_does_not_is_not(measured: Data, result: Result) -> None:
    data_sets = measured.chosen(None)
    assert lack_of_fit(result.model, data_sets, 5) is None
    assert misfit(result.model, data_sets, 5) == []
    off = result.model.with_values({"mu": 1.05 * result.model.values["mu"]})
    reduced = lack_of_fit(off, data_sets, 5)
    assert reduced is not None
    assert reduced > 2.0
    (sentence,) = misfit(off, data_sets, 5, ", and so on")
    assert "intervals are invalid" in sentence
    assert sentence.endswith("standard errors are scaled up, and so on")


def test_a_parameter_that_no_test_sees_has_an_error_beyond_all_bounds(
    rig: Callable[..., Campaign], paper_model: Model
) -> None:
    data_sets = Data.of(replace(rig(), sweeps=())).chosen(None)
    model = paper_model.with_effect("stiffness_factor.radial")
    names = (*FIVE[:1], "stiffness_factor.radial")
    found = covariance(model, [Stage(names, data_sets)])
    assert found.stderr("stiffness_factor.radial") > 10.0  # type: ignore[operator]
    assert found.stderr("mu") < 1e-2 * model.values["mu"]  # type: ignore[operator]
