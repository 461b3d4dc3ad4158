"""Which tests: the best per minute one after the other, then exchanged for others as long as that helps."""

from dataclasses import dataclass

import numpy as np

from bushfit.effects.contract import Array
from bushfit.planning.criterion import Criterion

#: Passes of exchanges at most; nearly all plans take three.
_PASSES = 8
#: Fall of the logarithm of the variance that a run, or an exchange, is worth; chosen: a quarter per cent of the error.
_WORTH = 5e-3


@dataclass(frozen=True, eq=False)
class Budget:
    """What tests cost.

    Args:
        minutes: of each test, (tests,).
        place: number of the place of each test, (tests,).
        line: number of what each test holds, (tests,): of tests that hold the same, one is chosen.
        runs: of each test at most, (tests,); 0 where it may not be chosen.
        setup: minutes to mount the bushing at a place, once for each place that is tested.
        most: minutes in all.
    """

    minutes: Array
    place: Array
    line: Array
    runs: Array
    setup: float
    most: float

    def spent(self, counts: Array) -> float:
        """Minutes of so many runs of each test, (tests,)."""
        return float(self.minutes @ counts) + self.setup * np.unique(self.place[counts > 0]).size

    def further(self, counts: Array) -> Array:
        """Minutes that one run more of each test adds, (tests,); beyond all limits where it may not be chosen."""
        more = self.minutes + self.setup * ~np.isin(self.place, self.place[counts > 0])
        barred = np.isin(self.line, self.line[counts > 0]) & (counts == 0) | (counts >= self.runs)
        return np.where(barred | (self.spent(counts) + more > self.most), np.inf, more)


def chosen(criterion: Criterion, budget: Budget, start: Array) -> Array:
    """So many runs of each test within the budget, (tests,), that the criterion is small.

    Notes: greedy from `start` by what the logarithm falls per minute; then exchanges (Fedorov 1972): one run of each
    test, and all of them, are given up for the best that can be had in their time, as long as that helps.
    """
    counts = _filled(criterion, budget, start)
    best = criterion.together(counts)
    for _ in range(_PASSES):
        before = best
        for test in np.flatnonzero(counts):
            for fewer in {1, int(counts[test])}:
                less = counts - fewer * (np.arange(counts.size) == test)
                other = _filled(criterion, budget, less)
                value = criterion.together(other)
                if value < best - _WORTH:
                    counts, best = other, value
                    break
        if before - best < _WORTH:
            break
    return counts


def _filled(criterion: Criterion, budget: Budget, counts: Array) -> Array:
    """Runs added one after the other, each the best per minute, as long as time is left."""
    counts, so_far = counts.copy(), criterion.together(counts)
    while np.isfinite(further := budget.further(counts)).any():
        values = criterion.one_more(counts)
        fall = (so_far - values) / further
        best = int(np.argmax(np.where(np.isfinite(further), fall, -np.inf)))
        if so_far - values[best] <= _WORTH:
            break
        counts[best] += 1
        so_far = values[best]
    return counts
