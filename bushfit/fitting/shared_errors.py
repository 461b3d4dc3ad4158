"""Errors that several residuals share. The residuals are then correlated and must be whitened together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from bushfit.effects.contract import Array

#: Variance along a direction, relative to the largest, below which it is rounding.
_ROUNDING = 1e-14
#: Number of entries of the directions of groups from which on they are a sparse array, which is then faster.
_MANY_ENTRIES = 30_000


@dataclass(frozen=True, eq=False)
class SharedErrors:
    """Independent errors that each change several of n residuals, such as the gain error of a run or of a loop.

    Args:
        directions: changes of the n residuals, in units of noise, due to r independent errors, as orthonormal columns,
            (n, r); a sparse array for very many groups.
        deviations: standard deviation of the change along each direction, (r,).
        rotation: orthonormal combinations of the directions, as columns, (r, r), along which the errors are independent
            with these deviations; None for the directions themselves.

    Notes:
        The covariance of the residuals is S = 1 + D diag(s^2) D^T with the (rotated) directions D and the deviations s.
        S^(-1/2) = 1 - D diag(1 - 1/sqrt(1 + s^2)) D^T whitens the residuals.
    """

    directions: Any
    deviations: Array
    rotation: Array | None = None

    @classmethod
    def from_columns(cls, columns: Array) -> SharedErrors:
        """Build errors from the changes of n residuals due to one standard deviation of each of q errors, (q, n)."""
        variance, mixed = np.linalg.eigh(columns @ columns.T)
        significant = variance > _ROUNDING * variance.max(initial=0.0)
        deviations = np.sqrt(variance[significant])
        return cls(columns.T @ (mixed[:, significant] / deviations), deviations)

    @classmethod
    def of_groups(cls, group: Array, change: Array, deviations: tuple[float, float]) -> SharedErrors:
        """Build a gain and a phase error for each of g groups of a sweep's points; each point belongs to one group.

        Args:
            group: index of the group of each point, (n,).
            change: change of the n whitened gain residuals due to a relative gain error of 1, then of the n phase
                residuals due to a phase error of 1 rad, (2 n,).
            deviations: standard deviations of the relative gain error and of the phase error [rad] of each group.

        Returns:
            Errors with one direction for the gain of each group, in order, then one for each phase.
        """
        of_residual = np.concatenate((group, group + group.max() + 1))
        norm = np.sqrt(np.bincount(of_residual, np.square(change)))
        entries = change / np.maximum(norm, np.finfo(float).tiny)[of_residual]
        rows, deviation = np.arange(change.size), norm * np.repeat(deviations, norm.size // 2)
        if change.size * norm.size > _MANY_ENTRIES:
            from scipy.sparse import csr_array

            return cls(csr_array((entries, (rows, of_residual))), deviation)
        directions = np.zeros((change.size, norm.size))
        directions[rows, of_residual] = entries
        return cls(directions, deviation)

    def components(self, rows: Array) -> Array:
        """Return the components of residuals, (..., n), along the r independent errors, (..., r)."""
        along = rows @ self.directions
        return np.asarray(along if self.rotation is None else along @ self.rotation)

    def whiten(self, rows: Array) -> Array:
        """Whiten residuals or derivatives in units of noise, (..., n): multiply by S^(-1/2) with their covariance S."""
        if not self.deviations.any():
            return rows
        return rows - self.multiply(rows, 1.0 - 1.0 / np.hypot(1.0, self.deviations))

    def multiply(self, rows: Array, factors: Array) -> Array:
        """Multiply the components of residuals, (..., n), along the r directions by factors, (r,), and drop the rest.

        Returns:
            Sum of the multiplied components, (..., n).
        """
        multiplied = self.components(rows) * factors
        return np.asarray((multiplied if self.rotation is None else multiplied @ self.rotation.T) @ self.directions.T)

    def covariance(self, influence: Array) -> Array:
        """Covariance of k estimates due to the shared errors, (k, k).

        Args:
            influence: change of each estimate per unit of each residual, (k, n).
        """
        changes = self.components(influence) * self.deviations
        return np.asarray(changes @ changes.T)
