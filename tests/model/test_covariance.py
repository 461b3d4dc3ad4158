"""Covariance: its root, and intervals as wide as an estimated variance needs."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import t

from bushfit.model.covariance import Z95, Covariance
from bushfit.model.result import Result


def test_covariance_root(result: Result) -> None:
    root = result.covariance.root
    np.testing.assert_allclose(root @ root.T, result.covariance.matrix, rtol=1e-7)
    singular = Covariance(("mu", "m"), np.array([[4.0, 6.0], [6.0, 9.0]]))
    np.testing.assert_allclose(singular.root @ singular.root.T, singular.matrix, atol=1e-12)
    held = Covariance(("mu", "m"), np.array([[4.0, 0.0], [0.0, 0.0]]))
    np.testing.assert_allclose(held.root @ held.root.T, held.matrix, atol=1e-12)
    assert held.correlations() == []


def test_intervals_are_as_wide_as_an_estimated_variance_needs() -> None:
    """A variance of 3 and one of 5 degrees of freedom: alone Student's t, in a sum between the two and the normal."""
    one, other = np.diag([4.0, 0.0]), np.diag([0.0, 9.0])
    spread = (one * np.sqrt(2.0 / 3.0), other * np.sqrt(2.0 / 5.0))
    covariance = Covariance(("mu", "m"), one + other, spread)
    found = covariance.half_width(np.array([[1.0, 0.0, 1.0], [0.0, 1.0, 1.0]]))
    summed = 2.0 * 13.0**2 / (4.0**2 * 2.0 / 3.0 + 9.0**2 * 2.0 / 5.0)
    print(f"half widths {found}; degrees of freedom of the sum {summed:.2f}")
    expected = [t.ppf(0.975, freedom) * np.sqrt(variance) for freedom, variance in ((3, 4), (5, 9), (summed, 13))]
    np.testing.assert_allclose(found, expected)
    np.testing.assert_allclose(covariance.restricted(["m"]).half_width(np.ones((1, 1))), found[1:2])
    known = Covariance(("mu", "m"), one + other)
    np.testing.assert_allclose(known.half_width(np.eye(2)), [Z95 * 2.0, Z95 * 3.0], rtol=1e-4)
    assert known.restricted(["m"]).half_width(np.ones((1, 1))) == pytest.approx(3.0 * Z95, rel=1e-4)
