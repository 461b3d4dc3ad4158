"""Inner products of residuals and explanations in each noise case, with rig errors and parameters projected out."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from bushfit.diagnosis.explanations import Group
from bushfit.diagnosis.rig_errors import RigErrors
from bushfit.effects.contract import Array

#: Information added to each parameter, relative to its own, so that the matrix of undetermined parameters has an
#: inverse.
_ROUNDING = 1e-9
#: Largest array of products, over noise cases or groups, that is computed at once: 4 million numbers, 32 MB.
AT_ONCE = 4_000_000


@dataclass(frozen=True, eq=False)
class Products:
    """Evidence without a further explanation, and inner products with P, in each noise case.

    P projects out the parameters and the compound's deviation, and whitens by the rig's errors. A block is a set of
    columns that act together; blocks are collected by their number of columns (width) for array operations.

    Args:
        base: natural log of the prior weight of the case times the evidence without a further explanation, (cases,).
        misfit: r^T P r of the residuals r, (cases,).
        changes: square of the largest relative change of |K| due to the compound's deviation, (cases,).
        projections: U^T P r of the blocks U, an array (cases, blocks, width) for each width.
        grams: U^T P U of the blocks U, an array (cases, blocks, width, width) for each width.
    """

    base: Array
    misfit: Array
    changes: Array
    projections: list[Array]
    grams: list[Array]


@dataclass(frozen=True, eq=False)
class ProjectedColumns:
    """Residuals of a fitted model and columns of possible explanations, without the part that parameters absorb.

    A residual column is the change of the residuals due to an explanation of unit size.

    Args:
        residual: residuals in units of the scatter from point to point, (n,).
        jacobian: derivatives of the residuals with respect to the parameters and the deviations of faulty parts, (k,
            n).
        precision: prior precision of each row of the Jacobian, 0 for a flat prior, (k,).
        rig: errors of the rig. Each of its noise cases assumes a size of these errors and of the compound's deviation
            from the model's laws.
        groups: candidate explanations, each a group of residual columns.
        chosen_cases: indices of the noise cases to average over; None for all cases.
        compound: columns of the compound's deviation at unit size, part of every hypothesis; None without a deviation.
    """

    residual: Array
    jacobian: Array
    precision: Array
    rig: RigErrors
    groups: Sequence[Group] = ()
    chosen_cases: Array | None = None
    compound: Group | None = None

    @cached_property
    def cases(self) -> Array:
        """Indices of the noise cases to average over; without `compound`, only cases without a deviation."""
        chosen = np.arange(len(self.rig.cases)) if self.chosen_cases is None else self.chosen_cases
        return np.array([n for n in chosen.tolist() if self.compound or not self.rig.cases[n].compound], dtype=int)

    @cached_property
    def deviations(self) -> Array:
        """Standard deviation of the compound's deviation from the model in each case, relative to |K|, (cases,)."""
        return np.array([self.rig.cases[n].compound for n in self.cases])

    @cached_property
    def blocks(self) -> list[tuple[Array, Array]]:
        """Blocks of columns that act together, by width: those of a group are one block, or one block each.

        Returns:
            For each width, the index of each block's group, (blocks,), and the indices of its columns among residual,
            Jacobian, compound and groups, (blocks, width).
        """
        first = 1 + len(self.jacobian) + (len(self.compound.columns) if self.compound else 0)
        ends = first + np.cumsum([0, *(len(group.columns) for group in self.groups)])
        by_width: dict[int, list[tuple[int, Array]]] = {}
        for number, (group, (start, stop)) in enumerate(zip(self.groups, pairwise(ends.tolist()), strict=True)):
            rows = np.arange(start, stop)
            for block in rows[None] if group.act_together else rows[:, None]:
                by_width.setdefault(block.size, []).append((number, block))
        return [tuple(map(np.array, zip(*blocks, strict=True))) for blocks in by_width.values()]  # type: ignore[misc]

    @cached_property
    def products(self) -> Products:
        """Evidence without a further explanation, and inner products, in each noise case; in parts to limit memory."""
        rig = self.rig
        deviation = self.compound.whole if self.compound else np.zeros((0, self.residual.size))
        rows = np.concatenate([self.residual[None], self.jacobian, deviation, *(group.scaled for group in self.groups)])
        first = 1 + len(self.jacobian) + len(deviation)
        scatters = np.zeros(self.residual.size, dtype=bool)
        projections = np.zeros((len(rig.blocks), rig.roots[0].shape[-1], len(rows)))
        for number, block in enumerate(rig.blocks):
            scatters[block.rows] |= block.scatters
            projections[number, : len(block.kinds)] = block.columns @ rows[:, block.rows].T
        parts = [_select_columns(rows, scatters), _select_columns(rows, ~scatters)]
        products = [part[:first] @ part.T for part in parts]
        block_products = [[_block_products(part, block_rows) for part in parts] for _, block_rows in self.blocks]
        by_noise = np.diag(products[0] + products[1])[1 : 1 + len(self.jacobian)]
        index = rig.combinations[1][self.cases]
        used = np.unique(index)
        results = list[tuple[Array, list[Array]]]()
        for part in np.array_split(used, max(1, min(used.size, used.size * projections.size // AT_ONCE))):
            scatter, roots = rig.combinations[0][part, 0], rig.roots[0][part]
            share = 1.0 / np.square(scatter)[:, None, None]
            error_products = (roots @ projections).reshape(len(part), -1, len(rows))
            gram = share * products[0] + products[1] - error_products[..., :first].swapaxes(1, 2) @ error_products
            grams = []
            for (_, block_rows), both in zip(self.blocks, block_products, strict=True):
                errors = np.moveaxis(error_products[..., block_rows], 1, -1)  # (combinations, blocks, width, errors)
                grams.append(share[..., None] * both[0] + both[1] - errors @ errors.swapaxes(-1, -2))
            log_det = rig.roots[1][part] + 2.0 * np.count_nonzero(scatters) * np.log(scatter)
            chosen = np.flatnonzero(np.isin(index, part))
            arrays = self._projected(chosen, np.searchsorted(part, index[chosen]), gram, grams, log_det, by_noise)
            results.append((chosen, arrays))
        order = np.argsort(np.concatenate([chosen for chosen, _ in results]))
        joined = [np.concatenate(kind)[order] for kind in zip(*(arrays for _, arrays in results), strict=True)]
        base, misfit, changes, *products = joined
        return Products(base, misfit, changes, products[: len(self.blocks)], products[len(self.blocks) :])

    def _projected(
        self, chosen: Array, index: Array, gram: Array, grams: Sequence[Array], log_det: Array, by_noise: Array
    ) -> list[Array]:
        """Project parameters and the compound's deviation out of the inner products, for some noise cases.

        Args:
            chosen: positions of the m cases in `cases`, (m,).
            index: index of the combination of rig errors in each of these cases, (m,).
            gram: inner products of residual, Jacobian and compound with all rows, for each combination.
            grams: inner products within the blocks of groups, for each combination, one array per block width.
            log_det: natural log of the determinant of the covariance of noise and rig errors, for each combination.
            by_noise: squared norms of the rows of the Jacobian, whitened by noise alone, (k,).

        Returns:
            The fields of `Products` for these cases, in order; the arrays of projections and grams are returned one by
            one.
        """
        flat, has_prior = slice(1, 1 + len(self.jacobian)), self.precision > 0.0
        scale = np.sqrt(np.maximum(by_noise + self.precision, np.finfo(float).tiny))
        information = gram[:, flat, flat] + np.diag(self.precision)
        root = np.linalg.cholesky(information / np.outer(scale, scale) + _ROUNDING * np.eye(scale.size))
        free = np.linalg.solve(root, gram[:, flat] / scale[:, None])
        log_det = log_det + 2.0 * np.sum(np.log(np.einsum("nkk->nk", root) * scale), axis=1)
        log_det -= np.sum(np.log(self.precision[has_prior]))
        residual = gram[:, 0] - np.einsum("nk,nkc->nc", free[..., 0], free)
        smooth = slice(flat.stop, gram.shape[1])
        deviation = gram[:, smooth] - free[..., smooth].swapaxes(1, 2) @ free
        values, vectors = np.linalg.eigh(deviation[..., smooth])
        values, deviation = np.maximum(values, 0.0)[index], (vectors.swapaxes(1, 2) @ deviation)[index]
        variance = np.square(self.deviations[chosen])[:, None]
        shrinkage = variance / (1.0 + variance * values)  # of the products along each eigenvector
        residual = residual[index] - np.einsum("nq,nqc->nc", shrinkage * deviation[..., 0], deviation)
        log_det = log_det[index] + np.sum(np.log1p(variance * values), axis=1)
        changes = np.zeros(len(chosen))
        if self.compound:
            amounts = np.einsum("nij,nj->ni", vectors[index], shrinkage * deviation[..., 0])
            changes = np.square(np.abs(amounts @ self.compound.unit)).max(axis=-1)
        projections, projected = [], []
        for (_, rows), products in zip(self.blocks, grams, strict=True):
            absorbed = np.moveaxis(free[..., rows], 1, -1)  # (combinations, blocks, width, k)
            smooth_rows = np.moveaxis(deviation[..., rows], 1, -1)
            products = products - absorbed @ absorbed.swapaxes(-1, -2)
            projected.append(products[index] - (smooth_rows * shrinkage[:, None, None]) @ smooth_rows.swapaxes(-1, -2))
            projections.append(residual[:, rows])
        weight = np.array([self.rig.cases[n].log_weight for n in self.cases[chosen]])
        return [weight - 0.5 * (residual[:, 0] + log_det), residual[:, 0], changes, *projections, *projected]


def _select_columns(rows: Array, chosen: Array) -> Array:
    """Select columns of a matrix by a mask; a view without a copy if the selected columns are adjacent.

    Args:
        rows: matrix, (m, n).
        chosen: mask of the columns, (n,).
    """
    places = np.flatnonzero(chosen)
    if places.size and places[-1] - places[0] + 1 == places.size:
        return rows[:, places[0] : places[-1] + 1]
    return rows[:, places]


def _block_products(part: Array, block_rows: Array) -> Array:
    """Inner products of the rows within each block; blocks of zero rows are skipped for speed.

    Args:
        part: rows of residual columns, (rows, n).
        block_rows: indices of the rows of each block, (blocks, width).

    Returns:
        Products, (blocks, width, width).
    """
    filled = np.any(np.any(part, axis=1)[block_rows], axis=1)
    products, rows = np.zeros((*block_rows.shape, block_rows.shape[1])), part[block_rows[filled]]
    products[filled] = rows @ rows.swapaxes(-1, -2)
    return products
