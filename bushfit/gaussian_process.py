"""Gaussian processes over frequency, strain and temperature: kernel, patterns, restricted likelihood, conditioning.

The one place for smooth functions of no particular form: the discrepancy of a model from its tests, in the fit and in
the diagnosis, and the correction that a model carries.

Notes:
    Kernel and conditioning: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, Eqs. 2.25, 2.26 and
    4.17. Restricted likelihood: H. D. Patterson, R. Thompson, Biometrika 58 (1971) 545-554.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

Array = NDArray[Any]

#: Variance, relative to the kernel's, that keeps its matrix invertible; far below what tests show.
_JITTER = 1e-8
#: Nodes at most; chosen: all points of the paper's plan, and little time.
MAXIMUM_NODES = 100
#: Patterns at most, and the variance of one, relative to the largest, that counts; chosen for time.
_MAXIMUM_PATTERNS, _MINIMUM_VARIANCE = 60, 1e-5
#: Digits of coordinates, in lengths, that tell points apart; of more points than the number given, two: their
#: correlation is then still known within 1e-4.
_DIGITS, _MANY = 6, 500
#: Change of temperature [K] that counts as a neper of frequency: near room temperature, the time scale of most rubber
#: shifts by as much in 8 to 20 K.
_KELVIN = 10.0


def coordinates(frequency: Array, strain: Array, temperature: Array | None = None) -> Array:
    """Coordinates of operating points in which a process is stationary.

    Args:
        frequency: [Hz], (...).
        strain: equivalent strain amplitude, (...).
        temperature: [K], (...); None where the process does not depend on it.

    Returns:
        ln frequency, ln strain and, if given, temperature in units that change the time scale as a neper of frequency
        does, (..., 2 or 3).
    """
    axes = [np.log(frequency), np.log(strain)] + ([] if temperature is None else [temperature / _KELVIN])
    return np.stack(np.broadcast_arrays(*axes), axis=-1)


def in_lengths(points: Array, lengths: Sequence[float]) -> Array:
    """Points divided by the correlation lengths of a process.

    Args:
        points: from `coordinates`, (..., 2 or 3).
        lengths: in ln frequency and ln strain; temperature has that of frequency.

    Returns:
        (..., 2 or 3).
    """
    over_frequency, over_strain = lengths
    return points / (over_frequency, over_strain, over_frequency)[: points.shape[-1]]


def matern(points: Array, nodes: Array) -> Array:
    """Matern 5/2 correlation of points with nodes, both in units of the lengths, (..., n, d), (m, d) -> (..., n, m).

    >>> matern(np.zeros((1, 2)), np.array([[0.0, 0.0], [1.0, 0.0], [9.0, 0.0]])).round(3)
    array([[1.   , 0.524, 0.   ]])
    """
    squares = np.zeros((*points.shape[:-1], len(nodes)))
    for axis in range(nodes.shape[1]):  # one at a time: faster than a norm over so short an axis
        squares += np.square(points[..., :, None, axis] - nodes[:, axis])
    distance = np.sqrt(5.0) * np.sqrt(squares)
    return (1.0 + distance + np.square(distance) / 3.0) * np.exp(-distance)


def condition(points: Array, nodes: Array) -> tuple[Array, Array]:
    """Condition a process of unit variance on its values at nodes.

    Args:
        points: in units of the lengths, (..., n, d).
        nodes: in the same units, (m, d).

    Returns:
        Weights of the nodes' values in the mean at each point, (..., n, m), and the variance that is left, (..., n).
    """
    correlation = matern(points, nodes)
    weights = correlation @ np.linalg.inv(matern(nodes, nodes) + _JITTER * np.eye(len(nodes)))
    return weights, np.maximum(1.0 - np.sum(weights * correlation, axis=-1), 0.0)


def spread_nodes(points: Array, count: int) -> Array:
    """Choose points that lie far from one another, each the farthest from those before it.

    Args:
        points: (n, d).
        count: of nodes at most; fewer where points coincide.

    Returns:
        Indices of the points, (m,).
    """
    chosen, distance, axes = [0], np.full(len(points), np.inf), np.ascontiguousarray(points.T)
    while len(chosen) < count:
        distance = np.minimum(distance, np.sqrt(np.square(axes - axes[:, chosen[-1:]]).sum(axis=0)))
        if distance.max() <= 0.0:
            break
        chosen.append(int(np.argmax(distance)))
    return np.array(chosen)


def patterns(
    points: Array, nodes: int = MAXIMUM_NODES, count: int = _MAXIMUM_PATTERNS, minimum: float = _MINIMUM_VARIANCE
) -> tuple[Array, Array]:
    """Principal patterns of a process of unit variance: independent amounts of unit variance make the process.

    Args:
        points: in units of the lengths, (n, d); points that coincide share the process.
        nodes: number of points at most that the patterns are computed from.
        count: of patterns at most.
        minimum: variance of a pattern, relative to the largest, below which it is left out.

    Returns:
        Indices of the nodes, (m,), and the patterns at all points, (q, n).
    """
    for digits in (_DIGITS, 2):
        distinct, first, inverse = np.unique(points.round(digits), axis=0, return_index=True, return_inverse=True)
        if len(distinct) <= _MANY:
            break
    chosen = np.arange(len(distinct)) if len(distinct) <= nodes else spread_nodes(distinct, nodes)
    correlation = matern(distinct[chosen], distinct[chosen]) + _JITTER * np.eye(chosen.size)
    variance, vectors = np.linalg.eigh(correlation)  # the largest last
    significant = (variance > minimum * variance[-1]) & (np.arange(variance.size) >= variance.size - count)
    shapes = matern(distinct, distinct[chosen]) @ vectors[:, significant] / np.sqrt(variance[significant])
    return first[chosen], shapes.T[:, inverse.ravel()]


@dataclass(frozen=True, eq=False)
class RestrictedLikelihood:
    """Restricted likelihood of the size of a process beside fitted parameters.

    Args:
        values: eigenvalues of U^T P U, (q,): U are the whitened residuals that a unit of each amount makes, P projects
            out what the parameters absorb.
        squares: squared components b^2 of U^T P r along the eigenvectors, (q,); r are the residuals.

    Notes:
        A size v adds sum(v^2 b^2/(1 + v^2 l) - ln(1 + v^2 l))/2 to the logarithm of the likelihood.
    """

    values: Array
    squares: Array

    @classmethod
    def from_columns(cls, columns: Array, residual: Array, span: Array) -> "RestrictedLikelihood":
        """The likelihood of columns beside parameters.

        Args:
            columns: whitened residuals of a unit of each amount, (q, n).
            residual: whitened, the span already taken out, (n,).
            span: orthonormal directions that the parameters absorb, (k, n).
        """
        absorbed = columns @ span.T
        values, vectors = np.linalg.eigh(columns @ columns.T - absorbed @ absorbed.T)
        return cls(np.maximum(values, 0.0), np.square(vectors.T @ (columns @ residual)))

    def gains(self, sizes: Array) -> Array:
        """Gain of the log likelihood by each size over none, (s,) -> (s,)."""
        grown = 1.0 + np.square(sizes)[:, None] * self.values
        return 0.5 * np.sum(np.square(sizes)[:, None] * self.squares / grown - np.log(grown), axis=-1)

    def log_evidence(self, sizes: Array) -> float:
        """Log of the mean likelihood over sizes, each equally probable, relative to none."""
        return float(logsumexp(self.gains(sizes)) - np.log(sizes.size))

    def freedom(self, size: float) -> float:
        """Degrees of freedom that determine a size, at least 1."""
        share = np.square(size) * self.values / (1.0 + np.square(size) * self.values)
        return max(float(np.sum(np.square(share))), 1.0)
