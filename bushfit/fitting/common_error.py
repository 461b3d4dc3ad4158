"""Errors that residuals have in common, so that these are independent only when whitened together."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bushfit.effects.contract import Array

#: Variance along a direction, relative to the largest, below which it is rounding.
_ROUNDING = 1e-14


@dataclass(frozen=True, eq=False)
class CommonError:
    """Independent amounts of an error that each move many residuals.

    Args:
        columns: residuals in units of noise that one standard deviation of each amount makes, (q, n).

    Notes:
        The covariance of the residuals is S = 1 + U^T U, U the columns. S^(-1/2) whitens them.
    """

    columns: Array

    @cached_property
    def along(self) -> tuple[Array, Array]:
        """Orthonormal directions that the error takes, (n, q), and its standard deviation along each, (q,)."""
        variance, mixed = np.linalg.eigh(self.columns @ self.columns.T)
        kept = variance > _ROUNDING * variance.max(initial=0.0)
        size = np.sqrt(variance[kept])
        return self.columns.T @ (mixed[:, kept] / size), size

    @property
    def log_size(self) -> float:
        """ln|S|."""
        return float(np.sum(np.log1p(np.square(self.along[1]))))

    def whiten(self, rows: Array) -> Array:
        """Residuals in units of noise, (..., n), as independent numbers of unit variance."""
        vectors, size = self.along
        return rows - (rows @ vectors * (1.0 - 1.0 / np.hypot(1.0, size))) @ vectors.T
