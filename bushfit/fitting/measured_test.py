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
    """One measured test with its noise; `preparation.MeasuredTest` is either of its kinds, a loop or a sweep.

    Fits, quality figures, pictures and the diagnosis use both kinds in the same way; `MeasuredLoop` documents the
    methods. A whitened residual is model less measured in units of noise; residuals are independent with unit variance
    if the model is right. A loop of n points has n residuals, a sweep 2 n: all gains, then all phases.

    Args:
        kind: "loop" or "sweep".
        components: quantities that the residuals of a point belong to: force, or storage and loss.
    """

    kind: ClassVar[Kind]
    components: ClassVar[tuple[str, ...]]

    @property
    @abstractmethod
    def test(self) -> Loop | Sweep:
        """Measurement behind the test."""

    @property
    @abstractmethod
    def weights(self) -> Array:
        """Share of its weight that each point has, (n,); of a long loop the rows behind it."""

    @abstractmethod
    def relative_difference(self, model: Model) -> Array:
        """Model less measured of every point, relative to |K| or to half a loop's force range, (parts, n)."""

    @property
    def parts(self) -> int:
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
        """The file of the test, if any."""
        return self.test.source

    def relative(self, model: Model) -> Array:
        """Size of the relative difference of the points that carry weight, for NRMSE, (n,)."""
        return np.linalg.norm(self.relative_difference(model)[:, self.weights > 0.0], axis=0)

    def change(self, one: Model, reference: Model) -> float:
        """Largest relative difference between two models."""
        return float(np.linalg.norm(self.relative_difference(one) - self.relative_difference(reference), axis=0).max())

    @cached_property
    def _last(self) -> dict[str, tuple[Model, Any, Array]]:
        """Last response and derivatives of the response, with their model and the names of the parameters."""
        return {}

    def _keep(self, key: str, model: Model, names: Any, values: Array) -> Array:
        """Store values for the next call with the same model; they become read-only."""
        values.flags.writeable = False
        self._last[key] = model, names, values
        return values


def shown_amplitude(direction: Place, amplitude: float) -> str:
    """An amplitude [m or rad] as engineers read it: "0.1 mm"."""
    unit, factor = direction.display.displacement
    return f"{amplitude * factor:.4g} {unit}"
