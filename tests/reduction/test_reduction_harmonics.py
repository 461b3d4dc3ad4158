"""Harmonics of a steady sine: exact without noise, drift and overtones parted, and errors that are those made."""

from __future__ import annotations

import numpy as np
import pytest

from bushfit.reduction.harmonics import HarmonicFit

FREQUENCY, CYCLES, ROWS = 12.5, 20, 3000
STIFFNESS = 4e5 * np.exp(0.25j)


def fitted(noise: float = 0.0, overtone: float = 0.0, drift: float = 0.0, seed: int = 0) -> HarmonicFit:
    """20 cycles of 1 mm at uneven times: force of a given stiffness, a third harmonic, and a zero that drifts."""
    random = np.random.default_rng(seed)
    edges = 0.3 + np.arange(CYCLES + 1) / FREQUENCY
    time = np.sort(random.uniform(edges[0], edges[-1], ROWS))
    phase = 2.0 * np.pi * FREQUENCY * time
    motion = 1e-3 * (np.sin(phase) + noise * random.standard_normal(ROWS))
    force = 400.0 * (np.sin(phase + 0.25) + overtone * np.sin(3.0 * phase) + noise * random.standard_normal(ROWS))
    return HarmonicFit.of(time, motion + 1e-3 * drift * time, force + 400.0 * drift * time**2, edges)


@pytest.mark.parametrize(("overtone", "drift"), [(0.0, 0.0), (0.1, 0.0), (0.0, 0.5), (0.1, 0.5)])
def test_stiffness_is_exact_whatever_overtones_and_drift(overtone: float, drift: float) -> None:
    fit = fitted(overtone=overtone, drift=drift)
    displacement, force = fit.coefficients[:, 1]
    assert fit.frequency == pytest.approx(FREQUENCY, rel=1e-8)
    assert force / displacement == pytest.approx(STIFFNESS, rel=1e-6)
    assert abs(displacement) == pytest.approx(1e-3, rel=1e-6)


def test_distortion_is_that_of_the_force_alone() -> None:
    displacement, force = fitted(overtone=0.07).distortion()
    assert displacement < 1e-6
    assert force == pytest.approx(0.07, rel=1e-4)
    assert max(fitted(noise=0.02).distortion()) < 0.01


@pytest.mark.parametrize("per_cycle", [3, 4, 8, 20, 20.0001])
def test_harmonics_at_half_the_rows_of_a_cycle_are_none(per_cycle: float) -> None:
    """There the rows lie on the zeros of one of the two waves."""
    time = np.arange(int(56 * per_cycle) + 1) / (per_cycle * FREQUENCY)
    phase = 2.0 * np.pi * FREQUENCY * time
    motion, force = np.sin(phase) + 1e-4 * np.random.default_rng(0).standard_normal((2, time.size))
    fit = HarmonicFit.of(time, motion, force, np.arange(57) / FREQUENCY)
    print(f"{per_cycle} rows a cycle: order {fit.coefficients.shape[1] - 1}, distortion {max(fit.distortion()):.1e}")
    assert fit.coefficients.shape[1] - 1 < per_cycle / 2.0
    assert max(fit.distortion()) < 1e-3


def test_white_noise_is_stated_as_it_scatters() -> None:
    off, stated = [], []
    for seed in range(200):
        fit = fitted(noise=0.01, seed=seed)
        displacement, force = fit.coefficients[:, 1]
        ratio = np.log(force / displacement / STIFFNESS)
        off.append((ratio.real, ratio.imag))
        stated.append(fit.errors())
    np.testing.assert_allclose(np.std(off, axis=0), np.mean(stated, axis=0), rtol=0.2)
