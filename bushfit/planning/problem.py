"""The planning problem: candidate tests with their durations and their information on the aim, for any hours."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bushfit.diagnosis.priors import DECISIVE_CHI_SQUARE
from bushfit.effects import Effect
from bushfit.effects.contract import Array
from bushfit.model.covariance import Z95
from bushfit.planning.candidates import candidates, standard_tests
from bushfit.planning.contract import Knowledge, PlanRequest, Test
from bushfit.planning.criterion import Budget
from bushfit.planning.information import CandidateGrid, ModelInformation, rival_chi_squares
from bushfit.planning.targets import UNLIMITED_RUNS, PointSensitivity, TargetSensitivity

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
    """Candidate tests with their durations and their information, and the aim of the plan: data of the search.

    The k parameters include the parameters at a bound.

    Args:
        knowledge: model, covariance and noise before the planned tests.
        request: aim of the plan and limits of the rig.
        tests: candidate tests, then tests that only the standard programme has.
        effects: the e missing effects, each repeated for its shapes (such as frequencies of a resonance).
        models: Fisher information of each test on the likeliest model and the missing effects, then on each rival model
            and its differences from the other rivals.
        wanted: derivatives, by parameter, of the stiffness at the operating points of each direction of the request.
        goals: for each target of the request, its derivatives by parameter, and the variance that no test reduces.
        budget: durations of the tests, without a limit of hours.
    """

    knowledge: Knowledge
    request: PlanRequest
    tests: tuple[Test, ...]
    effects: list[Effect]
    models: list[ModelInformation]
    wanted: list[PointSensitivity]
    goals: list[TargetSensitivity]
    budget: Budget

    @classmethod
    def from_request(cls, knowledge: Knowledge, request: PlanRequest) -> PlanningProblem:
        """Compute the durations and the information of all candidate tests.

        Args:
            knowledge: model, covariance and noise before the planned tests.
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
        residuals = np.array(
            [np.concatenate([test.residual(rival.model) for test in grid.data_sets]) for rival in knowledge.rivals]
        )
        for index, rival in enumerate(knowledge.rivals):
            models.append(grid.information(rival, np.delete(residuals, index, axis=0) - residuals[index]))
        wanted = {points.place: PointSensitivity.from_knowledge(knowledge, points) for points in request.points}
        names = (*knowledge.names, *knowledge.bounded)
        goals = [
            TargetSensitivity.from_target(target, names, wanted[target.place] if target.place else None)
            for target in request.targets
        ]
        budget = Budget.from_tests(tests, request)
        return cls(knowledge, request, tests, effects, models, list(wanted.values()), goals, budget)

    def error_covariance(self, counts: Array) -> Array:
        """Covariance of the parameters' relative errors, (k, k), after `counts` runs of each test, (tests,)."""
        return np.asarray(self.models[0].error_covariance(self.models[0].total(counts))[0])

    @cached_property
    def limit_covariance(self) -> Array:
        """Covariance of the parameters' relative errors after unlimited repeats of all candidates, (k, k)."""
        return self.error_covariance(UNLIMITED_RUNS * (self.budget.maximum_runs > 0))

    @cached_property
    def weight(self) -> Array | None:
        """Matrix W, (k, k), of the search criterion trace(W C) with the parameters' covariance C; None for rivals."""
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
        """Expected chi-square between any two rival models, (rivals, rivals), for runs `counts`, (tests,)."""
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
        """Smallest expected chi-square between separable rival models, for runs `counts`, (tests,)."""
        return float(self.rival_distances(counts)[self.separable_rivals].min())
