"""Gaussian processes over frequency, strain and temperature: kernel, patterns, restricted likelihood, conditioning.

A Gaussian process (here: process) represents a smooth function without a particular formula: the discrepancy between a
model and its tests, in the fit and in the diagnosis, and the correction that a model file may contain.

Notes:
    Kernel and conditioning: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, Eqs. 2.25, 2.26 and
    4.17. Restricted likelihood: H. D. Patterson, R. Thompson, Biometrika 58 (1971) 545-554.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

Array = NDArray[Any]

#: Variance added to the diagonal of the correlation matrix to keep it invertible; far below the scatter of tests.
_JITTER = 1e-8
#: Maximum number of nodes; chosen: all points of the paper's test plan, and little computing time.
MAXIMUM_NODES = 100
#: Maximum number of patterns, and minimum variance of a pattern relative to the largest; chosen for computing time.
_MAXIMUM_PATTERNS, MINIMUM_VARIANCE = 60, 1e-5
#: Decimals of the coordinates, in correlation lengths, by which points are distinguished; only two if there are more
#: than `_MANY` points, which changes their correlation by less than 1e-4.
_DIGITS, _MANY = 6, 500
#: Change of temperature [K] equivalent to a factor e of frequency: near room temperature, 8 to 20 K shift the time
#: scale of most rubber by that factor.
_KELVIN = 10.0


def coordinates(frequency: Array, strain: Array, temperature: Array | None = None) -> Array:
    """Coordinates of operating points in which a Gaussian process is stationary.

    Args:
        frequency: frequencies [Hz], (...).
        strain: equivalent strain amplitudes [1], (...).
        temperature: temperatures [K], (...); None if the process does not depend on temperature.

    Returns:
        ln frequency, ln strain and, if given, temperature/10 K, which shifts the time scale of rubber by about a factor
        e per unit, (..., 2 or 3).
    """
    axes = [np.log(frequency), np.log(strain)] + ([] if temperature is None else [temperature / _KELVIN])
    return np.stack(np.broadcast_arrays(*axes), axis=-1)


def in_lengths(points: Array, lengths: Sequence[float]) -> Array:
    """Divide coordinates of operating points by the correlation lengths of a Gaussian process.

    Args:
        points: coordinates from `coordinates`, (..., 2 or 3).
        lengths: correlation lengths in ln frequency and ln strain; temperature has the length of ln frequency.

    Returns:
        Dimensionless coordinates, (..., 2 or 3).
    """
    over_frequency, over_strain = lengths
    return points / (over_frequency, over_strain, over_frequency)[: points.shape[-1]]


def matern(points: Array, nodes: Array) -> Array:
    """Matern 5/2 correlation of a Gaussian process between operating points.

    Args:
        points: points in units of the correlation lengths, (..., n, d).
        nodes: reference points (nodes) in the same units, (m, d).

    Returns:
        Correlation of the process at each point with that at each node, (..., n, m).

    >>> matern(np.zeros((1, 2)), np.array([[0.0, 0.0], [1.0, 0.0], [9.0, 0.0]])).round(3)
    array([[1.   , 0.524, 0.   ]])
    """
    squares = np.zeros((*points.shape[:-1], len(nodes)))
    for axis in range(nodes.shape[1]):  # one at a time: faster than a norm over so short an axis
        squares += np.square(points[..., :, None, axis] - nodes[:, axis])
    distance = np.sqrt(5.0) * np.sqrt(squares)
    return (1.0 + distance + np.square(distance) / 3.0) * np.exp(-distance)


def condition(points: Array, nodes: Array) -> tuple[Array, Array]:
    """Condition a Gaussian process of unit variance on its values at some points, the nodes.

    Args:
        points: points in units of the correlation lengths, (..., n, d).
        nodes: nodes in the same units, (m, d).

    Returns:
        Weights of the nodes' values in the conditional mean at each point, (..., n, m), and the conditional variance at
        each point, (..., n).
    """
    correlation = matern(points, nodes)
    weights = correlation @ np.linalg.inv(matern(nodes, nodes) + _JITTER * np.eye(len(nodes)))
    return weights, np.maximum(1.0 - np.sum(weights * correlation, axis=-1), 0.0)


def spread_nodes(points: Array, count: int) -> Array:
    """Choose points that lie far from one another, each the farthest from those before it.

    Args:
        points: candidate points, (n, d).
        count: maximum number of chosen points; fewer are chosen if points coincide.

    Returns:
        Indices of the chosen points, (m,).
    """
    chosen, distance, axes = [0], np.full(len(points), np.inf), np.ascontiguousarray(points.T)
    while len(chosen) < count:
        distance = np.minimum(distance, np.sqrt(np.square(axes - axes[:, chosen[-1:]]).sum(axis=0)))
        if distance.max() <= 0.0:
            break
        chosen.append(int(np.argmax(distance)))
    return np.array(chosen)


def patterns(
    points: Array,
    nodes: int = MAXIMUM_NODES,
    count: int = _MAXIMUM_PATTERNS,
    minimum: float = MINIMUM_VARIANCE,
    correlate: Callable[[Array, Array], Array] = matern,
) -> tuple[Array, Array]:
    """Principal components of a Gaussian process of unit variance.

    The process at all points is approximately a sum of patterns, each times an independent standard normal number.

    Args:
        points: points in units of the correlation lengths, (n, d); points that coincide have the same process value.
        nodes: maximum number of points from which the patterns are computed.
        count: maximum number of patterns.
        minimum: variance, relative to the largest pattern's, at or below which a pattern is left out.
        correlate: correlation of points (n, d) with nodes (m, d), of shape (n, m).

    Returns:
        Indices of the nodes among the points, (m,), and the patterns at all points, (q, n).
    """
    for digits in (_DIGITS, 2):
        distinct, first, inverse = np.unique(points.round(digits), axis=0, return_index=True, return_inverse=True)
        if len(distinct) <= _MANY:
            break
    chosen = np.arange(len(distinct)) if len(distinct) <= nodes else spread_nodes(distinct, nodes)
    correlation = correlate(distinct[chosen], distinct[chosen]) + _JITTER * np.eye(chosen.size)
    variance, vectors = np.linalg.eigh(correlation)  # the largest last
    significant = (variance > minimum * variance[-1]) & (np.arange(variance.size) >= variance.size - count)
    shapes = correlate(distinct, distinct[chosen]) @ vectors[:, significant] / np.sqrt(variance[significant])
    return first[chosen], shapes.T[:, inverse.ravel()]


@dataclass(frozen=True, eq=False)
class RestrictedLikelihood:
    """Restricted likelihood of the standard deviation of a Gaussian process added to a fitted model.

    Args:
        values: eigenvalues l of U^T P U, (q,). Column i of U is the change of the whitened residuals by pattern i of
            the process (a column of a square root of its covariance) with amount 1; P projects out the changes that
            the fitted parameters can absorb.
        squares: squared components b^2 of U^T P r along the eigenvectors, (q,); r are the whitened residuals of the
            fitted model.

    Notes:
        A process with v times the standard deviation of the patterns adds sum(v^2 b^2/(1 + v^2 l) - ln(1 + v^2 l))/2
        to the natural logarithm of the likelihood.
    """

    values: Array
    squares: Array

    @classmethod
    def from_columns(cls, columns: Array, residual: Array, span: Array) -> "RestrictedLikelihood":
        """Build the likelihood from residual changes by the patterns of the process and the residuals of the fit.

        Args:
            columns: change of the whitened residuals per unit of each pattern, (q, n).
            residual: whitened residuals of the fit, already projected out of the span, (n,).
            span: orthonormal basis of the residual changes that the fitted parameters can absorb, (k, n).
        """
        absorbed = columns @ span.T
        values, vectors = np.linalg.eigh(columns @ columns.T - absorbed @ absorbed.T)
        return cls(np.maximum(values, 0.0), np.square(vectors.T @ (columns @ residual)))

    def gains(self, sizes: Array) -> Array:
        """Increase of the natural log of the likelihood for each size of the process, compared with size zero.

        Args:
            sizes: standard deviations of the process, (s,).

        Returns:
            Increases, (s,).
        """
        grown = 1.0 + np.square(sizes)[:, None] * self.values
        return 0.5 * np.sum(np.square(sizes)[:, None] * self.squares / grown - np.log(grown), axis=-1)

    def log_evidence(self, sizes: Array) -> float:
        """Natural log of the likelihood averaged over equally probable sizes of the process, relative to size zero."""
        return float(logsumexp(self.gains(sizes)) - np.log(sizes.size))

    def freedom(self, size: float) -> float:
        """Effective number of patterns that the data determine at a given size: freedom of that size, at least 1."""
        share = np.square(size) * self.values / (1.0 + np.square(size) * self.values)
        return max(float(np.sum(np.square(share))), 1.0)
