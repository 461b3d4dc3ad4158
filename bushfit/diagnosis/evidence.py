"""A model fitted to all tests of a campaign, with the figures by which models are compared."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from bushfit.campaign.schema import UNSTATED, RigSettings
from bushfit.effects.contract import Array
from bushfit.fitting.agreement import expected_errors
from bushfit.fitting.assess import temperature_warning
from bushfit.fitting.coordinates import Bounds
from bushfit.fitting.descent import Descent
from bushfit.fitting.levels import LevelErrors
from bushfit.fitting.model_error import with_excess_errors
from bushfit.fitting.preparation import MeasuredTest, with_level_errors
from bushfit.fitting.problem import FitProblem, FitResult
from bushfit.fitting.procedures import build_result
from bushfit.model.covariance import Covariance
from bushfit.model.model import Model
from bushfit.model.result import Result

#: Maximum number of model evaluations in one fit; a model that fits badly is used unconverged.
EVALUATIONS = 40
#: Warning for a model with a smooth correction.
_CORRECTED = (
    "a smooth correction closes a gap that no effect explains: "
    "the parameters and their intervals contain a part of this gap"
)


@dataclass(frozen=True, eq=False)
class Evidence:
    """Fit of a model to all tests of a campaign, with the figures by which models are compared.

    Args:
        solution: fit with residuals in units of noise.
        joint: same fit, whitened also by errors that all tests share; None if the fit has no such errors.
    """

    solution: FitResult
    joint: FitResult | None = None

    @property
    def data_sets(self) -> tuple[MeasuredTest, ...]:
        """Tests that the model was fitted to."""
        return tuple(self.solution.problem.tests)

    @property
    def model(self) -> Model:
        """Fitted model, with its parameter values."""
        return self.solution.model

    @property
    def residual(self) -> Array:
        """Whitened residuals, model minus measurement in units of noise, (n,)."""
        return self.solution.residual

    @property
    def chi_square(self) -> float:
        """Chi-square: sum of the squared residuals of all tests, in units of noise."""
        return self.solution.chi_square

    @property
    def parameters(self) -> int:
        """Number of parameters that the fit estimated."""
        return len(self.solution.names)

    @property
    def mean_square(self) -> float:
        """Mean square of the residuals, in squared units of noise."""
        return self.chi_square / max(sum(data_set.residual_count for data_set in self.data_sets), 1)

    @property
    def reduced_chi_square(self) -> float:
        """Chi-square per degree of freedom; 1 if the residuals are noise alone."""
        counted = sum(data_set.residual_count for data_set in self.data_sets)
        return self.chi_square / max(counted - self.parameters, 1)

    @property
    def bic(self) -> float:
        """Bayesian information criterion: chi-square + parameters ln n, n independent points; lower is better."""
        independent = sum(data_set.independent_count for data_set in self.data_sets)
        return self.chi_square + self.parameters * float(np.log(independent))

    @property
    def fixed(self) -> list[str]:
        """Names of the parameters that the fit kept at their values."""
        return [name for name in self.model.values if name not in self.solution.coordinates.names]

    def covariance_of(self, names: Collection[str]) -> Covariance:
        """Covariance of the named parameters, from the fit with errors that tests share if this exists."""
        fitted = self.joint or self.solution
        full = np.linalg.pinv(fitted.jacobian @ fitted.jacobian.T, rcond=1e-12, hermitian=True)
        full *= max(fitted.chi_square / max(fitted.residual.size - len(full), 1), 1.0)  # what the fit misses
        slopes = fitted.coordinates.slopes(self.model.values)
        covariance = Covariance(fitted.coordinates.names, full * np.outer(slopes, slopes))
        return covariance.restricted([name for name in names if name not in fitted.at_bound])

    @cached_property
    def span(self) -> Array:
        """Orthonormal basis of the residuals that the parameters of the model can absorb, (n, k)."""
        basis, size, _ = np.linalg.svd(self.solution.jacobian.T, full_matrices=False)
        return basis[:, size > 1e-10 * size[0]]

    @cached_property
    def residual_rows(self) -> Mapping[MeasuredTest, slice]:
        """Slice of each test's residuals in the vector of the residuals of all tests."""
        ends = np.cumsum([data_set.size for data_set in self.data_sets]).tolist()
        return {data_set: slice(end - data_set.size, end) for end, data_set in zip(ends, self.data_sets, strict=True)}


def fit(model: Model, data_sets: Sequence[MeasuredTest], fixed: Sequence[str], bounds: Bounds) -> Evidence:
    """Fit the parameters of a model to tests, starting from the model's values.

    Args:
        model: the model at its starting values.
        data_sets: the tests.
        fixed: names of parameters that are not fitted.
        bounds: limits of parameters inside their general limits.

    Returns:
        The fitted model with its tests.

    Raises:
        FitError: fewer data than parameters, or no finite response.
        ModelError: no response.
    """
    problem = FitProblem.with_fixed(model, data_sets, fixed, bounds)
    return Evidence(Descent.start(problem).run(EVALUATIONS).solution)


def result_of(
    evidence: Evidence,
    bounds: Bounds,
    resolved: Collection[str],
    *,
    lacking: bool = True,
    corrected: FitResult | None = None,
    rig: RigSettings = UNSTATED,
    fixed: Covariance | None = None,
) -> Result:
    """Build the result of a fit, with its uncertainty; a parameter at a bound is treated as fixed.

    Args:
        evidence: the fitted model and the tests.
        bounds: limits of parameters inside their general limits.
        resolved: names of effects known to belong to the bushing and not to the rig; the model's other effects with a
            twin in the rig are reported as unresolved.
        lacking: False if the record of the tests has a mistake, so that no error of the model is estimated.
        corrected: fit together with a smooth correction of the model; None if the model has no correction.
        rig: stated accuracy class of the rig (gain and phase errors).
        fixed: covariance of parameters that the fit kept fixed; None if these are exact.

    Returns:
        The model with covariance, quality, range, warnings and expected error.
    """
    model, solution, error, misses = evidence.model, evidence.solution, None, list[str]()
    if corrected:
        solution = replace(corrected, noise_weighted=evidence.data_sets)
    elif lacking:
        solution, error, misses = with_excess_errors(solution, bounds, rig, partial(_with_levels, solution))
        model = solution.model
    notes = (
        *([_CORRECTED] if corrected else misses),
        *temperature_warning(model, evidence.data_sets),
    )
    return replace(
        build_result([solution], bounds, model=model, fixed=fixed, notes=notes, bounded_is_fixed=True),
        # a correction has seen every run
        usable=expected_errors(model, evidence.data_sets, fit=None if corrected else solution),
        model_error=error,
        unresolved=tuple(effect.name for effect in model.records if effect.twins and effect.name not in resolved),
    )


def _with_levels(solution: FitResult, errors: LevelErrors) -> FitResult:
    """Repeat a fit with noise that contains errors shared by all runs of a level."""
    tests = with_level_errors(solution.problem.tests, errors.error, errors.freedom)
    return Descent.start(replace(solution.problem, model=solution.model, tests=tests)).run(EVALUATIONS).solution
