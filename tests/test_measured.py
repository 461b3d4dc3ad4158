"""Measured rubber, as its page has it: coupons fitted, a mount predicted and measured; and the paper's own way."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from fits import joint_fit

from bushfit.campaign.campaign import Campaign, load_campaign, model_of
from bushfit.campaign.simulated import SimulateSettings
from bushfit.diagnosis.workflow import diagnose
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.procedures import fit_joint, fit_two_step
from bushfit.model.result import Result
from bushfit.prediction.resonance import predict_resonance
from bushfit.prediction.stiffness import predict
from bushfit.reading.finding import find_table
from bushfit.reading.headers import RESONANCE_COLUMNS
from bushfit.reading.measurement import loss_factor
from bushfit.reading.resonance import read_resonance
from bushfit.reduction.resonance import reduce_resonance
from bushfit.simulation.exact import simulate_exact
from bushfit.simulation.measured import measure

#: Draws of noise; simulated data.
SEEDS = 20
GRAVITY = 9.80665
#: Stated mass by the name of its files, and that of the discs [kg].
MASSES, DISCS = {"118g": 0.118, "253g": 0.253, "573g": 0.573, "1196g": 1.196}, 0.0148
LEVELS = {"01g": 0.1, "1g": 1.0}


@pytest.fixture(scope="module")
def off(root) -> Callable[[Campaign], tuple[float, float]]:
    """How far a campaign's two steps put the radial stiffness, relative, and loss factor off the kept computation."""
    known = pd.read_csv(root / "data/reference/stiffness_table1.csv")
    known = known[(known.direction == "radial") & known["amplitude [m or rad]"].isin([1e-4, 2e-4, 5e-4])]
    frequency, amplitude, stiffness, loss = known.iloc[:, 1:].to_numpy().T

    def worst(campaign: Campaign) -> tuple[float, float]:
        data = PreparedCampaign.from_campaign(campaign)
        assert data.smallest_sweep.amplitude.max() == 1e-4
        found = fit_two_step(data).result.model.stiffness("radial", frequency, amplitude)
        apart = np.abs(found) / stiffness - 1.0, found.imag / found.real - loss
        return float(np.abs(apart[0]).max()), float(np.abs(apart[1]).max())

    return worst


@pytest.fixture(scope="module")
def claimed(root) -> re.Match[str]:
    """What the page says: of the campaign, and median and worst of the draws [%]."""
    page = (root / "bushfit/manual/model.md").read_text(encoding="utf-8")
    found = re.search(
        r"within ([\d.]+) % of an? \[independent.*median\s+error is ([\d.]+) % and the largest ([\d.]+) %",
        page,
        re.DOTALL,
    )
    assert found is not None
    return found


def test_the_smallest_axial_sweep_and_a_loop_tell_the_radial_stiffness(root, off, claimed):
    stiffness, loss = off(load_campaign(root / "configs/cmp_15961.toml"))
    print(f"configs/cmp_15961.toml: radial stiffness {100 * stiffness:.2f} %, loss factor {loss:.4f}")
    assert 100 * stiffness <= float(claimed[1]) <= 0.7


@pytest.mark.slow
def test_so_they_do_whatever_the_noise(root, off, claimed):
    plan = SimulateSettings(noise=5e-3, force_noise=3e-3, repeats=3)
    clean = simulate_exact(model_of(load_campaign(root / "configs/table_1.toml")), plan)
    drawn = [100.0 * off(measure(clean, replace(plan, seed=seed)).campaign())[0] for seed in range(SEEDS)]
    print(f"{SEEDS} draws: radial stiffness, median {np.median(drawn):.2f} %, worst {max(drawn):.2f} %")
    assert [f"{np.median(drawn):.1f}", f"{max(drawn):.1f}"] == [claimed[2], claimed[3]]


@pytest.fixture(scope="module")
def campaign(root) -> Campaign:
    return load_campaign(root / "configs/epdm_70.toml")


@pytest.fixture(scope="module")
def compound(campaign) -> Result:
    return joint_fit(campaign, effects=PreparedCampaign.from_campaign(campaign).effects, directions=["DMA", "DMA 2"])


@pytest.fixture(scope="module")
def row(root) -> Callable[[str], list[str]]:
    """The cells of a row of its tables, by its first."""
    text = (root / "data/measured/epdm_70/README.md").read_text(encoding="utf-8")

    def cells(first: str) -> list[str]:
        found = re.search(rf"^\| {re.escape(first)} \|(.*)\|$", text, re.MULTILINE)
        assert found, first
        return [cell.strip() for cell in found[1].split("|")]

    return cells


def test_the_mount_against_its_prediction(campaign, compound, row):
    parts = []
    for sweep in campaign.sweeps:
        if str(sweep.direction) == "mount":
            model = compound.model.stiffness(sweep.direction, sweep.frequency, sweep.amplitude_reached)
            known = sweep.relative_error < 0.05  # type: ignore[operator]
            ratio, loss = np.abs(sweep.stiffness / model), loss_factor(sweep.stiffness) - loss_factor(model)
            parts.append(np.stack((sweep.frequency, ratio, loss))[:, known & (sweep.frequency >= 100.0)])
    frequency, ratio, loss = np.concatenate(parts, axis=1)
    bands = [(frequency >= low) & (frequency < high) for low, high in ((100, 200), (200, 400), (400, 800), (800, 1200))]
    stiffness = [f"{np.median(ratio[band]):.2f}" for band in bands]
    low, high = np.quantile(ratio, (0.05, 0.95))
    stiffness.append(f"{low:.2f} to {high:.2f}, median {np.median(ratio):.2f}")
    losses = [f"{np.median(loss[band]):+.3f}" for band in bands]
    losses.append("{:+.2f} to {:+.2f}".format(*np.quantile(loss, (0.05, 0.95))))
    assert row("stiffness, measured over predicted") == stiffness
    assert row("loss factor, measured minus predicted") == losses


