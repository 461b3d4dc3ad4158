"""Harmonics of a loop: the motion cleared of noise, a triangle with its corners, and rows that are faults found."""

from __future__ import annotations

import numpy as np
import pytest

from bushfit.fitting.harmonics import basis, harmonics, order, sample, series, turned
from bushfit.geometry import Direction
from bushfit.reading.measurement import Loop

PHASE = np.arange(3000) / 1000.0


def loop(displacement: np.ndarray, noise: float = 1e-3) -> Loop:
    """Three cycles at 0.1 Hz; the force is 500 N a millimetre, 20 N off zero and a little ahead."""
    random = np.random.default_rng(0)
    force = 5e5 * np.roll(displacement, -30) + 20.0
    return Loop(
        "l",
        Direction.AXIAL,
        PHASE / 0.1,
        displacement + 1e-3 * noise * random.standard_normal(PHASE.size),
        force + 500.0 * noise * random.standard_normal(PHASE.size),
    )


def test_a_sine_is_one_harmonic_with_its_mean() -> None:
    found = harmonics(loop(1e-3 * np.cos(2.0 * np.pi * PHASE) + 2e-4), 0.1, 3.0)
    assert found.motion.size == 2
    np.testing.assert_allclose(found.motion, [2e-4, 1e-3], atol=1e-7)
    assert found.force_mean == pytest.approx(120.0, abs=0.1)
    assert found.force_noise == pytest.approx(0.5, rel=0.1)
    assert all(wild.rows.size == 0 for wild in found.wild.values())


def test_a_triangle_keeps_its_corners() -> None:
    triangle = 2e-3 / np.pi * np.arcsin(np.sin(2.0 * np.pi * PHASE))
    found = harmonics(loop(triangle), 0.1, 3.0)
    cleared = series(found.motion, PHASE)
    np.testing.assert_allclose(cleared, triangle, atol=2e-6)


def test_wild_rows_are_found_in_their_column_and_do_not_bend_it() -> None:
    test = loop(1e-3 * np.cos(2.0 * np.pi * PHASE))
    test.force[[100, 1500]] += 60.0
    found = harmonics(test, 0.1, 3.0)
    assert found.wild["force"].rows.tolist() == [100, 1500]
    assert found.wild["force"].off == pytest.approx(120.0, rel=0.15)
    assert found.wild["displacement"].rows.size == 0
    assert found.force_noise == pytest.approx(0.5, rel=0.1)


def test_a_series_is_the_sum_of_its_harmonics_and_turns_into_its_slope() -> None:
    phase = np.linspace(0.0, 1.0, 50)
    coefficients = np.array([0.5, 1.0 - 0.5j, 0.0, 0.2j])
    expected = 0.5 + np.cos(2 * np.pi * phase) + 0.5 * np.sin(2 * np.pi * phase) - 0.2 * np.sin(6 * np.pi * phase)
    np.testing.assert_allclose(series(coefficients, phase), expected, atol=1e-12)
    solution = np.concatenate((coefficients.real, coefficients.imag[1:]))
    np.testing.assert_allclose(basis(phase, 3) @ solution, expected, atol=1e-12)
    step = 1e-6
    rise = (basis(phase + step, 3) - basis(phase - step, 3)) @ solution / (4.0 * np.pi * step)
    np.testing.assert_allclose(basis(phase, 3) @ turned(solution), rise, atol=1e-7)


@pytest.mark.parametrize(("rows", "harmonics_of_it"), [(3.0, 1), (50.0, 10), (1e6, 60)])
def test_as_many_harmonics_as_the_rows_carry(rows: float, harmonics_of_it: int) -> None:
    assert order(rows, 60) == harmonics_of_it


def test_a_sample_is_spread_evenly_and_keeps_no_time_with_cycles() -> None:
    assert sample(7, 10).tolist() == list(range(7))
    chosen = sample(1_000_000, 1000)
    assert chosen.size == 1000
    assert np.all(np.diff(chosen) > 0)
    assert chosen[-1] < 1_000_000
    beat = np.abs(np.exp(2j * np.pi * chosen / 1000.0).mean())
    assert beat < 0.1
