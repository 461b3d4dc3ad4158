"""The smooth correction of what has no name: a Gaussian process beside all parameters, held out before it is kept.

Notes:
    The correction c has values w at nodes, w = s R z with z standard normal and R R^T the correlation of the nodes, and
    is orthogonal to what the parameters can do: of all such z only those count whose residuals are (Plumlee and Joseph,
    2018, Orthogonal Gaussian process models of deterministic computer experiments). So the parameters stay where the
    plain fit put them. Beside them r = -E y + noise with y ~ N(0, s^2 I), and with the eigenvalues l of E E^T and the
    amounts a of E r along its eigenvectors the marginal likelihood over that of no correction is
    ln L = sum (s^2 a^2/(1 + s^2 l) - ln(1 + s^2 l))/2 (Rasmussen and Williams, 2006, Eq. 2.30).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.holdout import HoldOut
from bushfit.diagnosis.terms import Terms, halves, inner_parts, log_score, predicted
from bushfit.effects.contract import Array
from bushfit.effects.unnamed import Unnamed, correlation, kernel, nodes_among, patches_of

#: Nodes of a patch at most; chosen: all points of the paper's plan, and little time.
_MOST_NODES = 100
#: Lengths tried, in ln frequency and ln motion: from next points apart to the same everywhere.
_LENGTHS = 2.0 ** np.arange(-2, 4)
#: The lengths that are tried first.
_FIRST = (1.0, 2.0)
#: Sizes tried, over that of the gap; chosen: the best is a few times the root mean square of what it corrects.
_SIZES = np.geomspace(0.1, 30.0, 26)
#: Length in units of which values between nodes are those of a smooth curve.
_BETWEEN = 1.0
#: Digits of the logarithms of points that tell them apart.
_DIGITS = 6
#: Width of the band over that of one that would hold the gap, at the most: a correction that only widens its band has
#: explained nothing.
_HALF = 0.5


@dataclass(frozen=True, eq=False)
class Correction:
    """A smooth correction, and whether it stands where it was not fitted.

    Args:
        data: of the effect `unnamed`.
        held: whole runs inside the range, predicted without and with it.
        log_score: mean logarithm of the density it gave to what was held out, less that of the model without it.
        band: its standard deviation over the gap, both as root mean squares over the points.
    """

    data: Unnamed
    held: HoldOut
    log_score: float
    band: float

    @property
    def kept(self) -> bool:
        """Whether the gap at least halves where it was not fitted, by a band that is narrower than the gap."""
        return halves(self.held) and self.log_score > 0.0 and self.band <= _HALF


def correct(evidence: Evidence) -> Correction | None:
    """The likeliest smooth correction of a fitted model, common to the directions or of each its own; None where none
    is likelier than none."""
    terms = Terms(evidence, "gain")
    names = tuple(dict.fromkeys(map(str, terms.directions))) if terms.sensible else ()
    groups: list[list[tuple[str, ...]]] = [[names], [(name,) for name in names]]
    found = [process for each in groups[: len(names)] if (process := _likeliest(_Design.of(terms, each)))]
    best = max(found, key=lambda process: process.likelihood, default=None)
    return best.held_out() if best else None


@dataclass(frozen=True, eq=False)
class _Design:
    """What a correction by values at nodes does to the residuals.

    Args:
        directions: that share a patch, by name.
        nodes: logarithms of frequency and motion of each patch's nodes, (m, 2) each.
        at_points: values at the points by values at the nodes, (p, m).
        columns: whitened residuals by values at the nodes, all storage, then all loss, (2 m, n).
        weight: of each residual in what is estimated, 1 or 0.
    """

    terms: Terms
    directions: Sequence[tuple[str, ...]]
    nodes: Sequence[Array]
    at_points: Array
    columns: Array
    weight: Array

    @classmethod
    def of(cls, terms: Terms, directions: Sequence[tuple[str, ...]]) -> _Design:
        """Nodes at the points, or at some that lie farthest apart, and what their values do."""
        nodes, blocks = [], []
        for group in directions:
            inside = np.isin(terms.directions, group)
            distinct = np.unique(terms.points[inside].round(_DIGITS), axis=0)
            own = distinct[nodes_among(distinct, _MOST_NODES)]
            nodes.append(own)
            near = kernel(terms.points / _BETWEEN, own / _BETWEEN) @ np.linalg.inv(correlation(own / _BETWEEN))
            blocks.append(near * inside[:, None])
        at_points = np.concatenate(blocks, axis=1)
        values = np.concatenate((at_points.T, 1j * at_points.T))
        columns = terms.columns(values, terms.evidence.model)
        return cls(terms, directions, nodes, at_points, columns, np.ones(columns.shape[1]))

    @cached_property
    def gram(self) -> Array:
        """Inner products of the columns, (2 m, 2 m)."""
        return (self.columns * self.weight) @ self.columns.T

    @cached_property
    def along(self) -> Array:
        """Of the columns and the residuals, (2 m,)."""
        return self.columns @ (self.weight * self.terms.evidence.residual)

    @cached_property
    def absorbed(self) -> Array:
        """What the parameters can do of each column, (2 m, k)."""
        return self.columns @ self.terms.evidence.span


@dataclass(frozen=True, eq=False)
class _Process:
    """A Gaussian process on a design.

    Args:
        lengths: of the kernel, in ln frequency and ln motion.
        root: values at the nodes by standard normal amounts, orthogonal to the parameters, (2 m, q).
        size: standard deviation of the correction.
        likelihood: logarithm of the marginal likelihood over that of no correction.
    """

    design: _Design
    lengths: tuple[float, float]
    root: Array
    size: float
    likelihood: float

    @property
    def columns(self) -> Array:
        """Whitened residuals by the amounts, (q, n)."""
        return self.root.T @ self.design.columns

    def held_out(self) -> Correction:
        """The correction, and how it fares on whole runs that were held out: inside the range, and in turn.

        Lengths and size are estimated anew without each part; whether directions share the correction is not.
        """
        evidence, told, scores = self.design.terms.evidence, dict[str, Array](), []
        own = evidence.solution.jacobian
        for part in inner_parts(evidence.data_sets):
            rows = part.rows(evidence.data_sets)
            anew = _likeliest(replace(self.design, weight=np.where(rows, 0.0, 1.0)), self.lengths)
            root, size = (anew.root, anew.size) if anew else (self.root[:, :0], 1.0)
            pair = [
                predicted(evidence.residual, *_beside(own, root[:, :amounts].T @ self.design.columns, size), rows)
                for amounts in (0, root.shape[1])
            ]
            told[part.name] = np.array([(left, left / np.sqrt(variance)) for left, variance in pair])
            scores.append(log_score(*pair[1]) - log_score(*pair[0]))
        mean, covariance = self._posterior()
        errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        data = Unnamed(self.size, self.lengths, patches_of(self.design.directions, self.design.nodes, mean, errors))
        score = float(np.mean(scores)) if scores else 0.0
        return Correction(data, HoldOut.of(told), score, self._band(mean, covariance))

    def _posterior(self) -> tuple[Array, Array]:
        """Values at the nodes and their covariance, (2 m,) and (2 m, 2 m)."""
        prior = np.eye(self.root.shape[1]) / self.size**2
        inverse = np.linalg.inv(self.root.T @ self.design.gram @ self.root + prior)
        return -self.root @ inverse @ self.root.T @ self.design.along, self.root @ inverse @ self.root.T

    def _band(self, mean: Array, covariance: Array) -> float:
        """Standard deviation over the gap, root mean squares over the points."""
        points, parts = self.design.at_points, [slice(0, mean.size // 2), slice(mean.size // 2, None)]
        gap = sum(np.mean(np.square(points @ mean[part])) for part in parts)
        width = sum(np.mean(np.sum(points @ covariance[part, part] * points, axis=1)) for part in parts)
        return float(np.sqrt(width / gap))


def _beside(own: Array, columns: Array, size: float) -> tuple[Array, Array]:
    """Columns beside the parameters', (k, n), and what is known of each amount beforehand, inverse variances, (k,)."""
    return np.concatenate((own, columns)), np.repeat([0.0, size**-2], [len(own), len(columns)])


