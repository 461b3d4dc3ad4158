"""How large a gain noise alone makes: a parametric bootstrap in the space of the questions asked.

A question is a group of directions in residual space (a candidate's sensitivity, a fault's pattern, smooth contrasts).
Noise is drawn as the campaign has it: independent residuals, and blocks whose shared variance was itself estimated
from a few repeats, which makes the tails of what acts on whole blocks heavier. Only the directions' inner products
enter, so thousands of draws cost one small matrix product; the draws depend on their number alone and are kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from bushfit.diagnosis.evidence import Evidence
from bushfit.effects.contract import Array

DRAWS = 4000
#: Share of a unit direction that must be left beside the model's own parameters: of a candidate's sensitivity, and
#: of a pattern, of which what little remains would be the curvature of the model and the grid of the computation.
SENSITIVITY_LEFT, PATTERN_LEFT = 1e-4, 0.1
_SEED = 20260101


@dataclass(frozen=True, eq=False)
class Question:
    """Directions in residual space, (c, n), that one answer would use together.

    Args:
        columns: the directions, as the model's residuals would move.
        sense: +1 or -1 where physics allows only one sign of the answer, 0 where both.
    """

    columns: Array
    sense: int = 0


def orthonormal(evidence: Evidence, columns: Array, least: float) -> Array:
    """Orthonormal rows that span what is visible of the columns beside the model's own parameters, (r, n).

    Directions of which less than a share of `least` is left are dropped; r may be 0. A single column keeps its sign.
    """
    lengths = np.linalg.norm(columns, axis=1)
    left = evidence.beside(columns[lengths > 0.0] / lengths[lengths > 0.0][:, None])
    if not left.size:
        return left
    _, size, rows = np.linalg.svd(left, full_matrices=False)
    if len(left) == 1:
        rows = rows * np.sign(rows @ left[0])
    return rows[size > least]


def gain(directions: Array, residual: Array, sense: int = 0) -> float:
    """What a group of orthonormal directions would take off chi-square."""
    amounts = directions @ residual
    if sense:
        return float(max(-sense * amounts[0], 0.0) ** 2) if amounts.size else 0.0
    return float(amounts @ amounts)


def largest_by_chance(
    evidence: Evidence, groups: Sequence[Array], level: float, senses: Sequence[int] | None = None
) -> float:
    """The gain that the best of several groups of directions exceeds by chance with probability 1 - level."""
    sizes = np.array([len(group) for group in groups])
    if sizes.sum() == 0:
        return np.inf
    rows = np.concatenate(groups)
    amounts = _draw(evidence, rows)
    if senses is not None:
        sided = np.repeat(senses, sizes)[:, None]
        amounts = np.where(sided == 0, amounts, np.maximum(-sided * amounts, 0.0))
    starts = np.concatenate(([0], np.cumsum(sizes[sizes > 0])[:-1]))
    gains = np.add.reduceat(amounts**2, starts, axis=0)
    return float(np.quantile(gains.max(axis=0), level))


def _draw(evidence: Evidence, rows: Array) -> Array:
    """Amounts of noise along rows, (c, DRAWS)."""
    blocks = evidence.blocks
    shared = (
        np.stack([rows[:, block].sum(axis=1) / np.sqrt(block.size) for block in blocks], axis=1) if blocks else None
    )
    rest = rows @ rows.T
    amounts = np.zeros((rows.shape[0], DRAWS))
    if shared is not None:
        rest = rest - shared @ shared.T
        scale = np.ones(DRAWS)
        if evidence.shared_freedom:
            scale = np.sqrt(evidence.shared_freedom / _chi_squares(evidence.shared_freedom))
        amounts += (shared @ _normals(shared.shape[1], 0)) * scale
    size, vectors = np.linalg.eigh(rest)
    root = vectors * np.sqrt(np.maximum(size, 0.0))
    kept = size > 1e-10 * max(float(size.max()), 1e-300)
    return amounts + root[:, kept] @ _normals(int(kept.sum()), 1)


@lru_cache(maxsize=32)
def _normals(rows: int, stream: int) -> Array:
    return np.random.default_rng([_SEED, stream]).standard_normal((rows, DRAWS))


@lru_cache(maxsize=32)
def _chi_squares(freedom: int) -> Array:
    return np.random.default_rng([_SEED, 2]).chisquare(freedom, DRAWS)
