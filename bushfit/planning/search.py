"""Which tests: the best per minute one after the other, then exchanged for others as long as that helps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bushfit.effects.contract import Array
from bushfit.planning.criterion import Criterion

#: Passes of exchanges at most; nearly all plans take three.
_PASSES = 8
#: Fall of the logarithm of the criterion that is worth an exchange.
_WORTH = 1e-3


@dataclass(frozen=True, eq=False)
class Budget:
    """What tests cost.

    Args:
        minutes: of each test, (tests,).
        place: number of the place of each test, (tests,).
        setup: minutes to mount the bushing at a place, once for each place that is tested.
        most: minutes in all.
    """

    minutes: Array
    place: Array
    setup: float
    most: float

    def spent(self, counts: Array) -> float:
        """Minutes of so many runs of each test, (tests,)."""
        return float(self.minutes @ counts) + self.setup * np.unique(self.place[counts > 0]).size

    def further(self, counts: Array) -> Array:
        """Minutes that one run more of each test adds, (tests,)."""
        return self.minutes + self.setup * ~np.isin(self.place, self.place[counts > 0])


def chosen(criterion: Criterion, budget: Budget, start: Array) -> Array:
    """So many runs of each test within the budget, (tests,), that the criterion is small.

    Notes: greedy from `start` by what the logarithm falls per minute, then exchanges of one run for another, each after
    Fedorov (1972): the best of all for each run in turn, and what time is left over is filled again.
    """
    counts = _filled(criterion, budget, start)
    best = criterion.together(counts)
    for _ in range(_PASSES):
        before = best
        for test in np.flatnonzero(counts):
            fewer = counts.copy()
            fewer[test] -= 1
            other = _filled(criterion, budget, fewer, first_of_all=True)
            value = criterion.together(other)
            if value < best - _WORTH:
                counts, best = other, value
        if before - best < _WORTH:
            break
    return counts


def _filled(criterion: Criterion, budget: Budget, counts: Array, *, first_of_all: bool = False) -> Array:
    """Runs added one after the other, each the best per minute, or the first the best of all, as long as time is left."""
    counts, so_far = counts.copy(), criterion.together(counts)
    while True:
        further = budget.further(counts)
        fits = budget.spent(counts) + further <= budget.most
        if not fits.any():
            return counts
        values = criterion.one_more(counts)
        fall = np.where(fits, so_far - values, -np.inf) / (1.0 if first_of_all else further)
        best = int(np.argmax(fall))
        if fall[best] <= 0.0:
            return counts
        counts[best] += 1
        so_far, first_of_all = values[best], False
