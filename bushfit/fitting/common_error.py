"""Errors shared by several residuals, which make them correlated: the residuals must be whitened together."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bushfit.effects.contract import Array

#: Variance along a direction, relative to the largest, below which it is rounding.
_ROUNDING = 1e-14


@dataclass(frozen=True, eq=False)
class CommonError:
    """Errors shared by many residuals, such as the gain error of a run: q independent random amounts.

    Args:
        columns: change of the residuals, in units of noise, by one standard deviation of each amount, (q, n).

    Notes:
        The covariance of the residuals is S = 1 + U^T U, where U is `columns`. S^(-1/2) whitens the residuals.
    """

    columns: Array

    @cached_property
    def principal_errors(self) -> tuple[Array, Array]:
        """Principal directions of the shared error, orthonormal columns, (n, r), and standard deviations, (r,)."""
        variance, mixed = np.linalg.eigh(self.columns @ self.columns.T)
        significant = variance > _ROUNDING * variance.max(initial=0.0)
        size = np.sqrt(variance[significant])
        return self.columns.T @ (mixed[:, significant] / size), size

    def scaled(self, size: float) -> CommonError:
        """Multiply the shared error by a positive factor `size`; the factorised covariance is reused."""
        error = CommonError(size * self.columns)
        directions, deviations = self.principal_errors
        error.__dict__["principal_errors"] = directions, size * deviations
        return error

    @property
    def log_det_covariance(self) -> float:
        """Natural log of the determinant of the residuals' covariance with the shared error."""
        return float(np.sum(np.log1p(np.square(self.principal_errors[1]))))

    def whiten(self, rows: Array) -> Array:
        """Whiten residuals or derivatives in units of noise, (..., n), by the shared error; same shape."""
        directions, size = self.principal_errors
        return rows - (rows @ directions * (1.0 - 1.0 / np.hypot(1.0, size))) @ directions.T
