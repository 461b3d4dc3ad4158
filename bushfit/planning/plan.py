"""The plan: tests chosen for an aim, in their order, and the standard programme of as many hours beside them."""

from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bushfit.campaign.schema import SimulatedLoop, SimulatedSweep
from bushfit.diagnosis.priors import TELLS
from bushfit.effects import qualified
from bushfit.effects.contract import Array
from bushfit.errors import ModelError
from bushfit.fitting.coordinates import residual
from bushfit.fitting.data_sets import new_sweep
from bushfit.fitting.repeats import FEWEST_STEPS
from bushfit.geometry import Place, Specimen
from bushfit.model.covariance import Z95
from bushfit.planning.candidates import candidates, minutes, setup_minutes, standard_tests
from bushfit.planning.contract import Knowledge, Plan, Programme, Test, Visible, Wanted
from bushfit.planning.criterion import Budget, Criterion, View, best_runs, distances, noncentrality_of, root_of
from bushfit.planning.order import Drifting, ordered
from bushfit.planning.sensitivity import Column, Grid, Information, relative_slopes
from bushfit.reading.measurement import loss_factor
from bushfit.units import number

#: The 90 % quantile of the normal distribution.
_NINE_OF_TEN = 1.2815515655446004
#: Amount of an effect over its standard error that a test of one in twenty finds in nine of ten cases: the 97.5 % and
#: the 90 % quantile of the normal distribution.
FOUND = Z95 + _NINE_OF_TEN
#: Expected chi-square between rivals from which on `diagnose` tells them apart in nine of ten cases: of d it finds d
#: with a standard deviation of 2 sqrt(d), and it takes those for one set that are within TELLS.
RIVALS_APART = (_NINE_OF_TEN + float(np.sqrt(_NINE_OF_TEN**2 + TELLS))) ** 2
#: Shares of the hours that are tried for rivals, before all of them.
_SHARES = (0.125, 0.1875, 0.25, 0.375, 0.5)
#: Weight of the logarithm of each lack of power, beside the logarithm of the variance that is wanted small, and the
#: weight where the first leaves a lack; chosen.
_PENALTY, _STRICT = 3.0, 30.0
#: Degrees of freedom behind the scatter of sweeps at least; chosen: with five, errors are a tenth larger than planned.
_SCATTER_FREEDOM = 10


def plan(known: Knowledge, wanted: Wanted) -> Plan:
    """Tests for an aim within the hours and the limits of the rig; rivals in as few of the hours as tell them apart.

    Raises:
        ModelError: no test is possible, none fits into the hours, or there are no rivals to be told apart.
    """
    found: dict[float, Plan] = {}

    def surely_apart(share: float) -> bool:
        with suppress(ModelError):  # too few hours for any test
            found[share] = _Planner(known, replace(wanted, hours=share * wanted.hours)).plan()
            return (found[share].planned.apart or 0.0) >= 2.0 * RIVALS_APART  # rivals may be smaller than they seem
        return False

    enough = bisect_left(_SHARES, True, key=surely_apart) if wanted.aim == "rivals" else len(_SHARES)
    return found[_SHARES[enough]] if enough < len(_SHARES) else _Planner(known, wanted).plan()


