"""How good a choice of tests is: one number for its aim, and what it falls short of the standard programme."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bushfit.effects.contract import Array
from bushfit.planning.sensitivity import Told

#: Noncentrality relative to the one asked for below which a lack counts no further: logarithms stay finite.
_LEAST = 1e-12


@dataclass(frozen=True, eq=False)
class View:
    """What tests tell about the parameters of one model, and how well further columns show beside these.

    Args:
        told: by every candidate test, made once.
        prior: information on relative changes of the parameters before, (k, k).
        level: error that all runs of a test share, gain and phase, (tests, 2).
        bounded: so many of the parameters, the last, are at rest on a bound.
    """

    told: Told
    prior: Array
    level: Array
    bounded: int = 0

    def together(self, counts: Array) -> Told:
        """What so many runs of each test, (tests,), tell together with what is known, (1, ...)."""
        total = self._each(counts).total()
        return replace(total, own=total.own + self.prior)

    def one_more(self, counts: Array) -> Told:
        """The same with one run more of each test in turn, (tests, ...)."""
        return self.together(counts) + (self._each(counts + 1) - self._each(counts))

    def off(self, told: Told) -> Array:
        """Expected squares and products of what a fit to such tests finds less the truth, (..., k, k).

        Notes:
            Of a parameter whose true value is on its bound, noise would take half of the fits beyond it. There it stays
            on the bound, and the others are found as if it were held: so half of what it adds to their squares is gone.
        """
        free = np.linalg.inv(told.own)
        first = free.shape[-1] - self.bounded
        own = free[..., first:]
        return free - 0.5 * own @ np.linalg.inv(own[..., first:, :]) @ own.mT

    def _each(self, counts: Array) -> Told:
        """What so many runs of each test tell about the parameters, test by test."""
        return self.told.times(counts).beside(self.level)


@dataclass(frozen=True, eq=False)
class Criterion:
    """What is made small by a choice of tests.

    Args:
        views: the likeliest model's, whose further columns are effects that it lacks; then those of its rivals.
        weight: of the parameters' covariance in the variance that is wanted small, (k, k); None where rivals are to be
            told apart.
        pairs: of rivals that are to be told apart, by their numbers, (2, pairs).
        least: noncentrality of each effect that the tests are to reach at least, (e,); 0 where none is asked for.
        penalty: weight of the logarithm of each lack of it, beside the logarithm of the variance that is wanted small.
    """

    views: Sequence[View]
    weight: Array | None
    pairs: Array
    least: Array
    penalty: float

    def together(self, counts: Array) -> float:
        """Of so many runs of each test, (tests,)."""
        return float(self._of([view.together(counts) for view in self.views])[0])

    def one_more(self, counts: Array) -> Array:
        """The same with one run more of each test in turn, (tests,)."""
        return self._of([view.one_more(counts) for view in self.views])

    def _of(self, told: Sequence[Told]) -> Array:
        if self.weight is None:
            aim = -np.log(np.maximum(distances(told[1:])[:, *self.pairs].min(axis=1), np.finfo(float).tiny))
        else:
            aim = np.log(np.einsum("tij,ij->t", self.views[0].off(told[0]), self.weight))
        asked = self.least > 0.0
        reached = shown(told[0])[:, asked] / self.least[asked]
        return aim - self.penalty * np.sum(np.log(np.clip(reached, _LEAST, 1.0)), axis=1)


def shown(told: Told) -> Array:
    """Noncentrality of each further column beside the parameters, (tests, e): chi-square that a unit of it makes."""
    return np.maximum(told.size - np.sum(told.cross * np.linalg.solve(told.own, told.cross), axis=-2), 0.0)


def distances(told: Sequence[Told]) -> Array:
    """Expected chi-square between any two rivals after the best refit of either, (tests, rivals, rivals)."""
    each = [shown(one) for one in told]
    one_way = np.stack([np.insert(row, place, np.inf, axis=1) for place, row in enumerate(each)], axis=1)
    return np.minimum(one_way, np.swapaxes(one_way, 1, 2))


def root_of(information: Array) -> Array:
    """A root of the covariance that an information leaves, R R^T, (k, k)."""
    return np.linalg.inv(np.linalg.cholesky(information)).T
