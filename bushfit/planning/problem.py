"""The planning problem: candidate tests with their duration and their information on the aim, whatever the hours."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bushfit.campaign.simulated import SimulatedLoop
from bushfit.diagnosis.priors import DECISIVE_CHI_SQUARE
from bushfit.effects import Effect
from bushfit.effects.contract import Array
from bushfit.fitting.coordinates import residual
from bushfit.model.covariance import Z95
from bushfit.planning.candidates import candidates, run_minutes, standard_tests
from bushfit.planning.contract import Knowledge, PlanRequest, Test
from bushfit.planning.criterion import Budget
from bushfit.planning.information import CandidateGrid, ModelInformation, rival_chi_squares
from bushfit.planning.targets import UNLIMITED_RUNS, TargetSensitivity, WantedPoints

#: The 90 % quantile of the normal distribution.
_NINE_OF_TEN = 1.2815515655446004
#: Amount of an effect over its standard error that a test at the 5 % level detects in 90 % of the cases: the sum of the
#: 97.5 % and the 90 % quantiles of the normal distribution.
DETECTABLE = Z95 + _NINE_OF_TEN
#: Expected chi-square between rivals above which `diagnose` separates them in 90 % of the cases: the observed value of
#: an expected d scatters by 2 sqrt(d), and `diagnose` does not separate rivals within DECISIVE_CHI_SQUARE.
RIVALS_APART = (_NINE_OF_TEN + float(np.sqrt(_NINE_OF_TEN**2 + DECISIVE_CHI_SQUARE))) ** 2


@dataclass(frozen=True, eq=False)
class PlanningProblem:
    """Data of the search for tests: candidate tests with their durations and information, and the aim.

    The k parameters include the parameters at a bound.

    Args:
        knowledge: knowledge before the tests.
        request: aim of the plan and limits of the rig.
        tests: candidate tests, then tests that only the standard programme has.
        effects: effect of each further column of `models[0]`.
        models: Fisher information of each test on the parameters of the likeliest model and on the effects that it
            lacks, then on each rival model and its differences from the other rivals.
        wanted: derivatives, by parameter, of the stiffness at the operating points of each direction of the request.
        goals: for each target of the request, its derivatives by parameter, and the variance that no test reduces.
        budget: durations of the tests, without a limit of hours.
    """

    knowledge: Knowledge
    request: PlanRequest
    tests: tuple[Test, ...]
    effects: list[Effect]
    models: list[ModelInformation]
    wanted: list[WantedPoints]
    goals: list[TargetSensitivity]
    budget: Budget

    @classmethod
    def from_request(cls, knowledge: Knowledge, request: PlanRequest) -> PlanningProblem:
        """Compute the information of all candidate tests.

        Args:
            knowledge: knowledge before the tests.
            request: aim of the plan and limits of the rig.

        Returns:
            The problem.

        Raises:
            ModelError: no test is within the limits of the rig.
        """
        tests = tuple(dict.fromkeys([*candidates(knowledge, request), *standard_tests(knowledge, request)]))
        grid = CandidateGrid.from_tests(knowledge, tests)
        effects, columns = grid.effect_columns()
        models = [grid.information(knowledge, columns)]
        residuals = np.array([residual(rival.model, grid.data_sets) for rival in knowledge.rivals])
        for index, rival in enumerate(knowledge.rivals):
            models.append(grid.information(rival, np.delete(residuals, index, axis=0) - residuals[index]))
        wanted = {points.place: WantedPoints.from_knowledge(knowledge, points) for points in request.points}
        names = (*knowledge.names, *knowledge.bounded)
        goals = [
            TargetSensitivity.from_target(target, names, wanted[target.place] if target.place else None)
            for target in request.targets
        ]
        budget = _budget(request, tests)
        return cls(knowledge, request, tests, effects, models, list(wanted.values()), goals, budget)

    def error_covariance(self, counts: Array) -> Array:
        """Covariance of the parameters, (k, k), with the number of runs of each test in `counts`, (tests,)."""
        return np.asarray(self.models[0].error_covariance(self.models[0].total(counts))[0])

    @cached_property
    def limit_covariance(self) -> Array:
        """Covariance of the parameters with unlimited repeats of all candidates, (k, k)."""
        return self.error_covariance(UNLIMITED_RUNS * (self.budget.maximum_runs > 0))

    @cached_property
    def weight(self) -> Array | None:
        """Matrix W of the criterion trace(W C) for the parameters' covariance C, (k, k); None if the aim is rivals."""
        if self.request.aim == "rivals":
            return None
        if self.request.aim == "targets":
            return np.sum([goal.weight(self.limit_covariance) for goal in self.goals], axis=0)
        if self.request.aim == "predictions":
            slopes = np.concatenate([points.slopes for points in self.wanted], axis=1)
            return np.asarray(np.einsum("cnk,cnl->kl", slopes, slopes) / slopes.shape[1])
        names = (*self.knowledge.names, *self.knowledge.bounded)
        return np.diag(np.isin(names, self.request.parameters).astype(float))

    def rival_distances(self, counts: Array) -> Array:
        """Expected chi-square between any two rival models, (rivals, rivals), for `counts` runs of each test, (tests,).

        Rival models explain the tests so far equally well; the planned tests shall separate them.
        """
        return np.asarray(rival_chi_squares([model.total(counts) for model in self.models[1:]])[0])

    @cached_property
    def separable_rivals(self) -> Array:
        """Mask of the pairs of rival models that all candidate tests together can distinguish, (rivals, rivals).

        If no pair is separable, the mask contains all pairs. Only the upper triangle is used.
        """
        rivals = len(self.knowledge.rivals)
        pairs = np.triu(np.ones((rivals, rivals), dtype=bool), 1)
        if not rivals:
            return pairs
        separable = pairs & (self.rival_distances(np.ones(len(self.tests), dtype=int)) >= RIVALS_APART)
        return separable if separable.any() else pairs

    def nearest_rivals(self, counts: Array) -> float:
        """Smallest expected chi-square between separable rival models, for `counts` runs of each test, (tests,)."""
        return float(self.rival_distances(counts)[self.separable_rivals].min())


def _budget(request: PlanRequest, tests: tuple[Test, ...]) -> Budget:
    """Durations of the tests without a limit of hours; tests in directions that the request excludes get no runs."""
    places = list(dict.fromkeys([*request.places, *(test.direction for test in tests)]))
    lines = [
        (test.direction, test.amplitude, test.frequency)
        if isinstance(test, SimulatedLoop)
        else (test.direction, test.stepped, test.levels)
        for test in tests
    ]
    distinct, setup = list(dict.fromkeys(lines)), request.rig.minutes_per_setup
    return Budget(
        np.array([run_minutes(test, request.rig) for test in tests]),
        np.array([places.index(test.direction) for test in tests]),
        np.array([distinct.index(line) for line in lines]),
        np.array([1000 * (test.direction in request.places) for test in tests]),
        30.0 if setup is None else setup / 60.0,  # half an hour if [rig] states none (chosen)
        np.inf,
    )
