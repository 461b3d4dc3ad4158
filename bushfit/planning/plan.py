"""The plan: tests chosen for an aim, in their order, and the standard programme of as many hours beside them."""

from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bushfit.campaign.schema import SimulatedSweep
from bushfit.effects import qualified_name
from bushfit.effects.contract import Array
from bushfit.errors import ModelError
from bushfit.fitting.repeats import FEWEST_STEPS
from bushfit.geometry import Place, Specimen
from bushfit.planning.contract import Knowledge, Plan, Programme, Test, Visible, Wanted
from bushfit.planning.criterion import (
    Budget,
    Criterion,
    Drifting,
    best_runs,
    filled,
    noncentrality_of,
    ordered,
    root_of,
)
from bushfit.planning.offer import FOUND, RIVALS_APART, Offer, smallest_found, standard_tests, unlimited_rig
from bushfit.planning.sensitivity import Information
from bushfit.planning.targets import ENDLESS, Goal, percent, untested
from bushfit.reading.measurement import loss_factor
from bushfit.units import number

#: Shares of the hours that are tried before all of them: for rivals, and within a tenth for targets.
_SHARES = {"rivals": (0.125, 0.1875, 0.25, 0.375, 0.5), "targets": tuple((2.0 ** (np.arange(-40, 0) / 8)).tolist())}
#: Weight of the logarithm of each lack of power, beside the logarithm of the variance that is wanted small, and the
#: weight where the first leaves a lack; chosen.
_PENALTY, _STRICT = 3.0, 30.0
#: Degrees of freedom behind the scatter of sweeps at least; chosen: with five, errors are a tenth larger than planned.
_SCATTER_FREEDOM = 10
#: What a test has to be worth of an error to be made for its sake; chosen.
_WORTH_SAYING = 1.005
#: Minutes after which no more are asked for: months.
_MOST_MINUTES = 60.0 * 2000.0


def plan(knowledge: Knowledge, wanted: Wanted) -> Plan:
    """Tests for an aim within the hours and the limits of the rig, in as few hours as part rivals or meet targets.

    Raises:
        ModelError: no test is possible, none fits into the hours, or there are no rivals to be told apart.
    """
    if wanted.aim == "rivals" and len(knowledge.rivals) < 2:
        raise ModelError(
            "there are no rivals to be told apart",
            found=knowledge.source,
            expected="tests of a campaign that two effects or more explain alike",
            hint="plan from the campaign, or for parameters or predictions",
        )
    offer = Offer(knowledge, wanted)
    few = [_Planner(offer, share * wanted.hours) for share in _SHARES.get(wanted.aim, ())]
    for sound in (True, False) if offer.goals else (False,):  # blind, or without repeats, only where it has to be
        least = bisect_left(few, True, key=lambda each: each.reaches and (each.sound or not sound))
        if least < len(few):
            return few[least].plan()
    return _Planner(offer, wanted.hours).plan()


