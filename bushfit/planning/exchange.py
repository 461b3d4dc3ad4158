"""Choose the best tests within the available hours by exchanging tests."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bushfit.campaign.simulated import SimulatedLoop
from bushfit.effects.contract import Array
from bushfit.planning.contract import PlanRequest, Test
from bushfit.progress import track

if TYPE_CHECKING:
    from bushfit.planning.search import PlanSearch

#: Smallest useful decrease of the logarithm of the variance by a run or an exchange; chosen: 0.25 % of the error.
_USEFUL_DECREASE = 5e-3
#: Time to bring the rig to another run, for its control to settle [s]; chosen.
_RUN_SECONDS = 120.0
#: Time for a point of a sweep [s] and to mount the bushing [min] if [rig] states none; chosen: some cycles to settle
#: and some to average.
_POINT_SECONDS, _SETUP_MINUTES = 30.0, 30.0


@dataclass(frozen=True, eq=False)
class Budget:
    """Durations of the candidate tests, and limits on their number and total duration.

    Args:
        minutes: duration of one run of each test [min], (tests,).
        place: index of the direction or specimen of each test, (tests,).
        alternative: index shared by the tests of one direction with the same constant amplitude or frequency, (tests,).
            A plan chooses at most one of them.
        maximum_runs: largest number of runs of each test, (tests,); 0 for a test that may not be chosen.
        setup_minutes: time to mount the bushing [min], spent once for each direction or specimen.
        maximum_minutes: largest total duration [min].
    """

    minutes: Array
    place: Array
    alternative: Array
    maximum_runs: Array
    setup_minutes: float
    maximum_minutes: float

    @classmethod
    def from_tests(cls, tests: Sequence[Test], request: PlanRequest) -> Budget:
        """Compute the durations of tests.

        Args:
            tests: candidate tests; tests in directions that the request excludes get no runs.
            request: directions that the rig can test, its durations, and the available hours.

        Returns:
            Durations and limits of the tests.
        """
        places = list(dict.fromkeys([*request.places, *(test.direction for test in tests)]))
        alternatives, minutes, setup = list[object](), list[float](), request.rig.minutes_per_setup
        for test in tests:
            if isinstance(test, SimulatedLoop):
                seconds = test.cycles / test.frequency
                alternatives.append((test.direction, test.amplitude, test.frequency))
            else:
                seconds = (request.rig.minutes_per_point or _POINT_SECONDS) * test.points[0].size
                alternatives.append((test.direction, test.stepped, test.levels))
            minutes.append((_RUN_SECONDS + seconds) / 60.0)
        distinct = list(dict.fromkeys(alternatives))
        return cls(
            np.array(minutes),
            np.array([places.index(test.direction) for test in tests]),
            np.array([distinct.index(alternative) for alternative in alternatives]),
            np.array([1000 * (test.direction in request.places) for test in tests]),
            _SETUP_MINUTES if setup is None else setup / 60.0,
            60.0 * request.hours,
        )

    def total_minutes(self, counts: Array) -> float:
        """Total duration [min], with set-ups, if each test is run `counts` times, (tests,)."""
        return float(self.minutes @ counts) + self.setup_minutes * np.unique(self.place[counts > 0]).size


def best_runs(search: PlanSearch, start: Array, minimum_runs: Array) -> Array:
    """Find the number of runs of each test that minimises the objective of a search within the available hours.

    Args:
        search: search with the objective and the budget.
        start: number of runs of each test to start from, (tests,).
        minimum_runs: smallest number of runs of each test, (tests,).

    Returns:
        Number of runs of each test within the budget, (tests,).

    Notes:
        Greedy search by the decrease of the objective per minute; then exchanges (Fedorov 1972): one run of a test, or
        all its runs, are replaced by the best runs of the same duration, until no exchange lowers the objective.
    """
    counts = add_runs(search, search.budget, start)
    best = search.objective(counts)
    for _ in range(8):  # nearly all plans take three
        before = best
        for test in track("tests of the plan exchanged", np.flatnonzero(counts).tolist()):
            for removed in {1, int(counts[test] - minimum_runs[test])} - {0}:
                if counts[test] - removed < minimum_runs[test]:
                    continue
                reduced = counts - removed * (np.arange(counts.size) == test)
                exchanged = add_runs(search, search.budget, reduced)
                value = search.objective(exchanged)
                if value < best - _USEFUL_DECREASE:
                    counts, best = exchanged, value
                    break
        if before - best < _USEFUL_DECREASE:
            break
    return counts


def add_runs(
    search: PlanSearch, budget: Budget, counts: Array, enough: Callable[[Array], bool] = lambda _: False
) -> Array:
    """Add runs one by one, each time the run with the largest decrease of the objective per minute.

    Args:
        search: search with the objective.
        budget: durations and limits of the tests.
        counts: number of runs of each test to start from, (tests,).
        enough: function that returns true to stop adding runs, of the number of runs of each test, (tests,).

    Returns:
        Number of runs of each test with the added runs, (tests,).
    """
    counts, value = counts.copy(), search.objective(counts)
    while not enough(counts):
        run = counts > 0
        minutes = budget.minutes + budget.setup_minutes * ~np.isin(budget.place, budget.place[run])
        barred = np.isin(budget.alternative, budget.alternative[run]) & ~run | (counts >= budget.maximum_runs)
        barred |= budget.total_minutes(counts) + minutes > budget.maximum_minutes
        if barred.all():
            break
        values = search.objectives(counts, one_more=True)
        best = int(np.argmax(np.where(barred, -np.inf, (value - values) / minutes)))
        if value - values[best] <= _USEFUL_DECREASE:
            break
        counts[best] += 1
        value = values[best]
    return counts
