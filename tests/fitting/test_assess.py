"""What a solution is worth: covariance, quality, reach of the tests, misfit per test and run, and what is held out.

And what a fit says of the tests it left out, and of tests that no rubber could have given.
"""

from dataclasses import replace

import numpy as np
import pytest
from fits import joint_fit

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.simulated import SimulatedLoop, SimulatedSweep
from bushfit.fitting.agreement import LeaveOut
from bushfit.fitting.assess import covariance
from bushfit.fitting.preparation import MeasuredLoop, planned_loop
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.problem import FitProblem
from bushfit.fitting.procedures import fit_joint
from bushfit.geometry import Direction
from bushfit.model.model import FIVE, Model
from bushfit.model.result import Misfit, Result
from tests.fits import jacobian, solve

LEVELS = (1e-4, 2e-4, 5e-4)


@pytest.fixture
def levelled(rig) -> Campaign:
    """Simulated: an axial loop, an axial and a radial sweep of three levels."""
    frequencies = tuple(np.arange(5.0, 156.0, 10.0))
    sweeps = tuple(SimulatedSweep(direction, LEVELS, frequencies) for direction in (Direction.AXIAL, Direction.RADIAL))
    return rig(5, loops=(SimulatedLoop(Direction.AXIAL, 1e-3, 0.1),), sweeps=sweeps)


def test_the_nrmse_of_a_loop_excludes_the_zero_of_the_load_cell(levelled):
    (loop,) = levelled.loops
    shifted = replace(loop, force=loop.force + 0.02 * np.ptp(loop.force))
    results = [fit_joint(PreparedCampaign.from_campaign(replace(levelled, loops=(each,)))) for each in (loop, shifted)]
    assert results[1].quality.nrmse == pytest.approx(results[0].quality.nrmse, rel=0.02)


def test_what_wrong_weights_cost_is_that_of_a_mean_of_two_groups(paper_model):
    """One parameter from two loops of unsure noise, as P. Meier (Biometrics 9 (1953) 59) has a mean of two groups: its
    variance grows by 4 sum p (1 - p)/f, p the weights and f the degrees of freedom; and has those of Satterthwaite."""
    new = {400: (1e-3, 0.01), 1000: (4e-4, 0.006)}  # rows, amplitude and noise
    loops = [planned_loop(paper_model, Direction.AXIAL, 0.1, *of, cycles=2.0, rows=rows) for rows, of in new.items()]

    def stated(noise: float | None) -> list[MeasuredLoop]:
        tests = [replace(loop.test, name=f"{number}", noise=noise) for number, loop in enumerate(loops)]
        return [replace(each, test=test) for each, test in zip(loops, tests, strict=True)]

    plain, wide = (covariance(paper_model, [FitProblem(paper_model, stated(noise), ["mu"])]) for noise in (0.01, None))
    told = np.array([float(np.sum(np.square(jacobian(paper_model, [loop], ["mu"])))) for loop in loops])
    told /= paper_model.values["mu"] ** 2
    share, freedom = told / told.sum(), np.array([loop.residual_count for loop in loops])
    assert plain.matrix[0, 0] == pytest.approx(1.0 / told.sum(), rel=1e-6)
    grown = wide.matrix[0, 0] / plain.matrix[0, 0] - 1.0
    assert grown == pytest.approx(4.0 * np.sum(share * (1.0 - share) / freedom), rel=1e-3)
    assert wide.freedom(np.ones((1, 1)))[0] == pytest.approx(1.0 / np.sum(share**2 / freedom), rel=0.01)


def level_off(campaign: Campaign, test: int, level: float, factor: float) -> Campaign:
    """The campaign with one level of a sweep off by a factor."""
    sweeps = list(campaign.sweeps)
    wrong = np.where(sweeps[test].amplitude == level, factor, 1.0)
    sweeps[test] = replace(sweeps[test], stiffness=wrong * sweeps[test].stiffness)
    return replace(campaign, sweeps=tuple(sweeps))


def runs(result: Result, direction: str) -> dict[float | None, Misfit]:
    return {test.value: test for test in result.tests if test.place == direction and test.points < 1000}


def test_thousands_of_rows_of_a_loop_do_not_hide_a_level_that_is_off(levelled):
    result = joint_fit(level_off(levelled, 1, 2e-4, 1.03))
    told = runs(result, "radial")
    assert result.quality.nrmse < 0.01, "the loop's rows make the total look well"
    assert told[2e-4].gain == pytest.approx(0.03, abs=0.01)
    assert (told[2e-4].held, told[2e-4].unit, told[2e-4].fitted) == ("amplitude", "m", False)
    assert all(abs(told[level].gain) < 0.01 for level in (1e-4, 5e-4))
    assert [test.fitted for test in result.tests if test.held is None] == [True, True, False]


def test_a_run_held_out_is_a_refit_without_it(levelled):
    """One Gauss-Newton step against the real refit: the same to a tenth of the standard errors."""
    data = PreparedCampaign.from_campaign(replace(levelled, loops=()))
    (sweep,) = data.select_tests(None)
    best = solve(
        FitProblem(Model.with_defaults(levelled.bushing, ("elastic", "springpot", "friction"), {}), [sweep], FIVE)
    )
    errors = np.sqrt(np.diag(np.linalg.inv(best.jacobian @ best.jacobian.T)))
    for level in LEVELS:
        rows = np.flatnonzero(np.tile(sweep.amplitude == level, 2))
        step = LeaveOut.from_fit(best.jacobian, best.residual).parameter_step(rows)
        rest = solve(FitProblem(best.model, [sweep.without(np.flatnonzero(sweep.amplitude == level))], FIVE))
        moved = best.coordinates.point(rest.model.values) - best.coordinates.point(best.model.values)
        np.testing.assert_allclose(step / errors, moved / errors, atol=0.5)


def test_usable_within_what_95_of_a_hundred_points_show(levelled):
    result = joint_fit(level_off(levelled, 1, 5e-4, 1.05))
    by_place = {place.place: place for place in result.usable}
    assert by_place["axial"].held_out
    assert 0.004 < by_place["axial"].stiffness < 0.02
    assert by_place["radial"].held_out, "it was not fitted"
    assert by_place["radial"].stiffness == pytest.approx(0.05, abs=0.015)
