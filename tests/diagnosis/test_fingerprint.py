"""The power law of what has no name: found with its phase and powers, in words, and with honest intervals.

The data are the virtual rig's; the terms are added to their stiffness in the frequency domain.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rigged import PLAN, Fitted, Measured
from scipy.stats import binomtest

from bushfit.campaign.campaign import Campaign, load_campaign
from bushfit.campaign.schema import Residuals
from bushfit.diagnosis.described import weighed
from bushfit.diagnosis.fingerprint import Fingerprint, fingerprint
from bushfit.diagnosis.terms import Measure, Terms
from bushfit.effects.contract import Array
from bushfit.fitting.data import Data
from bushfit.fitting.starts import start_values
from bushfit.geometry import Direction, stiffness_per_modulus, unit_strain

#: A term's stiffness, complex [N/m], by frequency [Hz], amplitude [m] and the stiffness without it.
Term = Callable[[Array, Array, Array], Array]
#: Campaigns with terms of random phase and powers.
RANDOM = 50


def with_stiffness(campaign: Campaign, stiffness: Sequence[Array]) -> Campaign:
    """The sweeps of a campaign with other stiffness, and no loops."""
    pairs = zip(campaign.sweeps, stiffness, strict=True)
    return replace(campaign, sweeps=tuple(replace(sweep, stiffness=k) for sweep, k in pairs), loops=())


def with_term(campaign: Campaign, term: Term) -> Campaign:
    """The sweeps of a campaign with a term in parallel."""
    added = (term(sweep.frequency, sweep.amplitude, sweep.stiffness) for sweep in campaign.sweeps)
    return with_stiffness(
        campaign, [sweep.stiffness + more for sweep, more in zip(campaign.sweeps, added, strict=True)]
    )


def power_law(size: float, phase_deg: float, p: float, q: float) -> Term:
    """The same stiffness in every direction, of a size [N/m] at 50 Hz and 0.2 mm."""
    turn = size * np.exp(1j * np.radians(phase_deg))
    return lambda frequency, amplitude, _: turn * (frequency / 50.0) ** p * (amplitude / 2e-4) ** q


def found_in(campaign: Campaign, fitted: Fitted) -> Fingerprint | None:
    evidence, data = fitted(campaign), Data.of(campaign)
    start = start_values(campaign.bushing, data.sweeps, {})
    return fingerprint(evidence, *weighed(evidence, campaign.rig), start, {})


def surely(campaign: Campaign, fitted: Fitted) -> Fingerprint:
    found = found_in(campaign, fitted)
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("law", "words"),
    [
        ((60e3, 90.0, 1.0, 0.0), "a damper"),
        ((60e3, 180.0, 2.0, 0.0), "a mass"),
        ((60e3, 0.0, 0.0, 2.0), "a spring that stiffens"),
        ((60e3, 90.0, 0.0, -1.0), "dry friction"),
        ((60e3, 40.0, 1.4, 0.7), ""),
        ((60e3, -60.0, 0.6, -0.6), ""),
    ],
)
def test_laws_are_found_with_their_phase_and_powers(
    law: tuple[float, float, float, float], words: str, measured: Measured, fitted: Fitted
) -> None:
    """Of 3 % of the stiffness, each within three and a half standard errors, and called what they act like."""
    found = surely(with_term(measured(), power_law(*law)), fitted)
    assert found.measure == "stiffness"
    assert found.is_power_law
    for (value, low, high), true in zip(
        (found.phase_deg, found.frequency_power, found.amplitude_power), law[1:], strict=True
    ):
        off = (true - value + 180.0) % 360.0 - 180.0
        assert abs(off) < 3.5 * (high - low) / 3.92, (value, low, high, true)
    assert ("acts like" in found.words) == bool(words)
    assert words in found.words


@pytest.mark.parametrize("residuals", ["complex", "magnitude_loss_factor"])
def test_it_finds_the_dashpot_of_a_practice_campaign(residuals: Residuals, root: Path, fitted: Fitted) -> None:
    """A tenth of the stiffness; in the intervals, whatever is fitted."""
    campaign = replace(load_campaign(root / "data/practice/case_004/bushing.toml"), loops=())
    found = surely(replace(campaign, fit=replace(campaign.fit, residuals=residuals)), fitted)
    for (_, low, high), true in ((found.phase_deg, 90.0), (found.frequency_power, 1.0), (found.amplitude_power, 0.0)):
        assert low <= true <= high
    assert found.is_power_law


@pytest.mark.parametrize("measure", ["stiffness", "modulus", "gain"])
@pytest.mark.parametrize("residuals", ["complex", "magnitude_loss_factor"])
def test_derivatives_beside_a_large_term(
    residuals: Residuals, measure: Measure, measured: Measured, fitted: Fitted
) -> None:
    """Of residuals of sweeps and loops with a tenth of the stiffness added, against central differences."""
    campaign = measured()
    evidence = fitted(replace(campaign, fit=replace(campaign.fit, residuals=residuals)))
    terms, model = Terms(evidence, measure), evidence.model
    value = (0.06 + 0.08j) * np.exp((terms.points - terms.points.mean(axis=0)) @ (0.5, 0.1))
    value *= np.mean(np.abs(terms.stiffness(model) / terms.unit(model)))
    coordinates, step = evidence.solution.coordinates, 1e-5
    middle = coordinates.point(model.values)
    for row, own in zip(terms.jacobian(value, model), np.eye(middle.size) * step, strict=True):
        ends = [terms.residual(value, model.with_values(coordinates.values(middle + off))) for off in (own, -own)]
        assert row == pytest.approx((ends[0] - ends[1]) / (2.0 * step), rel=1e-5, abs=1e-5 * np.abs(row).max())
    ends = [terms.residual(value * (1.0 + off), model) for off in (step, -step)]
    row = terms.columns(value[None], model, value)[0]
    assert row == pytest.approx((ends[0] - ends[1]) / (2.0 * step), rel=1e-5, abs=1e-5 * np.abs(row).max())


def test_a_resonance_is_no_power_law(measured: Measured, fitted: Fitted) -> None:
    def resonance(frequency: Array, amplitude: Array, _: Array) -> Array:
        ratio = frequency / 80.0
        return 120e3 * ratio**2 / (1.0 - ratio**2 + 0.3j * ratio) * np.ones_like(amplitude)

    assert not surely(with_term(measured(), resonance), fitted).is_power_law


@pytest.mark.slow
def test_intervals_hold_the_phase_and_the_powers_in_95_of_100(measured: Measured, fitted: Fitted) -> None:
    """Random laws in N/m, in a modulus and in shares of the stiffness, 3 to 12 % of it at the most, simulated."""
    random, held = np.random.default_rng(20), {"phase": [], "p": [], "q": []}  # type: ignore[var-annotated]
    for seed in range(RANDOM):
        phase, p, q = random.uniform(-180.0, 180.0), random.uniform(-1.0, 2.0), random.uniform(-1.0, 1.5)
        size, kind = float(np.exp(random.uniform(*np.log((0.03, 0.12))))), seed % 3
        campaign, shares = measured(plan=PLAN, seed=seed), []
        for sweep in campaign.sweeps:
            place = campaign.bushing, sweep.direction
            strain = sweep.amplitude * unit_strain(*place) / unit_strain(campaign.bushing, Direction.AXIAL)
            law = power_law(1.0, phase, p, q)(sweep.frequency, strain if kind else sweep.amplitude, strain)
            shares.append(law * (1.0, stiffness_per_modulus(*place), sweep.stiffness)[kind] / sweep.stiffness)
        largest = max(float(np.abs(share).max()) for share in shares)
        pairs = zip(campaign.sweeps, shares, strict=True)
        stiffness = [sweep.stiffness * (1.0 + size / largest * share) for sweep, share in pairs]
        if (found := found_in(with_stiffness(campaign, stiffness), fitted)) is None:
            continue  # the parameters can do most of it
        truths = {"phase": (found.phase_deg, phase), "p": (found.frequency_power, p), "q": (found.amplitude_power, q)}
        for name, ((value, low, high), true) in truths.items():
            off = (true - value + 180.0) % 360.0 - 180.0
            held[name].append(low - value <= off <= high - value)
    for name, hits in held.items():
        print(f"{name}: {sum(hits)} of {len(hits)}, {binomtest(sum(hits), len(hits)).proportion_ci()}")
    assert len(held["p"]) > 0.9 * RANDOM
    every = [hit for hits in held.values() for hit in hits]
    ends = binomtest(sum(every), len(every)).proportion_ci()
    assert ends.low <= 0.97
    assert ends.high >= 0.93
