"""Results: covariance and intervals; and model files: what is written comes back, and older ones are read."""

import json
from typing import Any

import numpy as np
import pytest
from scipy.stats import t

from bushfit.model.covariance import Z95, Covariance
from bushfit.model.file import from_document, to_document


def test_covariance_root(result):
    root = result.covariance.root
    np.testing.assert_allclose(root @ root.T, result.covariance.matrix, rtol=1e-7)
    for matrix in ([[4.0, 6.0], [6.0, 9.0]], [[4.0, 0.0], [0.0, 0.0]]):
        singular = Covariance(("mu", "m"), np.array(matrix))
        np.testing.assert_allclose(singular.root @ singular.root.T, singular.matrix, atol=1e-12)
    assert singular.correlations() == []


def test_intervals_are_as_wide_as_an_estimated_variance_needs():
    """A variance of 3 and one of 5 degrees of freedom: alone Student's t, in a sum between the two and the normal."""
    one, other = np.diag([4.0, 0.0]), np.diag([0.0, 9.0])
    spread = (one * np.sqrt(2.0 / 3.0), other * np.sqrt(2.0 / 5.0))
    covariance = Covariance(("mu", "m"), one + other, spread)
    found = covariance.half_width(np.array([[1.0, 0.0, 1.0], [0.0, 1.0, 1.0]]))
    summed = 2.0 * 13.0**2 / (4.0**2 * 2.0 / 3.0 + 9.0**2 * 2.0 / 5.0)
    expected = [t.ppf(0.975, freedom) * np.sqrt(variance) for freedom, variance in ((3, 4), (5, 9), (summed, 13))]
    np.testing.assert_allclose(found, expected)
    np.testing.assert_allclose(covariance.restricted(["m"]).half_width(np.ones((1, 1))), found[1:2])
    known = Covariance(("mu", "m"), one + other)
    np.testing.assert_allclose(known.half_width(np.eye(2)), [Z95 * 2.0, Z95 * 3.0], rtol=1e-4)


def test_intervals(result):
    """Of a positive parameter symmetric in its logarithm; Student's t with hundreds of degrees of freedom."""
    low, high = result.interval("mu") or (0.0, 0.0)
    value = result.model.values["mu"]
    assert low * high == pytest.approx(value**2)
    assert 1.0 <= np.log(high / value) / (Z95 * (result.covariance.stderr("mu") or 0.0) / value) < 1.05
    low, high = result.interval("alpha") or (0.0, 0.0)
    assert (low + high) / 2.0 == pytest.approx(result.model.values["alpha"])


@pytest.fixture
def document(result) -> dict[str, Any]:
    return json.loads(json.dumps(to_document(result), allow_nan=False))  # type: ignore[no-any-return]


def test_there_and_back(result, document):
    back = from_document(document)
    for key in ("model", "fitted", "quality", "measured", "warnings"):
        assert getattr(back, key) == getattr(result, key)
    np.testing.assert_array_equal(back.covariance.matrix, result.covariance.matrix)
    np.testing.assert_array_equal(back.covariance.spread, result.covariance.spread)
    assert {**to_document(back), "provenance": None} == {**document, "provenance": None}
