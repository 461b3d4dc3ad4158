"""Tests that share an error of the model, so that their residuals are whitened together."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.common_error import CommonError
from bushfit.fitting.data_sets import DataSet


@dataclass(frozen=True, eq=False)
class Joined(Sequence[DataSet]):
    """Data sets with an error in common beside the noise of each.

    Args:
        freedom: degrees of freedom that tell the size of the error.
    """

    data_sets: tuple[DataSet, ...]
    error: CommonError
    freedom: float

    @overload
    def __getitem__(self, index: int) -> DataSet: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[DataSet]: ...
    def __getitem__(self, index: int | slice) -> DataSet | Sequence[DataSet]:
        return self.data_sets[index]

    def __len__(self) -> int:
        return len(self.data_sets)

    def unsure(self, influence: Array) -> Array:
        """As `DataSet.unsure`, of the variance of the error, (k, n) -> (k, n)."""
        vectors, size = self.error.along
        moved = self.error.seen.of(influence) @ vectors * np.square(size) * np.sqrt(2.0 / self.freedom)
        return self.error.seen.back(moved @ vectors.T)

    def beside(self, jacobian: Array) -> Array:
        """Derivatives of residuals in units of noise, (k, n), with those by the amounts below, and what is known of the
        amounts beforehand as q more residuals, (k + q, n + q)."""
        k, columns = len(jacobian), self.error.seen.back(self.error.columns)
        return np.block([[jacobian, np.zeros((k, len(columns)))], [columns, np.eye(len(columns))]])
