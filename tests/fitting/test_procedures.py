"""What the fits must hold: the truth found from ideal and from noisy tests, whatever the start; and 95 % means 95 %.

Intervals and bands against the truth, over simulated campaigns that differ in noise; and the errors that all repeats of
a level share, told from what a fit leaves.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fits import joint_fit
from tries import SEEDS

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import UNSTATED, RigSettings
from bushfit.campaign.simulated import SimulateSettings
from bushfit.fitting.levels import level_errors
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.problem import FitProblem
from bushfit.fitting.procedures import fit_dynamic, fit_joint, fit_two_step
from bushfit.geometry import Direction
from bushfit.model.model import FIVE, Model
from bushfit.model.result import Result
from bushfit.prediction.stiffness import predict
from tests.fits import held_by_bands, solve

Rig = Callable[..., Campaign]
NAMES = ("paper", "soft and long", "stiff and thin", "strongly filled")
#: Three standard errors of a share of 95 % over that many campaigns.
CHANCE = 3.0 * np.sqrt(0.95 * 0.05 / SEEDS)
#: How many times as wide intervals have to be to hold all five parameters at once: the normal quantile of 1 % over that
#: of 5 % (Bonferroni).
AT_ONCE = 1.3
BOTH = ["axial", "radial"]


@pytest.fixture(scope="module")
def models(paper_model, other_models) -> dict[str, Model]:
    return {"paper": paper_model, **other_models}


def errors(result: Result, truth: Mapping[str, float]) -> np.ndarray:
    """Relative errors of the five."""
    return np.array([result.model.values[name] / truth[name] - 1.0 for name in FIVE])


def shown(values: np.ndarray) -> str:
    return ", ".join(f"{name} {100 * value:+.3g} %" for name, value in zip(FIVE, values, strict=True))


@pytest.mark.parametrize("name", NAMES)
def test_an_ideal_rig_gives_the_truth_within_0_2_percent(rig, models, name):
    found = errors(joint_fit(rig(model=models[name], settings=SimulateSettings())), models[name].values)
    print(f"{name}, no noise: {shown(found)}")
    assert np.max(np.abs(found)) < 2e-3


@pytest.mark.parametrize(
    ("name", "seeds"), [(NAMES[0], 8), *(pytest.param(name, 20, marks=pytest.mark.slow) for name in NAMES)]
)
def test_the_mean_over_seeds_is_the_truth(rig, models, name, seeds):
    truth, joint, two_step, spread = models[name], [], [], []
    for seed in range(seeds):
        data = PreparedCampaign.from_campaign(rig(seed, truth))
        result = fit_joint(data)
        joint.append(errors(result, truth.values))
        spread.append([(result.covariance.stderr(n) or 0.0) / truth.values[n] for n in FIVE])
        two_step.append(errors(fit_two_step(data).result, truth.values))
    print(f"{name}, {seeds} seeds: joint {shown(np.mean(joint, axis=0))}, two-step {shown(np.mean(two_step, axis=0))}")
    print(f"  worst seed, joint: {shown(np.max(np.abs(joint), axis=0))}")
    assert np.max(np.abs(np.mean(joint, axis=0))) < 0.015 * np.sqrt(20 / seeds)
    assert np.max(np.abs(np.array(joint) / np.array(spread))) < 4.0
    two_step_error = np.std(two_step, axis=0) / np.sqrt(seeds)
    assert np.all(np.abs(np.mean(two_step, axis=0)) < 3.0 * two_step_error + 2e-3)


def test_errors_of_held_parameters_are_carried_over(measured, result):
    carried, sharp = fit_dynamic(measured, result), fit_dynamic(measured, Result(result.model))
    for name, most in (("m", 0.02), ("alpha", 0.01)):
        alone = sharp.covariance.stderr(name)
        assert carried.covariance.stderr(name) > 1.1 * alone  # type: ignore[operator]
        assert alone < most * sharp.model.values[name]  # type: ignore[operator]


def covered(result: Result, truth: Mapping[str, float]) -> list[bool]:
    """Whether each parameter's interval holds the truth."""
    limits = [result.interval(name) or (np.nan, np.nan) for name in FIVE]
    return [low <= truth[name] <= high for name, (low, high) in zip(FIVE, limits, strict=True)]


def bands_covered(result: Result, truth: Model) -> np.ndarray:
    """Share of the points of which each band holds the truth, (direction, quantity), at points that were not fitted:
    between and beyond the amplitudes and frequencies of the tests, and in the radial direction."""
    top = 1e-3 * truth.bushing.unit_strain(Direction.AXIAL)
    shares = []
    for direction in (Direction.AXIAL, Direction.RADIAL):
        amplitudes = np.array([0.05, 0.3, 0.8]) * top / truth.bushing.unit_strain(direction)
        found = predict(result, direction, [1.0, 40.0, 250.0], amplitudes)
        stiffness = truth.stiffness(direction, found.frequency, found.amplitude)
        shares.append([np.mean(inside) for inside in held_by_bands(found, stiffness)])
    return np.array(shares)


def coverage(rig: Rig, truth: Model, seeds: int, **noise: Any) -> tuple[np.ndarray, np.ndarray]:
    """Per seed whether each parameter's interval, (seeds, 5), and the share of each band, hold the truth."""
    exact = RigSettings(gain_error=0.0, phase_error=0.0)  # as it is simulated: no calibration is off
    results = [joint_fit(replace(rig(seed, truth, **noise), rig=exact)) for seed in range(seeds)]
    inside = np.array([covered(result, truth.values) for result in results])
    return inside, np.array([bands_covered(result, truth) for result in results])