@dataclass(frozen=True, eq=False)
class _Planner:
    """Search for the best candidates within some hours."""

    offer: Offer
    hours: float

    @cached_property
    def budget(self) -> Budget:
        return replace(self.offer.budget, most=60.0 * self.hours)

    @cached_property
    def best(self) -> Array:
        """Number of runs of each test, (tests,), by which all effects show as in the standard programme, if possible.

        Zero for all if no test fits into the hours."""
        kept, standard = self.kept, self._counts(self.standard_runs)
        best = best_runs(self._criterion(_PENALTY), self.budget, kept, kept)
        if self._lacking(best):
            starts = [best, *([] if kept.any() else [np.minimum(standard, self.budget.runs)])]
            every = (best_runs(self.strict, self.budget, start, kept) for start in starts)
            best = min(every, key=self.strict.together)
        return self._with_repeats(best)

    @property
    def reaches(self) -> bool:
        """True if the tests separate the rivals with a margin of two, or meet the targets that can be met."""
        if self.offer.wanted.aim == "rivals":
            return bool(self.offer.apart(self.best, self.offer.tellable).min() >= 2.0 * RIVALS_APART)
        offer, error_covariance = self.offer, self.offer.error_covariance(self.best)
        told = all(goal.reached(error_covariance, offer.endless) for goal in offer.goals)
        here = [goal for goal in offer.goals if goal.target.place in offer.wanted.places]
        return bool(offer.goals) and told and not any(self._untold(goal, self.best) for goal in here)

    @property
    def sound(self) -> bool:
        """True if all effects show as in the standard programme, and repeats determine the scatter."""
        return not self._lacking(self.best) and self._scatter_freedom(self.best) >= [_SCATTER_FREEDOM]

    def plan(self) -> Plan:
        """See the function."""
        best = self.best
        if not best.any() and not self.reaches:
            raise ModelError(
                "no test fits into the hours",
                place="--hours",
                found=f"{number(self.offer.wanted.hours, 3)} h",
                expected=f"at least {number((self.budget.minutes.min() + self.budget.setup) / 60.0, 2)} h",
            )
        planned = self._programme(ordered(best, self.budget.place, self._drifting(best)) if best.any() else [])
        before, standard = self._programme([]), self._programme(self.standard_runs)
        missed, reasons = tuple(self._missed(best, goal) for goal in self.offer.goals), dict[Test, str]()
        for test in np.flatnonzero(best).tolist():
            lost = self._lost(best, np.where(np.arange(best.size) == test, 0, best))
            reasons[self.offer.tests[test]] = lost or "shows effects that the model lacks"
        enough, notes = self._enough(planned, missed), tuple(self._notes(planned, missed))
        return Plan(self.offer.knowledge, self.offer.wanted, before, planned, standard, reasons, missed, enough, notes)

    def _with_repeats(self, counts: Array) -> Array:
        """The runs with a test of each place made twice, that a drift shows as in the standard programme, in place of
        what is least useful."""
        standard = self._drifting(self._counts(self.standard_runs)).noncentrality(self.standard_runs)
        for place in np.unique(self.budget.place[counts > 0]):
            chosen = np.flatnonzero((counts > 0) & (self.budget.place == place))
            again, drifting = chosen[self.budget.runs[chosen] > 1], self._drifting(counts)
            if chosen.size > 2 and (
                counts[chosen].max() < 2
                or drifting.noncentrality(ordered(counts, self.budget.place, drifting)) < standard
            ):
                quickest = again[np.argsort(self.budget.minutes[again])][:4]
                counts = min(self._once_more(counts, quickest), key=self.strict.together, default=counts)
        return self._with_scatter(counts)

    @cached_property
    def kept(self) -> Array:
        """One run at each place whose stiffness is a target, where it can be tested and was not, (tests,): no other
        place tells the error of the formula that leads there. None where they do not fit into the hours."""
        nothing = np.zeros(len(self.offer.tests), dtype=int)
        kept, worth = nothing.copy(), self.strict.one_more(nothing) if self.offer.goals else nothing
        for goal in self.offer.goals:
            chosen = np.array([test.direction == goal.target.place for test in self.offer.tests]) & (
                self.budget.runs > 0
            )
            if chosen.any() and (not self._tested(kept) or self._untold(goal, kept)):
                kept[int(np.argmin(np.where(chosen, worth, np.inf)))] = 1
        return kept if self.budget.spent(kept) <= self.budget.most else nothing

    def _tested(self, counts: Array) -> list[str]:
        """Directions, and specimens, of the tests so far and of so many runs of each test."""
        planned = (self.offer.tests[test] for test in np.flatnonzero(counts))
        return [str(test.direction) for test in (*self.offer.knowledge.tests, *planned)]

    def _untold(self, goal: Goal, counts: Array) -> str | None:
        """Error that the interval of a goal lacks because its place is not tested; None if it lacks none."""
        place = goal.target.place
        return untested(self.offer.knowledge, place, self._tested(counts)) if place else None

    def _with_scatter(self, counts: Array) -> Array:
        """The runs with further repeats of sweeps, until a fit can tell their scatter from what repeats differ by, as
        far as that costs next to nothing of the aim; for targets whatever it costs, as long as they are met."""
        most = np.inf if self.offer.goals else self.strict.together(counts) + 0.1  # a twentieth of the error
        while (freedom := self._scatter_freedom(counts)) < [_SCATTER_FREEDOM]:
            again = [test for test in np.flatnonzero(counts).tolist() if _differences(self.offer.tests[test])]
            more = [
                runs
                for runs in self._once_more(counts, again)
                if self._scatter_freedom(runs) > freedom and self.strict.together(runs) <= most
            ]
            if not more:
                break
            counts = min(more, key=self.strict.together)
        return counts

    def _once_more(self, counts: Array, tests: Iterable[int]) -> Iterator[Array]:
        """The runs with one more of each test in turn, so far as they fit into the hours.

        Of tests that are made once, the least useful are left out in turn; what takes longer without them is left out.
        """
        one = np.eye(len(self.offer.tests), dtype=int)
        for test in tests:
            runs = counts + one[test]
            while self.budget.spent(runs) > self.budget.most and (single := (runs == 1) & (self.kept == 0)).any():
                runs = min((runs - one[each] for each in np.flatnonzero(single)), key=self.strict.together)
            if self.budget.spent(runs) <= self.budget.most:
                yield runs

    def _scatter_freedom(self, counts: Array) -> list[int]:
        """Degrees of freedom of the scatter of sweeps that repeats tell, those before and so many runs of each test.

        Of each rig, the bushing's and each specimen's, up to what is enough; the fewest first.
        """
        runs = Counter(self.offer.knowledge.tests)
        runs.update({test: int(n) for test, n in zip(self.offer.tests, counts, strict=True) if n})
        freedom = Counter[Place | None]()
        for test, times in runs.items():
            if isinstance(test, SimulatedSweep):
                rig = test.direction if isinstance(test.direction, Specimen) else None
                freedom[rig] += _differences(test) * (times - 1)
        return sorted(min(each, _SCATTER_FREEDOM) for each in freedom.values())

    def _criterion(self, penalty: float) -> Criterion:
        odds = np.array([rival.probability for rival in self.offer.knowledge.rivals])
        return Criterion(self.offer.views, self.offer.weight, odds, self.least, penalty)

    @cached_property
    def strict(self) -> Criterion:
        """Criterion with more weight on effects that show less than in the standard programme."""
        return self._criterion(_STRICT)

    def _counts(self, runs: Sequence[int]) -> Array:
        """How often each test stands among the runs, (tests,)."""
        return np.bincount(np.array(runs, dtype=int), minlength=len(self.offer.tests))

    def _lacking(self, counts: Array) -> list[str]:
        """Effects that so many runs of each test show less well than the standard programme."""
        reached = noncentrality_of(self.offer.views[0].together(counts))[0]
        short = np.sqrt(reached) < 0.995 * np.sqrt(self.least)  # what the numbers are good for
        return list(dict.fromkeys(self.offer.grid.columns[i].effect.name for i in np.flatnonzero(short)))

    @cached_property
    def standard_runs(self) -> list[int]:
        """The standard programme over and over, as long as it fits into the hours; by direction, as labs do."""
        places = [self.offer.tests.index(test) for test in standard_tests(self.offer.knowledge, self.offer.wanted)]
        counts, runs = np.zeros(len(self.offer.tests), dtype=int), list[int]()
        while places:
            counts[test := places[len(runs) % len(places)]] += 1
            if self.budget.spent(counts) > self.budget.most:
                break
            runs.append(test)
        return sorted(runs, key=lambda test: self.budget.place[test])

    @cached_property
    def least(self) -> Array:
        """Noncentrality of each effect that the standard programme can show, 0 of others, (e,)."""
        reached = noncentrality_of(self.offer.views[0].together(self._counts(self.standard_runs)))[0]
        reach = np.array([column.reach for column in self.offer.grid.columns])
        return np.where(reach * np.sqrt(reached) >= FOUND, reached, 0.0)

    def _drifting(self, counts: Array) -> Drifting:
        """Effect of a drift on the given number of runs of each test."""
        view, k = self.offer.views[0], len(self.offer.knowledge.names) + len(self.offer.knowledge.bounded)
        own, seen = view.information.own, view.information.own[:, k, k]
        one = Information(own * counts[:, None, None], own[..., k : k + 1], seen[:, None])  # by the gain of one run
        level = np.square(view.level[:, 0])
        root = root_of(view.together(counts).own[0])
        pull = one.beside(view.level).cross[..., 0] @ root
        return Drifting(seen, level * seen**2 / (1.0 + counts * level * seen), pull)

    def _programme(self, runs: Sequence[int]) -> Programme:
        """Programme of runs in their order, with their expected results."""
        counts, places = self._counts(runs), self.budget.place[list(runs)]
        view, k, drifting = self.offer.views[0], len(self.offer.knowledge.names), self._drifting(counts)
        found = view.together(counts)
        error_covariance, covariance = view.error_covariance(found)[0], np.linalg.inv(found.own[0])
        gain, phase = np.sqrt(np.einsum("kcn,kl,lcn->cn", self.offer.slopes, error_covariance, self.offer.slopes))
        wanted, model = self.offer.wanted.points, self.offer.knowledge.model
        loss = np.concatenate([loss_factor(model.stiffness(at.place, at.frequency, at.amplitude)) for at in wanted])
        moved = root_of(found.own[0]) @ drifting.shift(runs) / np.sqrt(np.diag(covariance))
        # tests alone leave open what they tell less of than rounding; without tests errors are beyond all use
        values, vectors = np.linalg.eigh(found.own[0] - view.prior)
        alone = vectors / np.sqrt(np.maximum(values, max(1e-14 * float(values.max()), 1e-12)))
        return Programme(
            tuple(self.offer.tests[run] for run in runs),
            self.budget.minutes[list(runs)] + self.budget.setup * (np.diff(places, prepend=-1) != 0),
            np.sqrt(np.diag(error_covariance))[:k],
            np.linalg.norm(alone, axis=1)[:k],
            np.hypot(gain, self.offer.model_error[0]),
            np.hypot(phase * (1.0 + np.square(loss)), self.offer.model_error[1]),
            float(self.offer.apart(counts, self.offer.tellable).min()) if self.offer.knowledge.rivals else None,
            tuple(goal.half(error_covariance) for goal in self.offer.goals),
            tuple(self._visible(noncentrality_of(found)[0], drifting.noncentrality(runs))),
            0.01 * float(np.abs(moved[:k]).max()),
        )

    def _visible(self, reached: Array, drifting: float) -> Iterator[Visible]:
        """The smallest amount found of each effect that the standard programme shows, in the shape it shows best."""
        for effect in dict.fromkeys(column.effect for column in self.offer.grid.columns):
            chosen = [i for i, column in enumerate(self.offer.grid.columns) if column.effect is effect]
            best = chosen[int(np.argmax(self.least[chosen]))]
            if self.least[best] > 0.0:
                amount = effect.amount
                yield Visible(
                    effect.name,
                    qualified_name(effect, amount),
                    amount.unit,
                    amount.typical * smallest_found(reached[best]),
                )
        yield Visible("drift", "drift.gain", "1", smallest_found(drifting))

    def _missed(self, counts: Array, goal: Goal) -> str | None:
        """Reason why the given number of runs of each test misses a target; None if they meet it."""
        offer = self.offer
        if sentence := self._untold(goal, counts):
            which = "in the plan" if goal.target.place in offer.wanted.places else "on offer"
            return f"no test so far or {which} is made there: {sentence}"
        if not goal.met(offer.endless):
            limit, why = percent(goal.half(offer.endless)), goal.why_not(offer.knowledge, offer.endless)
            return f"no test on offer meets it, {ENDLESS} runs of each would reach {limit}: {why}"
        return None if goal.met(offer.error_covariance(counts)) else self._more_hours(counts, goal)

    def _more_hours(self, counts: Array, goal: Goal) -> str:
        """Sentence on the hours that would meet a target, by the best runs per minute after those planned."""
        more = filled(
            replace(self.strict, weight=goal.weight(self.offer.endless)),
            self.offer.budget,
            counts,
            lambda runs: goal.met(self.offer.error_covariance(runs)) or self.offer.budget.spent(runs) > _MOST_MINUTES,
        )
        hours = number(self.offer.budget.spent(more) / 60.0, 2)
        if goal.met(self.offer.error_covariance(more)):
            return f"{number(self.hours, 3)} h are too few, about {hours} h would do"
        reached = percent(goal.half(self.offer.error_covariance(more)))
        return f"{hours} h would reach {reached}, and no further run would take a quarter per cent off that"

    def _lost(self, counts: Array, without: Array) -> str | None:
        """Sentence on the largest loss by leaving out runs; None if next to nothing is lost."""
        offer, error_covariance, less = (
            self.offer,
            self.offer.error_covariance(counts),
            self.offer.error_covariance(without),
        )
        if offer.wanted.aim == "rivals":
            apart, closer = (float(offer.apart(runs, offer.tellable).min()) for runs in (counts, without))
            far = f"rivals {number(closer, 2)} apart in expected chi-square without it, {number(apart, 2)} with it"
            return far if closer * _WORTH_SAYING <= apart else None
        if offer.goals:
            wider = [goal for goal in offer.goals if goal.half(less) >= _WORTH_SAYING * goal.half(error_covariance)]
            for goal in sorted(wider, key=lambda goal: -goal.half(less) / goal.target.half):
                fewer, planned = (percent(goal.half(errors), 3) for errors in (less, error_covariance))
                return f"{goal.target}: {fewer} without it, {planned} with it"
            return None
        growths = dict(zip(offer.knowledge.names, np.sqrt(np.diag(less) / np.diag(error_covariance)), strict=False))
        if offer.wanted.aim == "predictions":
            growths = {"stiffness": np.sqrt(np.sum(less * offer.weight) / np.sum(error_covariance * offer.weight))}
        growth, name = max((growths[name], name) for name in growths if name in ("stiffness", *offer.wanted.parameters))
        more = number(100.0 * (growth - 1.0), 2)
        return f"{name}: error {more} % larger without it" if growth >= _WORTH_SAYING else None

    def _enough(self, planned: Programme, missed: Sequence[str | None]) -> str | None:
        """Reason why hours stay free; None if they are used."""
        asked, left = self.offer.wanted.hours, self.offer.wanted.hours - planned.hours
        if left <= float(self.budget.minutes.max() + self.budget.setup) / 60.0:
            return None
        why = "no further run would take a quarter per cent off the error"
        if self.offer.wanted.aim == "rivals" and self.hours < asked:
            why = "these tests tell the rivals apart"
        elif missed and self.hours < asked:
            why = "no target that can be met is missed" if any(missed) else "all targets are met"
        if not planned.tests:
            needed = "would help" if any(missed) else "is needed"
            return f"no test {needed}: {why} by what is known, and all of the {number(asked, 3)} h stay free"
        return (
            f"{number(planned.hours, 2)} of {number(asked, 3)} h are enough: {why}, and {number(left, 2)} h stay free"
        )

    def _notes(self, planned: Programme, missed: Sequence[str | None]) -> Iterator[str]:
        """Warnings and limits of the plan, the important ones first."""
        yield from unlimited_rig(self.offer.knowledge, self.offer.wanted, planned.tests)
        worst = float(self.offer.model_error[0].max(initial=0.0))
        if worst > _WORTH_SAYING - 1.0:
            yield (
                f"the errors of the stiffness contain the model error, up to {number(100.0 * worst, 2)} %, which no "
                "test lowers; bushfit diagnose looks for the effect that the model lacks"
            )
        yield from self.offer.knowledge.warnings
        for target, half, why in zip(self.offer.wanted.targets, planned.halves, missed, strict=True):
            if why:
                yield f"{target}: {percent(target.half)} asked for, {percent(half)} planned: {why}"
        if self.offer.knowledge.bounded:
            yield (
                f"{' and '.join(self.offer.knowledge.bounded)} came to rest on a bound: the errors of the others count "
                "that noise takes it off there half of the times"
            )
        if missed and self._scatter_freedom(self.best) < [_SCATTER_FREEDOM]:
            yield "too few repeats tell how sweeps scatter: intervals may come out half as wide again as planned"
        if lacking := self._lacking(self.best):
            yield f"the standard programme shows these effects better: {', '.join(lacking)}"
        tellable = {tuple(pair) for pair in self.offer.tellable.T.tolist()}
        for one, other in self.offer.pairs.T.tolist():
            if (one, other) not in tellable:
                names = (self.offer.knowledge.rivals[place].model.effects[-1] for place in (one, other))
                yield f"no test of this rig would tell {' from '.join(names)}: they are left out"
        if planned.apart is not None and planned.apart < RIVALS_APART:
            yield (
                f"the nearest rivals are {number(planned.apart, 2)} apart in expected chi-square, less than the "
                f"{number(RIVALS_APART, 3)} that tell them in nine of ten cases"
            )


def _differences(test: Test) -> int:
    """Degrees of freedom of the scatter that a repeat of a test tells."""
    steps = len(test.steps) if isinstance(test, SimulatedSweep) else 0
    return steps - 1 if steps >= FEWEST_STEPS else 0
