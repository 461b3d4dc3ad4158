"""A model fitted to all tests of a campaign, with the figures by which models are compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.data_sets import DataSet, SweepData
from bushfit.fitting.descent import Descent
from bushfit.fitting.solve import Bounds, Solution
from bushfit.model.model import Model

#: Evaluations of the model in one fit at most; a model that fits badly is then taken as it is.
EVALUATIONS = 40


@dataclass(frozen=True, eq=False)
class Evidence:
    """A model fitted to all tests of a campaign.

    Args:
        solution: where the fit ended.
        data_sets: the tests.
    """

    solution: Solution
    data_sets: tuple[DataSet, ...]

    @property
    def model(self) -> Model:
        return self.solution.model

    @property
    def residual(self) -> Array:
        """Whitened residuals, model less measured, (n,)."""
        return self.solution.residual

    @property
    def chi_square(self) -> float:
        return self.solution.chi_square

    @property
    def parameters(self) -> int:
        return len(self.solution.coordinates.names)

    @property
    def reduced(self) -> float:
        """Reduced chi-square; 1 where only noise is left."""
        return self.chi_square / max(self.counted - self.parameters, 1)

    @property
    def counted(self) -> int:
        """Residuals that carry weight."""
        return sum(data_set.counted for data_set in self.data_sets)

    @property
    def penalty(self) -> float:
        """Price of one parameter by the Bayesian information criterion: ln of the number of residuals."""
        return float(np.log(self.residual.size))

    @property
    def bic(self) -> float:
        """chi-square + parameters ln n; lower is better."""
        return self.chi_square + self.parameters * self.penalty

    @cached_property
    def _span(self) -> Array:
        """Orthonormal basis of what the model's own parameters can absorb, (n, k)."""
        basis, size, _ = np.linalg.svd(self.solution.jacobian.T, full_matrices=False)
        return basis[:, size > 1e-10 * size[0]]

    def beside(self, columns: Array) -> Array:
        """What is left of columns, (c, n), when the model's own parameters have absorbed what they can."""
        return columns - (columns @ self._span) @ self._span.T

    @cached_property
    def slices(self) -> list[slice]:
        """Place of each data set's residuals among all."""
        ends = np.cumsum([data_set.size for data_set in self.data_sets])
        return [slice(int(end - data_set.size), int(end)) for end, data_set in zip(ends, self.data_sets, strict=True)]

    @cached_property
    def blocks(self) -> list[Array]:
        """Indices of the residuals that share an error: one array per block and part (gain, phase) of the sweeps."""
        groups = []
        for data_set, place in zip(self.data_sets, self.slices, strict=True):
            if not isinstance(data_set, SweepData):
                continue
            count = data_set.frequency.size
            edges = [*data_set.block_starts.tolist(), count]
            for part in (place.start, place.start + count):
                groups += [part + np.arange(a, b) for a, b in pairwise(edges)]
        return groups

    @property
    def shared_freedom(self) -> int:
        """Degrees of freedom of the measured variance that blocks share; 0 where it was not measured."""
        sweeps = [data_set for data_set in self.data_sets if isinstance(data_set, SweepData)]
        return sweeps[0].noise.freedom if sweeps else 0


def fit(model: Model, data_sets: Sequence[DataSet], held: Sequence[str], bounds: Bounds) -> Evidence:
    """Fit every parameter of a model but the held ones, from its own values.

    Raises:
        FitError: fewer data than parameters, or no finite response.
        ModelError: no response.
    """
    descent = fit_from(model, data_sets, held, bounds).finished(EVALUATIONS)
    return Evidence(descent.solution, tuple(data_sets))


def fit_from(model: Model, data_sets: Sequence[DataSet], held: Sequence[str], bounds: Bounds) -> Descent:
    """The same fit before its first step."""
    return Descent.start(model, data_sets, [name for name in model.parameters if name not in held], bounds)
