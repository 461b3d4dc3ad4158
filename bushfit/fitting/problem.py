"""A least-squares problem, with its model, tests, free parameters and bounds, and its result."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from bushfit.effects.contract import AT_BOUND, Array
from bushfit.errors import FitError
from bushfit.fitting.coordinates import ROUNDING, Bounds, Coordinates, coordinate_bounds, prior_rows
from bushfit.fitting.preparation import MeasuredTest, residual_slices
from bushfit.fitting.shared_errors import SharedErrors
from bushfit.model.covariance import Z95
from bushfit.model.model import Model
from bushfit.model.result import End, Outlier
from bushfit.model.sensitivity import difference_quotients, stepped_values

#: Smallest distance of the start values from the bounds, relative to the distance between the bounds: the conversion
#: between values and coordinates rounds.
_INSIDE = 1e-12


@dataclass(frozen=True, eq=False)
class FitProblem:
    """Least-squares problem: a model, the tests to fit it to, and its free parameters; all others are fixed.

    Args:
        model: model with the start values.
        tests: tests with their noise.
        names: names of the k free parameters.
        bounds: limits of parameters [SI] by name, inside their default limits.
        shared_error: error that the residuals of all tests share in addition to the noise of each test; or None.
    """

    model: Model
    tests: Sequence[MeasuredTest]
    names: Sequence[str]
    bounds: Bounds = field(default_factory=dict)
    shared_error: SharedErrors | None = None

    @classmethod
    def with_fixed(
        cls, model: Model, tests: Sequence[MeasuredTest], fixed: Collection[str], bounds: Bounds
    ) -> FitProblem:
        """Build the problem in which all parameters of the model are free except the fixed ones.

        Args:
            model: model with the start values.
            tests: tests with their noise.
            fixed: names of the fixed parameters.
            bounds: limits of parameters [SI] by name, inside their default limits.
        """
        return cls(model, tests, [name for name in model.parameters if name not in (*fixed, *model.tied_names)], bounds)

    @cached_property
    def coordinates(self) -> Coordinates:
        """Map between values and dimensionless coordinates of the free parameters."""
        return Coordinates.of_parameters(self.model, self.names)

    @cached_property
    def limits(self) -> tuple[Array, Array]:
        """Lower and upper bounds of the free parameters' coordinates, (k,) each."""
        low, high = coordinate_bounds(self.coordinates, self.bounds)
        inside = _INSIDE * (high - low)
        return low + inside, high - inside

    def residual(self, model: Model) -> Array:
        """Whitened residuals of the tests, then of the p priors of the model, (n + p,)."""
        rows = np.concatenate([*(test.residual(model) for test in self.tests), prior_rows(model, ())[0]])
        return self.shared_error.whiten(rows) if self.shared_error else rows

    def linearise(self, model: Model) -> tuple[Array, Array]:
        """Whitened residuals, and their derivatives with respect to the coordinates of the k free parameters.

        Args:
            model: model at whose values the derivatives are taken.

        Returns:
            Residuals of the n points and of the p priors of the model, (n + p,), and their derivatives, (k, n + p).
        """
        free, varied = len(self.names), (*self.names, *model.tied_names)
        of_priors, prior_slopes = prior_rows(model, self.names)
        count = sum(test.size for test in self.tests)
        rows = np.zeros((1 + len(varied), count + of_priors.size))
        for test, block in zip(self.tests, residual_slices(self.tests), strict=True):
            if (of_test := test.recall("rows", model, varied)) is None:
                values, steps = stepped_values(model, varied, test.direction)
                response = test.response(model, values)
                test.keep("response", model, np.atleast_2d(response)[-1])
                stepped = test.residual_of(response)
                of_test = test.keep("rows", model, np.vstack(difference_quotients(stepped, steps)), varied)
            rows[:, block] = of_test
        residual, jacobian = rows[0], rows[1:]
        if model.tied_names:
            jacobian = jacobian[:free] + model.constraints.slopes(model.values, self.names) @ jacobian[free:]
        jacobian *= self.coordinates.slopes(model.values)[:, None]
        residual[count:], jacobian[:, count:] = of_priors, prior_slopes
        if self.shared_error:
            return self.shared_error.whiten(residual), self.shared_error.whiten(jacobian)
        return residual, jacobian

    @property
    def start(self) -> Array:
        """Coordinates of the start values, moved inside the bounds, (k,).

        Raises:
            FitError: there are not more residuals than parameters.
        """
        points = sum(test.size for test in self.tests) + prior_rows(self.model, ())[0].size
        if points <= len(self.names):
            raise FitError("too few points for the fit", found=f"{points} points for {len(self.names)} parameters")
        positive = {name: part.bounds[0] for name, part in self.model.parameters.items() if part.log}
        values = {name: value or positive.get(name, 0.0) for name, value in self.model.values.items()}
        return np.clip(self.coordinates.point(values), *self.limits)

    def at_bound(self, point: Array) -> dict[str, End]:
        """Names of the parameters that are at a bound, each with the bound ("min" or "max").

        Args:
            point: dimensionless coordinates of the k free parameters, (k,).
        """
        low, high = self.limits
        near = AT_BOUND * np.minimum(high - low, 1.0)
        rooms: dict[End, Array] = {"min": point - low, "max": high - point}
        return {
            name: end for end, room in rooms.items() for name, met in zip(self.names, room < near, strict=True) if met
        }


