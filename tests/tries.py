"""Cases that a commit tries, those that wait for the slow tests, and how many campaigns a rate is taken over."""

import os
from collections.abc import Collection, Iterable
from typing import Any

import pytest

#: Campaigns of each rate of intervals that hold the truth; the figures on pages are of BUSHFIT_SEEDS=300.
SEEDS = int(os.environ.get("BUSHFIT_SEEDS", "100"))


def some(cases: Iterable[Any], quick: Collection[Any]) -> list[Any]:
    """All cases to parametrise a test with; those that are not quick are slow tests."""
    return [case if case in quick else pytest.param(case, marks=pytest.mark.slow) for case in cases]
