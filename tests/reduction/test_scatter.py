"""Scatter that a few wild values hardly move."""

from __future__ import annotations

import numpy as np
import pytest

from bushfit.reduction.scatter import scatter


def test_of_normal_values_it_is_mean_and_standard_deviation() -> None:
    middle, spread = scatter(3.0 + 0.5 * np.random.default_rng(0).standard_normal(100_000))
    assert middle == pytest.approx(3.0, abs=0.01)
    assert spread == pytest.approx(0.5, rel=0.02)


def test_wild_values_hardly_move_it() -> None:
    values = np.random.default_rng(1).standard_normal(1000)
    clean = scatter(values)
    values[:30] = 1e6
    assert scatter(values) == pytest.approx(clean, abs=0.06)
