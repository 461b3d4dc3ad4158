"""Score tests: what a pattern in the residuals would take off chi-square, and how much noise alone would.

Notes:
    A pattern is a group of columns, whitened residuals that are free to move together: a candidate's sensitivity, a
    fault's gain and phase, smooth contrasts. How far the best pattern gets by chance comes from a parametric
    bootstrap: noise is drawn as the campaign has it, in units of a noise that was itself estimated, from a few repeats
    or a few points, which makes the tails heavier. Only the columns' inner products enter, so thousands of draws cost
    one small matrix product. The underlying draws depend on their number alone and are kept.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from bushfit.diagnosis.evidence import Evidence
from bushfit.effects.contract import Array

#: Draws of noise: the 0.5 % that a threshold leaves are then known within a fifth.
DRAWS = 4000
#: Of all draws, so that a campaign has the same thresholds at every run.
_SEED = 20260101
#: Share of a candidate's unit sensitivity that the model's own parameters must leave for it to count as visible.
SENSITIVITY_LEFT = 1e-4
#: The same share of a fault's or a smooth pattern: of these, the little that is left below it would be the curvature of
#: the model and the grid of the computation.
PATTERN_LEFT = 0.1
#: Variance, relative to the largest, below which a direction of the draws is rounding.
_ROUNDING = 1e-10


@dataclass(frozen=True, eq=False)
class ScoreTest:
    """Patterns held against the residuals of one fitted model.

    Args:
        columns: whitened residuals that a unit of each amount would make, (c, n).
        groups: indices of the columns of each pattern.
        least: share of a unit column that must be left beside the model's own parameters.
    """

    evidence: Evidence
    columns: Array
    groups: Sequence[Array]
    least: float

    @cached_property
    def _lengths(self) -> Array:
        lengths = np.linalg.norm(self.columns, axis=1)
        return np.where(lengths > 0.0, lengths, 1.0)

    @cached_property
    def _left(self) -> Array:
        """Unit columns less what the model's own parameters absorb."""
        return self.evidence.beside(self.columns / self._lengths[:, None])

    @cached_property
    def _roots(self) -> list[Array]:
        """Per pattern a matrix that makes its columns orthonormal, those all but absorbed dropped, (k, r)."""
        squares, roots = np.einsum("ij,ij->i", self._left, self._left), []
        for group in self.groups:
            if group.size == 1:
                size, vectors = squares[group], np.ones((1, 1))
            else:
                size, vectors = np.linalg.eigh(self._left[group] @ self._left[group].T)
            kept = size > self.least**2
            roots.append(vectors[:, kept] / np.sqrt(size[kept]))
        return roots

    @cached_property
    def _along(self) -> list[Array]:
        """What the residuals have of each pattern's orthonormal columns, (r,)."""
        amounts = self._left @ self.evidence.residual
        return [root.T @ amounts[group] for group, root in zip(self.groups, self._roots, strict=True)]

    @property
    def sizes(self) -> list[int]:
        """Number of columns of each pattern that are visible."""
        return [root.shape[1] for root in self._roots]

    def gains(self) -> list[float]:
        """What each pattern would take off chi-square."""
        return [float(np.sum(np.square(along))) for along in self._along]

    def amounts(self) -> list[Array]:
        """Least-squares amounts of each pattern's columns, in their own units; 0 for what is not visible."""
        triples = zip(self.groups, self._roots, self._along, strict=True)
        return [-(root @ along) / self._lengths[group] for group, root, along in triples]

    def largest_by_chance(self, level: float) -> float:
        """The gain that the best pattern exceeds by chance with probability 1 - level.

        Args:
            level: probability, such as 0.995.
        """
        drawn = _draw(self.evidence, self._left)
        best = np.zeros(DRAWS)
        for group, root in zip(self.groups, self._roots, strict=True):
            best = np.maximum(best, np.sum(np.square(root.T @ drawn[group]), axis=0))
        return float(np.quantile(best, level)) if best.any() else np.inf


def _draw(evidence: Evidence, rows: Array) -> Array:
    """Amounts of noise along rows, (c, DRAWS): what levels share, what blocks share, what scatters from point to
    point."""
    drawn = np.zeros((len(rows), DRAWS))
    for number, (freedoms, own, blocks, levels) in enumerate(evidence.rigs):
        of_levels, of_blocks = _moved_together(rows, levels), _moved_together(rows, blocks)
        of_points = _rest(rows[:, own], of_blocks)
        in_levels = _rest(of_blocks, of_levels) if levels else of_blocks
        drawn += in_levels @ _normals(in_levels.shape[1], 6 * number) * _unknown(freedoms.shared, 6 * number + 2)
        drawn += of_points @ _normals(of_points.shape[1], 6 * number + 1) * _unknown(freedoms.scatter, 6 * number + 3)
        drawn += of_levels @ _normals(of_levels.shape[1], 6 * number + 4) * _unknown(freedoms.level, 6 * number + 5)
    return drawn


def _moved_together(rows: Array, groups: Sequence[Array]) -> Array:
    """Amounts along rows, (c, n), of the unit error of each group of residuals, (c, groups)."""
    columns = [rows[:, group].sum(axis=1) / np.sqrt(group.size) for group in groups]
    return np.reshape(columns, (-1, len(rows))).T


def _rest(whole: Array, part: Array) -> Array:
    """A root of what is left of whole @ whole.T without part @ part.T, (c, r)."""
    size, vectors = np.linalg.eigh(whole @ whole.T - part @ part.T)
    kept = size > _ROUNDING * max(float(size.max()), 1e-300)
    return vectors[:, kept] * np.sqrt(size[kept])


@lru_cache(maxsize=32)
def _normals(rows: int, stream: int) -> Array:
    return np.random.default_rng([_SEED, stream]).standard_normal((rows, DRAWS))


@lru_cache(maxsize=32)
def _unknown(freedom: int, stream: int) -> Array:
    """True over estimated standard deviation, as far as so many degrees of freedom tell it: (DRAWS,); 1 if known."""
    if not freedom:
        return np.ones(DRAWS)
    return np.sqrt(freedom / np.random.default_rng([_SEED, stream]).chisquare(freedom, DRAWS))