def test_its_band_after_one_factor_and_the_second_coupon(campaign, compound, root):
    text = (root / "data/measured/epdm_70/README.md").read_text(encoding="utf-8")
    ratio, half = [], []
    for sweep in campaign.sweeps:
        if str(sweep.direction) == "mount":
            for row, frequency in enumerate(sweep.frequency):
                found = predict(compound, sweep.direction, [frequency], [sweep.amplitude_reached[row]]).stiffness
                ratio.append(abs(sweep.stiffness[row]) / found.value[0])
                half.append((found.high[0] - found.value[0]) / found.value[0])
    off = np.array(ratio) / np.median(ratio) - 1.0
    inside, width = float(np.mean(np.abs(off) <= half)), float(np.median(half)) / 1.96 / float(np.std(off))
    print(f"after one factor {inside:.3f} of the points within the band, {width:.2f} times as wide as they scatter")
    assert inside >= 0.9
    assert width <= 4.0
    assert f"{100 * inside:.0f} % of its points" in text
    low, high = compound.interval("stiffness_factor.DMA 2") or (0.0, 0.0)
    value = dict(compound.model.values)["stiffness_factor.DMA 2"]
    assert f"{value:.3f} times as stiff as the first (95 % interval {low:.3f} to {high:.3f})" in text
    assert 1.02 < value < 1.06, "1.04 to 1.05 read off where both were tested"


def test_its_resonances_and_the_reduced_files(campaign, compound, row, root):
    mount = next(specimen for specimen in campaign.specimens if specimen.name == "mount")
    folder, peaks = root / "data/measured/epdm_70", {}
    for level, acceleration in LEVELS.items():
        for name, stated in MASSES.items():
            file, mass = f"shaker_{level}_{name}.csv", stated + DISCS
            found = reduce_resonance(read_resonance(find_table(folder / file, RESONANCE_COLUMNS), mount), mass)
            shaken = predict_resonance(compound, mount, mass, acceleration * GRAVITY, None)
            peaks[level, name] = found.peak[0], shaken.peak[0]
            kept = pd.read_csv(folder / "reduced" / file)
            np.testing.assert_allclose(kept["frequency [Hz]"], found.frequency, rtol=1e-6)
            np.testing.assert_allclose(kept["stiffness [N/mm]"], 1e-3 * np.abs(found.stiffness), rtol=1e-5)
            np.testing.assert_allclose(kept["amplitude [mm]"], 1e3 * found.amplitude, rtol=1e-5)
    small = ["{:.1f} / {:.1f} Hz".format(*peaks["01g", name]) for name in MASSES]
    lower = [[100.0 * (1.0 - peaks["1g", n][k] / peaks["01g", n][k]) for k in (0, 1)] for n in MASSES]
    assert row("at 0.1 g, measured / predicted") == small
    assert row("decrease at 1 g, measured / predicted") == ["{:.1f} / {:.1f} %".format(*pair) for pair in lower]


@pytest.mark.slow
def test_effects_fitted_to_half_of_the_masses_shrink_the_gap_on_the_other_half(root, campaign, compound):
    """No name closes the gap of this rubber; effects that are chosen by hand help where they were not fitted."""
    half = PreparedCampaign.from_campaign(load_campaign(root / "configs/epdm_70_half.toml"))
    found = diagnose(half)
    print(found.verdict, found.summary, sep=": ")
    assert found.verdict in ("unexplained", "described")
    assert not [effect.label for effect in found.effects if effect.label != "unnamed"]
    leads = ["maxwell", "fractional_zener", "stiffness_factor.mount"]
    fitted = fit_joint(half, effects=(*half.effects, *leads), directions=["DMA", "DMA 2", "mount"])

    def off(result: Result) -> tuple[float, float]:
        """Root mean square of |K| and of the loss factor on the masses that were not fitted."""
        apart = []
        for sweep in campaign.sweeps:
            if sweep.source and re.search("_(253|573)g", str(sweep.source.file)):
                model = result.model.stiffness(sweep.direction, sweep.frequency, sweep.amplitude_reached)
                known = (sweep.relative_error < 0.05) & (sweep.frequency >= 100.0)  # type: ignore[operator]
                ratio, loss = np.abs(sweep.stiffness / model) - 1.0, loss_factor(sweep.stiffness) - loss_factor(model)
                apart.append(np.stack((ratio, loss))[:, known])
        stiffness, loss = np.sqrt(np.mean(np.square(np.concatenate(apart, axis=1)), axis=1)).tolist()
        return stiffness, loss

    before, after = off(compound), off(fitted)
    factor = fitted.interval("stiffness_factor.mount")
    print(f"{leads}, factor of the mount 95 % {factor}")
    print(f"other half, |K| and loss factor off: {before} by the coupons alone, {after} with the leads")
    assert after[0] < 0.25 * before[0]
    assert after[1] < 0.7 * before[1]
