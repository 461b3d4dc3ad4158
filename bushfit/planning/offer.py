"""Candidates of a plan: runs that the rig can make, with their duration and information, and the standard programme."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bushfit.campaign.schema import RigSettings, SimulatedLoop, SimulatedSweep
from bushfit.diagnosis.next_test import within_limits
from bushfit.diagnosis.priors import TELLS
from bushfit.effects.contract import Array
from bushfit.errors import ModelError
from bushfit.fitting.coordinates import residual
from bushfit.fitting.preparation import new_sweep
from bushfit.geometry import TRANSLATION, Direction, Place
from bushfit.model.covariance import Z95
from bushfit.planning.contract import Knowledge, Test, Wanted, operating_points
from bushfit.planning.criterion import Budget, View, distances
from bushfit.planning.sensitivity import Grid, relative_slopes
from bushfit.planning.targets import ENDLESS, Goal, goals, own_bands
from bushfit.simulation.undisturbed import PAPER_LOOPS, PAPER_SWEEPS
from bushfit.units import number

#: Time to bring the rig to another run, for its control to settle [s]; chosen.
_RUN_SECONDS = 120.0
#: Cycles of the loops that are considered: few, and so many that the noise of the rows hardly counts.
_LOOP_CYCLES = (3, 20)
#: Which of ten frequencies, evenly spaced below three near the top and the top, a run steps through: all of the seven,
#: few, the ends, either end more densely, and those near the top with none, one or two of the lowest.
_CHOICES = (
    (0, 1, 2, 3, 4, 5, 9),
    (0, 2, 4, 9),
    (0, 3, 9),
    (0, 9),
    (0, 1, 2),
    (4, 5, 9),
    (6, 7, 8, 9),
    (0, 7, 8, 9),
    (0, 1, 6, 7, 8, 9),
)
#: Axial strain per displacement of the paper's bushing [1/m]: 1/sqrt(2 (b^2 - a^2) ln(b/a)), a = 10 mm, b = 18 mm.
_PAPER_STRAIN = float(1.0 / np.sqrt(2.0 * (0.018**2 - 0.010**2) * np.log(1.8)))
#: The 90 % quantile of the normal distribution.
_NINE_OF_TEN = 1.2815515655446004
#: Amount of an effect over its standard error that a test of one in twenty finds in nine of ten cases: the 97.5 % and
#: the 90 % quantile of the normal distribution.
FOUND = Z95 + _NINE_OF_TEN
#: Expected chi-square between rivals from which on `diagnose` tells them apart in nine of ten cases: of d it finds d
#: with a standard deviation of 2 sqrt(d), and it takes those for one set that are within TELLS.
RIVALS_APART = (_NINE_OF_TEN + float(np.sqrt(_NINE_OF_TEN**2 + TELLS))) ** 2


def minutes(test: Test, rig: RigSettings) -> float:
    """Time that one run takes, without a change of direction before it."""
    if isinstance(test, SimulatedLoop):
        return (_RUN_SECONDS + test.cycles / test.frequency) / 60.0
    per_point = rig.minutes_per_point or 30.0  # [s], chosen: some cycles to settle, and some to average
    return (_RUN_SECONDS + per_point * test.points[0].size) / 60.0


def standard_tests(knowledge: Knowledge, wanted: Wanted) -> list[Test]:
    """Every run of the standard programme once: the paper's, axial and radial; of specimens, the axial ones.

    Displacements are those that make the paper's axial strains, within the limits of the rig.
    """
    if knowledge.model.bushing is None:
        return [test for place in wanted.places for test in _of_paper(knowledge, wanted.rig, place)]
    loops = [test for test in _of_paper(knowledge, wanted.rig, Direction.AXIAL) if isinstance(test, SimulatedLoop)]
    sweeps = [test for place in (Direction.AXIAL, Direction.RADIAL) for test in _of_paper(knowledge, wanted.rig, place)]
    return [*loops, *(test for test in sweeps if isinstance(test, SimulatedSweep))]


def candidates(knowledge: Knowledge, wanted: Wanted) -> list[Test]:
    """Runs to choose from: the standard programme's, and others of few points, over its amplitudes and beyond.

    Raises:
        ModelError: there is none within the limits of the rig.
    """
    found = [test for test in standard_tests(knowledge, wanted) if test.direction in wanted.places]
    found += [replace(test, cycles=_LOOP_CYCLES[-1]) for test in found if isinstance(test, SimulatedLoop)]
    for place in wanted.places:
        wished = [points for points in wanted.points if points.place == place]
        usual = [test for test in _of_paper(knowledge, wanted.rig, place) if isinstance(test, SimulatedSweep)]
        if usual:
            sizes = np.concatenate([*(each.amplitude for each in wished), *(each.amplitudes for each in usual)])
            rates = np.concatenate([*(each.frequency for each in wished), *(each.frequencies for each in usual)])
            found += _runs(knowledge, wanted.rig, place, sizes, rates)
    if not found:
        places = " and ".join(map(str, wanted.places))
        raise ModelError(
            "the rig can make no test of this bushing",
            place="[rig]",
            found=f"limits below every test that is considered, {places}",
            expected="limits that let it make two points of a sweep, or a loop",
        )
    return list(dict.fromkeys(found))


def _of_paper(knowledge: Knowledge, rig: RigSettings, place: Place) -> list[Test]:
    """The paper's loop and axial sweeps at a place, within the limits of the rig; a run for each amplitude."""
    of_strain = Direction.AXIAL if place is Direction.RADIAL else place  # the paper's radial displacements are axial
    scale = _PAPER_STRAIN / knowledge.model.unit_strain(of_strain)
    loops = [replace(loop, direction=place, amplitude=_rounded(loop.amplitude * scale)) for loop in PAPER_LOOPS]
    sweep = PAPER_SWEEPS[0]
    sweeps = [replace(sweep, direction=place, amplitudes=(_rounded(x * scale),)) for x in sweep.amplitudes]
    tests: list[Test] = [*loops, *sweeps]
    return [kept for test in tests if (kept := _within(knowledge, rig, test)) is not None]


