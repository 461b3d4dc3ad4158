"""Long arrays in chunks."""

from __future__ import annotations

import os

import numpy as np
import pytest

from bushfit.reduction.arrays import by_chunks


@pytest.mark.parametrize("cores", [1, 5])
def test_the_number_of_cores_changes_no_digit(cores: int, monkeypatch: pytest.MonkeyPatch) -> None:
    values = np.random.default_rng(0).standard_normal(10_001)
    alone = [values[start : start + 100].sum() for start in range(0, values.size, 100)]
    monkeypatch.setattr(os, "cpu_count", lambda: cores)
    assert by_chunks(lambda part: values[part].sum(), values.size, 100) == alone
