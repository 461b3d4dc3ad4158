"""A model fitted to all tests of a campaign, with the figures by which models are compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.data_set import DataSet, Freedoms
from bushfit.fitting.descent import Descent
from bushfit.fitting.solve import Bounds, Solution
from bushfit.model.model import Model

#: Evaluations of the model in one fit at most; a model that fits badly is then taken as it is.
EVALUATIONS = 40


@dataclass(frozen=True, eq=False)
class Evidence:
    """Where the fit of a model to all tests of a campaign ended, and the tests."""

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
        counted = sum(data_set.counted for data_set in self.data_sets)
        return self.chi_square / max(counted - self.parameters, 1)

    @property
    def penalty(self) -> float:
        """Price of one parameter by the Bayesian information criterion: ln of the number of independent points."""
        return float(np.log(sum(data_set.independent for data_set in self.data_sets)))

    @property
    def bic(self) -> float:
        """chi-square + parameters ln n; lower is better."""
        return self.chi_square + self.parameters * self.penalty

    @cached_property
    def span(self) -> Array:
        """Orthonormal basis of what the model's own parameters can absorb, (n, k)."""
        basis, size, _ = np.linalg.svd(self.solution.jacobian.T, full_matrices=False)
        return basis[:, size > 1e-10 * size[0]]

    def beside(self, columns: Array) -> Array:
        """What is left of columns, (c, n), when the model's own parameters have absorbed what they can."""
        return columns - (columns @ self.span) @ self.span.T

    @cached_property
    def place(self) -> Mapping[DataSet, slice]:
        """Where each data set's residuals stand."""
        ends = np.cumsum([data_set.size for data_set in self.data_sets]).tolist()
        return {data_set: slice(end - data_set.size, end) for end, data_set in zip(ends, self.data_sets, strict=True)}

    @cached_property
    def rigs(self) -> list[tuple[Freedoms, Array, list[Array], list[Array]]]:
        """Per rig how well its noise is known, the indices of its residuals, of those that share an error of a block
        each, and of those that share an error of a level."""
        found: dict[Freedoms, tuple[list[Array], list[Array], list[Array]]] = {}
        for data_set, place in self.place.items():
            rows, blocks, levels = found.setdefault(data_set.freedoms, ([], [], []))
            rows.append(np.arange(place.start, place.stop))
            blocks += [place.start + block for block in data_set.blocks]
            levels += [place.start + level for level in data_set.levels]
        return [(freedoms, np.concatenate(rows), blocks, levels) for freedoms, (rows, blocks, levels) in found.items()]

    def embedded(self, values: Array, data_set: DataSet) -> Array:
        """Residuals of one data set among those of all, 0 elsewhere, (n,)."""
        row = np.zeros(self.residual.size)
        row[self.place[data_set]] = values
        return row


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
