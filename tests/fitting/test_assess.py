"""What a solution is worth: covariance, quality, reach of the tests, and whether the model misses the data.

And what a fit says of the tests it left out, and of tests that no rubber could have given.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import SimulatedLoop, SimulatedSweep
from bushfit.diagnosis.workflow import diagnose
from bushfit.fitting.assess import Stage, covariance, lack_of_fit, measured_range, misfit, quality
from bushfit.fitting.coordinates import jacobian
from bushfit.fitting.data import Data
from bushfit.fitting.data_sets import LoopData, new_loop
from bushfit.fitting.procedures import fit_joint, fit_two_step
from bushfit.fitting.solve import solve
from bushfit.geometry import Direction
from bushfit.model.model import FIVE, Model
from bushfit.model.result import Result
from bushfit.reading.measurement import Sweep
from bushfit.units import CELSIUS

BAND = (5.0, 15.0, 45.0, 100.0, 155.0)


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


@pytest.fixture
def small(rig: Callable[..., Campaign]) -> Campaign:
    """An axial loop, an axial and a radial sweep."""
    sweeps = tuple(SimulatedSweep(direction, (1e-4, 5e-4), BAND) for direction in (Direction.AXIAL, Direction.RADIAL))
    return rig(1, loops=(SimulatedLoop(Direction.AXIAL, 1e-3, 0.1),), sweeps=sweeps)


def stiffer(test: Sweep, factor: float) -> Sweep:
    return replace(test, stiffness=factor * test.stiffness)


def without(campaign: Campaign, direction: Direction) -> tuple[Sweep, ...]:
    return tuple(sweep for sweep in campaign.sweeps if sweep.direction is not direction)


@pytest.mark.parametrize("factor", [1.0, 1.05])
def test_a_test_that_was_left_out_is_told_where_the_model_misses_it(small: Campaign, factor: float) -> None:
    radial = [stiffer(sweep, factor) for sweep in without(small, Direction.AXIAL)]
    data = Data.of(replace(small, sweeps=(*without(small, Direction.RADIAL), *radial)))
    told = [line for line in fit_joint(data).warnings if "was not fitted" in line]
    assert len(told) == (factor != 1.0)
    if told:
        assert f"{radial[0].name}, radial, was not fitted, and the model misses it by 4." in told[0]
        assert "bushfit diagnose" in told[0]
    both = fit_joint(data, directions=(Direction.AXIAL, Direction.RADIAL))
    assert not any("was not fitted" in line for line in both.warnings)


def test_kilonewtons_taken_for_newtons_are_told(small: Campaign) -> None:
    axial = without(small, Direction.RADIAL)
    slip = replace(small, sweeps=tuple(stiffer(sweep, 1e-3) for sweep in axial))
    (told,) = [line for line in fit_joint(Data.of(slip)).warnings if "units" in line]
    assert told.startswith(f"{small.loops[0].name} shows ")
    assert f"times the modulus of {axial[0].name}, which no rubber does: check the units" in told


@pytest.mark.parametrize(("warm", "told"), [(25.9, 0), (60.0, 1)])
def test_tests_at_other_temperatures_are_told_by_fit_and_diagnose(small: Campaign, warm: float, told: int) -> None:
    (loop,), (sweep,) = small.loops, without(small, Direction.RADIAL)
    at_23, hot = replace(loop, temperature=23.0 + CELSIUS), replace(sweep, temperature=warm + CELSIUS)
    data = Data.of(replace(small, loops=(at_23,), sweeps=(hot,)))
    for result in (fit_joint(data), fit_two_step(data).result, diagnose(data).result):
        lines = [line for line in result.warnings if "degC" in line]
        assert len(lines) == told
        if told:
            assert lines[0].startswith(
                f"{sweep.name} was tested at 60 degC and {loop.name} at 23 degC, 37 degC apart: "
            )


def test_a_modulus_of_no_rubber_is_told(small: Campaign) -> None:
    loops = tuple(replace(loop, force=1e-3 * loop.force) for loop in small.loops)
    axial = tuple(stiffer(sweep, 1e-3) for sweep in without(small, Direction.RADIAL))
    (told,) = [
        line for line in fit_joint(Data.of(replace(small, loops=loops, sweeps=axial))).warnings if "units" in line
    ]
    assert "kPa is that of no rubber" in told


def test_what_wrong_weights_cost_is_that_of_a_mean_of_two_groups(paper_model: Model) -> None:
    """One parameter from two loops of unsure noise, as P. Meier (Biometrics 9 (1953) 59) has a mean of two groups: its
    variance grows by 4 sum p (1 - p)/f, p the weights and f the degrees of freedom; and has those of Satterthwaite."""
    new = {400: (1e-3, 0.01), 1000: (4e-4, 0.006)}  # rows, amplitude and noise
    loops = [new_loop(paper_model, Direction.AXIAL, 0.1, *of, cycles=2.0, rows=rows) for rows, of in new.items()]

    def stated(noise: float | None) -> list[LoopData]:
        tests = [replace(loop.test, name=f"{number}", noise=noise) for number, loop in enumerate(loops)]
        return [replace(each, drive=replace(each.drive, loop=test)) for each, test in zip(loops, tests, strict=True)]

    plain, wide = (covariance(paper_model, [Stage(("mu",), stated(noise))]) for noise in (0.01, None))
    told = np.array([float(np.sum(np.square(loop.jacobian(paper_model, ["mu"])))) for loop in loops])
    share, freedom = told / told.sum(), np.array([loop.counted for loop in loops])
    print("weights", share, "of rows", freedom)
    assert plain.matrix[0, 0] == pytest.approx(1.0 / told.sum(), rel=1e-6)
    grown = wide.matrix[0, 0] / plain.matrix[0, 0] - 1.0
    assert grown == pytest.approx(4.0 * np.sum(share * (1.0 - share) / freedom), rel=1e-3)
    assert wide.freedom(np.ones((1, 1)))[0] == pytest.approx(1.0 / np.sum(share**2 / freedom), rel=0.01)


def test_a_gain_that_does_not_weigh_moves_parameters_as_a_refit_says(small: Campaign, paper_model: Model) -> None:
    """What its standard error adds to the covariance are the squares of how far a loop that is off by it leads."""
    data = Data.of(small)
    loop = replace(data.loops[0], gain_error=0.01, gain_weighs=False)
    fitted = solve(paper_model, (*data.sweeps, loop), FIVE).model
    off = replace(loop, drive=replace(loop.drive, force=1.01 * loop.drive.force))
    moved = solve(fitted, (*data.sweeps, off), FIVE).model
    shift = np.array([moved.values[name] - fitted.values[name] for name in FIVE])
    known, unknown = (
        covariance(fitted, [Stage(tuple(FIVE), (*data.sweeps, each))]) for each in (replace(loop, gain_error=0.0), loop)
    )
    added = np.sqrt(np.diag(unknown.matrix - known.matrix))
    np.testing.assert_allclose(added, np.abs(shift), rtol=0.1, atol=0.02 * np.sqrt(np.diag(known.matrix)).min())
