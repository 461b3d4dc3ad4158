"""What is on offer: the runs that a rig can make, what each would tell of models that may be right, and its cost."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bushfit.campaign.schema import SimulatedLoop
from bushfit.diagnosis.priors import TELLS
from bushfit.effects.contract import Array
from bushfit.fitting.coordinates import residual
from bushfit.fitting.data_sets import new_sweep
from bushfit.model.covariance import Z95
from bushfit.planning.candidates import candidates, minutes, setup_minutes, standard_tests
from bushfit.planning.contract import Knowledge, Test, Wanted
from bushfit.planning.criterion import Budget, View, distances
from bushfit.planning.sensitivity import Grid, relative_slopes
from bushfit.planning.targets import ENDLESS, Goal, goals

#: The 90 % quantile of the normal distribution.
_NINE_OF_TEN = 1.2815515655446004
#: Amount of an effect over its standard error that a test of one in twenty finds in nine of ten cases: the 97.5 % and
#: the 90 % quantile of the normal distribution.
FOUND = Z95 + _NINE_OF_TEN
#: Expected chi-square between rivals from which on `diagnose` tells them apart in nine of ten cases: of d it finds d
#: with a standard deviation of 2 sqrt(d), and it takes those for one set that are within TELLS.
RIVALS_APART = (_NINE_OF_TEN + float(np.sqrt(_NINE_OF_TEN**2 + TELLS))) ** 2


@dataclass(frozen=True, eq=False)
class Offer:
    """The tests to choose from for what is wanted, whatever the hours."""

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
    def views(self) -> list[View]:
        """The likeliest model's, beside the effects that it lacks; each rival's, beside what the others differ by."""
        data_sets = self.grid.data_sets
        effects = np.array([column.values for column in self.grid.columns])
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
    def goals(self) -> tuple[Goal, ...]:
        """What the targets ask for."""
        return tuple(goals(self.known, self.wanted, self.slopes))

    def off(self, counts: Array) -> Array:
        """Covariance of the parameters by so many runs of each test, (k, k)."""
        return np.asarray(self.views[0].off(self.views[0].together(counts))[0])

    @cached_property
    def endless(self) -> Array:
        """The same of all tests on offer, each again and again, (k, k): no plan leaves less."""
        return self.off(ENDLESS * (self.budget.runs > 0))

    @cached_property
    def weight(self) -> Array | None:
        """Of the parameters' covariance in what is to be small; None where rivals are to be told apart."""
        if self.wanted.aim == "rivals":
            return None
        if self.wanted.aim == "targets":
            return np.sum([goal.weight(self.endless) for goal in self.goals], axis=0)
        if self.wanted.aim == "predictions":
            return np.asarray(np.einsum("kcn,lcn->kl", self.slopes, self.slopes) / self.slopes.shape[-1])
        return np.diag(np.isin((*self.known.names, *self.known.bounded), self.wanted.parameters).astype(float))

    @cached_property
    def budget(self) -> Budget:
        """What the tests cost, without a limit of hours."""
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
            np.inf,
        )

    @cached_property
    def pairs(self) -> Array:
        """Any two rivals by their numbers, (2, pairs)."""
        return np.stack(np.triu_indices(len(self.known.rivals), 1))

    @cached_property
    def tellable(self) -> Array:
        """Those that all tests together would tell apart, (2, pairs); all where none are."""
        if not self.known.rivals:
            return self.pairs
        told = self.apart(np.ones(len(self.tests), dtype=int), self.pairs) >= RIVALS_APART
        return self.pairs[:, told] if told.any() else self.pairs

    def apart(self, counts: Array, pairs: Array) -> Array:
        """Expected chi-square between the rivals of each pair by so many runs of each test, (pairs,)."""
        return distances([view.together(counts) for view in self.views[1:]])[0, *pairs]


def smallest_found(noncentrality: float) -> float:
    """The smallest amount that is found, of a column with this noncentrality for a unit; inf where it is not seen."""
    return FOUND / float(np.sqrt(noncentrality)) if noncentrality > 0.0 else np.inf