def _runs(knowledge: Knowledge, rig: RigSettings, place: Place, sizes: Array, rates: Array) -> Iterator[Test]:
    """Sweeps and loops at one place over amplitudes [m or rad] and frequencies [Hz], and beyond.

    Frequencies go to twice those of the standard programme, where [rig] says that the rig can; those near the top show
    masses, delays and resonances in fewer points than a whole sweep.
    """
    amplitudes = [_rounded(x) for x in np.geomspace(sizes.min(), 2.0 * sizes.max(), 6)]
    top = min(2.0 * float(rates.max()), rig.max_frequency or float(rates.max()))
    even = np.geomspace(0.2 * rates.min(), top, 7)
    frequencies = [min(_rounded(f), top) for f in (*even[:-1], 0.7 * top, 0.8 * top, 0.9 * top, top)]
    steps = [tuple(sorted({frequencies[i] for i in chosen})) for chosen in _CHOICES]
    runs: list[Test] = [SimulatedSweep(place, (x,), stepped) for x in amplitudes for stepped in steps]
    runs += [SimulatedSweep(place, tuple(amplitudes), (frequencies[i],), "amplitude") for i in (0, 2, 4, 9)]
    # quasi-static loops, and as fast as most rigs still record
    runs += [SimulatedLoop(place, x, f, n) for x in amplitudes for f in (0.1, 1.0) for n in _LOOP_CYCLES]
    yield from (kept for run in runs if (kept := _within(knowledge, rig, run)) is not None)


def _within(knowledge: Knowledge, rig: RigSettings, test: Test) -> Test | None:
    """A test less the steps that are beyond the limits of the rig or what rubber bears; None where too few are left."""
    (frequency, size), place = operating_points(test), test.direction
    bearable = size * knowledge.model.unit_strain(place) <= max(0.5, knowledge.strain or 0.0)  # what it has borne
    bearable &= within_limits(knowledge.model, rig, place, frequency, size)
    if isinstance(test, SimulatedLoop):
        return test if bearable.all() else None
    kept = np.array(test.steps)[bearable]
    if kept.size < 2:
        return None
    steps = tuple(kept.tolist())
    return replace(test, frequencies=steps) if test.stepped == "frequency" else replace(test, amplitudes=steps)


def unlimited_rig(knowledge: Knowledge, wanted: Wanted, tests: Sequence[Test]) -> Iterator[str]:
    """A warning on what tests ask of a rig whose limits are not stated.

    Args:
        knowledge: whose model gives the forces.
        wanted: with the rig.
        tests: of the plan.
    """
    rig, linear = wanted.rig, [test for test in tests if test.direction.motion is TRANSLATION]
    if not linear or any((rig.max_force, rig.max_displacement, rig.max_velocity, rig.max_frequency)):
        return
    points = [(test.direction, *operating_points(test)) for test in linear]
    frequency, amplitude = np.concatenate([pair for _, *pair in points], axis=1)
    fastest = int(np.argmax(frequency * amplitude))
    velocity = 2.0 * np.pi * float(frequency[fastest] * amplitude[fastest])
    acceleration = float(np.max(np.square(2.0 * np.pi * frequency) * amplitude)) / 9.80665
    force = max(float(np.max(np.abs(knowledge.model.stiffness(place, f, x)) * x)) for place, f, x in points)
    where = f"{number(1e3 * amplitude[fastest], 3)} mm at {number(frequency[fastest], 3)} Hz"
    yield (
        f"[rig] states no limits: the plan reaches {number(velocity, 3)} m/s ({where}), "
        f"{number(acceleration, 3)} g and {number(force, 3)} N; state max_velocity, max_force, max_displacement and "
        "max_frequency, and plan again"
    )


def _rounded(value: float) -> float:
    """Value with two digits, as a set point is typed."""
    return float(f"{value:.2g}")


