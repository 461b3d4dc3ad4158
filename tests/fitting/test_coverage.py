"""Whether 95 % means 95 %: intervals and bands against the truth, over simulated campaigns that differ in noise."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import UNSTATED, RigSettings, SimulateSettings
from bushfit.fitting.data import Data
from bushfit.fitting.procedures import fit_joint
from bushfit.geometry import Direction
from bushfit.model.model import FIVE, Model
from bushfit.model.result import Result
from bushfit.prediction import Band, predict

SEEDS = 300
#: Campaigns whose loop noise is correlated from row to row.
FILTERED_SEEDS = 150
#: Three standard errors of a share of 95 % over that many campaigns.
CHANCE = 3.0 * np.sqrt(0.95 * 0.05 / SEEDS)

#: How many times as wide intervals have to be to hold all five parameters at once: the normal quantile of 1 % over that
#: of 5 % (Bonferroni).
AT_ONCE = 1.3

Rig = Callable[..., Campaign]


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
        pairs: list[tuple[Band, np.ndarray]] = [
            (found.stiffness, np.abs(stiffness)),
            (found.loss_factor, stiffness.imag / stiffness.real),
            (found.storage_stiffness, stiffness.real),
            (found.loss_stiffness, stiffness.imag),
        ]
        shares.append([np.mean((band.low <= true) & (true <= band.high)) for band, true in pairs])
    return np.array(shares)


def coverage(rig: Rig, truth: Model, noise: SimulateSettings, seeds: int) -> tuple[np.ndarray, np.ndarray]:
    """Per seed whether each parameter's interval, (seeds, 5), and the share of each band, hold the truth."""
    exact = RigSettings(gain_error=0.0, phase_error=0.0)  # as it is simulated: no calibration is off
    results = [fit_joint(Data.of(replace(rig(truth, noise, seed), rig=exact))) for seed in range(seeds)]
    inside = np.array([covered(result, truth.values) for result in results])
    return inside, np.array([bands_covered(result, truth) for result in results])


def told(shares: np.ndarray) -> str:
    """A mean share with its 95 % interval, from the shares of each campaign, (seeds, ...)."""
    by_seed = shares.reshape(len(shares), -1).mean(axis=1)
    return f"{by_seed.mean():.3f} +- {1.96 * by_seed.std() / np.sqrt(len(by_seed)):.3f}"


@pytest.mark.parametrize(
    ("correlation", "seeds"),
    [
        (0.98, 20),
        *(pytest.param(correlation, FILTERED_SEEDS, marks=pytest.mark.slow) for correlation in (0.0, 0.9, 0.98)),
    ],
)
def test_intervals_cover_where_the_noise_of_a_loop_is_filtered(
    rig: Rig, paper_noise: SimulateSettings, paper_model: Model, correlation: float, seeds: int
) -> None:
    inside, banded = coverage(rig, paper_model, replace(paper_noise, force_correlation=correlation), seeds)
    print(
        f"rows of a loop correlated by {correlation}, {seeds} simulated campaigns: of all intervals "
        f"{told(inside)} hold the truth, of each parameter {inside.mean(axis=0).round(3)}; of all bands {told(banded)}"
    )
    widest = 0.03 if seeds == FILTERED_SEEDS else 0.10
    assert abs(inside.mean() - 0.95) <= widest
    assert abs(banded.mean() - 0.95) <= widest


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "shared"),
    [
        ("paper", False),
        ("soft and long", False),
        ("stiff and thin", False),
        ("strongly filled", False),
        ("paper", True),
        ("stiff and thin", True),
    ],
)
def test_95_percent_intervals_and_bands_cover(
    rig: Rig,
    paper_noise: SimulateSettings,
    shared_noise: SimulateSettings,
    paper_model: Model,
    other_models: dict[str, Model],
    name: str,
    shared: bool,
) -> None:
    truth = {"paper": paper_model, **other_models}[name]
    inside, banded = coverage(rig, truth, shared_noise if shared else paper_noise, SEEDS)
    each, bands = np.mean(inside, axis=0), np.mean(banded, axis=0)
    print(
        f"{name}, {SEEDS} seeds, block errors {shared}: all parameters {np.mean(inside):.3f}, "
        + ", ".join(f"{parameter} {share:.3f}" for parameter, share in zip(FIVE, each, strict=True))
    )
    print(
        f"  bands at points not fitted {np.mean(banded):.3f}; axial |K|, loss factor, K', K'': {bands[0].round(3)}, "
        f"radial {bands[1].round(3)}"
    )
    assert 0.93 <= np.mean(inside) <= 0.97
    assert 0.93 <= np.mean(banded) <= 0.97
    assert np.all(np.abs(each - 0.95) <= max(0.02, CHANCE))
    assert np.all(np.abs(bands - 0.95) <= max(0.02, CHANCE))


@pytest.mark.parametrize("seeds", [12, pytest.param(SEEDS, marks=pytest.mark.slow)])
@pytest.mark.parametrize("stated", [False, True])
def test_95_percent_intervals_cover_where_the_gain_of_a_loop_is_off(
    rig: Rig, paper_noise: SimulateSettings, paper_model: Model, seeds: int, stated: bool
) -> None:
    """By 0.5 %, as each run and level of the sweeps, whether [rig] states it or nothing does; and all five at once."""
    noise = replace(paper_noise, gain_error=5e-3, level_gain_error=5e-3)
    inside, wide = [], []
    for seed in range(seeds):
        campaign = replace(rig(paper_model, noise, seed), rig=RigSettings(gain_error=5e-3) if stated else UNSTATED)
        result = fit_joint(Data.of(campaign))
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
