"""Harmonics of a loop: the motion cleared of noise, a triangle with its corners, and outliers found."""

from __future__ import annotations

import numpy as np
import pytest

from bushfit.fitting.loop_harmonics import loop_harmonics
from bushfit.geometry import Direction
from bushfit.reading.measurement import Loop
from bushfit.reduction.harmonics import series

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
    found = loop_harmonics(loop(1e-3 * np.cos(2.0 * np.pi * PHASE) + 2e-4), 0.1, 3.0)
    assert found.motion.size == 2
    np.testing.assert_allclose(found.motion, [2e-4, 1e-3], atol=1e-7)
    assert found.force_mean == pytest.approx(120.0, abs=0.1)
    assert found.force_noise == pytest.approx(0.5, rel=0.1)
    assert all(outliers.rows.size == 0 for outliers in found.outliers.values())


def test_a_triangle_keeps_its_corners() -> None:
    triangle = 2e-3 / np.pi * np.arcsin(np.sin(2.0 * np.pi * PHASE))
    found = loop_harmonics(loop(triangle), 0.1, 3.0)
    cleared = series(found.motion, PHASE)
    np.testing.assert_allclose(cleared, triangle, atol=2e-6)


def test_outliers_are_found_in_their_column_and_do_not_bend_it() -> None:
    test = loop(1e-3 * np.cos(2.0 * np.pi * PHASE))
    test.force[[100, 1500]] += 60.0
    found = loop_harmonics(test, 0.1, 3.0)
    assert found.outliers["force"].rows.tolist() == [100, 1500]
    assert found.outliers["force"].off == pytest.approx(120.0, rel=0.15)
    assert found.outliers["displacement"].rows.size == 0
    assert found.force_noise == pytest.approx(0.5, rel=0.1)
