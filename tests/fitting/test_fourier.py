"""Fourier series: the basis, its slope, and how many harmonics and rows it takes."""

from __future__ import annotations

import numpy as np
import pytest

from bushfit.reduction.harmonics import basis, resolved_order, series, spread_rows


def test_a_series_is_the_sum_of_its_harmonics_and_turns_into_its_slope() -> None:
    phase = np.linspace(0.0, 1.0, 50)
    coefficients = np.array([0.5, 1.0 - 0.5j, 0.0, 0.2j])
    expected = 0.5 + np.cos(2 * np.pi * phase) + 0.5 * np.sin(2 * np.pi * phase) - 0.2 * np.sin(6 * np.pi * phase)
    np.testing.assert_allclose(series(coefficients, phase), expected, atol=1e-12)
    solution = np.concatenate((coefficients.real, coefficients.imag[1:]))
    np.testing.assert_allclose(basis(phase, 3) @ solution, expected, atol=1e-12)


@pytest.mark.parametrize(("rows", "harmonics_of_it"), [(3.0, 1), (50.0, 10), (1e6, 60)])
def test_as_many_harmonics_as_the_rows_carry(rows: float, harmonics_of_it: int) -> None:
    assert resolved_order(rows, 60) == harmonics_of_it


def test_a_sample_is_spread_evenly_and_keeps_no_time_with_cycles() -> None:
    assert spread_rows(7, 10).tolist() == list(range(7))
    chosen = spread_rows(1_000_000, 1000)
    assert chosen.size == 1000
    assert np.all(np.diff(chosen) > 0)
    assert chosen[-1] < 1_000_000
    beat = np.abs(np.exp(2j * np.pi * chosen / 1000.0).mean())
    assert beat < 0.1
