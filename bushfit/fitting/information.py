"""What tests tell about parameters: Fisher information, and the standard errors that follow from it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.data_sets import DataSet
from bushfit.fitting.solve import jacobian
from bushfit.model.model import Model

#: Least size of a parameter, relative to its typical value, that a relative change is counted from.
_LEAST_SIZE = 0.05
#: Relative standard error beyond which a figure tells nothing more.
_BEYOND = 10.0


@dataclass(frozen=True, eq=False)
class Information:
    """What tests tell about parameters, each relative to its size.

    Args:
        names: of the k parameters.
        matrix: Fisher information J J^T, (k, k), where J holds the derivatives of the whitened residuals by relative
            change.
    """

    names: tuple[str, ...]
    matrix: Array

    @classmethod
    def of(cls, model: Model, data_sets: Sequence[DataSet], names: Sequence[str]) -> "Information":
        """What some data sets tell about the named parameters of a model at its values."""
        slope = jacobian(model, data_sets, names) * relative_sizes(model, names)[:, None]
        return cls(tuple(names), slope @ slope.T)

    def with_more(self, model: Model, data_sets: Sequence[DataSet]) -> "Information":
        """What further data sets tell as well."""
        return replace(self, matrix=self.matrix + Information.of(model, data_sets, self.names).matrix)

    def directions(self) -> tuple[Array, Array]:
        """Relative standard errors, (k,), of the eigenvectors of the information, and these, (k, k) by column."""
        values, vectors = np.linalg.eigh(self.matrix)
        return 1.0 / np.sqrt(np.maximum(values, np.finfo(float).eps * values.max())), vectors

    def errors(self) -> Array:
        """Relative standard error of each parameter, (k,)."""
        errors, vectors = self.directions()
        return np.linalg.norm(vectors * errors, axis=1)

    def error(self, weights: Mapping[str, float]) -> float:
        """Standard error of a sum of relative changes, each with its weight."""
        errors, vectors = self.directions()
        row = np.array([weights.get(name, 0.0) for name in self.names])
        return float(np.linalg.norm(row @ vectors * errors))


def relative_sizes(model: Model, names: Sequence[str]) -> Array:
    """Change of each coordinate of a fit per relative change of its parameter, (k,)."""
    pairs = [(model.parameters[name], abs(model.values[name])) for name in names]
    return np.array([1.0 if each.log else max(value / each.typical, _LEAST_SIZE) for each, value in pairs])


def percent(error: float) -> str:
    """A relative standard error for people: "2.5 %"."""
    return f"{float(f'{100.0 * error:.2g}'):g} %" if error < _BEYOND else "beyond 1000 %"