@dataclass(frozen=True, eq=False)
class SmoothError:
    """Smooth error of a model over operating points (a Gaussian process), which adds to the errors of parameters.

    Args:
        columns: change of d components of the whitened residuals of all tests for each of q independent patterns of the
            error, at one standard deviation, (q, d).
        project: function that reduces the n residuals, (..., n), to these components, (..., d).
        freedom: degrees of freedom of the estimated standard deviation of the error.
    """

    columns: Array
    project: Callable[[Array], Array]
    freedom: float


@dataclass(frozen=True, eq=False)
class FitResult:
    """Result of a least-squares fit.

    Args:
        problem: least-squares problem; its tests have the weights at which the sum of squares is minimal.
        model: fitted model.
        residual: whitened residuals of the tests, model minus measured, then of the priors of the model, (n,).
        jacobian: derivatives of the residuals with respect to the coordinates, (k, n).
        evaluations: number of model evaluations.
        at_bound: names of the parameters that ended at a bound, with the bound ("min" or "max").
        stopped: True if the fit was stopped before it converged.
        covariance_tests: tests, weighted as for the covariance of the parameters; empty if these are the problem's.
        noise_weighted: tests, weighted by their noise alone, with weight 0 for excluded outliers; empty if these are
            the problem's.
        outliers: outliers by file and row.
        smooth_error: smooth error of the model, if the model misses the tests by more than their noise; else None.
    """

    problem: FitProblem
    model: Model
    residual: Array
    jacobian: Array
    evaluations: int = 1
    at_bound: Mapping[str, End] = field(default_factory=dict)
    stopped: bool = False
    covariance_tests: Sequence[MeasuredTest] = ()
    noise_weighted: Sequence[MeasuredTest] = ()
    outliers: tuple[Outlier, ...] = ()
    smooth_error: SmoothError | None = None

    @property
    def names(self) -> Sequence[str]:
        """Names of the fitted parameters."""
        return self.problem.names

    @property
    def coordinates(self) -> Coordinates:
        """Map between values and dimensionless coordinates of the fitted parameters."""
        return self.problem.coordinates

    @property
    def data_sets(self) -> Sequence[MeasuredTest]:
        """Tests weighted by their noise alone, for quality and warnings; excluded outliers have weight 0."""
        return self.noise_weighted or self.problem.tests

    @cached_property
    def residual_rows(self) -> Mapping[MeasuredTest, slice]:
        """Slice of the residuals of each test in `residual`."""
        return dict(zip(self.data_sets, residual_slices(self.data_sets), strict=True))

    def row_span(self, tests: Sequence[MeasuredTest]) -> slice:
        """Slice of `residual` from the first to the last residual of `tests`, which are neighbours in the fit."""
        slices = [self.residual_rows[test] for test in tests]
        return slice(min(rows.start for rows in slices), max(rows.stop for rows in slices))

    @property
    def fixed_names(self) -> list[str]:
        """Names of the parameters that the fit kept at their values."""
        return [name for name in self.model.values if name not in self.names]

    def stage(self, fixed: Collection[str] = ()) -> FitProblem:
        """Problem of this fit with the tests weighted as for the covariance, and parameters in `fixed` not free."""
        names = [name for name in self.names if name not in fixed]
        return replace(self.problem, tests=self.covariance_tests or self.problem.tests, names=names)

    @property
    def chi_square(self) -> float:
        """Chi-square: sum of the squared whitened residuals."""
        return float(self.residual @ self.residual)

    @property
    def mean_square(self) -> float:
        """Chi-square divided by the number of residuals (not by the degrees of freedom)."""
        return self.chi_square / max(sum(test.residual_count for test in self.data_sets), 1)

    @property
    def reduced_chi_square(self) -> float:
        """Chi-square per degree of freedom; 1 if the residuals are noise alone."""
        count = sum(test.residual_count for test in self.data_sets)
        return self.chi_square / max(count - len(self.names), 1)

    @property
    def inner_indices(self) -> list[int]:
        """Indices of the fitted parameters that are not at a bound."""
        return [i for i, name in enumerate(self.names) if name not in self.at_bound]

    @property
    def at_minimum(self) -> bool:
        """True if a further Gauss-Newton step would lower chi-square by less than chance does (3.84 at 95 %)."""
        return self.expected_fall(self.at_bound) <= Z95**2 * max(self.chi_square / self.residual.size, 1.0)

    def expected_fall(self, fixed: Collection[str]) -> float:
        """Decrease of chi-square expected from one Gauss-Newton step of all parameters not named in `fixed`."""
        free = [i for i, name in enumerate(self.names) if name not in fixed]
        left_vectors, values, _ = np.linalg.svd(self.jacobian[free].T, full_matrices=False)
        significant = values > ROUNDING * values.max(initial=0.0)
        return float(np.sum(np.square(left_vectors[:, significant].T @ self.residual)))

    def with_shared_error(self, error: SharedErrors) -> FitResult:
        """Return the result with residuals and derivatives whitened by an error that all tests share."""
        problem = replace(self.problem, shared_error=error)
        return replace(
            self, problem=problem, residual=error.whiten(self.residual), jacobian=error.whiten(self.jacobian)
        )

    def reevaluate(self, model: Model, tests: Sequence[MeasuredTest]) -> FitResult:
        """Compute residuals and Jacobian for other parameter values or other tests, without a fit.

        Args:
            model: model with the same parameters.
            tests: tests.

        Returns:
            Result with the new residuals and Jacobian, without an error shared by the tests; outliers and bounds are
            copied from this result.
        """
        problem = replace(self.problem, tests=tests, shared_error=None)
        residual, jacobian = problem.linearise(model)
        return replace(self, problem=problem, model=model, residual=residual, jacobian=jacobian)