def _likeliest(design: _Design, first: Sequence[float] = _FIRST) -> _Process | None:
    """The process of the likeliest lengths and size, uphill from the first; None where none is likelier than no
    correction."""
    known: dict[tuple[int, ...], _Process | None] = {}

    def at(place: tuple[int, ...]) -> float:
        if place not in known:
            known[place] = _process(design, tuple(float(_LENGTHS[i]) for i in place))
        process = known[place]
        return process.likelihood if process else 0.0

    best = tuple(np.searchsorted(_LENGTHS, first).tolist())
    while True:
        steps = [(best[0] + i, best[1] + j) for i, j in ((1, 0), (-1, 0), (0, 1), (0, -1))]
        inside = [place for place in steps if all(0 <= i < _LENGTHS.size for i in place)]
        next_best = max(inside, key=at)
        if at(next_best) <= at(best):
            return known[best]
        best = next_best


def _process(design: _Design, lengths: Sequence[float]) -> _Process | None:
    """The process of these lengths and its likeliest size."""
    count = design.along.size // 2
    root, begin = np.zeros((2 * count, 2 * count)), 0
    for own in design.nodes:
        corner = np.linalg.cholesky(correlation(own / lengths))
        for first in (begin, count + begin):
            root[first : first + len(own), first : first + len(own)] = corner
        begin += len(own)
    bound = root.T @ design.absorbed
    basis = np.linalg.qr(bound, mode="complete")[0][:, np.linalg.matrix_rank(bound) :]
    root = root @ basis
    strength, vectors = np.linalg.eigh(root.T @ design.gram @ root)
    along = np.square(vectors.T @ (root.T @ design.along))
    sizes = _SIZES * np.sqrt(max(along.sum(), np.finfo(float).tiny)) / max(strength.max(), np.finfo(float).tiny)
    grown = 1.0 + np.square(sizes)[:, None] * np.maximum(strength, 0.0)
    gain = 0.5 * np.sum(np.square(sizes)[:, None] * along / grown - np.log(grown), axis=1)
    best = int(np.argmax(gain))
    if gain[best] <= 0.0:
        return None
    return _Process(design, (lengths[0], lengths[1]), root, float(sizes[best]), float(gain[best]))
