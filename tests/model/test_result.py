"""Results: 95 % intervals of a fit, and their limits."""

from __future__ import annotations

import json

import numpy as np
import pytest

from bushfit.model.covariance import Z95, Covariance
from bushfit.model.file import to_document
from bushfit.model.model import FIVE, Model
from bushfit.model.result import Result


def test_intervals(result: Result) -> None:
    stderr = result.covariance.stderr("mu") or 0.0
    low, high = result.interval("mu") or (0.0, 0.0)
    value = result.model.values["mu"]
    assert low * high == pytest.approx(value**2)
    assert 1.0 <= np.log(high / value) / (Z95 * stderr / value) < 1.05, (
        "Student's t with hundreds of degrees of freedom"
    )
    low, high = result.interval("alpha") or (0.0, 0.0)
    assert (low + high) / 2.0 == pytest.approx(result.model.values["alpha"])


def test_intervals_stay_within_what_is_possible(paper_model: Model) -> None:
    open_ended = Result(paper_model, FIVE, Covariance(FIVE, np.diag([1e40, 1e40, 1e20, 1e40, 1e20])))
    for name in FIVE:
        low, high = open_ended.interval(name) or (0.0, 0.0)
        assert (low, high) == paper_model.parameters[name].bounds
    json.dumps(to_document(open_ended), allow_nan=False)
