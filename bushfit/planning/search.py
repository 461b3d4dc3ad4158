"""Search for the tests of a plan within given hours, with repeats that show the scatter of the rig."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bushfit.campaign.simulated import SimulatedSweep
from bushfit.effects.contract import Array
from bushfit.fitting.repeats import FEWEST_STEPS
from bushfit.geometry import Place
from bushfit.model.result import Range, Result
from bushfit.planning.candidates import standard_tests
from bushfit.planning.contract import Programme, Test
from bushfit.planning.criterion import Budget, Criterion, best_runs
from bushfit.planning.problem import DETECTABLE, RIVALS_APART, PlanningProblem
from bushfit.planning.targets import TargetSensitivity
from bushfit.prediction.caveats import unfitted_warnings

#: Penalty weight of the criterion for effects that are detected less well than with the standard programme, and the
#: weight that is used if the first leaves such effects; chosen.
_PENALTY, _STRICT_PENALTY = 3.0, 30.0
#: Wanted degrees of freedom of the scatter of sweeps; chosen: with five, errors are a tenth larger than planned.
_SCATTER_FREEDOM = 10


@dataclass(frozen=True, eq=False)
class PlanSearch:
    """Search for the best number of runs of each candidate test within given hours.

    In all methods, `counts` is the number of runs of each candidate test, (tests,).

    Args:
        problem: candidate tests with their durations and information.
        hours: available time on the rig [h].
    """

    problem: PlanningProblem
    hours: float

    @cached_property
    def budget(self) -> Budget:
        """Durations and limits of the candidate tests, with the available hours."""
        return replace(self.problem.budget, maximum_minutes=60.0 * self.hours)

    @cached_property
    def counts(self) -> Array:
        """Best number of runs of each test, (tests,); all zero if no test fits into the hours.

        If possible, the tests detect every effect as well as the standard programme does.
        """
        required = self.required_runs
        counts = best_runs(replace(self.strict_criterion, penalty=_PENALTY), self.budget, required, required)
        if self.less_visible_effects(counts):
            standard = np.minimum(self.count_runs(self.standard_runs), self.budget.maximum_runs)
            starts = [counts, *([] if required.any() else [standard])]
            choices = (best_runs(self.strict_criterion, self.budget, start, required) for start in starts)
            counts = min(choices, key=self.strict_criterion.value)
        return self.with_scatter(self.with_repeats(counts))

    @cached_property
    def strict_criterion(self) -> Criterion:
        """Criterion with a large penalty for effects that the tests detect less well than the standard programme."""
        problem = self.problem
        probabilities = np.array([rival.probability for rival in problem.knowledge.rivals])
        return Criterion(problem.models, problem.weight, probabilities, self.minimum_noncentrality, _STRICT_PENALTY)

    @cached_property
    def standard_runs(self) -> list[int]:
        """Test indices of the standard programme, repeated to fill the hours and ordered by direction."""
        problem = self.problem
        tests = [problem.tests.index(test) for test in standard_tests(problem.knowledge, problem.request)]
        runs = list[int]()
        while tests:
            runs.append(tests[len(runs) % len(tests)])
            if self.budget.spent(self.count_runs(runs)) > self.budget.maximum_minutes:
                runs.pop()
                break
        return sorted(runs, key=lambda test: self.budget.place[test])

    @cached_property
    def minimum_noncentrality(self) -> Array:
        """Noncentrality (expected chi-square) that the standard programme reaches for each effect, (e,).

        It is that of a typical amount, and 0 if the programme cannot detect even the largest possible amount.
        """
        reached = self.problem.models[0].total(self.count_runs(self.standard_runs)).noncentralities()[0]
        amounts = [effect.amount for effect in self.problem.effects]
        # the largest amount that a bushing or a rig can have, in typical amounts
        largest = [max(abs(end - (x.neutral or 0.0)) for end in x.bounds) / x.typical for x in amounts]
        return np.where(np.array(largest) * np.sqrt(reached) >= DETECTABLE, reached, 0.0)

    @cached_property
    def required_runs(self) -> Array:
        """Smallest number of runs of each candidate test, (tests,): one test in each untested target direction.

        Only a test in a direction determines the error of its stiffness formula. All zero if the runs do not fit into
        the hours.
        """
        problem = self.problem
        required = np.zeros(len(problem.tests), dtype=int)
        if problem.goals:
            values = self.strict_criterion.values_with_one_more(required)
            for goal in problem.goals:
                chosen = np.array([test.direction == goal.target.place for test in problem.tests])
                chosen &= self.budget.maximum_runs > 0
                tested = problem.knowledge.tests or required.any()
                if chosen.any() and (not tested or self.untested_warning(goal, required)):
                    required[int(np.argmin(np.where(chosen, values, np.inf)))] = 1
        return required if self.budget.spent(required) <= self.budget.maximum_minutes else 0 * required

    def count_runs(self, runs: Sequence[int]) -> Array:
        """Number of runs of each test, (tests,), in a sequence of test indices."""
        return np.bincount(np.array(runs, dtype=int), minlength=len(self.problem.tests))

    def reaches_aim(self, *, with_checks: bool = False) -> bool:
        """Check that the chosen tests separate the rival models with a margin of two, or meet the reachable targets.

        Args:
            with_checks: true to require also that the tests detect all effects as well as the standard programme, and
                that repeats determine the scatter of sweeps.

        Returns:
            True if the tests reach the aim.
        """
        problem, counts = self.problem, self.counts
        if problem.request.aim == "rivals":
            return problem.nearest_rivals(counts) >= 2.0 * RIVALS_APART
        covariance = problem.error_covariance(counts)
        reached = all(goal.reached(covariance, problem.limit_covariance) for goal in problem.goals)
        testable = [goal for goal in problem.goals if goal.target.place in problem.request.places]
        if not problem.goals or not reached or any(self.untested_warning(goal, counts) for goal in testable):
            return False
        return not with_checks or (not self.less_visible_effects(counts) and self.determines_scatter(counts))

    def untested_warning(self, goal: TargetSensitivity, counts: Array) -> str | None:
        """Warning that no test in a target's direction shows the error of its stiffness formula.

        Args:
            goal: target with its operating points.
            counts: number of runs of each test in addition to the tests so far, (tests,).

        Returns:
            Sentence; None if the direction is tested or the target is a parameter.
        """
        place, knowledge = goal.target.place, self.problem.knowledge
        measured = knowledge.result.measured if knowledge.result else None
        planned = (self.problem.tests[test] for test in np.flatnonzero(counts))
        tested = [*(measured.directions if measured else ())]
        tested += [str(test.direction) for test in (*knowledge.tests, *planned)]
        if place is None or str(place) in tested:
            return None
        fitted = replace(measured or Range((1.0, 1.0), (1.0, 1.0)), directions=tuple(dict.fromkeys(tested)))
        return next(unfitted_warnings(Result(knowledge.model, knowledge.names, measured=fitted), place), None)

    def less_visible_effects(self, counts: Array) -> list[str]:
        """Names of the effects that `counts` runs, (tests,), detect less well than the standard programme."""
        reached = self.problem.models[0].total(counts).noncentralities()[0]
        short = np.sqrt(reached) < 0.995 * np.sqrt(self.minimum_noncentrality)  # numerical accuracy
        return list(dict.fromkeys(self.problem.effects[index].name for index in np.flatnonzero(short)))

    def with_repeats(self, counts: Array) -> Array:
        """Repeat one test in each direction with more than two tests, so that repeats show drift and noise.

        Args:
            counts: number of runs of each test, (tests,).

        Returns:
            Number of runs of each test, (tests,); the least useful runs make room for the repeats.
        """
        for place in np.unique(self.budget.place[counts > 0]):
            chosen = np.flatnonzero((counts > 0) & (self.budget.place == place))
            if chosen.size > 2 and counts[chosen].max() < 2:
                quickest = chosen[np.argsort(self.budget.minutes[chosen])][:4]
                counts = min(self.with_one_repeat(counts, quickest), key=self.strict_criterion.value, default=counts)
        return counts

    def with_scatter(self, counts: Array) -> Array:
        """Repeat sweeps until a fit can separate the scatter of points from the differences between runs.

        Args:
            counts: number of runs of each test, (tests,).

        Returns:
            Number of runs of each test, (tests,). Unless there are targets, the errors grow by at most a twentieth.
        """
        largest = (
            np.inf if self.problem.goals else self.strict_criterion.value(counts) + 0.1
        )  # a twentieth of the error
        while not self.determines_scatter(counts):
            freedom = self.scatter_freedom(counts)
            sweeps = [test for test in np.flatnonzero(counts).tolist() if freedom_per_repeat(self.problem.tests[test])]
            choices = [
                runs
                for runs in self.with_one_repeat(counts, sweeps)
                if self.scatter_freedom(runs) > freedom and self.strict_criterion.value(runs) <= largest
            ]
            if not choices:
                break
            counts = min(choices, key=self.strict_criterion.value)
        return counts

    def with_one_repeat(self, counts: Array, tests: Iterable[int]) -> Iterator[Array]:
        """Generate variants of a choice of tests: in each, one of the given tests has one more run.

        Tests with a single run are dropped, the least useful first, until the repeat fits into the hours.

        Args:
            counts: number of runs of each test, (tests,).
            tests: indices of the tests to repeat.

        Returns:
            Iterator over the numbers of runs of each test, (tests,), one for each repeat that fits.
        """
        one = np.eye(len(self.problem.tests), dtype=int)
        for test in tests:
            runs = counts + one[test]
            while (
                self.budget.spent(runs) > self.budget.maximum_minutes
                and (single := (runs == 1) & (self.required_runs == 0)).any()
            ):
                runs = min((runs - one[dropped] for dropped in np.flatnonzero(single)), key=self.strict_criterion.value)
            if self.budget.spent(runs) <= self.budget.maximum_minutes:
                yield runs

    def scatter_freedom(self, counts: Array) -> list[int]:
        """Count the degrees of freedom with which repeats determine the scatter of sweeps, with the tests so far.

        Args:
            counts: number of runs of each test, (tests,).

        Returns:
            Degrees of freedom for the bushing and for each specimen, in ascending order, capped at the wanted number.
        """
        runs = Counter(self.problem.knowledge.tests)
        runs.update({test: int(n) for test, n in zip(self.problem.tests, counts, strict=True) if n})
        freedom = Counter[Place | None]()
        for test, count in runs.items():
            if isinstance(test, SimulatedSweep):
                specimen = None if test.direction.axis else test.direction
                freedom[specimen] += freedom_per_repeat(test) * (count - 1)
        return sorted(min(n, _SCATTER_FREEDOM) for n in freedom.values())

    def determines_scatter(self, counts: Array) -> bool:
        """True if the repeats among `counts` runs, (tests,), determine the scatter of sweeps well enough."""
        return self.scatter_freedom(counts) >= [_SCATTER_FREEDOM]

    def programme(self, runs: Sequence[int]) -> Programme:
        """Compute the durations and expected results of a sequence of runs.

        Args:
            runs: test indices in the order of the runs.

        Returns:
            The tests with their durations, standard errors and detectable amounts.
        """
        problem, counts, places = self.problem, self.count_runs(runs), self.budget.place[list(runs)]
        model, k = problem.models[0], len(problem.knowledge.names)
        information = model.total(counts)
        covariance = model.error_covariance(information)[0]
        errors = []
        for points in problem.wanted:
            gain, phase = np.sqrt(np.einsum("cnk,kl,cnl->cn", points.slopes, covariance, points.slopes))
            errors.append(np.hypot([gain, phase * (1.0 + np.square(points.loss_factor))], points.model_error))
        stiffness, loss = np.concatenate(errors, axis=1)
        return Programme(
            tests=tuple(problem.tests[run] for run in runs),
            minutes=self.budget.minutes[list(runs)] + self.budget.setup_minutes * (np.diff(places, prepend=-1) != 0),
            errors=np.sqrt(np.diag(covariance))[:k],
            stiffness=stiffness,
            loss=loss,
            rival_chi_square=problem.nearest_rivals(counts) if problem.knowledge.rivals else None,
            half_widths=tuple(goal.half_width(covariance) for goal in problem.goals),
            detectable=self.detectable_amounts(counts),
        )

    def detectable_amounts(self, counts: Array) -> Mapping[str, float]:
        """Compute the smallest amount of each effect that runs detect in 90 % of the cases by a test at the 5 % level.

        Args:
            counts: number of runs of each test, (tests,).

        Returns:
            Amount [SI] by name, for effects that the standard programme can detect; infinite if the runs detect none.

        Notes:
            Noise alone would permit amounts that many repeats average out, such as 0.1 g of moving mass. The accuracy
            class of a rig limits its errors at each frequency and amplitude, not only their average: an amount is
            detected only if it changes the response somewhere by more than the class. Of the shapes of an effect, such
            as the frequencies of a resonance, the median is reported: the most visible one, a resonance at a tested
            frequency, is a rare case.
        """
        model = self.problem.models[0]
        ratios = model.class_ratios[counts > 0].max(axis=0, initial=0.0)
        with np.errstate(divide="ignore"):
            smallest = np.maximum(DETECTABLE / np.sqrt(model.total(counts).noncentralities()[0]), 1.0 / ratios)
        amounts = defaultdict[str, list[float]](list)
        for index in np.flatnonzero(self.minimum_noncentrality).tolist():
            effect = self.problem.effects[index]
            amounts[effect.name].append(effect.amount.typical * float(smallest[index]))
        return {name: float(np.median(sizes)) for name, sizes in amounts.items()}


def freedom_per_repeat(test: Test) -> int:
    """Degrees of freedom that one more repeat of a test adds to the noise estimate; 0 for loops and short sweeps."""
    steps = len(test.steps) if isinstance(test, SimulatedSweep) else 0
    return steps - 1 if steps >= FEWEST_STEPS else 0
