"""Base class of loops and sweeps as data: one measured test with its noise."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from typing import Any, ClassVar

import numpy as np

from bushfit.effects.contract import Array, Values
from bushfit.geometry import Place
from bushfit.model.model import Kind, Model
from bushfit.reading.measurement import Loop, Source, Sweep


class MeasuredBase(ABC):
    """One measured test with its noise; `preparation.MeasuredTest` is either of its kinds, a loop or a sweep.

    Fits, quality figures, pictures and the diagnosis use both kinds in the same way; `MeasuredLoop` documents the
    methods. A whitened residual is model less measured in units of noise; residuals are independent with unit variance
    if the model is right. A loop of n points has n residuals, a sweep 2 n: all gains, then all phases.

    Args:
        kind: whether it is a loop or a sweep.
        components: what a point's residuals are of: force, or storage and loss.
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
        """Numbers that make up a point: 1 for a force, 2 for a complex stiffness."""
        return len(self.components)

    @property
    def name(self) -> str:
        return self.test.name

    @property
    def direction(self) -> Place:
        return self.test.direction

    @property
    def source(self) -> Source | None:
        """The file it came from; None where it came from none."""
        return self.test.source

    def relative(self, model: Model) -> Array:
        """Size of the misfit of the points that carry weight, relative as `off`, for NRMSE."""
        return np.linalg.norm(self.relative_difference(model)[:, self.weights > 0.0], axis=0)

    def change(self, one: Model, reference: Model) -> float:
        """Largest difference between two models, relative as `off`."""
        return float(np.linalg.norm(self.relative_difference(one) - self.relative_difference(reference), axis=0).max())


def cache_last(answer: Callable[..., Array]) -> Callable[..., Array]:
    """Keeps what a data set answered to the last model; of values in place of the model's own nothing is kept.

    Returns:
        The method, with a cache of its last result.
    """
    place = f"_last_{answer.__name__}"

    @wraps(answer)
    def cached(data_set: Any, model: Model, argument: Sequence[str] | Values | None = None) -> Array:
        """Result of the method, from the cache if model and argument are those of the last call.

        Args:
            data_set: test that the method belongs to.
            model: model that the result belongs to.
            argument: names of parameters, or values in place of the model's.

        Returns:
            Result, read-only.
        """
        if isinstance(argument, Mapping):
            return answer(data_set, model, argument)
        question = () if argument is None else (tuple(argument),)
        last = data_set.__dict__.get(place)
        if last is None or last[0] is not model or last[1] != question:
            last = data_set.__dict__[place] = (model, question, answer(data_set, model, *question))
            last[2].flags.writeable = False
        return last[2]

    return cached


def store_last(data_set: MeasuredBase, answer: str, model: Model, found: Array) -> None:
    """Store a result that came with another one, for a method decorated with `cache_last`.

    Args:
        data_set: test whose cache is filled.
        answer: name of the method.
        model: model that the result belongs to.
        found: the result; it becomes read-only.
    """
    data_set.__dict__[f"_last_{answer}"] = model, (), found
    found.flags.writeable = False


def shown_amplitude(direction: Place, amplitude: float) -> str:
    """An amplitude [m or rad] as engineers read it: "0.1 mm"."""
    unit, factor = direction.display.displacement
    return f"{amplitude * factor:.4g} {unit}"
