"""Base class of measured loops and sweeps: one test with its noise."""

from abc import ABC, abstractmethod
from collections.abc import Hashable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from bushfit.caveat import Caveat
from bushfit.effects.contract import UNKNOWN, Array, RubberConditions, Values
from bushfit.fitting.shared_errors import SharedErrors
from bushfit.geometry import Place
from bushfit.model.model import Kind, Model
from bushfit.reading.measurement import Loop, Source, Sweep


@dataclass(frozen=True, eq=False, kw_only=True)
class MeasuredBase(ABC):
    """One measured test with its noise: a loop from `prepare_loops` or a sweep from `prepare_sweeps`.

    Fits, quality figures, pictures and the diagnosis use both kinds in the same way; this class and `MeasuredLoop`
    document the methods. A loop has n points, its rows (or bins of phase, if it is long), and n residuals; a sweep has
    n operating points and 2 n residuals: all gains, then all phases. Whitened residuals are model minus measured in
    units of noise, independent and of unit variance if the model is right.

    Args:
        kind: "loop" or "sweep".
        components: names of the residuals of a point: "force", or "storage" and "loss".
        test: measured data as read from the file.
        weights: weight of each point, (n,): 1 full, 0 left out; for a long loop, the number of rows averaged in the
            point.
        test_conditions: temperature and earlier strains of the rubber: one number each for a loop, one for each row of
            a sweep's file.
        model_error: standard deviation of the model's error, added to the noise, relative to |K| in phase and in
            quadrature, or relative to half the force range of a loop. 0: noise alone.
        compliance_error: standard deviation of a compliance of the rig that all tests share [m/N].
        contradiction: warning on a disagreement with an earlier test of the same points; None without one.
    """

    kind: ClassVar[Kind]
    components: ClassVar[tuple[str, ...]]
    test: Loop | Sweep
    weights: Array
    test_conditions: RubberConditions = UNKNOWN
    model_error: float = 0.0
    compliance_error: float = 0.0
    contradiction: Caveat | None = None

    @property
    @abstractmethod
    def response_size(self) -> Array:
        """Size of the measured response, to which differences are relative: |K|, (n,), or half the range of a force."""

    @abstractmethod
    def relative_difference(self, model: Model) -> Array:
        """Model minus measured at each of the n points, relative to the measured |K| or half the force range of a loop.

        Returns:
            Real and imaginary part of the stiffness difference of a sweep, (2, n), or force difference of a loop, (1,
            n).
        """

    @abstractmethod
    def response(self, model: Model, values: Values | None = None) -> Array:
        """Response of a model in this test: complex stiffness at each point of a sweep, or force at each row of a loop.

        Args:
            model: model to evaluate; the last response without `values` is cached.
            values: parameter values [SI] in place of the model's; leading axes are added to the result.

        Returns:
            Stiffness [N/m or N m/rad] or force [N or N m], (..., n).
        """

    @abstractmethod
    def residual_of(self, response: Array) -> Array:
        """Whitened residuals, (..., size), of a modelled `response`, (..., n): modelled minus measured."""

    def residual(self, model: Model) -> Array:
        """Whitened residuals: model minus measured in units of noise; independent with variance 1 for a true model.

        Returns:
            Residuals in the force of each row, (size,); of a sweep of n points, n gains, then n phases.
        """
        return self.residual_of(self.response(model))

    @abstractmethod
    def residual_change(self, change: Array, model: Model, added: Array | float = 0.0) -> Array:
        """Change of the whitened residuals, (..., size), due to a small change of the model's stiffness.

        Args:
            change: change of the stiffness, complex: at each point of a sweep, (..., n), or in the first harmonic of a
                loop's force, (..., 1) [N/m or N m/rad].
            model: model whose stiffness changes; not used for a loop.
            added: stiffness that is added to the model's at the points of a sweep, complex (n,) [N/m or N m/rad]; not
                used for a loop.
        """

    @abstractmethod
    def noise_sensitivity(self, influence: Array) -> dict[Hashable, Array]:
        """Change of the weights of the residuals in k estimates if a noise variance changes by its standard error.

        Args:
            influence: change of each estimate per unit of each whitened residual, (k, size).

        Returns:
            Changes of `influence`, (k, size), by identifier of the noise variance.
        """

    @property
    @abstractmethod
    def unit_model_error(self) -> SharedErrors:
        """Error of the model with a standard deviation of 100 % of |K|, or of half the force range of a loop."""

    def with_model_error(self, size: float, **changes: Any) -> Self:
        """Return the test with a model error of this size, relative to |K| or half a loop's force range.

        Args:
            size: standard deviation of the model error.
            changes: further fields of the test to replace that do not change its noise, such as `first_harmonic_errs`.
        """
        test = replace(self, model_error=size, **changes)
        test.__dict__["unit_model_error"] = self.unit_model_error
        return test

    @cached_property
    def model_errors(self) -> SharedErrors:
        """Error of the model with the standard deviation `model_error`, as correlated errors of the residuals."""
        return replace(self.unit_model_error, deviations=self.model_error * self.unit_model_error.deviations)

    def weighted(self, weight: Array) -> Self:
        """Return the test with the weight of each of its n points multiplied by `weight`, (n,)."""
        return replace(self, weights=self.weights * weight)

    def misfit(self, model: Model) -> Array:
        """Model minus measured in units of noise, (size,), for tables: whitened for a sweep, row by row for a loop."""
        return self.residual(model)

    def without(self, points: Array) -> Self:  # noqa: ARG002
        """Return a sweep with weight 0 at the points with the given indices; a loop is unchanged."""
        return self

    def with_weight(self) -> Self:
        """Return a sweep with only those points that have weight; a loop is unchanged."""
        return self

    def fundamental(self) -> Self:
        """Return a loop whose residuals are the two of its first harmonic, as one operating point; sweeps unchanged."""
        return self

    @property
    def residuals_per_point(self) -> int:
        """Number of residuals of a point: 1 for a force, 2 for a complex stiffness."""
        return len(self.components)

    @property
    def name(self) -> str:
        """Name of the test in tables and messages."""
        return self.test.name

    @property
    def direction(self) -> Place:
        """Direction or specimen of the test."""
        return self.test.direction

    @property
    def source(self) -> Source | None:
        """Source file of the test; None for a simulated test."""
        return self.test.source

    def relative_distance(self, model: Model) -> Array:
        """Absolute relative difference of model and test at the w points with weight, (w,), for the NRMSE.

        The difference of the complex stiffness is relative to |K|, that of a loop's force to half the force range.
        """
        return np.linalg.norm(self.relative_difference(model)[:, self.weights > 0.0], axis=0)

    def largest_difference(self, model: Model, reference: Model) -> float:
        """Largest difference between two models over the points of the test.

        Returns:
            Magnitude of the difference of the complex stiffness relative to |K|, or of the force relative to half the
            force range of a loop.
        """
        return float(np.max(np.abs(self.response(model) - self.response(reference)) / self.response_size))

    @cached_property
    def _cache(self) -> dict[str, tuple[Model, Any, Array]]:
        """Cache for `recall` and `keep`: by name of the quantity, its model, parameter names and last array."""
        return {}

    def recall(self, key: str, model: Model, names: Any = ()) -> Array | None:
        """Return the array that `keep` cached for the same key, model and parameter names, or None.

        Args:
            key: name of the cached quantity.
            model: model that the values belong to.
            names: names of the parameters of the derivatives.
        """
        last = self._cache.get(key)
        return last[2] if last and last[0] is model and last[1] == names else None

    def keep(self, key: str, model: Model, values: Array, names: Any = ()) -> Array:
        """Cache an array, read-only, for the next call with the same key, model and parameter names, and return it.

        Args:
            key: name of the cached quantity: "response", or "rows" (residuals and derivatives).
            model: model that the values belong to.
            values: array to cache.
            names: names of the parameters of the derivatives.
        """
        values.flags.writeable = False
        self._cache[key] = model, names, values
        return values


def shown_amplitude(direction: Place, amplitude: float) -> str:
    """Format an amplitude [m or rad] in display units, such as "0.1 mm"."""
    unit, factor = direction.display.displacement
    return f"{amplitude * factor:.4g} {unit}"
