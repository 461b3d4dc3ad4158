"""A least-squares problem, with its model, tests, free parameters and bounds, and its result."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from bushfit.effects.contract import Array
from bushfit.errors import FitError
from bushfit.fitting.coordinates import ROUNDING, Bounds, Coordinates, coordinate_bounds, jacobian, residual
from bushfit.fitting.preparation import MeasuredTest, rows_of
from bushfit.model.covariance import Z95
from bushfit.model.model import Model
from bushfit.model.result import End, Outlier

#: Distance of the start values from the bounds at the least, relative to the room between the bounds: the conversion
#: between values and coordinates rounds.
_INSIDE = 1e-12
#: Distance from a bound, in coordinates, up to which a parameter is at the bound.
_AT_BOUND = 1e-3


@dataclass(frozen=True, eq=False)
class FitProblem:
    """Parameters of a model to be fitted to tests; parameters that are not named are fixed.

    Args:
        model: model with the start values.
        tests: tests with their noise.
        names: k free parameters.
        bounds: limits inside the parameters' own [SI].
    """

    model: Model
    tests: Sequence[MeasuredTest]
    names: Sequence[str]
    bounds: Bounds = field(default_factory=dict)

    @classmethod
    def with_fixed(
        cls, model: Model, tests: Sequence[MeasuredTest], fixed: Collection[str], bounds: Bounds
    ) -> FitProblem:
        """The problem in which all parameters of the model are free except those that are fixed.

        Args:
            model: model with the start values.
            tests: tests with their noise.
            fixed: names of the fixed parameters.
            bounds: limits inside the parameters' own [SI].
        """
        return cls(model, tests, [name for name in model.parameters if name not in fixed], bounds)

    @cached_property
    def coordinates(self) -> Coordinates:
        """Coordinates of the free parameters."""
        return Coordinates.of_parameters(self.model, self.names)

    @cached_property
    def limits(self) -> tuple[Array, Array]:
        """Lower and upper bounds of the coordinates, (k,) each."""
        low, high = coordinate_bounds(self.coordinates, self.bounds)
        inside = _INSIDE * (high - low)
        return low + inside, high - inside

    @property
    def start(self) -> Array:
        """Coordinates of the start values, moved inside the bounds, (k,).

        Raises:
            FitError: not more residuals than parameters.
        """
        points = sum(test.size for test in self.tests)
        if points <= len(self.names):
            raise FitError("too few points for the fit", found=f"{points} points for {len(self.names)} parameters")
        positive = {name: part.bounds[0] for name, part in self.model.parameters.items() if part.log}
        values = {name: value or positive.get(name, 0.0) for name, value in self.model.values.items()}
        return np.clip(self.coordinates.point(values), *self.limits)

    def at_bound(self, point: Array) -> dict[str, End]:
        """Parameters that are at a bound at a point, (k,), and at which bound."""
        low, high = self.limits
        near = _AT_BOUND * np.minimum(high - low, 1.0)
        rooms: dict[End, Array] = {"min": point - low, "max": high - point}
        return {
            name: end for end, room in rooms.items() for name, met in zip(self.names, room < near, strict=True) if met
        }


@dataclass(frozen=True, eq=False)
class Process:
    """A Gaussian process of the relative error of a model, as a part of the covariance of its residuals.

    Args:
        shapes: one standard deviation of each amount at the operating points of all tests, complex (q, p).
        freedom: degrees of freedom that determine its size.
    """

    shapes: Array
    freedom: float

    def covariance(self, model: Model, tests: Sequence[MeasuredTest], influence: Array) -> Array:
        """Covariance of parameters that the process causes, (k, k).

        Args:
            model: fitted model.
            tests: tests.
            influence: of each whitened residual on the parameters, (k, n).

        Returns:
            Covariance in the coordinates of the influence, (k, k).
        """
        first, changes = 0, np.zeros((len(influence), len(self.shapes)))
        for test, rows in zip(tests, rows_of(tests), strict=True):
            last = first + test.frequency.size
            change = self.shapes[:, first:last] * test.noise_free(model).measured
            changes += influence[:, rows] @ test.residual_change(change, model).T
            first = last
        return np.asarray(changes @ changes.T)


@dataclass(frozen=True, eq=False)
class FitResult:
    """Minimum of a least-squares problem.

    Args:
        problem: the problem; its tests have the weights of the minimum.
        model: fitted model.
        residual: whitened residuals, model less measured, (n,).
        jacobian: their derivatives by coordinate, (k, n).
        evaluations: of the model.
        at_bound: parameters that ended at a bound, and at which.
        stopped: True if the fit was stopped before it converged.
        weighed: tests with the weights that give the covariance, if these differ from the problem's.
        unsoftened: tests with the weights of their noise alone, if these differ; outliers left out have none.
        outliers: by file and row.
        process: error of the model, where the model misses the tests.
    """

    problem: FitProblem
    model: Model
    residual: Array
    jacobian: Array
    evaluations: int = 1
    at_bound: Mapping[str, End] = field(default_factory=dict)
    stopped: bool = False
    weighed: Sequence[MeasuredTest] = ()
    unsoftened: Sequence[MeasuredTest] = ()
    outliers: tuple[Outlier, ...] = ()
    process: Process | None = None

    @property
    def names(self) -> Sequence[str]:
        """Fitted parameters."""
        return self.problem.names

    @property
    def coordinates(self) -> Coordinates:
        """Coordinates of the fitted parameters."""
        return self.problem.coordinates

    @property
    def minimised(self) -> Sequence[MeasuredTest]:
        """Tests with the weights at which the fit is the least sum of squares."""
        return self.problem.tests

    @property
    def data_sets(self) -> Sequence[MeasuredTest]:
        """Tests with the weights of their noise alone; outliers left out have none."""
        return self.unsoftened or self.problem.tests

    @property
    def chi_square(self) -> float:
        """Sum of the squared residuals."""
        return float(self.residual @ self.residual)

    @property
    def moving(self) -> list[int]:
        """Indices of the parameters that are not at a bound."""
        return [i for i, name in enumerate(self.names) if name not in self.at_bound]

    @property
    def flat(self) -> bool:
        """True if the next step would lower chi-square by less than chance does."""
        return self.gain(self.at_bound) <= Z95**2 * max(self.chi_square / self.residual.size, 1.0)

    def gain(self, fixed: Collection[str]) -> float:
        """Fall of chi-square by one Gauss-Newton step with some parameters fixed."""
        free = [i for i, name in enumerate(self.names) if name not in fixed]
        left_vectors, values, _ = np.linalg.svd(self.jacobian[free].T, full_matrices=False)
        significant = values > ROUNDING * values.max(initial=0.0)
        return float(np.sum(np.square(left_vectors[:, significant].T @ self.residual)))

    def moved_to(self, model: Model, tests: Sequence[MeasuredTest]) -> FitResult:
        """Move the result to the values of another model, with the residuals of other tests.

        Args:
            model: model with the same parameters.
            tests: tests.

        Returns:
            The result there, with the outliers and bounds of this one.
        """
        problem = replace(self.problem, tests=tests)
        return replace(
            self,
            problem=problem,
            model=model,
            residual=residual(model, tests),
            jacobian=jacobian(model, tests, self.names),
        )
