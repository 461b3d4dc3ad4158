"""Criterion for a choice of tests, search for the best choice within the hours, and order of its runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bushfit.diagnosis.next_test import entropy_left
from bushfit.effects.contract import Array
from bushfit.planning.contract import Knowledge
from bushfit.planning.sensitivity import Grid, Information, relative_slopes
from bushfit.progress import track

#: Fall of the logarithm of the variance that a run, or an exchange, is worth; chosen: a quarter per cent of the error.
_WORTH = 5e-3
#: Weight of what the parameters take of a drift, beside what shows of it; chosen: orders then keep it below a fifth of
#: a standard error for 1 % over the session.
_STEADY = 100.0


@dataclass(frozen=True, eq=False)
class View:
    """Information of tests on the parameters of one model, and on further columns beside these.

    Args:
        information: of every candidate test, made once.
        prior: information on relative changes of the parameters before, (k, k).
        level: error that all runs of a test share, gain and phase, (tests, 2).
        bounded: so many of the parameters, the last, are at rest on a bound.
    """

    information: Information
    prior: Array
    level: Array
    bounded: int = 0

    @classmethod
    def of(cls, grid: Grid, knowledge: Knowledge, further: Array | None = None) -> View:
        """Information of the tests of a grid on the parameters of a model, and on further columns, (e, n)."""
        slopes = relative_slopes(knowledge, grid.data_sets)
        columns = np.empty((0, slopes.shape[-1])) if further is None else further
        return cls(grid.information(slopes, columns), knowledge.precision, grid.level, len(knowledge.bounded))

    def together(self, counts: Array) -> Information:
        """Information of the given number of runs of each test, (tests,), with the knowledge before, (1, ...)."""
        total = self._each(counts).total()
        return replace(total, own=total.own + self.prior)

    def one_more(self, counts: Array) -> Information:
        """Information with one run more of each test in turn, (tests, ...)."""
        return self.together(counts) + (self._each(counts + 1) - self._each(counts))

    def error_covariance(self, found: Information) -> Array:
        """Expected squares and products of what a fit to such tests finds less the truth, (..., k, k).

        Notes:
            Of a parameter whose true value is on its bound, noise would take half of the fits beyond it. There it stays
            on the bound, and the others are found as if it were held: so half of what it adds to their squares is gone.
        """
        free = np.linalg.inv(found.own)
        first = free.shape[-1] - self.bounded
        own = free[..., first:]
        return free - 0.5 * own @ np.linalg.inv(own[..., first:, :]) @ own.mT

    def _each(self, counts: Array) -> Information:
        """Information of the given number of runs of each test on the parameters, test by test."""
        return self.information.times(counts).beside(self.level)


@dataclass(frozen=True, eq=False)
class Criterion:
    """Criterion that a choice of tests makes small.

    Args:
        views: the likeliest model's, whose further columns are effects that it lacks; then those of its rivals.
        weight: of the parameters' covariance in the variance that is wanted small, (k, k); None where rivals are to be
            told apart.
        odds: of the rivals, as probable as they are now, (rivals,).
        least: noncentrality of each effect that the tests are to reach at least, (e,); 0 where none is asked for.
        penalty: weight of the logarithm of each lack of it, beside the logarithm of the variance that is wanted small.
    """

    views: Sequence[View]
    weight: Array | None
    odds: Array
    least: Array
    penalty: float

    def together(self, counts: Array) -> float:
        """Criterion of the given number of runs of each test, (tests,)."""
        return float(self._of([view.together(counts) for view in self.views])[0])

    def one_more(self, counts: Array) -> Array:
        """Criterion with one run more of each test in turn, (tests,)."""
        return self._of([view.one_more(counts) for view in self.views])

    def _of(self, found: Sequence[Information]) -> Array:
        if self.weight is None:
            aim = np.log(np.maximum(entropy_left(self.odds, distances(found[1:])), np.finfo(float).tiny))
        else:
            aim = np.log(np.einsum("tij,ij->t", self.views[0].error_covariance(found[0]), self.weight))
        asked = self.least > 0.0
        reached = noncentrality_of(found[0])[:, asked] / self.least[asked]
        return aim - self.penalty * np.sum(np.log(np.clip(reached, 1e-12, 1.0)), axis=1)  # finite


def noncentrality_of(found: Information) -> Array:
    """Noncentrality of each further column beside the parameters, (tests, e): chi-square that a unit of it makes."""
    return np.maximum(found.size - np.sum(found.cross * np.linalg.solve(found.own, found.cross), axis=-2), 0.0)


def distances(found: Sequence[Information]) -> Array:
    """Expected chi-square between any two rivals after the best refit of either, (tests, rivals, rivals)."""
    each = [noncentrality_of(one) for one in found]
    one_way = np.stack([np.insert(row, place, 0.0, axis=1) for place, row in enumerate(each)], axis=1)
    return np.minimum(one_way, np.swapaxes(one_way, 1, 2))


def root_of(information: Array) -> Array:
    """A root of the covariance that an information leaves, R R^T, (k, k)."""
    return np.linalg.inv(np.linalg.cholesky(information)).T


@dataclass(frozen=True, eq=False)
class Budget:
    """Duration and limits of tests.

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


