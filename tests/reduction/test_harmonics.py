"""Fourier series: the basis, how many harmonics rows tell apart, and rows that stand for all."""

from __future__ import annotations

import numpy as np
import pytest

from bushfit.reduction.harmonics import HarmonicFit, basis, series, spread_rows


def test_a_series_is_the_sum_of_its_harmonics() -> None:
    phase = np.linspace(0.0, 1.0, 50)
    coefficients = np.array([0.5, 1.0 - 0.5j, 0.0, 0.2j])
    expected = 0.5 + np.cos(2 * np.pi * phase) + 0.5 * np.sin(2 * np.pi * phase) - 0.2 * np.sin(6 * np.pi * phase)
    np.testing.assert_allclose(series(coefficients, phase), expected, atol=1e-12)
    solution = np.concatenate((coefficients.real, coefficients.imag[1:]))
    np.testing.assert_allclose(basis(phase, 3) @ solution, expected, atol=1e-12)


@pytest.mark.parametrize("per_cycle", [3, 4, 8, 20, 20.0001])
def test_harmonics_at_half_the_rows_of_a_cycle_are_none(per_cycle: float) -> None:
    """There the rows lie on the zeros of one of the two waves."""
    time = np.arange(int(56 * per_cycle) + 1) / per_cycle
    noise = 1e-4 * np.random.default_rng(0).standard_normal((2, time.size))
    fit = HarmonicFit.of(time, *(np.sin(2.0 * np.pi * time) + noise), np.arange(57.0))
    order = fit.coefficients.shape[1] - 1
    assert order < per_cycle / 2.0
    assert max(fit.distortion()) < 1e-3


def test_errors_and_distortion_are_those_of_what_the_force_does_not_follow() -> None:
    """Jitter of the motion is no error where the force follows it, and noise is no overtone."""
    time, sigma, overtone, stiffness = np.arange(800) / 20.0, 0.05, 0.03, 3.0
    off, distorted = [], []
    for seed in range(40):
        jitter, noise = np.random.default_rng(seed).standard_normal((2, time.size))
        motion = np.sin(2.0 * np.pi * time) + overtone * np.sin(6.0 * np.pi * time) + sigma * jitter
        fit = HarmonicFit.of(time, motion, stiffness * motion + 0.2 * sigma * noise, np.arange(41.0))
        assert fit.errors() == pytest.approx(0.2 * sigma * np.sqrt(2.0 / time.size) / stiffness, rel=0.4)
        k = fit.coefficients[1, 1] / fit.coefficients[0, 1]
        off.append(abs(k / stiffness - 1.0) / np.hypot(*fit.errors()))
        distorted.append(np.square(fit.distortion()))
    assert np.mean(np.square(off)) == pytest.approx(1.0, rel=0.25)
    assert np.mean(distorted, axis=0) == pytest.approx(overtone**2, rel=0.1)


def test_rows_that_stand_for_all_keep_no_time_with_cycles() -> None:
    chosen = spread_rows(1_000_000, 1000)
    assert chosen.size == 1000
    assert np.all(np.diff(chosen) > 0)
    assert chosen[-1] < 1_000_000
    assert np.abs(np.exp(2j * np.pi * chosen / 1000.0).mean()) < 0.1
