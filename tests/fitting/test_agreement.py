"""Misfit per test and run, and within what a model is usable: what is off is seen, and held out means held out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import FitSettings, ParameterSetting, SimulatedLoop, SimulatedSweep
from bushfit.fitting.agreement import LeaveOut
from bushfit.fitting.data import Data
from bushfit.fitting.procedures import fit_joint
from bushfit.fitting.solve import solve
from bushfit.geometry import Direction
from bushfit.model.model import FIVE, Model
from bushfit.model.result import Misfit, Result

LEVELS = (1e-4, 2e-4, 5e-4)


@pytest.fixture
def campaign(rig: Callable[..., Campaign]) -> Campaign:
    """Simulated: an axial loop, an axial and a radial sweep of three levels."""
    frequencies = tuple(np.arange(5.0, 156.0, 10.0))
    sweeps = tuple(SimulatedSweep(direction, LEVELS, frequencies) for direction in (Direction.AXIAL, Direction.RADIAL))
    return rig(5, loops=(SimulatedLoop(Direction.AXIAL, 1e-3, 0.1),), sweeps=sweeps)


def level_off(campaign: Campaign, test: int, level: float, factor: float) -> Campaign:
    """The campaign with one level of a sweep off by a factor."""
    sweeps = list(campaign.sweeps)
    wrong = np.where(sweeps[test].amplitude == level, factor, 1.0)
    sweeps[test] = replace(sweeps[test], stiffness=wrong * sweeps[test].stiffness)
    return replace(campaign, sweeps=tuple(sweeps))


def of_levels(campaign: Campaign, at: np.ndarray) -> Campaign:
    """The campaign with some rows of its axial sweep alone."""
    axial = campaign.sweeps[0]
    parts = {name: getattr(axial, name)[at] for name in ("frequency", "amplitude", "stiffness", "repeat")}
    return replace(campaign, sweeps=(replace(axial, **parts, reached=None),))


def runs(result: Result, direction: str) -> dict[float | None, Misfit]:
    return {test.value: test for test in result.tests if test.place == direction and test.points < 1000}


def test_thousands_of_rows_of_a_loop_do_not_hide_a_level_that_is_off(campaign: Campaign) -> None:
    result = fit_joint(Data.of(level_off(campaign, 1, 2e-4, 1.03)))
    assert result.quality is not None
    told = runs(result, "radial")
    assert result.quality.nrmse < 0.01, "the loop's rows make the total look well"
    assert told[2e-4].gain == pytest.approx(-0.03, abs=0.01)
    assert (told[2e-4].held, told[2e-4].unit, told[2e-4].fitted) == ("amplitude", "m", False)
    assert all(abs(told[level].gain) < 0.01 for level in (1e-4, 5e-4))
    assert [test.fitted for test in result.tests if test.held is None] == [True, True, False]


def test_a_test_is_the_sum_of_its_runs(campaign: Campaign) -> None:
    told = runs(fit_joint(Data.of(campaign)), "axial")
    whole = told.pop(None)
    assert sorted(told) == list(LEVELS)  # type: ignore[type-var]
    assert sum(test.points for test in told.values()) == whole.points
    for name in ("reduced_chi_square", "gain"):
        mean = np.average([getattr(test, name) for test in told.values()], weights=[t.points for t in told.values()])
        assert getattr(whole, name) == pytest.approx(mean)


def test_a_run_held_out_is_a_refit_without_it(campaign: Campaign) -> None:
    """One Gauss-Newton step against the real refit: the same to a tenth of the standard errors."""
    data = Data.of(replace(campaign, loops=()))
    (sweep,) = data.chosen(None)
    best = solve(Model.started(campaign.bushing, ("elastic", "springpot", "friction"), {}), [sweep], FIVE)
    errors = np.sqrt(np.diag(np.linalg.inv(best.jacobian @ best.jacobian.T)))
    for level in LEVELS:
        rows = np.flatnonzero(np.tile(sweep.amplitude == level, 2))
        step = LeaveOut.of(best.jacobian, best.residual).step(rows)
        assert step is not None
        rest = solve(best.model, [sweep.without(np.flatnonzero(sweep.amplitude == level))], FIVE)
        moved = best.coordinates.point(rest.model.values) - best.coordinates.point(best.model.values)
        np.testing.assert_allclose(step / errors, moved / errors, atol=0.5)


def test_what_the_rest_leaves_open_is_not_held_out() -> None:
    random = np.random.default_rng(1)
    jacobian = np.zeros((2, 20))
    jacobian[0] = random.standard_normal(20)
    jacobian[1, :5] = 1.0
    whole = LeaveOut.of(jacobian, 0.1 * random.standard_normal(20))
    assert whole.step(np.arange(5)) is None
    assert whole.step(np.arange(5, 10)) is not None
    assert LeaveOut.of(np.zeros((0, 20)), np.ones(20)).step(np.arange(3)).shape == (0,)  # type: ignore[union-attr]


def test_usable_within_what_95_of_a_hundred_points_show(campaign: Campaign) -> None:
    result = fit_joint(Data.of(level_off(campaign, 1, 5e-4, 1.05)))
    by_place = {place.place: place for place in result.usable}
    assert by_place["axial"].held_out
    assert 0.004 < by_place["axial"].stiffness < 0.02
    assert by_place["radial"].held_out, "it was not fitted"
    assert by_place["radial"].stiffness == pytest.approx(0.05, abs=0.015)


def test_one_level_alone_counts_as_fitted(campaign: Campaign) -> None:
    alone = of_levels(campaign, campaign.sweeps[0].amplitude == 2e-4)
    held = FitSettings(parameters={"mu": ParameterSetting(value=1e6)})
    (place,) = fit_joint(Data.of(replace(alone, fit=held))).usable
    assert not place.held_out


def test_a_run_without_which_the_rest_says_something_else_counts_as_fitted(campaign: Campaign) -> None:
    """Two levels that contradict each other: one Gauss-Newton step to the other is no refit."""
    two = replace(of_levels(campaign, campaign.sweeps[0].amplitude != 5e-4), loops=())
    (place,) = fit_joint(Data.of(level_off(two, 0, 2e-4, 1.1))).usable
    assert not place.held_out
    assert place.stiffness < 0.2


def test_values_that_are_given_are_predictions(campaign: Campaign, paper_model: Model) -> None:
    held = {name: ParameterSetting(value=value, vary=False) for name, value in paper_model.values.items()}
    result = fit_joint(Data.of(replace(campaign, fit=FitSettings(parameters=held))))
    assert all(place.held_out for place in result.usable)


def test_a_robust_fit_counts_no_outliers(campaign: Campaign) -> None:
    sweep = campaign.sweeps[0]
    spoiled = sweep.stiffness.copy()
    spoiled[10] *= 2.0
    data = Data.of(replace(campaign, sweeps=(replace(sweep, stiffness=spoiled),), fit=FitSettings(loss="soft_l1")))
    result = fit_joint(data)
    whole = runs(result, "axial")[None]
    assert whole.points == sweep.frequency.size - 1
    assert whole.nrmse < 0.02
    (place,) = result.usable
    assert place.stiffness < 0.02
