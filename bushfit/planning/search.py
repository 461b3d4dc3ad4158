"""Search for the tests of a plan within some hours: their number, repeats that show the scatter, and the programme."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bushfit.campaign.simulated import SimulatedSweep
from bushfit.effects import qualified_name
from bushfit.effects.contract import Array
from bushfit.fitting.repeats import FEWEST_STEPS
from bushfit.geometry import Place
from bushfit.model.result import Range, Result
from bushfit.planning.candidates import standard_tests
from bushfit.planning.contract import DetectableAmount, Programme, Test
from bushfit.planning.criterion import Budget, Criterion, best_runs
from bushfit.planning.problem import DETECTABLE, RIVALS_APART, PlanningProblem
from bushfit.planning.targets import TargetSensitivity
from bushfit.prediction.caveats import unfitted_warnings

#: Weight of the logarithm of each lack of power beside the logarithm of the variance, and the weight that is used if
#: the first leaves a lack; chosen.
_PENALTY, _STRICT_PENALTY = 3.0, 30.0
#: Wanted degrees of freedom of the scatter of sweeps; chosen: with five, errors are a tenth larger than planned.
_SCATTER_FREEDOM = 10


@dataclass(frozen=True, eq=False)
class PlanSearch:
    """Search for the best numbers of runs of the candidate tests within given hours.

    In all methods, `counts` is the number of runs of each candidate test, (tests,).

    Args:
        problem: candidate tests with their durations and information.
        hours: available time on the rig [h].
    """

    problem: PlanningProblem
    hours: float

    @cached_property
    def budget(self) -> Budget:
        """Durations and limits of the candidate tests, with the available hours as largest total duration."""
        return replace(self.problem.budget, maximum_minutes=60.0 * self.hours)

    @cached_property
    def counts(self) -> Array:
        """Best number of runs of each test, (tests,); all zero if no test fits into the hours.

        If possible, the tests detect every effect as well as the standard programme does.
        """
        required = self.required_runs
        counts = best_runs(replace(self.strict, penalty=_PENALTY), self.budget, required, required)
        if self.less_visible_effects(counts):
            standard = np.minimum(self.count(self.standard_runs), self.budget.maximum_runs)
            starts = [counts, *([] if required.any() else [standard])]
            choices = (best_runs(self.strict, self.budget, start, required) for start in starts)
            counts = min(choices, key=self.strict.value)
        return self.with_scatter(self.with_repeats(counts))

    @cached_property
    def strict(self) -> Criterion:
        """Search criterion with a large penalty for effects detected less well than with the standard programme."""
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
            if self.budget.spent(self.count(runs)) > self.budget.maximum_minutes:
                runs.pop()
                break
        return sorted(runs, key=lambda test: self.budget.place[test])

    @cached_property
    def minimum_noncentrality(self) -> Array:
        """Noncentrality of each effect in the standard programme, 0 for effects that it cannot detect, (e,)."""
        reached = self.problem.models[0].total(self.count(self.standard_runs)).noncentralities()[0]
        amounts = [effect.amount for effect in self.problem.effects]
        # the largest amount that a bushing or a rig can have, in typical amounts
        largest = [max(abs(end - (x.neutral or 0.0)) for end in x.bounds) / x.typical for x in amounts]
        return np.where(np.array(largest) * np.sqrt(reached) >= DETECTABLE, reached, 0.0)

    @cached_property
    def required_runs(self) -> Array:
        """Smallest number of runs of each candidate test, (tests,): 1 for one test in each untested target direction.

        Only a test in this direction determines the error of its stiffness formula. All zero if the runs do not fit
        into the hours.
        """
        problem = self.problem
        required = np.zeros(len(problem.tests), dtype=int)
        if problem.goals:
            values = self.strict.values_with_one_more(required)
            for goal in problem.goals:
                chosen = np.array([test.direction == goal.target.place for test in problem.tests])
                chosen &= self.budget.maximum_runs > 0
                tested = problem.knowledge.tests or required.any()
                if chosen.any() and (not tested or self.untested(goal, required)):
                    required[int(np.argmin(np.where(chosen, values, np.inf)))] = 1
        return required if self.budget.spent(required) <= self.budget.maximum_minutes else 0 * required

    def count(self, runs: Sequence[int]) -> Array:
        """Count the runs of each test, (tests,), in a sequence of test indices."""
        return np.bincount(np.array(runs, dtype=int), minlength=len(self.problem.tests))

    def reaches_aim(self, *, soundly: bool = False) -> bool:
        """Check that the chosen tests separate the rival models with a margin of two, or meet all reachable targets.

        Args:
            soundly: true to require also that the tests detect all effects as well as the standard programme, and that
                repeats determine the scatter of sweeps.

        Returns:
            True if the tests reach the aim.
        """
        problem, counts = self.problem, self.counts
        if problem.request.aim == "rivals":
            return problem.nearest_rivals(counts) >= 2.0 * RIVALS_APART
        covariance = problem.error_covariance(counts)
        reached = all(goal.reached(covariance, problem.limit_covariance) for goal in problem.goals)
        testable = [goal for goal in problem.goals if goal.target.place in problem.request.places]
        if not problem.goals or not reached or any(self.untested(goal, counts) for goal in testable):
            return False
        return not soundly or (not self.less_visible_effects(counts) and self.determines_scatter(counts))

    def untested(self, goal: TargetSensitivity, counts: Array) -> str | None:
        """Write a warning if a target's direction is untested, so that its interval omits the error of the formula.

        Args:
            goal: target with its operating points.
            counts: number of runs of each test, (tests,), in addition to the tests so far.

        Returns:
            The sentence; None if the direction is tested or the target is a parameter.
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
        """Names of the effects that these runs detect with a smaller expected chi-square than the standard programme.

        Args:
            counts: number of runs of each test, (tests,).
        """
        reached = self.problem.models[0].total(counts).noncentralities()[0]
        short = np.sqrt(reached) < 0.995 * np.sqrt(self.minimum_noncentrality)  # numerical accuracy
        return list(dict.fromkeys(self.problem.effects[index].name for index in np.flatnonzero(short)))

    def with_repeats(self, counts: Array) -> Array:
        """Repeat a test in each direction with more than two tests, so that a drift shows and noise is known.

        Args:
            counts: number of runs of each test, (tests,).

        Returns:
            Number of runs of each test, (tests,); the least useful runs make room for the repeats.
        """
        for place in np.unique(self.budget.place[counts > 0]):
            chosen = np.flatnonzero((counts > 0) & (self.budget.place == place))
            if chosen.size > 2 and counts[chosen].max() < 2:
                quickest = chosen[np.argsort(self.budget.minutes[chosen])][:4]
                counts = min(self.repeated(counts, quickest), key=self.strict.value, default=counts)
        return counts

    def with_scatter(self, counts: Array) -> Array:
        """Add repeats of sweeps until a fit can separate the scatter of points from the differences between runs.

        Args:
            counts: number of runs of each test, (tests,).

        Returns:
            Number of runs of each test, (tests,). Unless there are targets, the errors grow by at most a twentieth.
        """
        largest = np.inf if self.problem.goals else self.strict.value(counts) + 0.1  # a twentieth of the error
        while not self.determines_scatter(counts):
            freedom = self.scatter_freedom(counts)
            sweeps = [test for test in np.flatnonzero(counts).tolist() if scatter_differences(self.problem.tests[test])]
            choices = [
                runs
                for runs in self.repeated(counts, sweeps)
                if self.scatter_freedom(runs) > freedom and self.strict.value(runs) <= largest
            ]
            if not choices:
                break
            counts = min(choices, key=self.strict.value)
        return counts

    def repeated(self, counts: Array, tests: Iterable[int]) -> Iterator[Array]:
        """Generate the variants of a choice in which one of the given tests has one more run.

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
                runs = min((runs - one[dropped] for dropped in np.flatnonzero(single)), key=self.strict.value)
            if self.budget.spent(runs) <= self.budget.maximum_minutes:
                yield runs

    def scatter_freedom(self, counts: Array) -> list[int]:
        """Count the degrees of freedom with which repeats, and the tests so far, determine the scatter of sweeps.

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
                freedom[specimen] += scatter_differences(test) * (count - 1)
        return sorted(min(n, _SCATTER_FREEDOM) for n in freedom.values())

    def determines_scatter(self, counts: Array) -> bool:
        """True if repeats among `counts` runs, (tests,), determine the scatter of sweeps of each body well enough."""
        return self.scatter_freedom(counts) >= [_SCATTER_FREEDOM]

    def programme(self, runs: Sequence[int]) -> Programme:
        """Compute the expected results of a sequence of runs.

        Args:
            runs: test indices in the order of the runs.

        Returns:
            The tests with their durations, standard errors and detectable amounts.
        """
        problem, counts, places = self.problem, self.count(runs), self.budget.place[list(runs)]
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
            detectable=tuple(self.detectable_amounts(information.noncentralities()[0])),
        )

    def detectable_amounts(self, reached: Array) -> Iterator[DetectableAmount]:
        """Compute the smallest detectable amount of each effect that the standard programme can detect.

        Args:
            reached: noncentrality of a typical amount of each effect shape, (e,).

        Returns:
            Iterator over the amounts in SI units, each for the effect's most visible shape.
        """
        effects, visible = self.problem.effects, self.minimum_noncentrality
        with np.errstate(divide="ignore"):
            smallest = DETECTABLE / np.sqrt(reached)
        for effect in dict.fromkeys(effects):
            best = max((index for index in range(len(effects)) if effects[index] is effect), key=visible.__getitem__)
            if visible[best] > 0.0:
                amount = effect.amount
                size = amount.typical * float(smallest[best])
                yield DetectableAmount(effect.name, qualified_name(effect, amount), amount.unit, size)


def scatter_differences(test: Test) -> int:
    """Degrees of freedom of the scatter that one repeat of a test adds; 0 for loops and short sweeps."""
    steps = len(test.steps) if isinstance(test, SimulatedSweep) else 0
    return steps - 1 if steps >= FEWEST_STEPS else 0