@dataclass(frozen=True, eq=False)
class Offer:
    """The tests to choose from for what is wanted, whatever the hours."""

    knowledge: Knowledge
    wanted: Wanted

    @cached_property
    def tests(self) -> tuple[Test, ...]:
        """The candidates first, then what only the standard programme has."""
        every = [*candidates(self.knowledge, self.wanted), *standard_tests(self.knowledge, self.wanted)]
        return tuple(dict.fromkeys(every))

    @cached_property
    def grid(self) -> Grid:
        return Grid(self.knowledge, self.tests)

    @cached_property
    def views(self) -> list[View]:
        """The likeliest model's, beside the effects that it lacks; each rival's, beside what the others differ by."""
        data_sets = self.grid.data_sets
        effects = np.array([column.values for column in self.grid.columns])
        views = [View.of(self.grid, self.knowledge, effects)]
        left = [residual(rival.model, data_sets) for rival in self.knowledge.rivals]
        for i, rival in enumerate(self.knowledge.rivals):
            others = np.array([other - left[i] for j, other in enumerate(left) if j != i])
            views.append(View.of(self.grid, rival, others))
        return views

    @cached_property
    def slopes(self) -> Array:
        """Gain and phase of the stiffness at the points wanted by change of the parameters, (k + b, 2, n)."""
        sweeps = [
            new_sweep(self.knowledge.model, points.place, points.frequency, points.amplitude, (1.0, 1.0), (0.0, 0.0))
            for points in self.wanted.points
        ]
        each = [np.stack(np.split(relative_slopes(self.knowledge, [sweep]), 2, axis=-1), axis=1) for sweep in sweeps]
        return np.concatenate(each, axis=-1)

    @cached_property
    def model_error(self) -> Array:
        """Standard errors by the model's own error at the points wanted: |K|, relative, and loss factor, (2, n)."""
        bands = [own_bands(self.knowledge, points) for points in self.wanted.points]
        stiffness = np.concatenate([error / value for (value, error, _), _ in bands])
        return np.stack([stiffness, np.concatenate([error for _, (_, error, _) in bands])])

    @cached_property
    def goals(self) -> tuple[Goal, ...]:
        """Goal of each target."""
        return tuple(goals(self.knowledge, self.wanted, self.slopes))

    def error_covariance(self, counts: Array) -> Array:
        """Covariance of the parameters by so many runs of each test, (k, k)."""
        return np.asarray(self.views[0].error_covariance(self.views[0].together(counts))[0])

    @cached_property
    def endless(self) -> Array:
        """Covariance by endless repeats of all candidates, (k, k): the limit of every plan."""
        return self.error_covariance(ENDLESS * (self.budget.runs > 0))

    @cached_property
    def weight(self) -> Array | None:
        """Weight of the parameters' covariance in the criterion, (k, k); None if rivals are to be separated."""
        if self.wanted.aim == "rivals":
            return None
        if self.wanted.aim == "targets":
            return np.sum([goal.weight(self.endless) for goal in self.goals], axis=0)
        if self.wanted.aim == "predictions":
            return np.asarray(np.einsum("kcn,lcn->kl", self.slopes, self.slopes) / self.slopes.shape[-1])
        return np.diag(np.isin((*self.knowledge.names, *self.knowledge.bounded), self.wanted.parameters).astype(float))

    @cached_property
    def budget(self) -> Budget:
        """Duration of the tests, without a limit of hours."""
        places = list(dict.fromkeys([*self.wanted.places, *(test.direction for test in self.tests)]))
        lines = [
            (test.direction, test.amplitude, test.frequency)
            if isinstance(test, SimulatedLoop)
            else (test.direction, test.stepped, test.levels)
            for test in self.tests
        ]
        knowledge, setup = list(dict.fromkeys(lines)), self.wanted.rig.minutes_per_setup
        return Budget(
            np.array([minutes(test, self.wanted.rig) for test in self.tests]),
            np.array([places.index(test.direction) for test in self.tests]),
            np.array([knowledge.index(line) for line in lines]),
            np.array([1000 * (test.direction in self.wanted.places) for test in self.tests]),
            30.0 if setup is None else setup / 60.0,  # half an hour where the rig states none (chosen)
            np.inf,
        )

    @cached_property
    def pairs(self) -> Array:
        """Any two rivals by their numbers, (2, pairs)."""
        return np.stack(np.triu_indices(len(self.knowledge.rivals), 1))

    @cached_property
    def tellable(self) -> Array:
        """Pairs that all tests together would separate, (2, pairs); all pairs if there are none."""
        if not self.knowledge.rivals:
            return self.pairs
        told = self.apart(np.ones(len(self.tests), dtype=int), self.pairs) >= RIVALS_APART
        return self.pairs[:, told] if told.any() else self.pairs

    def apart(self, counts: Array, pairs: Array) -> Array:
        """Expected chi-square between the rivals of each pair by so many runs of each test, (pairs,)."""
        return distances([view.together(counts) for view in self.views[1:]])[0, *pairs]


def smallest_found(noncentrality: float) -> float:
    """The smallest amount that is found, of a column with this noncentrality for a unit; inf where it is not seen."""
    return FOUND / float(np.sqrt(noncentrality)) if noncentrality > 0.0 else np.inf
