"""In which order tests are made, so that a drift over the session shows and moves no parameter."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bushfit.effects.contract import Array

#: Weight of what the parameters take of a drift, beside what shows of it; chosen: orders then keep it below a fifth of
#: a standard error for 1 % over the session.
_STEADY = 100.0


@dataclass(frozen=True, eq=False)
class Drifting:
    """What a drift of the gain over the session does to tests, of which each is made so many times.

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
        """Of a drift of 1 by runs in their order, by the numbers of their tests."""
        first, second = self._sums(np.array(runs, dtype=int))
        shift = first @ self.pull
        return float(self.seen @ second - self.shared @ first**2 - shift @ shift)

    def shift(self, runs: Sequence[int]) -> Array:
        """What the parameters take of a drift of 1, (k,)."""
        return self._sums(np.array(runs, dtype=int))[0] @ self.pull

    def _sums(self, runs: Array) -> tuple[Array, Array]:
        first, second = (np.bincount(runs, turns(runs.size) ** power, self.seen.size) for power in (1, 2))
        return first, second

    def exchanged(self, runs: Array) -> Array:
        """By how much the noncentrality grows where two runs change places, (runs, runs).

        What the parameters take of the drift counts _STEADY times.
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
    """So many runs of each test, place by place, each place begun and ended with one test where one is repeated.

    Args:
        counts: (tests,).
        places: number of the place of each test, in the order in which they are mounted, (tests,).

    Notes: the others are mirrored about the middle, then the two runs of one place that show the drift best when they
    change places do so, as long as two do.
    """
    order, held = list[int](), list[int]()
    for place in np.unique(places[counts > 0]):
        mine = np.where(places == place, counts, 0)
        twice = np.flatnonzero(mine > 1)
        ends = [int(twice[np.argmax(drifting.seen[twice])])] if twice.size else []
        mine[ends] -= 2
        inner = np.repeat(np.arange(mine.size), mine).tolist()
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
