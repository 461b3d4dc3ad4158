"""Errors that all repeats of a level share: told from what a fit leaves, and counted in its intervals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import RigSettings, SimulateSettings
from bushfit.fitting.data import Data
from bushfit.fitting.levels import level_errors
from bushfit.fitting.procedures import fit_joint
from bushfit.fitting.solve import solve
from bushfit.model.model import FIVE, Model

BOTH = ["axial", "radial"]


def off_by_level(campaign: Campaign, error: float, seed: int) -> Campaign:
    """A simulated campaign whose levels are each off in gain and phase, all their repeats alike."""
    random, sweeps = np.random.default_rng([seed, 5]), []
    for sweep in campaign.sweeps:
        levels, place = np.unique(sweep.amplitude, return_inverse=True)
        gain, phase = error * random.standard_normal((2, levels.size))
        sweeps.append(replace(sweep, stiffness=sweep.stiffness * np.exp(gain + 1j * phase)[place]))
    return replace(campaign, sweeps=tuple(sweeps))


@pytest.mark.parametrize("error", [0.0, 5e-3])
def test_errors_of_levels_are_told(
    rig: Callable[..., Campaign], paper_noise: SimulateSettings, paper_model: Model, error: float
) -> None:
    found, matters = [], []
    for seed in range(30):
        data = Data.of(off_by_level(rig(paper_model, paper_noise, seed), error, seed))
        solution = solve(paper_model, data.chosen(BOTH), FIVE)
        told = level_errors(data.chosen(BOTH), solution.residual, solution.jacobian, (1.0, 1.0))
        found.append(np.square(told.error))
        matters.append(told.matters)
    size = np.sqrt(np.mean(found, axis=0))
    print(f"true {error}: {size}, {np.mean(matters):.0%} matter")
    np.testing.assert_allclose(size, error, rtol=0.25, atol=1e-3)
    assert np.mean(matters) >= 0.95 if error else np.mean(matters) <= 0.05


def test_what_the_class_of_the_rig_states_widens_intervals(
    rig: Callable[..., Campaign], paper_noise: SimulateSettings, paper_model: Model
) -> None:
    campaign = rig(paper_model, paper_noise, 1)
    rigs = RigSettings(gain_error=0.0, phase_error=0.0), RigSettings(gain_error=5e-3, phase_error=4e-3)
    stated = (Data.of(replace(campaign, rig=rig)) for rig in rigs)
    plain, wide = (fit_joint(data, directions=BOTH).covariance.stderr("m") for data in stated)
    assert plain is not None
    assert wide is not None
    assert wide > 1.5 * plain


@pytest.mark.slow
@pytest.mark.parametrize("directions", [["axial"], BOTH], ids=["axial", "both"])
@pytest.mark.parametrize("error", [0.0, 5e-3])
def test_95_percent_intervals_cover_with_errors_of_levels(
    rig: Callable[..., Campaign],
    paper_noise: SimulateSettings,
    paper_model: Model,
    directions: list[str],
    error: float,
) -> None:
    inside, seeds = [], 100
    for seed in range(seeds):
        campaign = off_by_level(rig(paper_model, paper_noise, seed), error, seed)
        result = fit_joint(Data.of(campaign), directions=directions)
        limits = [result.interval(name) or (np.nan, np.nan) for name in FIVE]
        truth = paper_model.values
        inside.append([low <= truth[name] <= high for name, (low, high) in zip(FIVE, limits, strict=True)])
    share, chance = np.mean(inside), 1.96 * np.std(np.mean(inside, axis=1)) / np.sqrt(seeds)
    print(f"{directions}, {error} a level, {seeds} seeds: {share:.3f} +- {chance:.3f} of the intervals hold the truth")
    assert 0.93 - chance <= share
    assert share <= 0.97 + chance or not error  # the class that is assumed is then larger than the rig's errors
