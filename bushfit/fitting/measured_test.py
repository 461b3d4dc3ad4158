"""Base class of measured loops and sweeps: one test with its noise."""

from abc import ABC, abstractmethod
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from bushfit.effects.contract import Array
from bushfit.geometry import Place
from bushfit.model.model import Kind, Model
from bushfit.reading.measurement import Loop, Source, Sweep


class MeasuredBase(ABC):
    """One measured test, a loop or a sweep, with its noise.

    Fits, quality figures, pictures and the diagnosis use both kinds in the same way; `MeasuredLoop` documents the
    methods. A whitened residual is model minus measured in units of noise; residuals are independent with unit variance
    if the model is right. A loop of n points has n residuals, a sweep 2 n: all gains, then all phases.

    Args:
        kind: "loop" or "sweep".
        components: names of the residuals of a point: "force", or "storage" and "loss".
    """

    kind: ClassVar[Kind]
    components: ClassVar[tuple[str, ...]]

    @property
    @abstractmethod
    def test(self) -> Loop | Sweep:
        """Measured data as read from the file."""

    @property
    @abstractmethod
    def weights(self) -> Array:
        """Weight of each point, (n,): 1 full, 0 left out; for a long loop the number of rows averaged in the point."""

    @abstractmethod
    def relative_difference(self, model: Model) -> Array:
        """Model minus measured at each of the n points, relative to the measured |K| or half the force range of a loop.

        Returns:
            Real and imaginary part of the stiffness difference of a sweep, (2, n), or force difference of a loop, (1,
            n).
        """

    @property
    def residuals_per_point(self) -> int:
        """Number of residuals of a point: 1 for a force, 2 for a complex stiffness."""
        return len(self.components)

    @property
    def name(self) -> str:
        return self.test.name

    @property
    def direction(self) -> Place:
        return self.test.direction

    @property
    def source(self) -> Source | None:
        """Source file of the test; None for a simulated test."""
        return self.test.source

    def relative(self, model: Model) -> Array:
        """Magnitude of the relative difference of model and test at each point with weight, (n,), for the NRMSE.

        The difference is that of the complex stiffness relative to |K|, or of a loop's force relative to half its
        range.
        """
        return np.linalg.norm(self.relative_difference(model)[:, self.weights > 0.0], axis=0)

    def change(self, model: Model, reference: Model) -> float:
        """Largest difference between two models over the points of the test.

        Returns:
            Magnitude of the difference of the complex stiffness relative to |K|, or of the force relative to half the
            force range of a loop.
        """
        difference = self.relative_difference(model) - self.relative_difference(reference)
        return float(np.linalg.norm(difference, axis=0).max())

    @cached_property
    def _last(self) -> dict[str, tuple[Model, Any, Array]]:
        """Cache of the last force or stiffness and its derivatives by key, each with its model and parameter names."""
        return {}

    def _keep(self, key: str, model: Model, names: Any, values: Array) -> Array:
        """Cache an array, read-only, for the next call with the same key, model and parameter names, and return it.

        Args:
            key: name of the cached quantity, such as "force" or "jacobian".
            model: model that the values belong to.
            names: names of the parameters of a Jacobian; empty for a response.
            values: array to cache.
        """
        values.flags.writeable = False
        self._last[key] = model, names, values
        return values


def shown_amplitude(direction: Place, amplitude: float) -> str:
    """Format an amplitude [m or rad] in display units, such as "0.1 mm"."""
    unit, factor = direction.display.displacement
    return f"{amplitude * factor:.4g} {unit}"
