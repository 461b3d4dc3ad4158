"""What loops and sweeps are asked alike: residuals in units of noise, their derivatives, and what looks odd in them.

A data set is one measured test with its noise. Fits, quality figures, pictures and the diagnosis ask it the questions
of `DataSet` and need not know which kind of test it is.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from functools import wraps
from typing import Any, ClassVar, Self

import numpy as np

from bushfit.effects.contract import Array, Circumstances, Values
from bushfit.geometry import Place
from bushfit.model.model import Kind, Model
from bushfit.model.result import Outlier
from bushfit.reading.measurement import Loop, Source, Sweep


class DataSet(ABC):
    """One measured test with its noise: what every loop and every sweep answers.

    A whitened residual is model less measured in units of noise; residuals are independent with unit variance where
    the model is right. Of n points a loop has n residuals, a sweep 2 n: all gains, then all phases.

    Args:
        kind: whether it is a loop or a sweep.
        components: what a point's residuals are of: force, or storage and loss.
        beside: what another test says otherwise, in words; see `data_sets.told_of_others`.
    """

    kind: ClassVar[Kind]
    components: ClassVar[tuple[str, ...]]
    beside: str | None

    @property
    def parts(self) -> int:
        """Numbers that make up a point: 1 for a force, 2 for a complex stiffness."""
        return len(self.components)

    @property
    @abstractmethod
    def test(self) -> Loop | Sweep:
        """What was measured."""

    @property
    def name(self) -> str:
        """Of the test."""
        return self.test.name

    @property
    def direction(self) -> Place:
        """Of the test."""
        return self.test.direction

    @property
    def source(self) -> Source | None:
        """The file it came from; None where it came from none."""
        return self.test.source

    @property
    def notes(self) -> Sequence[str]:
        """What is odd about the record, for the user."""
        return self.source.notes if self.source else ()

    @property
    @abstractmethod
    def size(self) -> int:
        """Number of residuals."""

    @property
    @abstractmethod
    def counted(self) -> int:
        """Number of residuals that carry weight."""

    @property
    def independent(self) -> float:
        """Number of independent points behind what varies slowly: fewer than `counted` where noise is correlated."""
        return float(self.counted)

    @property
    @abstractmethod
    def frequency(self) -> Array:
        """Of the operating points [Hz], (n,); a loop has one."""

    @property
    @abstractmethod
    def amplitude(self) -> Array:
        """Of the operating points, zero-to-peak [m or rad], (n,); a loop has one."""

    @property
    @abstractmethod
    def circumstances(self) -> Circumstances:
        """What the operating points were measured under, as `frequency`."""

    @property
    @abstractmethod
    def measured(self) -> Array:
        """Complex stiffness at the operating points [N/m or N m/rad], (n,)."""

    @property
    @abstractmethod
    def relative_noise(self) -> float:
        """Standard deviation of one point, relative to |K| or to half a loop's force range."""

    @abstractmethod
    def residual(self, model: Model, values: Values | None = None) -> Array:
        """Whitened residuals, (..., size); `values` in place of the model's own add leading axes."""

    @abstractmethod
    def jacobian(self, model: Model, names: Sequence[str]) -> Array:
        """Derivatives of the whitened residuals by fit coordinate, (len(names), size)."""

    @abstractmethod
    def moved(self, change: Array, model: Model, beside: Array | float = 0.0) -> Array:
        """What a small change of the model's stiffness at the operating points, complex (..., n) [N/m or N m/rad], does
        to the whitened residuals, (..., size), with another stiffness beside the model's; a loop changes by its first
        harmonic."""

    @abstractmethod
    def residual_with(self, added: Array, model: Model) -> Array:
        """Whitened residuals with a stiffness of any size added, complex (n,), (size,); as `moved`, but exact."""

    @abstractmethod
    def jacobian_with(self, added: Array, model: Model, names: Sequence[str], *, as_share: bool) -> Array:
        """As `jacobian`, of `residual_with`: what is added stays as it is, or stays the same share of the model's."""

    @abstractmethod
    def off(self, model: Model) -> Array:
        """Model less measured of every point, relative to |K| or to half a loop's force range, (parts, n)."""

    @property
    @abstractmethod
    def weights(self) -> Array:
        """Share of its weight that each point has, (n,); of a long loop the rows behind it."""

    def relative(self, model: Model) -> Array:
        """Size of the misfit of the points that carry weight, relative as `off`, for NRMSE."""
        return np.linalg.norm(self.off(model)[:, self.weights > 0.0], axis=0)

    @abstractmethod
    def distance(self, model: Model) -> Array:
        """How far each point lies off the model, in units of noise, (n,)."""

    def misfit(self, model: Model) -> Array:
        """As `residual`, but each row of a loop in units of its own noise, whatever those before it tell, (size,)."""
        return self.residual(model)

    @abstractmethod
    def shown(self, model: Model) -> Array:
        """As `misfit`, and of points without weight how far one lies off, in units of noise, (size,)."""

    def change(self, one: Model, other: Model) -> float:
        """Largest difference between two models, relative as `off`."""
        return float(np.linalg.norm(self.off(one) - self.off(other), axis=0).max())

    @abstractmethod
    def noise_free(self, model: Model) -> Self:
        """The same test as the model would have it, without noise."""

    @abstractmethod
    def weighted(self, weight: Array) -> Self:
        """The same test with the weight of each point, (n,), times a share."""

    def without(self, points: Array) -> Self:  # noqa: ARG002
        """The same test with no weight on some of its points, by number."""
        return self

    def standing(self) -> Self:
        """The part of the test that carries weight."""
        return self

    def timeless(self) -> Self:
        """The same test as far as an addition without a law in time can answer it: a loop by its first harmonic."""
        return self

    @abstractmethod
    def outlying(self, model: Model) -> Array:
        """Numbers of the points that are outliers: far off the model and off their neighbours alike."""

    @abstractmethod
    def outliers(self, points: Array, model: Model) -> Iterator[Outlier]:
        """Outliers by file and row."""

    @abstractmethod
    def unsure(self, influence: Array) -> Mapping[Hashable, Array]:
        """How an estimator reacts to each variance of the noise that was itself estimated.

        Args:
            influence: what the estimator takes of each whitened residual, (k, size).

        Returns:
            Per variance, (k, size): the influence times the whitened derivative of the residuals' covariance by that
            variance, times its standard error.
        """

    @abstractmethod
    def smooth_misfit(self, model: Model) -> float:
        """Largest smooth misfit, relative to |K| or to half a loop's force range."""

    @abstractmethod
    def columns(self) -> Mapping[str, Any]:
        """What names each residual's point in a table: columns by header."""


def kept(answer: Callable[..., Array]) -> Callable[..., Array]:
    """Keeps what a data set answered to the last model; of values in place of the model's own nothing is kept."""
    place = f"_last_{answer.__name__}"

    @wraps(answer)
    def asked(data_set: Any, model: Model, beside: Sequence[str] | Values | None = None) -> Array:
        if isinstance(beside, Mapping):
            return answer(data_set, model, beside)
        question = () if beside is None else (tuple(beside),)
        last = data_set.__dict__.get(place)
        if last is None or last[0] is not model or last[1] != question:
            last = data_set.__dict__[place] = (model, question, answer(data_set, model, *question))
            last[2].flags.writeable = False
        return last[2]

    return asked


def keep(data_set: DataSet, answer: str, model: Model, found: Array) -> None:
    """Let a data set know an answer to a model that came with another one; `answer` is a method that is `kept`."""
    data_set.__dict__[f"_last_{answer}"] = model, (), found
    found.flags.writeable = False


def shown_amplitude(direction: Place, amplitude: float) -> str:
    """An amplitude [m or rad] as engineers read it: "0.1 mm"."""
    unit, factor = direction.display.displacement
    return f"{amplitude * factor:.4g} {unit}"
