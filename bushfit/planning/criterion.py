"""Criterion for a choice of tests, search for the best choice within the hours, and order of its runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from bushfit.diagnosis.next_test import entropy_left
from bushfit.effects.contract import Array
from bushfit.planning.information import Information, ModelInformation, rival_chi_squares
from bushfit.progress import track

#: Smallest useful decrease of the logarithm of the variance by a run or an exchange; chosen: 0.25 % of the error.
_USEFUL_DECREASE = 5e-3
#: Weight of the shift of the parameters by a drift beside the visibility of the drift; chosen: orders then keep the
#: shift below a fifth of a standard error for a drift of 1 % over the session.
_SHIFT_WEIGHT = 100.0


@dataclass(frozen=True, eq=False)
class Criterion:
    """Criterion of a choice of tests; the smaller, the better.

    Args:
        models: information on the likeliest model, whose further columns are effects that it lacks; then on its rivals.
        weight: weight of the parameters' covariance in the variance to minimise, (k, k); None to separate rivals.
        probabilities: present probabilities of the rivals, (rivals,).
        minimum_noncentrality: smallest wanted noncentrality of each effect, (e,); 0 where none is wanted.
        penalty: weight of the logarithm of each shortfall beside the logarithm of the variance.
    """

    models: Sequence[ModelInformation]
    weight: Array | None
    probabilities: Array
    minimum_noncentrality: Array
    penalty: float

    def value(self, counts: Array) -> float:
        """Criterion of a number of runs of each test, (tests,)."""
        return float(self.values([model.total(counts) for model in self.models])[0])

    def values_with_one_more(self, counts: Array) -> Array:
        """Criterion with one more run of each test in turn, (tests,)."""
        return self.values([model.with_one_more(counts) for model in self.models])

    def values(self, informations: Sequence[Information]) -> Array:
        """Compute the criterion of several choices.

        Args:
            informations: information of the choices on each model, (choices, ...).

        Returns:
            Criterion, (choices,).
        """
        if self.weight is None:
            entropy = entropy_left(self.probabilities, rival_chi_squares(informations[1:]))
            aim = np.log(np.maximum(entropy, np.finfo(float).tiny))
        else:
            aim = np.log(np.einsum("tij,ij->t", self.models[0].error_covariance(informations[0]), self.weight))
        wanted = self.minimum_noncentrality > 0.0
        share = informations[0].noncentralities()[:, wanted] / self.minimum_noncentrality[wanted]
        return aim - self.penalty * np.sum(np.log(np.clip(share, 1e-12, 1.0)), axis=1)  # finite


@dataclass(frozen=True, eq=False)
class Budget:
    """Durations and limits of the candidate tests.

    Args:
        minutes: duration of one run of each test, (tests,).
        place: number of the direction of each test, (tests,).
        line: number of the quantity that each test holds constant, (tests,); one test of a line is chosen.
        maximum_runs: largest number of runs of each test, (tests,); 0 where it may not be chosen.
        setup_minutes: time to mount the bushing, once for each direction that is tested.
        maximum_minutes: largest duration in all.
    """

    minutes: Array
    place: Array
    line: Array
    maximum_runs: Array
    setup_minutes: float
    maximum_minutes: float

    def spent(self, counts: Array) -> float:
        """Minutes of a number of runs of each test, (tests,)."""
        return float(self.minutes @ counts) + self.setup_minutes * np.unique(self.place[counts > 0]).size

    def minutes_of_one_more(self, counts: Array) -> Array:
        """Minutes that one more run of each test adds, (tests,); infinite where it may not be chosen."""
        more = self.minutes + self.setup_minutes * ~np.isin(self.place, self.place[counts > 0])
        barred = np.isin(self.line, self.line[counts > 0]) & (counts == 0) | (counts >= self.maximum_runs)
        return np.where(barred | (self.spent(counts) + more > self.maximum_minutes), np.inf, more)


def best_runs(criterion: Criterion, budget: Budget, start: Array, minimum_runs: Array) -> Array:
    """Search for the number of runs of each test that makes the criterion small.

    Args:
        criterion: to be made small.
        budget: durations and limits of the tests.
        start: number of runs of each test to start from, (tests,).
        minimum_runs: smallest number of runs of each test, (tests,).

    Returns:
        Number of runs of each test within the budget, (tests,).

    Notes:
        Greedy by the decrease of the criterion per minute; then exchanges (Fedorov 1972): one run of a test, or all of
        them, are replaced by the best runs in the same time, as long as that helps.
    """
    counts = add_runs(criterion, budget, start)
    best = criterion.value(counts)
    for _ in range(8):  # nearly all plans take three
        before = best
        for test in track("tests of the plan exchanged", np.flatnonzero(counts).tolist()):
            for removed in {1, int(counts[test] - minimum_runs[test])} - {0}:
                if counts[test] - removed < minimum_runs[test]:
                    continue
                exchanged = add_runs(criterion, budget, counts - removed * (np.arange(counts.size) == test))
                value = criterion.value(exchanged)
                if value < best - _USEFUL_DECREASE:
                    counts, best = exchanged, value
                    break
        if before - best < _USEFUL_DECREASE:
            break
    return counts


def add_runs(
    criterion: Criterion, budget: Budget, counts: Array, enough: Callable[[Array], bool] = lambda _: False
) -> Array:
    """Add runs one after the other, the best per minute first.

    Args:
        criterion: to be made small.
        budget: durations and limits of the tests.
        counts: number of runs of each test to start from, (tests,).
        enough: returns true for a number of runs of each test after which no more are added.

    Returns:
        Number of runs of each test, (tests,).
    """
    counts, value = counts.copy(), criterion.value(counts)
    while not enough(counts) and np.isfinite(minutes := budget.minutes_of_one_more(counts)).any():
        values = criterion.values_with_one_more(counts)
        decrease = (value - values) / minutes
        best = int(np.argmax(np.where(np.isfinite(minutes), decrease, -np.inf)))
        if value - values[best] <= _USEFUL_DECREASE:
            break
        counts[best] += 1
        value = values[best]
    return counts


@dataclass(frozen=True, eq=False)
class DriftEffect:
    """Effect of a drift of the gain over the session on a number of runs of each test.

    Args:
        gain_information: square of the change of one run by a unit of gain, in units of noise, (tests,).
        level_share: part of it that may be an error of the level, (tests,).
        shift_root: shift of the parameters by a unit of gain, in standard errors, (tests, k).

    Notes:
        With S1 and S2 the sums of t and t^2 over the runs of each test, where t is the turn of a run from -1/2 to 1/2
        over the session, the noncentrality of a unit drift after a refit of the parameters is
        sum(gain_information S2 - level_share S1^2) - |sum(S1 shift_root)|^2.
    """

    gain_information: Array
    level_share: Array
    shift_root: Array

    def turn_sums(self, runs: Sequence[int] | Array) -> tuple[Array, Array, Array]:
        """Turn of each run, (runs,), and the sums of the turns and of their squares over each test, (tests,) each."""
        tests = np.array(runs, dtype=int)
        turn = np.arange(tests.size) / max(tests.size - 1, 1) - 0.5
        first, second = (np.bincount(tests, turn**power, self.gain_information.size) for power in (1, 2))
        return turn, first, second

    def noncentrality(self, runs: Sequence[int] | Array) -> float:
        """Noncentrality of a unit drift over runs in their order, given by the numbers of their tests."""
        _, first, second = self.turn_sums(runs)
        shift = first @ self.shift_root
        return float(self.gain_information @ second - self.level_share @ first**2 - shift @ shift)

    def shift(self, runs: Sequence[int] | Array) -> Array:
        """Shift of the parameters by a unit drift over runs in their order, (k,)."""
        return self.turn_sums(runs)[1] @ self.shift_root

    def exchange_gains(self, runs: Array) -> Array:
        """Compute the growth of the noncentrality if two runs change places.

        Args:
            runs: numbers of the tests in their order, (runs,).

        Returns:
            Growth for each pair of runs, (runs, runs); the shift of the parameters counts with _SHIFT_WEIGHT.
        """
        turn, first, _ = self.turn_sums(runs)
        step, squared = turn - turn[:, None], turn**2 - turn[:, None] ** 2  # of the run in the row
        gain, shared, root = self.gain_information[runs], self.level_share[runs], self.shift_root[runs]
        sums = first[runs]
        levels = shared[:, None] * (2.0 * sums[:, None] + step) * step - shared * (2.0 * sums - step) * step
        change = step[..., None] * (root[:, None] - root)
        shifts = np.sum((2.0 * (first @ self.shift_root) + change) * change, axis=-1)
        return np.where(runs[:, None] == runs, 0.0, (gain[:, None] - gain) * squared - levels - _SHIFT_WEIGHT * shifts)


def order_runs(counts: Array, places: Array, drift: DriftEffect) -> list[int]:
    """Order the runs direction by direction; each begins and ends with the same test if one is repeated.

    Args:
        counts: number of runs of each test, (tests,).
        places: number of the direction of each test, in the order in which they are mounted, (tests,).
        drift: effect of a drift on these runs.

    Returns:
        Numbers of the tests in the order of the runs.

    Notes:
        The inner runs are mirrored about the middle. Then the two runs of one direction whose exchange makes the drift
        most visible change places, as long as any exchange does.
    """
    order, ends = list[int](), list[int]()
    for place in np.unique(places[counts > 0]):
        chosen = np.where(places == place, counts, 0)
        repeated = np.flatnonzero(chosen > 1)
        outer = [int(repeated[np.argmax(drift.gain_information[repeated])])] if repeated.size else []
        chosen[outer] -= 2
        inner = np.repeat(np.arange(chosen.size), chosen).tolist()
        if outer:
            ends += [len(order), len(order) + len(inner) + 1]
        order += [*outer, *inner[::2], *inner[1::2][::-1], *outer]
    runs, free = np.array(order), ~np.isin(np.arange(len(order)), ends)
    for _ in range(100):  # nearly all orders take twenty
        exchangeable = (places[runs][:, None] == places[runs]) & free[:, None] & free
        gains = np.where(exchangeable, drift.exchange_gains(runs), 0.0)
        i, j = np.unravel_index(int(np.argmax(gains)), gains.shape)
        if gains[i, j] <= 1e-9 * abs(drift.noncentrality(runs)):
            break
        runs[[i, j]] = runs[[j, i]]
    return runs.tolist()
