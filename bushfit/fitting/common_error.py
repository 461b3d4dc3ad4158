"""Errors that residuals have in common, so that these are independent only when whitened together."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, overload

import numpy as np

from bushfit.effects.contract import Array

if TYPE_CHECKING:
    from bushfit.fitting.preparation import MeasuredTest

#: Variance along a direction, relative to the largest, below which it is rounding.
_ROUNDING = 1e-14


@dataclass(frozen=True, eq=False)
class ErrorSubspace:
    """Residuals that an error can move: all of some rows, and few directions of many others.

    Args:
        parts: rows that stand together, with orthonormal directions of them, (rows, d), or None for all.
    """

    parts: Sequence[tuple[slice, Array | None]]

    def project(self, rows: Array) -> Array:
        """Residuals, (..., n), along the directions, (..., d)."""
        return np.concatenate(
            [self.project_part(i, rows[..., block]) for i, (block, _) in enumerate(self.parts)], axis=-1
        )

    def project_part(self, number: int, rows: Array) -> Array:
        """Components of the rows of one part."""
        directions = self.parts[number][1]
        return rows if directions is None else rows @ directions

    def expand(self, values: Array) -> Array:
        """Residuals, (..., n), that have values along the directions, (..., d), and nothing else."""
        found = [
            values[..., block] if directions is None else values[..., block] @ directions.T
            for block, (_, directions) in zip(self.places, self.parts, strict=True)
        ]
        return np.concatenate(found, axis=-1)

    @cached_property
    def places(self) -> list[slice]:
        """Slices of the directions of each part."""
        sizes = [
            block.stop - block.start if directions is None else directions.shape[1] for block, directions in self.parts
        ]
        ends = np.cumsum([0, *sizes]).tolist()
        return [slice(*pair) for pair in itertools.pairwise(ends)]


@dataclass(frozen=True, eq=False)
class CommonError:
    """Independent amounts of an error that each move many residuals.

    Args:
        columns: what one standard deviation of each amount makes of residuals in units of noise, as they are seen,
            (q, d).
        subspace: which of the residuals these are.

    Notes:
        The covariance of the residuals is S = 1 + U^T U, U the columns. S^(-1/2) whitens them.
    """

    columns: Array
    subspace: ErrorSubspace

    @classmethod
    def of_all(cls, columns: Array) -> CommonError:
        """An error that moves any of the residuals, (q, n)."""
        return cls(columns, ErrorSubspace([(slice(0, columns.shape[1]), None)]))

    @cached_property
    def principal_errors(self) -> tuple[Array, Array]:
        """Orthonormal directions that the error takes, (d, q), and its standard deviation along each, (q,)."""
        variance, mixed = np.linalg.eigh(self.columns @ self.columns.T)
        significant = variance > _ROUNDING * variance.max(initial=0.0)
        size = np.sqrt(variance[significant])
        return self.columns.T @ (mixed[:, significant] / size), size

    @property
    def log_size(self) -> float:
        """ln|S|."""
        return float(np.sum(np.log1p(np.square(self.principal_errors[1]))))

    def whiten(self, rows: Array) -> Array:
        """Residuals in units of noise, (..., n), as independent numbers of unit variance."""
        vectors, size = self.principal_errors
        return rows - self.subspace.expand(
            (self.subspace.project(rows) @ vectors * (1.0 - 1.0 / np.hypot(1.0, size))) @ vectors.T
        )


class ErrorProducts(NamedTuple):
    """Inner products of whitened rows, such as a residual and its derivatives, with an error of unknown size.

    Args:
        products: of the rows in noise, (m, m).
        components: components of the rows along independent amounts of the error, (m, c).
        variance: by a unit of the error in each, (c,).
    """

    products: Array
    components: Array
    variance: Array

    def with_size(self, size: float) -> tuple[Array, float]:
        """Inner products beside the error of a size, (m, m), and the log determinant of the covariance, over noise."""
        grown = 1.0 + size**2 * self.variance
        products = self.products - self.components * (size**2 / grown) @ self.components.T
        return products, float(np.sum(np.log(grown)))


@dataclass(frozen=True, eq=False)
class Joined(Sequence["MeasuredTest"]):
    """Tests with an error in common beside the noise of each: their residuals are whitened together."""

    data_sets: tuple[MeasuredTest, ...]
    error: CommonError

    @overload
    def __getitem__(self, index: int) -> MeasuredTest: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[MeasuredTest]: ...
    def __getitem__(self, index: int | slice) -> MeasuredTest | Sequence[MeasuredTest]:
        return self.data_sets[index]

    def __len__(self) -> int:
        return len(self.data_sets)