@dataclass(frozen=True, eq=False)
class _Planner:
    known: Knowledge
    wanted: Wanted

    @cached_property
    def tests(self) -> tuple[Test, ...]:
        """The candidates first, then what only the standard programme has."""
        every = [*candidates(self.known, self.wanted), *standard_tests(self.known, self.wanted)]
        return tuple(dict.fromkeys(every))

    @cached_property
    def grid(self) -> Grid:
        return Grid(self.known, self.tests)

    @cached_property
    def columns(self) -> list[Column]:
        return self.grid.columns

    @cached_property
    def views(self) -> list[View]:
        """The likeliest model's, beside the effects that it lacks; each rival's, beside what the others differ by."""
        data_sets = self.grid.data_sets
        effects = np.array([column.values for column in self.columns])
        views = [View.of(self.grid, self.known, effects)]
        left = [residual(rival.model, data_sets) for rival in self.known.rivals]
        for i, rival in enumerate(self.known.rivals):
            others = np.array([other - left[i] for j, other in enumerate(left) if j != i])
            views.append(View.of(self.grid, rival, others))
        return views

    @cached_property
    def slopes(self) -> Array:
        """Gain and phase of the stiffness at the points wanted by change of the parameters, (k + b, 2, n)."""
        sweeps = [
            new_sweep(self.known.model, points.place, points.frequency, points.amplitude, (1.0, 1.0), (0.0, 0.0))
            for points in self.wanted.points
        ]
        each = [np.stack(np.split(relative_slopes(self.known, [sweep]), 2, axis=-1), axis=1) for sweep in sweeps]
        return np.concatenate(each, axis=-1)

    @cached_property
    def weight(self) -> Array | None:
        """Of the parameters' covariance in what is to be small; None where rivals are to be told apart."""
        if self.wanted.aim == "rivals":
            return None
        if self.wanted.aim == "predictions":
            return np.asarray(np.einsum("kcn,lcn->kl", self.slopes, self.slopes) / self.slopes.shape[-1])
        return np.diag(np.isin((*self.known.names, *self.known.bounded), self.wanted.parameters).astype(float))

    @cached_property
    def budget(self) -> Budget:
        places = list(dict.fromkeys([*self.wanted.places, *(test.direction for test in self.tests)]))
        lines = [
            (test.direction, test.amplitude, test.frequency)
            if isinstance(test, SimulatedLoop)
            else (test.direction, test.stepped, test.held)
            for test in self.tests
        ]
        known = list(dict.fromkeys(lines))
        return Budget(
            np.array([minutes(test, self.wanted.rig) for test in self.tests]),
            np.array([places.index(test.direction) for test in self.tests]),
            np.array([known.index(line) for line in lines]),
            np.array([1000 * (test.direction in self.wanted.places) for test in self.tests]),
            setup_minutes(self.wanted.rig),
            60.0 * self.wanted.hours,
        )

    def plan(self) -> Plan:
        """See the function."""
        if self.wanted.aim == "rivals" and len(self.known.rivals) < 2:
            raise ModelError(
                "there are no rivals to be told apart",
                found=self.known.source,
                expected="tests of a campaign that two effects or more explain alike",
                hint="plan from the campaign, or for parameters or predictions",
            )
        best = self._with_repeats(self._best())
        if not best.any():
            raise ModelError(
                "no test fits into the hours",
                place="--hours",
                found=f"{number(self.wanted.hours, 3)} h",
                expected=f"at least {number((self.budget.minutes.min() + self.budget.setup) / 60.0, 2)} h",
            )
        planned = self._programme(ordered(best, self.budget.place, self._drifting(best)))
        before, standard = self._programme([]), self._programme(self.standard_runs)
        return Plan(self.known, self.wanted, before, planned, standard, tuple(self._notes(planned, best)))

    def _best(self) -> Array:
        """So many runs of each test, (tests,), that all effects show as in the standard programme, if that can be."""
        nothing, standard = np.zeros(len(self.tests), dtype=int), self._counts(self.standard_runs)
        best = best_runs(self._criterion(_PENALTY), self.budget, nothing)
        if self._lacking(best):
            starts = best, np.minimum(standard, self.budget.runs)
            best = min((best_runs(self.strict, self.budget, start) for start in starts), key=self.strict.together)
        return best

    def _with_repeats(self, counts: Array) -> Array:
        """The runs with a test of each place made twice, that a drift shows as in the standard programme, in place of
        what is least useful."""
        standard = self._drifting(self._counts(self.standard_runs)).noncentrality(self.standard_runs)
        for place in np.unique(self.budget.place[counts > 0]):
            mine = np.flatnonzero((counts > 0) & (self.budget.place == place))
            again = mine[self.budget.runs[mine] > 1]
            if mine.size > 2 and (counts[mine].max() < 2 or self._drift_shown(counts) < standard):
                quickest = again[np.argsort(self.budget.minutes[again])][:4]
                counts = min(self._once_more(counts, quickest), key=self.strict.together, default=counts)
        return self._with_scatter(counts)

    def _drift_shown(self, counts: Array) -> float:
        """Noncentrality of a drift by so many runs of each test, in their best order."""
        drifting = self._drifting(counts)
        return drifting.noncentrality(ordered(counts, self.budget.place, drifting))

    def _with_scatter(self, counts: Array) -> Array:
        """The runs with further repeats of sweeps, until a fit can tell their scatter from what repeats differ by, as
        far as that costs next to nothing of the aim."""
        most = self.strict.together(counts) + 0.1  # of the logarithm of a variance: a twentieth of the error
        while (freedom := self._scatter_freedom(counts)) < [_SCATTER_FREEDOM]:
            again = [test for test in np.flatnonzero(counts).tolist() if _differences(self.tests[test])]
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
        one = np.eye(len(self.tests), dtype=int)
        for test in tests:
            runs = counts + one[test]
            while self.budget.spent(runs) > self.budget.most and (runs == 1).any():
                runs = min((runs - one[single] for single in np.flatnonzero(runs == 1)), key=self.strict.together)
            if self.budget.spent(runs) <= self.budget.most:
                yield runs

    def _scatter_freedom(self, counts: Array) -> list[int]:
        """Degrees of freedom of the scatter of sweeps that repeats tell, those before and so many runs of each test.

        Of each rig, the bushing's and each specimen's, up to what is enough; the fewest first.
        """
        runs = Counter(self.known.tests)
        runs.update({test: int(n) for test, n in zip(self.tests, counts, strict=True) if n})
        freedom = Counter[Place | None]()
        for test, times in runs.items():
            if isinstance(test, SimulatedSweep):
                rig = test.direction if isinstance(test.direction, Specimen) else None
                freedom[rig] += _differences(test) * (times - 1)
        return sorted(min(each, _SCATTER_FREEDOM) for each in freedom.values())

    def _criterion(self, penalty: float) -> Criterion:
        odds = np.array([rival.probability for rival in self.known.rivals])
        return Criterion(self.views, self.weight, odds, self.least, penalty)

    @cached_property
    def strict(self) -> Criterion:
        """With more weight on what effects show less than in the standard programme."""
        return self._criterion(_STRICT)

    @cached_property
    def _pairs(self) -> Array:
        """Any two rivals by their numbers, (2, pairs)."""
        return np.stack(np.triu_indices(len(self.known.rivals), 1))

    @cached_property
    def _tellable(self) -> Array:
        """Those that all tests together would tell apart, (2, pairs); all where none are."""
        if not self.known.rivals:
            return self._pairs
        apart = self._distances(np.ones(len(self.tests), dtype=int), self._pairs) >= RIVALS_APART
        return self._pairs[:, apart] if apart.any() else self._pairs

    def _distances(self, counts: Array, pairs: Array) -> Array:
        """Expected chi-square between the rivals of each pair by so many runs of each test, (pairs,)."""
        return distances([view.together(counts) for view in self.views[1:]])[0, *pairs]

    def _counts(self, runs: Sequence[int]) -> Array:
        """How often each test stands among the runs, (tests,)."""
        return np.bincount(np.array(runs, dtype=int), minlength=len(self.tests))

    def _lacking(self, counts: Array) -> list[str]:
        """Effects that so many runs of each test show less well than the standard programme."""
        reached = noncentrality_of(self.views[0].together(counts))[0]
        short = np.sqrt(reached) < 0.995 * np.sqrt(self.least)  # what the numbers are good for
        return list(dict.fromkeys(self.columns[i].effect.name for i in np.flatnonzero(short)))

    @cached_property
    def standard_runs(self) -> list[int]:
        """The standard programme over and over, as long as it fits into the hours; by direction, as labs do."""
        places = [self.tests.index(test) for test in standard_tests(self.known, self.wanted)]
        counts, runs = np.zeros(len(self.tests), dtype=int), list[int]()
        while places:
            counts[test := places[len(runs) % len(places)]] += 1
            if self.budget.spent(counts) > self.budget.most:
                break
            runs.append(test)
        return sorted(runs, key=lambda test: self.budget.place[test])

    @cached_property
    def least(self) -> Array:
        """Noncentrality of each effect that the standard programme can show, 0 of others, (e,)."""
        reached = noncentrality_of(self.views[0].together(self._counts(self.standard_runs)))[0]
        seen = [column.reach * np.sqrt(size) >= FOUND for column, size in zip(self.columns, reached, strict=True)]
        return np.where(seen, reached, 0.0)

    def _drifting(self, counts: Array) -> Drifting:
        """What a drift does to so many runs of each test."""
        view, k = self.views[0], len(self.known.names) + len(self.known.bounded)
        own, seen = view.information.own, view.information.own[:, k, k]
        one = Information(own * counts[:, None, None], own[..., k : k + 1], seen[:, None])  # by the gain of one run
        level = np.square(view.level[:, 0])
        root = root_of(view.together(counts).own[0])
        pull = one.beside(view.level).cross[..., 0] @ root
        return Drifting(seen, level * seen**2 / (1.0 + counts * level * seen), pull)

    def _programme(self, runs: Sequence[int]) -> Programme:
        """What runs in their order tell."""
        counts, places = self._counts(runs), self.budget.place[list(runs)]
        view, k, drifting = self.views[0], len(self.known.names), self._drifting(counts)
        found = view.together(counts)
        off, covariance = view.off(found)[0], np.linalg.inv(found.own[0])
        gain, phase = np.sqrt(np.einsum("kcn,kl,lcn->cn", self.slopes, off, self.slopes))
        moved = root_of(found.own[0]) @ drifting.shift(runs) / np.sqrt(np.diag(covariance))
        # tests alone leave open what they tell less of than rounding; without tests errors are beyond all use
        values, vectors = np.linalg.eigh(found.own[0] - view.prior)
        alone = vectors / np.sqrt(np.maximum(values, max(1e-14 * float(values.max()), 1e-12)))
        return Programme(
            tuple(self.tests[run] for run in runs),
            self.budget.minutes[list(runs)] + self.budget.setup * (np.diff(places, prepend=-1) != 0),
            np.sqrt(np.diag(off))[:k],
            np.linalg.norm(alone, axis=1)[:k],
            gain,
            phase * (1.0 + np.square(self._loss_factor())),
            float(self._distances(counts, self._tellable).min()) if self.known.rivals else None,
            tuple(self._visible(noncentrality_of(found)[0], drifting.noncentrality(runs))),
            0.01 * float(np.abs(moved[:k]).max()),
        )

    def _loss_factor(self) -> Array:
        """Of the model at the points wanted, (n,)."""
        model = self.known.model
        stiffness = [model.stiffness(each.place, each.frequency, each.amplitude) for each in self.wanted.points]
        return np.concatenate([loss_factor(each) for each in stiffness])

    def _visible(self, reached: Array, drifting: float) -> Iterator[Visible]:
        """The smallest amount found of each effect that the standard programme shows, in the shape it shows best."""
        for effect in dict.fromkeys(column.effect for column in self.columns):
            mine = [i for i, column in enumerate(self.columns) if column.effect is effect]
            best = mine[int(np.argmax(self.least[mine]))]
            if self.least[best] > 0.0:
                amount = effect.amount
                yield Visible(
                    effect.name, qualified(effect, amount), amount.unit, amount.typical * _found(reached[best])
                )
        yield Visible("drift", "drift.gain", "1", _found(drifting))

    def _notes(self, planned: Programme, counts: Array) -> Iterator[str]:
        """What a user must know."""
        yield from self.known.warnings
        if self.known.bounded:
            yield (
                f"{' and '.join(self.known.bounded)} came to rest on a bound: the errors of the others count that noise"
                " takes it off there half of the times"
            )
        if planned.hours < self.wanted.hours - float(self.budget.minutes.max() + self.budget.setup) / 60.0:
            yield (
                f"{number(planned.hours, 2)} of {number(self.wanted.hours, 3)} h are planned: no further run would "
                "take a quarter per cent off the error"
            )
        if lacking := self._lacking(counts):
            yield f"the standard programme shows these effects better: {', '.join(lacking)}"
        tellable = {tuple(pair) for pair in self._tellable.T.tolist()}
        for one, other in self._pairs.T.tolist():
            if (one, other) not in tellable:
                names = (self.known.rivals[place].model.effects[-1] for place in (one, other))
                yield f"no test of this rig would tell {' from '.join(names)}: they are left out"
        if planned.apart is not None and planned.apart < RIVALS_APART:
            yield (
                f"the nearest rivals are {number(planned.apart, 2)} apart in expected chi-square, less than the "
                f"{number(RIVALS_APART, 3)} that tell them in nine of ten cases"
            )