def told(shares: np.ndarray) -> str:
    """A mean share with its 95 % interval, from the shares of each campaign, (seeds, ...)."""
    by_seed = shares.reshape(len(shares), -1).mean(axis=1)
    return f"{by_seed.mean():.3f} +- {1.96 * by_seed.std() / np.sqrt(len(by_seed)):.3f}"


@pytest.mark.parametrize(
    ("name", "noise", "seeds"),
    [
        ("paper", {"force_correlation": 0.98}, 20),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in (
                *(("paper", {"force_correlation": correlation}, SEEDS // 2) for correlation in (0.0, 0.9, 0.98)),
                *((name, {}, SEEDS) for name in ("paper", "soft and long", "stiff and thin", "strongly filled")),
                *((name, {"shared": True}, SEEDS) for name in ("paper", "stiff and thin")),
            )
        ),
    ],
)
def test_95_percent_intervals_and_bands_cover(rig, paper_model, other_models, name, noise, seeds):
    """Also where the noise of a loop is correlated from row to row."""
    inside, banded = coverage(rig, {"paper": paper_model, **other_models}[name], seeds, **noise)
    each, bands = np.mean(inside, axis=0), np.mean(banded, axis=0)
    print(
        f"{name}, {noise}, {seeds} seeds: {told(inside)} of all intervals hold the truth, {told(banded)} of all bands"
    )
    print(f"  of each parameter {each.round(3)}; axial and radial |K|, loss factor, K', K'': {bands.round(3).tolist()}")
    widest = 0.02 * np.sqrt(300 / seeds) if seeds > 20 else 0.10
    assert abs(np.mean(inside) - 0.95) <= widest
    assert abs(np.mean(banded) - 0.95) <= widest
    if seeds == SEEDS:
        assert np.all(np.abs(each - 0.95) <= CHANCE)
        assert np.all(np.abs(bands - 0.95) <= CHANCE)


@pytest.mark.parametrize("seeds", [12, pytest.param(SEEDS, marks=pytest.mark.slow)])
@pytest.mark.parametrize("stated", [False, True])
def test_95_percent_intervals_cover_where_the_gain_of_a_loop_is_off(rig, paper_model, seeds, stated):
    """By 0.5 %, as each run and level of the sweeps, whether [rig] states it or nothing does; and all five at once."""
    inside, wide = [], []
    for seed in range(seeds):
        campaign = rig(seed, gain_error=5e-3, level_gain_error=5e-3)
        result = joint_fit(replace(campaign, rig=RigSettings(gain_error=5e-3) if stated else UNSTATED))
        inside.append(covered(result, paper_model.values))
        ends = np.log([result.interval(name) or (np.nan, np.nan) for name in FIVE])
        off = np.log([paper_model.values[name] for name in FIVE]) - ends.mean(axis=1)
        wide.append(np.all(np.abs(off) <= AT_ONCE * np.ptp(ends, axis=1) / 2.0))
    print(
        f"stated {stated}, {seeds} seeds: {told(np.array(inside))} of the intervals hold the truth, "
        f"all five at once {np.all(inside, axis=1).mean():.3f}, {AT_ONCE} times as wide {np.mean(wide):.3f}"
    )
    chance = 1.0 if seeds == SEEDS else np.sqrt(SEEDS / seeds)
    least, most = (0.93, 0.97) if stated else (0.90, 1.0)
    assert least - chance * CHANCE / 2.0 <= np.mean(inside) <= most + chance * CHANCE / 2.0
    assert np.mean(wide) >= 0.95 - chance * CHANCE


def off_by_level(campaign: Campaign, error: float, seed: int) -> Campaign:
    """A simulated campaign whose levels are each off in gain and phase, all their repeats alike."""
    random, sweeps = np.random.default_rng([seed, 5]), []
    for sweep in campaign.sweeps:
        levels, place = np.unique(sweep.amplitude, return_inverse=True)
        gain, phase = error * random.standard_normal((2, levels.size))
        sweeps.append(replace(sweep, stiffness=sweep.stiffness * np.exp(gain + 1j * phase)[place]))
    return replace(campaign, sweeps=tuple(sweeps))


@pytest.mark.parametrize("error", [0.0, 5e-3])
def test_errors_of_levels_are_told(rig, paper_model, error):
    found, matters, freedom = [], [], []
    for seed in range(30):
        data = PreparedCampaign.from_campaign(off_by_level(rig(seed), error, seed))
        solution = solve(FitProblem(paper_model, data.select_tests(BOTH), FIVE))
        told = level_errors(data.select_tests(BOTH), solution.residual, solution.jacobian, (1.0, 1.0))
        found.append(np.square(told.error))
        matters.append(told.significant)
        freedom.append(told.freedom)
    size = np.sqrt(np.mean(found, axis=0))
    np.testing.assert_allclose(size, error, rtol=0.25, atol=1e-3)
    assert np.mean(matters) >= 0.95 if error else np.mean(matters) <= 0.05
    print(f"degrees of freedom {min(freedom)} to {max(freedom)}")
    assert not error or 2 <= min(freedom) <= max(freedom) < 6  # six levels, less what the parameters take
