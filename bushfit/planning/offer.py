"""Candidate tests: runs that the rig can make, with their duration and information, and the standard programme."""

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
from bushfit.planning.contract import Knowledge, PlanRequest, Test, operating_points
from bushfit.planning.criterion import Budget, ModelInformation, rival_chi_squares
from bushfit.planning.sensitivity import Grid, relative_slopes
from bushfit.planning.targets import UNLIMITED_RUNS, Goal, irreducible_errors, make_goals
from bushfit.simulation.undisturbed import PAPER_LOOPS, PAPER_SWEEPS
from bushfit.units import number

#: Time to bring the rig to another run, for its control to settle [s]; chosen.
_RUN_SECONDS = 120.0
#: Cycles of the candidate loops: few, and enough to make the noise of the rows negligible.
_LOOP_CYCLES = (3, 20)
#: Indices of the frequencies of candidate sweeps among ten, which are six in equal ratios, three near the top, and the
#: top: all in equal ratios, few, the ends, the lower or upper part, and the top ones with none, one or two of the
#: lowest.
_FREQUENCY_CHOICES = (
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
#: Amount of an effect over its standard error that a test at the 5 % level detects in 90 % of the cases: the sum of the
#: 97.5 % and the 90 % quantiles of the normal distribution.
DETECTABLE = Z95 + _NINE_OF_TEN
#: Expected chi-square between rivals above which `diagnose` separates them in 90 % of the cases: the observed value of
#: an expected d scatters by 2 sqrt(d), and `diagnose` does not separate rivals within TELLS.
RIVALS_APART = (_NINE_OF_TEN + float(np.sqrt(_NINE_OF_TEN**2 + TELLS))) ** 2


def run_minutes(test: Test, rig: RigSettings) -> float:
    """Duration of one run [min] without a change of direction before it."""
    if isinstance(test, SimulatedLoop):
        return (_RUN_SECONDS + test.cycles / test.frequency) / 60.0
    per_point = rig.minutes_per_point or 30.0  # [s], chosen: some cycles to settle, and some to average
    return (_RUN_SECONDS + per_point * test.points[0].size) / 60.0


def standard_tests(knowledge: Knowledge, request: PlanRequest) -> list[Test]:
    """Runs of the standard programme: the paper's axial and radial tests, or its axial tests of specimens.

    Amplitudes are those that cause the strains of the paper's bushing, within the limits of the rig.

    Args:
        knowledge: model of the bushing or specimens.
        request: limits of the rig and directions.

    Returns:
        Each run once.
    """
    if knowledge.model.bushing is None:
        return [test for place in request.places for test in _paper_tests(knowledge, request.rig, place)]
    axial, radial = (_paper_tests(knowledge, request.rig, place) for place in (Direction.AXIAL, Direction.RADIAL))
    loops = [test for test in axial if isinstance(test, SimulatedLoop)]
    return [*loops, *(test for test in (*axial, *radial) if isinstance(test, SimulatedSweep))]


def candidates(knowledge: Knowledge, request: PlanRequest) -> list[Test]:
    """Candidate tests: those of the standard programme, and sweeps and loops of few points over a wider range.

    Frequencies reach twice those of the standard programme if [rig] states that the rig can. Frequencies near the top
    show masses, delays and resonances in fewer points than a whole sweep.

    Args:
        knowledge: model that gives forces and strains.
        request: limits of the rig, directions and wanted points.

    Returns:
        Distinct runs.

    Raises:
        ModelError: no test is within the limits of the rig.
    """
    rig = request.rig
    runs = [test for test in standard_tests(knowledge, request) if test.direction in request.places]
    runs += [replace(test, cycles=_LOOP_CYCLES[-1]) for test in runs if isinstance(test, SimulatedLoop)]
    for place in request.places:
        standard = [test for test in _paper_tests(knowledge, rig, place) if isinstance(test, SimulatedSweep)]
        if not standard:
            continue
        wanted = [points for points in request.points if points.place == place]
        sizes = np.concatenate([*(points.amplitude for points in wanted), *(test.amplitudes for test in standard)])
        rates = np.concatenate([*(points.frequency for points in wanted), *(test.frequencies for test in standard)])
        amplitudes = [_rounded(x) for x in np.geomspace(sizes.min(), 2.0 * sizes.max(), 6)]
        top = min(2.0 * float(rates.max()), rig.max_frequency or float(rates.max()))
        even = np.geomspace(0.2 * rates.min(), top, 7)
        frequencies = [min(_rounded(f), top) for f in (*even[:-1], 0.7 * top, 0.8 * top, 0.9 * top, top)]
        steps = [tuple(sorted({frequencies[i] for i in chosen})) for chosen in _FREQUENCY_CHOICES]
        further: list[Test] = [SimulatedSweep(place, (x,), stepped) for x in amplitudes for stepped in steps]
        further += [SimulatedSweep(place, tuple(amplitudes), (frequencies[i],), "amplitude") for i in (0, 2, 4, 9)]
        # quasi-static loops, and as fast as most rigs still record
        further += [SimulatedLoop(place, x, f, n) for x in amplitudes for f in (0.1, 1.0) for n in _LOOP_CYCLES]
        runs += [run for test in further if (run := _limited(knowledge, rig, test)) is not None]
    if not runs:
        places = " and ".join(map(str, request.places))
        raise ModelError(
            "the rig can make no test of this bushing",
            place="[rig]",
            found=f"limits below every test that is considered, {places}",
            expected="limits that let it make two points of a sweep, or a loop",
        )
    return list(dict.fromkeys(runs))


def _paper_tests(knowledge: Knowledge, rig: RigSettings, place: Place) -> list[Test]:
    """The paper's loops and axial sweeps in a direction, within the limits of the rig; a run for each amplitude."""
    strained = Direction.AXIAL if place is Direction.RADIAL else place  # the paper's radial displacements are axial
    scale = _PAPER_STRAIN / knowledge.model.unit_strain(strained)
    loops = [replace(loop, direction=place, amplitude=_rounded(loop.amplitude * scale)) for loop in PAPER_LOOPS]
    sweep = PAPER_SWEEPS[0]
    sweeps = [replace(sweep, direction=place, amplitudes=(_rounded(x * scale),)) for x in sweep.amplitudes]
    tests: list[Test] = [*loops, *sweeps]
    return [run for test in tests if (run := _limited(knowledge, rig, test)) is not None]


def _limited(knowledge: Knowledge, rig: RigSettings, test: Test) -> Test | None:
    """The test without steps beyond the limits of rig or rubber; None if fewer than two steps remain."""
    (frequency, amplitude), place = operating_points(test), test.direction
    strain = amplitude * knowledge.model.unit_strain(place)
    allowed = strain <= max(0.5, knowledge.strain or 0.0)  # strains that it has borne
    allowed &= within_limits(knowledge.model, rig, place, frequency, amplitude)
    if isinstance(test, SimulatedLoop):
        return test if allowed.all() else None
    steps = tuple(np.array(test.steps)[allowed].tolist())
    if len(steps) < 2:
        return None
    return replace(test, frequencies=steps) if test.stepped == "frequency" else replace(test, amplitudes=steps)


def warn_of_unlimited_rig(knowledge: Knowledge, request: PlanRequest, tests: Sequence[Test]) -> Iterator[str]:
    """Warn of the velocity, acceleration and force of a plan if [rig] states no limits.

    Args:
        knowledge: model that gives the forces.
        request: limits of the rig.
        tests: runs of the plan.

    Returns:
        Iterator over at most one sentence.
    """
    rig, linear = request.rig, [test for test in tests if test.direction.motion is TRANSLATION]
    if not linear or any((rig.max_force, rig.max_displacement, rig.max_velocity, rig.max_frequency)):
        return
    points = [(test.direction, *operating_points(test)) for test in linear]
    frequency, amplitude = np.concatenate([pair for _, *pair in points], axis=1)
    fastest = int(np.argmax(frequency * amplitude))
    velocity = 2.0 * np.pi * float(frequency[fastest] * amplitude[fastest])
    acceleration = float(np.max(np.square(2.0 * np.pi * frequency) * amplitude)) / 9.80665
    force = max(float(np.max(np.abs(knowledge.model.stiffness(place, f, x)) * x)) for place, f, x in points)
    point = f"{number(1e3 * amplitude[fastest], 3)} mm at {number(frequency[fastest], 3)} Hz"
    yield (
        f"[rig] states no limits: the plan reaches {number(velocity, 3)} m/s ({point}), "
        f"{number(acceleration, 3)} g and {number(force, 3)} N; state max_velocity, max_force, max_displacement and "
        "max_frequency, and plan again"
    )


def _rounded(value: float) -> float:
    """Value with two digits, as a set point is typed."""
    return float(f"{value:.2g}")


@dataclass(frozen=True, eq=False)
class PlanningProblem:
    """Candidate tests with their information and duration, whatever the hours; k includes parameters at a bound.

    Args:
        knowledge: before the tests.
        request: aim of the plan and limits of the rig.
    """

    knowledge: Knowledge
    request: PlanRequest

    @cached_property
    def tests(self) -> tuple[Test, ...]:
        """Candidate tests first, then tests that only the standard programme has."""
        tests = [*candidates(self.knowledge, self.request), *standard_tests(self.knowledge, self.request)]
        return tuple(dict.fromkeys(tests))

    @cached_property
    def grid(self) -> Grid:
        return Grid(self.knowledge, self.tests)

    @cached_property
    def models(self) -> list[ModelInformation]:
        """Information on the likeliest model and the effects that it lacks, then on each rival and its differences."""
        effects = np.array([column.values for column in self.grid.columns])
        models = [ModelInformation.from_grid(self.grid, self.knowledge, effects)]
        rivals = self.knowledge.rivals
        residuals = [residual(rival.model, self.grid.data_sets) for rival in rivals]
        for i, rival in enumerate(rivals):
            differences = np.array([residuals[j] - residuals[i] for j in range(len(rivals)) if j != i])
            models.append(ModelInformation.from_grid(self.grid, rival, differences))
        return models

    @cached_property
    def slopes(self) -> Array:
        """Gain and phase of the stiffness at the n wanted points by change of the parameters, (k, 2, n)."""
        sweeps = [
            new_sweep(self.knowledge.model, points.place, points.frequency, points.amplitude, (1.0, 1.0), (0.0, 0.0))
            for points in self.request.points
        ]
        parts = [np.stack(np.split(relative_slopes(self.knowledge, [sweep]), 2, axis=-1), axis=1) for sweep in sweeps]
        return np.concatenate(parts, axis=-1)

    @cached_property
    def model_error(self) -> Array:
        """Standard errors by the model's own error at the wanted points: |K|, relative, and loss factor, (2, n)."""
        errors = [irreducible_errors(self.knowledge, points) for points in self.request.points]
        stiffness = np.concatenate([error / value for (value, error, _), _ in errors])
        return np.stack([stiffness, np.concatenate([error for _, (_, error, _) in errors])])

    @cached_property
    def goals(self) -> tuple[Goal, ...]:
        """Goal of each target."""
        return tuple(make_goals(self.knowledge, self.request, self.slopes))

    def error_covariance(self, counts: Array) -> Array:
        """Covariance of the parameters with a number of runs of each test, (k, k)."""
        return np.asarray(self.models[0].error_covariance(self.models[0].total(counts))[0])

    @cached_property
    def limit_covariance(self) -> Array:
        """Covariance of the parameters with unlimited repeats of all candidates, (k, k)."""
        return self.error_covariance(UNLIMITED_RUNS * (self.budget.maximum_runs > 0))

    @cached_property
    def weight(self) -> Array | None:
        """Weight of the parameters' covariance in the criterion, (k, k); None if rivals are to be separated."""
        if self.request.aim == "rivals":
            return None
        if self.request.aim == "targets":
            return np.sum([goal.weight(self.limit_covariance) for goal in self.goals], axis=0)
        if self.request.aim == "predictions":
            return np.asarray(np.einsum("kcn,lcn->kl", self.slopes, self.slopes) / self.slopes.shape[-1])
        names = (*self.knowledge.names, *self.knowledge.bounded)
        return np.diag(np.isin(names, self.request.parameters).astype(float))

    @cached_property
    def budget(self) -> Budget:
        """Durations of the tests, without a limit of hours."""
        places = list(dict.fromkeys([*self.request.places, *(test.direction for test in self.tests)]))
        lines = [
            (test.direction, test.amplitude, test.frequency)
            if isinstance(test, SimulatedLoop)
            else (test.direction, test.stepped, test.levels)
            for test in self.tests
        ]
        distinct, setup = list(dict.fromkeys(lines)), self.request.rig.minutes_per_setup
        return Budget(
            np.array([run_minutes(test, self.request.rig) for test in self.tests]),
            np.array([places.index(test.direction) for test in self.tests]),
            np.array([distinct.index(line) for line in lines]),
            np.array([1000 * (test.direction in self.request.places) for test in self.tests]),
            30.0 if setup is None else setup / 60.0,  # half an hour if [rig] states none (chosen)
            np.inf,
        )

    @cached_property
    def pairs(self) -> Array:
        """Any two rivals by their numbers, (2, pairs)."""
        return np.stack(np.triu_indices(len(self.knowledge.rivals), 1))

    @cached_property
    def separable_pairs(self) -> Array:
        """Pairs of rivals that all tests together would separate, (2, pairs); all pairs if there are none."""
        if not self.knowledge.rivals:
            return self.pairs
        separable = self.chi_squares(np.ones(len(self.tests), dtype=int), self.pairs) >= RIVALS_APART
        return self.pairs[:, separable] if separable.any() else self.pairs

    def chi_squares(self, counts: Array, pairs: Array) -> Array:
        """Expected chi-square between the rivals of each pair.

        Args:
            counts: number of runs of each test, (tests,).
            pairs: numbers of the rivals, (2, pairs).

        Returns:
            Chi-square after the best refit of either rival, (pairs,).
        """
        return rival_chi_squares([model.total(counts) for model in self.models[1:]])[0, *pairs]

    def nearest_rivals(self, counts: Array) -> float:
        """Smallest expected chi-square between rivals that can be separated, for a number of runs of each test."""
        return float(self.chi_squares(counts, self.separable_pairs).min())


def smallest_amount(noncentrality: float) -> float:
    """Smallest detectable amount of a column whose unit has this noncentrality; infinite if it has none."""
    return DETECTABLE / float(np.sqrt(noncentrality)) if noncentrality > 0.0 else np.inf