def _found(noncentrality: float) -> float:
    """The smallest amount that is found, of a column with this noncentrality for a unit; inf where it is not seen."""
    return FOUND / float(np.sqrt(noncentrality)) if noncentrality > 0.0 else np.inf


def _differences(test: Test) -> int:
    """Degrees of freedom of the scatter that a repeat of a test tells."""
    steps = len(test.steps) if isinstance(test, SimulatedSweep) else 0
    return steps - 1 if steps >= FEWEST_STEPS else 0


def purposes(plan: Plan) -> dict[Test, str]:
    """In words, of each test with all its repeats, what would be lost without it."""
    known, counts = plan.knowledge, Counter(plan.planned.tests)
    view = View.of(Grid(known, tuple(counts)), known)
    runs = np.array(list(counts.values()))
    whole = _errors(view, runs)[: len(known.names)]
    rest = "tells the rivals apart" if plan.wanted.aim == "rivals" else "shows effects that the model lacks"
    found = {}
    for at, test in enumerate(counts):
        without = np.where(np.arange(runs.size) == at, 0, runs)
        growth = _errors(view, without)[: whole.size] / whole
        worst = int(np.argmax(growth))
        lost = f"{known.names[worst]}: error {number(100.0 * float(growth[worst] - 1.0), 2)} % larger without it"
        found[test] = lost if growth[worst] >= 1.005 else rest  # chosen
    return found


def _errors(view: View, runs: Array) -> Array:
    """Standard error of each parameter's relative change, after so many runs of each test."""
    return np.sqrt(np.diag(view.off(view.together(runs))[0]))
