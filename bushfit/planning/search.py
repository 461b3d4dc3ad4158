"""Search for the tests of a plan: data of all candidate tests, and the best choice of tests within the hours."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, cycle

import numpy as np

from bushfit.campaign.simulated import SimulatedSweep
from bushfit.caveat import Caveat
from bushfit.diagnosis.next_test import remaining_entropy
from bushfit.diagnosis.priors import DECISIVE_CHI_SQUARE
from bushfit.effects import Effect
from bushfit.effects.contract import Array
from bushfit.fitting.repeats import FEWEST_STEPS
from bushfit.geometry import Place
from bushfit.model.covariance import Z95
from bushfit.model.result import Range, Result
from bushfit.planning.candidates import candidates, standard_tests
from bushfit.planning.contract import Knowledge, PlanRequest, Test
from bushfit.planning.exchange import Budget, best_runs
from bushfit.planning.information import CandidateGrid, ModelInformation, rival_chi_squares
from bushfit.planning.targets import UNLIMITED_RUNS, PlannedQuantity
from bushfit.prediction.caveats import unfitted_warnings

#: The 90 % quantile of the normal distribution.
_NINE_OF_TEN = 1.2815515655446004
#: Amount of an effect over its standard error that a test at the 5 % level detects in 90 % of the cases: the sum of the
#: 97.5 % and the 90 % quantiles of the normal distribution.
DETECTABLE = Z95 + _NINE_OF_TEN
#: Expected chi-square between rivals above which `diagnose` separates them in 90 % of the cases: the observed value of
#: an expected d scatters by 2 sqrt(d), and `diagnose` does not separate rivals within DECISIVE_CHI_SQUARE.
RIVALS_APART = (_NINE_OF_TEN + float(np.sqrt(_NINE_OF_TEN**2 + DECISIVE_CHI_SQUARE))) ** 2

#: Penalty weight of the objective for effects that are detected less well than with the standard programme, and the
#: weight that is used if the first leaves such effects; chosen.
_PENALTY, _STRICT_PENALTY = 3.0, 30.0
#: Wanted degrees of freedom of the scatter of sweeps; chosen: with five, errors are a tenth larger than planned.
_NOISE_FREEDOM = 10


@dataclass(frozen=True, eq=False)
class PlanSearch:
    """Candidate tests of a plan with their durations and their information on the aim, and the search among them.

    In all methods, `counts` is the number of runs of each candidate test, (tests,). The k parameters include those at a
    bound.

    Args:
        knowledge: model, covariance and noise before the planned tests.
        request: aim of the plan and limits of the rig.
        tests: candidate tests, then tests that only the standard programme has.
        effects: the e missing effects, each repeated for its shapes (such as frequencies of a resonance).
        models: Fisher information of each test on the likeliest model and the missing effects, then on each rival model
            and its differences from the other rivals.
        predictions: stiffness and loss factor of each direction of the request.
        goals: parameter or prediction of each target of the request.
        budget: durations of the tests, and available hours.
        penalty: weight in the objective of effects that the plan detects less well than the standard programme.
    """

    knowledge: Knowledge
    request: PlanRequest
    tests: tuple[Test, ...]
    effects: list[Effect]
    models: list[ModelInformation]
    predictions: list[PlannedQuantity]
    goals: list[PlannedQuantity]
    budget: Budget
    penalty: float = _STRICT_PENALTY

    @classmethod
    def from_request(cls, knowledge: Knowledge, request: PlanRequest) -> PlanSearch:
        """Compute the durations and the information of all candidate tests.

        Args:
            knowledge: model, covariance and noise before the planned tests.
            request: aim of the plan and limits of the rig.

        Returns:
            Search within the hours of the request, not yet started.

        Raises:
            ModelError: no test is within the limits of the rig.
        """
        tests = tuple(dict.fromkeys([*candidates(knowledge, request), *standard_tests(knowledge, request)]))
        grid = CandidateGrid.from_tests(knowledge, tests)
        effects, columns = grid.effect_columns()
        models = [grid.information(knowledge, columns)]
        residuals = np.array(
            [np.concatenate([test.residual(rival.model) for test in grid.data_sets]) for rival in knowledge.rivals]
        )
        for index, rival in enumerate(knowledge.rivals):
            models.append(grid.information(rival, np.delete(residuals, index, axis=0) - residuals[index]))
        of_places = [PlannedQuantity.predictions(knowledge, place, *grid) for place, grid in request.grids.items()]
        predictions = list(chain(*of_places))
        named = {quantity.name: quantity for quantity in (*PlannedQuantity.parameters(knowledge), *predictions)}
        goals = [replace(named[name], target=half_width) for name, half_width in request.targets.items()]
        return cls(knowledge, request, tests, effects, models, predictions, goals, Budget.from_tests(tests, request))

    @cached_property
    def counts(self) -> Array:
        """Best number of runs of each test, (tests,); all zero if no test fits into the hours.

        If possible, the tests detect every effect as well as the standard programme does.
        """
        required = self.required_runs
        counts = best_runs(replace(self, penalty=_PENALTY), required, required)
        if self.less_visible_effects(counts):
            standard = np.minimum(self.standard_counts, self.budget.maximum_runs)
            starts = [counts] if required.any() else [counts, standard]
            counts = min((best_runs(self, start, required) for start in starts), key=self.objective)
        # a repeat of one test in each direction with more than two tests shows drift and noise
        for place in np.unique(self.budget.place[counts > 0]):
            chosen = np.flatnonzero((counts > 0) & (self.budget.place == place))
            if chosen.size > 2 and counts[chosen].max() < 2:
                quickest = chosen[np.argsort(self.budget.minutes[chosen])][:4]
                counts = min(self.with_one_repeat(counts, quickest), key=self.objective, default=counts)
        # repeats of sweeps determine the random noise of points, apart from differences of runs; without targets, the
        # errors grow by at most 5 %, which is 0.1 in the logarithm of the variance
        largest = np.inf if self.goals else self.objective(counts) + 0.1
        while not self.determines_noise(counts):
            freedom = self.noise_freedom(counts)
            sweeps = [test for test in np.flatnonzero(counts).tolist() if freedom_per_repeat(self.tests[test])]
            choices = [
                runs
                for runs in self.with_one_repeat(counts, sweeps)
                if self.noise_freedom(runs) > freedom and self.objective(runs) <= largest
            ]
            if not choices:
                break
            counts = min(choices, key=self.objective)
        return counts

    @cached_property
    def runs(self) -> list[int]:
        """Test index of each chosen run, in an order in which a drift of the gain hardly shifts the parameters.

        Runs are grouped by direction. Each direction begins and ends with its most repeated test, and the runs between
        are mirrored about the middle, so that the repeats of a test are spread over the session.
        """
        order = list[int]()
        for place in np.unique(self.budget.place[self.counts > 0]):
            chosen = np.where(self.budget.place == place, self.counts, 0)
            outer = [int(np.argmax(chosen))] if chosen.max() > 1 else []
            chosen[outer] -= 2
            inner = np.repeat(np.arange(chosen.size), chosen).tolist()
            order += [*outer, *inner[::2], *inner[1::2][::-1], *outer]
        return order

    def objective(self, counts: Array) -> float:
        """Objective that the plan minimises (see `objectives`) for `counts` runs of each test, (tests,)."""
        return float(self.objectives(counts)[0])

    def objectives(self, counts: Array, *, one_more: bool = False) -> Array:
        """Compute the objective that the plan minimises.

        It is the logarithm of a weighted parameter variance, or of the entropy of the rival models, plus a penalty for
        each missing effect that the tests would detect less well than the standard programme does.

        Args:
            counts: number of runs of each test, (tests,).
            one_more: True to add one run of each test in turn.

        Returns:
            Objective, (1,); with `one_more`, for each test that is run once more, (tests,).
        """
        likeliest, *rivals = (model.total(counts, one_more=one_more) for model in self.models)
        if self.weight is None:
            probabilities = [rival.probability for rival in self.knowledge.rivals]
            entropy = remaining_entropy(probabilities, rival_chi_squares(rivals))
            aim = np.log(np.maximum(entropy, np.finfo(float).tiny))
        else:
            aim = np.log(np.einsum("tij,ij->t", self.models[0].error_covariance(likeliest), self.weight))
        wanted = self.minimum_noncentrality > 0.0
        share = likeliest.noncentralities()[:, wanted] / self.minimum_noncentrality[wanted]
        return aim - self.penalty * np.sum(np.log(np.clip(share, 1e-12, 1.0)), axis=1)  # finite

    @cached_property
    def standard_counts(self) -> Array:
        """Number of runs of each test in the standard programme, repeated to fill the hours, (tests,)."""
        counts = np.zeros(len(self.tests), dtype=int)
        for test in cycle(self.tests.index(test) for test in standard_tests(self.knowledge, self.request)):
            counts[test] += 1
            if self.budget.total_minutes(counts) > self.budget.maximum_minutes:
                counts[test] -= 1
                break
        return counts

    @cached_property
    def minimum_noncentrality(self) -> Array:
        """Expected increase of chi-square by each missing effect in the standard programme, (e,).

        The value is for a typical amount of the effect; 0 if the programme cannot detect the largest possible amount.
        """
        reached = self.models[0].total(self.standard_counts).noncentralities()[0]
        amounts = [effect.amount for effect in self.effects]
        # the largest amount that a bushing or a rig can have, in typical amounts
        largest = [max(abs(end - (x.neutral or 0.0)) for end in x.bounds) / x.typical for x in amounts]
        return np.where(np.array(largest) * np.sqrt(reached) >= DETECTABLE, reached, 0.0)

    @cached_property
    def required_runs(self) -> Array:
        """Smallest number of runs of each candidate, (tests,): one run in each direction with a target but no test.

        Only a test in a direction determines the error of its stiffness formula. All zero if the runs do not fit into
        the hours.
        """
        required = np.zeros(len(self.tests), dtype=int)
        if self.goals:
            values = self.objectives(required, one_more=True)
            for goal in self.goals:
                chosen = np.array([test.direction == goal.place for test in self.tests])
                chosen &= self.budget.maximum_runs > 0
                tested = self.knowledge.tests or required.any()
                if chosen.any() and (not tested or self.untested_warning(goal, required)):
                    required[int(np.argmin(np.where(chosen, values, np.inf)))] = 1
        return required if self.budget.total_minutes(required) <= self.budget.maximum_minutes else 0 * required

    def reaches_aim(self, *, with_checks: bool = False) -> bool:
        """Check that the chosen tests separate the rival models with a margin of two, or meet the reachable targets.

        Args:
            with_checks: true to require also that the tests detect all effects as well as the standard programme, and
                that repeats determine the scatter of sweeps.

        Returns:
            True if the tests reach the aim.
        """
        counts = self.counts
        if self.request.aim == "rivals":
            return self.nearest_rivals(counts) >= 2.0 * RIVALS_APART
        covariance = self.error_covariance(counts)
        reached = all(goal.meets_target(covariance, self.limit_covariance) for goal in self.goals)
        testable = [goal for goal in self.goals if goal.place in self.request.places]
        if not self.goals or not reached or any(self.untested_warning(goal, counts) for goal in testable):
            return False
        return not with_checks or (not self.less_visible_effects(counts) and self.determines_noise(counts))

    def untested_warning(self, goal: PlannedQuantity, counts: Array) -> Caveat | None:
        """Warning that no test in a target's direction shows the error of its stiffness formula.

        Args:
            goal: parameter or prediction with a target.
            counts: number of runs of each test in addition to the tests so far, (tests,).

        Returns:
            Warning; None if the direction is tested or the target is a parameter.
        """
        place, knowledge = goal.place, self.knowledge
        measured = knowledge.result.measured
        planned = (self.tests[test] for test in np.flatnonzero(counts))
        tested = [*(measured.directions if measured else ())]
        tested += [str(test.direction) for test in (*knowledge.tests, *planned)]
        if place is None or str(place) in tested:
            return None
        fitted = replace(measured or Range((1.0, 1.0), (1.0, 1.0)), directions=tuple(dict.fromkeys(tested)))
        return next(unfitted_warnings(Result(knowledge.model, knowledge.names, measured=fitted), place), None)

    def less_visible_effects(self, counts: Array) -> list[str]:
        """Names of the effects that `counts` runs, (tests,), detect less well than the standard programme."""
        reached = self.models[0].total(counts).noncentralities()[0]
        short = np.sqrt(reached) < 0.995 * np.sqrt(self.minimum_noncentrality)  # numerical accuracy
        return list(dict.fromkeys(self.effects[index].name for index in np.flatnonzero(short)))

    def with_one_repeat(self, counts: Array, tests: Iterable[int]) -> Iterator[Array]:
        """Yield variants of a plan: in each, one of the given tests has one more run.

        Tests with a single run are dropped, the least useful first, until the repeat fits into the hours.

        Args:
            counts: number of runs of each test, (tests,).
            tests: indices of the tests to repeat.

        Returns:
            Iterator over the numbers of runs of each test, (tests,), one for each repeat that fits.
        """
        one = np.eye(len(self.tests), dtype=int)
        for test in tests:
            runs = counts + one[test]
            while (
                self.budget.total_minutes(runs) > self.budget.maximum_minutes
                and (single := (runs == 1) & (self.required_runs == 0)).any()
            ):
                runs = min((runs - one[dropped] for dropped in np.flatnonzero(single)), key=self.objective)
            if self.budget.total_minutes(runs) <= self.budget.maximum_minutes:
                yield runs

    def noise_freedom(self, counts: Array) -> list[int]:
        """Degrees of freedom of the random noise of sweeps, as repeats in the plan and in earlier tests give them.

        Args:
            counts: number of runs of each test, (tests,).

        Returns:
            Degrees of freedom for the bushing and for each specimen, in ascending order; a number above the required
            one is replaced by the required one.
        """
        runs = Counter(self.knowledge.tests)
        runs.update({test: int(n) for test, n in zip(self.tests, counts, strict=True) if n})
        freedom = Counter[Place | None]()
        for test, count in runs.items():
            if isinstance(test, SimulatedSweep):
                specimen = None if test.direction.axis else test.direction
                freedom[specimen] += freedom_per_repeat(test) * (count - 1)
        return sorted(min(n, _NOISE_FREEDOM) for n in freedom.values())

    def determines_noise(self, counts: Array) -> bool:
        """True if the repeats among `counts` runs, (tests,), determine the random noise of sweeps well enough."""
        return self.noise_freedom(counts) >= [_NOISE_FREEDOM]

    def error_covariance(self, counts: Array) -> Array:
        """Covariance of the parameters' relative errors, (k, k), after `counts` runs of each test, (tests,)."""
        return np.asarray(self.models[0].error_covariance(self.models[0].total(counts))[0])

    @cached_property
    def limit_covariance(self) -> Array:
        """Covariance of the parameters' relative errors after unlimited repeats of all candidates, (k, k)."""
        return self.error_covariance(UNLIMITED_RUNS * (self.budget.maximum_runs > 0))

    @cached_property
    def weight(self) -> Array | None:
        """Weights W, (k, k), of the objective ln trace(W C), C the covariance of the parameters' relative errors.

        None if the aim is to separate rival models: the objective is then the entropy that remains between them.
        """
        if self.request.aim == "rivals":
            return None
        if self.request.aim == "targets":
            return np.sum([goal.weight(self.limit_covariance) for goal in self.goals], axis=0)
        if self.request.aim == "predictions":
            slopes = np.concatenate([quantity.rows for quantity in self.predictions])  # of gain and phase
            return np.asarray(2.0 * slopes.T @ slopes / len(slopes))
        names = (*self.knowledge.names, *self.knowledge.bounded)
        return np.diag(np.isin(names, self.request.parameters).astype(float))

    @cached_property
    def separable_rivals(self) -> Array:
        """Mask of the pairs of rival models that all candidate tests together can distinguish, (rivals, rivals).

        If no pair is separable, the mask contains all pairs. Only the upper triangle is used.
        """
        rivals = len(self.knowledge.rivals)
        pairs = np.triu(np.ones((rivals, rivals), dtype=bool), 1)
        if not rivals:
            return pairs
        chi_square = rival_chi_squares([model.total(np.ones(len(self.tests), dtype=int)) for model in self.models[1:]])
        separable = pairs & (chi_square[0] >= RIVALS_APART)
        return separable if separable.any() else pairs

    def nearest_rivals(self, counts: Array) -> float:
        """Smallest expected chi-square between separable rival models, for runs `counts`, (tests,)."""
        chi_square = rival_chi_squares([model.total(counts) for model in self.models[1:]])[0]
        return float(chi_square[self.separable_rivals].min())


def freedom_per_repeat(test: Test) -> int:
    """Degrees of freedom that one more run of a test adds to the noise estimated from repeats.

    Returns:
        Degrees of freedom; 0 for loops and short sweeps.
    """
    steps = len(test.steps) if isinstance(test, SimulatedSweep) else 0
    return steps - 1 if steps >= FEWEST_STEPS else 0
