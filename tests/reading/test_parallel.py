"""Long arrays in chunks."""

from __future__ import annotations

import os
import threading

import numpy as np
import pytest

from bushfit.reading.parallel import by_chunks


@pytest.mark.parametrize("size", [0, 1, 10, 11, 99])
def test_every_entry_comes_once_and_in_order(size: int) -> None:
    entries = by_chunks(lambda part: np.arange(size)[part].tolist(), size, 10)
    assert [entry for part in entries for entry in part] == list(range(size))
    assert [len(part) for part in entries[:-1]] == [10] * (len(entries) - 1)


@pytest.mark.parametrize("cores", [1, 5])
def test_the_number_of_cores_changes_no_digit(cores: int, monkeypatch: pytest.MonkeyPatch) -> None:
    values = np.random.default_rng(0).standard_normal(10_001)
    alone = [values[start : start + 100].sum() for start in range(0, values.size, 100)]
    monkeypatch.setattr(os, "cpu_count", lambda: cores)
    assert by_chunks(lambda part: values[part].sum(), values.size, 100) == alone


def test_chunks_run_side_by_side_and_an_error_in_one_comes_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    both = threading.Barrier(2, timeout=10)
    assert by_chunks(lambda _: both.wait() >= 0, 2, 1) == [True, True]
    with pytest.raises(ZeroDivisionError):
        by_chunks(lambda part: 1 // (part.start - 20), 50, 10)