def best_runs(criterion: Criterion, budget: Budget, start: Array, kept: Array) -> Array:
    """Number of runs of each test within the budget, (tests,), with a small criterion; at least those `kept`.

    Notes: greedy from `start` by what the logarithm falls per minute; then exchanges (Fedorov 1972): one run of each
    test, and all of them, are given up for the best that can be had in their time, as long as that helps.
    """
    counts = filled(criterion, budget, start)
    best = criterion.together(counts)
    for _ in range(8):  # nearly all plans take three
        before = best
        for test in track("tests of the plan exchanged", np.flatnonzero(counts).tolist()):
            for fewer in {1, int(counts[test] - kept[test])} - {0}:
                if counts[test] - fewer < kept[test]:
                    continue
                less = counts - fewer * (np.arange(counts.size) == test)
                other = filled(criterion, budget, less)
                value = criterion.together(other)
                if value < best - _WORTH:
                    counts, best = other, value
                    break
        if before - best < _WORTH:
            break
    return counts


def filled(
    criterion: Criterion, budget: Budget, counts: Array, enough: Callable[[Array], bool] = lambda _: False
) -> Array:
    """Runs added one after the other, each the best per minute, as long as time is left and they are not `enough`."""
    counts, so_far = counts.copy(), criterion.together(counts)
    while not enough(counts) and np.isfinite(further := budget.further(counts)).any():
        values = criterion.one_more(counts)
        fall = (so_far - values) / further
        best = int(np.argmax(np.where(np.isfinite(further), fall, -np.inf)))
        if so_far - values[best] <= _WORTH:
            break
        counts[best] += 1
        so_far = values[best]
    return counts


@dataclass(frozen=True, eq=False)
class Drifting:
    """Effect of a drift of the gain over the session on a given number of runs of each test.

    Its noncentrality beside the parameters, with S1 and S2 the sums of t and of t^2 over the runs of each test, is
    sum(seen S2 - shared S1^2) - |sum(S1 pull)|^2; t is the turn of a run, from -1/2 to 1/2 over the session.

    Args:
        seen: square of what a unit of gain makes of one run of each test, in units of noise, (tests,).
        shared: the part of it that an error of the level may be, (tests,).
        pull: what the parameters take of it, (tests, k).
    """

    seen: Array
    shared: Array
    pull: Array

    def noncentrality(self, runs: Sequence[int]) -> float:
        """Noncentrality of a drift of 1 over runs in their order, by the numbers of their tests."""
        first, second = self._sums(np.array(runs, dtype=int))
        shift = first @ self.pull
        return float(self.seen @ second - self.shared @ first**2 - shift @ shift)

    def shift(self, runs: Sequence[int]) -> Array:
        """Shift of the parameters by a drift of 1, (k,)."""
        return self._sums(np.array(runs, dtype=int))[0] @ self.pull

    def _sums(self, runs: Array) -> tuple[Array, Array]:
        first, second = (np.bincount(runs, turns(runs.size) ** power, self.seen.size) for power in (1, 2))
        return first, second

    def exchanged(self, runs: Array) -> Array:
        """Growth of the noncentrality if two runs change places, (runs, runs).

        The shift of the parameters is weighted by _STEADY.
        """
        turn = turns(runs.size)
        first = self._sums(runs)[0]
        moved, squared = turn - turn[:, None], turn**2 - turn[:, None] ** 2  # of the run in the row
        seen, shared, pull, sums = self.seen[runs], self.shared[runs], self.pull[runs], first[runs]
        levels = shared[:, None] * (2.0 * sums[:, None] + moved) * moved - shared * (2.0 * sums - moved) * moved
        change = moved[..., None] * (pull[:, None] - pull)
        pulled = np.sum((2.0 * (first @ self.pull) + change) * change, axis=-1)
        return np.where(runs[:, None] == runs, 0.0, (seen[:, None] - seen) * squared - levels - _STEADY * pulled)


def turns(count: int) -> Array:
    """The turn of each run of a session, from -1/2 to 1/2, (count,)."""
    return np.arange(count) / max(count - 1, 1) - 0.5


def ordered(counts: Array, places: Array, drifting: Drifting) -> list[int]:
    """Order of the runs, place by place; each place begins and ends with the same test if one is repeated.

    Args:
        counts: (tests,).
        places: number of the place of each test, in the order in which they are mounted, (tests,).

    Notes: the others are mirrored about the middle, then the two runs of one place that show the drift best when they
    change places do so, as long as two do.
    """
    order, held = list[int](), list[int]()
    for place in np.unique(places[counts > 0]):
        chosen = np.where(places == place, counts, 0)
        twice = np.flatnonzero(chosen > 1)
        ends = [int(twice[np.argmax(drifting.seen[twice])])] if twice.size else []
        chosen[ends] -= 2
        inner = np.repeat(np.arange(chosen.size), chosen).tolist()
        if ends:
            held += [len(order), len(order) + len(inner) + 1]
        order += [*ends, *inner[::2], *inner[1::2][::-1], *ends]
    runs, free = np.array(order), ~np.isin(np.arange(len(order)), held)
    for _ in range(100):  # nearly all orders take twenty
        together = (places[runs][:, None] == places[runs]) & free[:, None] & free
        gain = np.where(together, drifting.exchanged(runs), 0.0)
        one, other = np.unravel_index(int(np.argmax(gain)), gain.shape)
        if gain[one, other] <= 1e-9 * abs(drifting.noncentrality(runs.tolist())):
            break
        runs[[one, other]] = runs[[other, one]]
    return runs.tolist()
