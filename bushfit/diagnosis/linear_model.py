"""Marginal likelihood of the tests under each explanation of a gap.

Notes:
    Around a fitted model the whitened residuals are r = noise + W e + J p + D d + U a: errors e of the rig, independent
    and of unit variance times a size that is not known; parameters p, with a flat prior or one of known precision; a
    deviation d of the compound from the model's laws, of size s; and amounts a of what may be missing. With S the
    covariance of noise and rig and the parameters projected out, P = S^-1 - S^-1 J (J^T S^-1 J)^-1 J^T S^-1, the
    logarithm of the restricted likelihood is -(r^T P r + ln|S| + ln|J^T S^-1 J|)/2 but for a constant (Patterson and
    Thompson, 1971). Amounts of variance v^2 along columns U add, with the eigenvalues l of U^T P U and the components b
    of U^T P r along its eigenvectors, sum (v^2 b^2/(1 + v^2 l) - ln(1 + v^2 l))/2. One decomposition of D^T P D gives
    the same for every size s of the deviation. Sizes of the rig's errors, of the deviation and of amounts are summed
    over nodes with weights of a prior. Only inner products of rows enter; errors of the rig stay within blocks of rows.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.special import chdtrc, log_ndtr

from bushfit.diagnosis.groups import Group, GroupEvidence
from bushfit.diagnosis.priors import SIZES
from bushfit.diagnosis.rig_errors import RigErrors
from bushfit.effects.contract import Array

#: Share of a parameter's information that is added to it, so that the matrix of undetermined parameters has an inverse.
_ROUNDING = 1e-9
#: Largest array of products, over nodes or groups, that is computed at once: 4 million numbers, 32 MB.
_AT_ONCE = 4_000_000


@dataclass(frozen=True, eq=False)
class LinearModel:
    """Linearised residuals of a fitted model, from which the evidence for each further explanation is computed.

    A node is one combination of sizes of the rig's errors and of the compound's deviation from the model's laws. All
    log evidences are natural logs of the marginal likelihood, averaged over nodes and up to a common constant.

    Args:
        residual: residuals in units of the scatter from point to point, (n,).
        jacobian: derivatives of the residuals by the parameters and by the deviations of faulty parts, (k, n).
        precision: prior precision of each row of the Jacobian, 0 for a flat prior, (k,).
        rig: errors of the rig, with the nodes.
        groups: candidate explanations, each a group of residual columns.
        chosen_nodes: indices of the nodes to average over; None for all.
        compound: columns of the compound's deviation at unit size, part of every hypothesis; None without a deviation.
    """

    residual: Array
    jacobian: Array
    precision: Array
    rig: RigErrors
    groups: Sequence[Group] = ()
    chosen_nodes: Array | None = None
    compound: Group | None = None

    @cached_property
    def nodes(self) -> Array:
        """Indices of the combinations of error sizes (nodes) to average over.

        Without `compound`, only nodes in which the compound follows the model's laws.
        """
        chosen = np.arange(len(self.rig.nodes)) if self.chosen_nodes is None else self.chosen_nodes
        return np.array([n for n in chosen.tolist() if self.compound or not self.rig.nodes[n].compound], dtype=int)

    @cached_property
    def _deviation(self) -> Array:
        """Standard deviation of the compound's deviation from the model at each node, relative to |K|, (nodes,)."""
        return np.array([self.rig.nodes[n].compound for n in self.nodes])

    @cached_property
    def _plain(self) -> Array:
        """Mask of the nodes (error sizes) with rig errors within the stated accuracy and no compound deviation."""
        return np.array([not self.rig.nodes[n].wide for n in self.nodes]) & (self._deviation == 0.0)

    @cached_property
    def _blocks(self) -> list[tuple[Array, Array]]:
        """Blocks of columns that act together, collected by their number of columns (width) for array operations.

        The columns of a group are one block if they act together, else one block each.

        Returns:
            For each width, the index of each block's group, (blocks,), and the indices of its columns among residual,
            Jacobian and all columns, (blocks, width).
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
    def _at_nodes(self) -> "_AtNodes":
        """Evidence without a further explanation, and inner products of all columns, for each node (error sizes).

        Nodes are computed in parts to limit memory.
        """
        rig = self.rig
        deviation = self.compound.whole if self.compound else np.zeros((0, self.residual.size))
        rows = np.concatenate([self.residual[None], self.jacobian, deviation, *(group.scaled for group in self.groups)])
        first = 1 + len(self.jacobian) + len(deviation)
        scatters = np.zeros(self.residual.size, dtype=bool)
        projections = np.zeros((len(rig.blocks), rig.roots[0].shape[-1], len(rows)))
        for number, block in enumerate(rig.blocks):
            scatters[block.rows] |= block.scatters
            projections[number, : len(block.kinds)] = block.columns @ rows[:, block.rows].T
        parts = [_columns(rows, scatters), _columns(rows, ~scatters)]
        products = [part[:first] @ part.T for part in parts]
        block_products = [[_block_products(part, block_rows) for part in parts] for _, block_rows in self._blocks]
        by_noise = np.diag(products[0] + products[1])[1 : 1 + len(self.jacobian)]
        index = rig.combinations[1][self.nodes]
        used = np.unique(index)
        results = list[tuple[Array, list[Array]]]()
        for part in np.array_split(used, max(1, min(used.size, used.size * projections.size // _AT_ONCE))):
            scatter, roots = rig.combinations[0][part, 0], rig.roots[0][part]
            share = 1.0 / np.square(scatter)[:, None, None]
            error_products = (roots @ projections).reshape(len(part), -1, len(rows))
            gram = share * products[0] + products[1] - error_products[..., :first].swapaxes(1, 2) @ error_products
            grams = []
            for (_, block_rows), both in zip(self._blocks, block_products, strict=True):
                errors = np.moveaxis(error_products[..., block_rows], 1, -1)  # (combinations, blocks, width, errors)
                grams.append(share[..., None] * both[0] + both[1] - errors @ errors.swapaxes(-1, -2))
            log_det = rig.roots[1][part] + 2.0 * np.count_nonzero(scatters) * np.log(scatter)
            chosen = np.flatnonzero(np.isin(index, part))
            arrays = self._projected(chosen, np.searchsorted(part, index[chosen]), gram, grams, log_det, by_noise)
            results.append((chosen, arrays))
        order = np.argsort(np.concatenate([chosen for chosen, _ in results]))
        joined = [np.concatenate(kind)[order] for kind in zip(*(arrays for _, arrays in results), strict=True)]
        base, misfit, changes, *products = joined
        return _AtNodes(base, misfit, changes, products[: len(self._blocks)], products[len(self._blocks) :])

    def _projected(
        self, chosen: Array, index: Array, gram: Array, grams: Sequence[Array], log_det: Array, by_noise: Array
    ) -> list[Array]:
        """Project parameters and the compound's deviation out of the inner products, for some error sizes (nodes).

        Args:
            chosen: positions of the m nodes in `nodes`, (m,).
            index: index of the combination of rig errors at each node, (m,).
            gram: inner products of residual, Jacobian and compound with all rows, for each combination.
            grams: inner products within the blocks of groups, for each combination, one array per block width.
            log_det: natural log of the determinant of the covariance of noise and rig errors, for each combination.
            by_noise: squared norms of the rows of the Jacobian, whitened by noise alone, (k,).

        Returns:
            Arrays of `_AtNodes` in order, those of projections and grams one by one.
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
        variance = np.square(self._deviation[chosen])[:, None]
        shrinkage = variance / (1.0 + variance * values)  # of the products along each eigenvector
        residual = residual[index] - np.einsum("nq,nqc->nc", shrinkage * deviation[..., 0], deviation)
        log_det = log_det[index] + np.sum(np.log1p(variance * values), axis=1)
        changes = np.zeros(len(chosen))
        if self.compound:
            amounts = np.einsum("nij,nj->ni", vectors[index], shrinkage * deviation[..., 0])
            changes = np.square(np.abs(amounts @ self.compound.unit)).max(axis=-1)
        projections, projected = [], []
        for (_, rows), products in zip(self._blocks, grams, strict=True):
            absorbed = np.moveaxis(free[..., rows], 1, -1)  # (combinations, blocks, width, k)
            smooth_rows = np.moveaxis(deviation[..., rows], 1, -1)
            products = products - absorbed @ absorbed.swapaxes(-1, -2)
            projected.append(products[index] - (smooth_rows * shrinkage[:, None, None]) @ smooth_rows.swapaxes(-1, -2))
            projections.append(residual[:, rows])
        weight = np.array([self.rig.nodes[n].log_weight for n in self.nodes[chosen]])
        return [weight - 0.5 * (residual[:, 0] + log_det), residual[:, 0], changes, *projections, *projected]

    @cached_property
    def _gains(self) -> list[tuple[Array, Array]]:
        """Gain in log evidence and squared relative change of |K| by each group of columns, in blocks of equal width.

        Returns:
            For each block width, gain and squared change, (nodes, blocks, sizes) each.
        """
        gains: list[list[tuple[Array, Array]]] = [[] for _ in self.groups]
        at_nodes = self._at_nodes
        for (numbers, _), projections, gram in zip(self._blocks, at_nodes.projections, at_nodes.grams, strict=True):
            units = [self.groups[number].unit if self.groups[number].act_together else np.eye(1) for number in numbers]
            senses = np.array([self.groups[number].sign for number in numbers])
            for number, gain, changes in zip(numbers, *_block_gains(gram, projections, units, senses), strict=True):
                gains[number].append((gain, changes))
        stacked = (zip(*blocks, strict=True) for blocks in gains)
        return [(np.stack(gain, axis=1), np.stack(changes, axis=1)) for gain, changes in stacked]

    @cached_property
    def group_evidence(self) -> list[GroupEvidence]:
        """Evidence of the tests for each explanation in `groups`, with rig errors within the stated accuracy."""
        bent = self._deviation > 0.0
        return [
            self._over_nodes(gains, self._plain, self._over_nodes(gains, bent) if bent.any() else None)
            for gains in self._gains
        ]

    def _over_nodes(
        self, gains: tuple[Array, Array], chosen: Array, with_compound: GroupEvidence | None = None
    ) -> GroupEvidence:
        """Average the evidence for one explanation over some combinations of error sizes (nodes).

        Args:
            gains: gain in log evidence, and squared relative change of |K|, by node and size of the amounts, (nodes,
                sizes).
            chosen: mask of the nodes, (nodes,).
            with_compound: evidence together with a compound deviation, copied to the result; None without it.
        """
        log_evidence = (self._at_nodes.base[:, None, None] + gains[0])[chosen]
        if not log_evidence.size:
            return GroupEvidence(-np.inf, 0.0, float(SIZES[0]), with_compound)
        total = _log_sum(log_evidence)
        share = np.exp(log_evidence - total)
        size = float(np.sqrt(np.sum(share * gains[1][chosen])))
        likeliest = float(SIZES[int(np.argmax(share.sum(axis=(0, 1))))])
        return GroupEvidence(total - float(np.log(log_evidence[0].size)), size, likeliest, with_compound)

    def group_evidence_of(self, groups: Sequence[Group]) -> list[GroupEvidence]:
        """Compute the evidence of the tests for further explanations (groups), in parts to limit memory.

        Returns:
            One evidence per group, in the same order.
        """
        part = np.cumsum([len(group.columns) for group in groups]) * self.residual.size // _AT_ONCE
        ends = [0, *(np.flatnonzero(np.diff(part)) + 1).tolist(), len(groups)]
        return [
            evidence
            for start, stop in pairwise(ends)
            for evidence in replace(self, groups=groups[start:stop]).group_evidence
        ]

    def _log_evidence_over(self, chosen: Array) -> float:
        """Natural log of the evidence without a further explanation, over the error sizes in a mask, (nodes,)."""
        return _log_sum(self._at_nodes.base[chosen]) if chosen.any() else -np.inf

    @property
    def log_evidence(self) -> float:
        """Natural log of the tests' marginal likelihood if nothing is missing and rig errors are as stated."""
        return self._log_evidence_over(self._plain)

    @property
    def log_evidence_with_compound(self) -> float:
        """Natural log of the tests' marginal likelihood if only the compound deviates from the model's laws."""
        return self._log_evidence_over(self._deviation > 0.0)

    @property
    def log_evidence_with_level_errors(self) -> float:
        """Natural log of the tests' marginal likelihood if only rig errors of levels exceed the stated accuracy."""
        return self._log_evidence_over(~self._plain & (self._deviation == 0.0))

    @property
    def deviation(self) -> tuple[float, float]:
        """Size of the compound's deviation from the model's laws, relative to |K|.

        Returns:
            Root mean square over the posterior, and the likeliest size.
        """
        bent = self._deviation > 0.0
        share = np.exp(self._at_nodes.base[bent] - self.log_evidence_with_compound)
        sizes = self._deviation[bent]
        likeliest = max(np.unique(sizes), key=lambda size: share[sizes == size].sum())
        return float(np.sqrt(share @ self._at_nodes.changes[bent])), float(likeliest)

    def likely(self, far: float) -> Array:
        """Select the combinations of error sizes (nodes) that matter to the evidence for further explanations.

        Args:
            far: difference in log evidence from the best node, beyond which a node is left out.

        Returns:
            Indices of the nodes within `far` of the best node, without a group or with one of `groups`. Nodes without a
            deviation of the compound are included if a node with the same rig errors and a deviation is near the best.
        """
        plain, index = self._plain, self.rig.combinations[1][self.nodes]
        base = np.where(plain | (self._deviation > 0.0), self._at_nodes.base, -np.inf)
        best = np.full(index.max() + 1, -np.inf)
        np.maximum.at(best, index, base)
        near = (base > base.max() - far) | (plain & (base > base[plain].max() - far))
        with_group = np.max([base, *(self._at_nodes.base + gains.max(axis=(1, 2)) for gains, _ in self._gains)], axis=0)
        led = (best[index] > best.max() - far) | (with_group > with_group[plain].max() - far)
        return self.nodes[near | (plain & led)]

    def p_value(self, *, compound_deviates: bool = False) -> float:
        """Probability that tests of a complete model would have a larger misfit r^T P r than these tests.

        Args:
            compound_deviates: True to average over error sizes with a deviation of the compound; False without one.

        Notes: a posterior predictive check (Gelman, Meng and Stern, 1996), averaged over error sizes by probability. r
        are the whitened residuals, and P projects out the parameters.
        """
        base = np.where(self._deviation > 0.0 if compound_deviates else self._plain, self._at_nodes.base, -np.inf)
        freedom = max(self.residual.size - int(np.count_nonzero(self.precision == 0.0)), 1)
        return float(np.exp(base - _log_sum(base)) @ chdtrc(freedom, self._at_nodes.misfit))

    def amounts(self, number: int) -> tuple[Array, Array]:
        """Posterior mean and covariance of the amounts of a group whose g columns act together.

        Args:
            number: index of the group in `groups`.

        Returns:
            Mean, (g,), and covariance, (g, g), averaged over all sizes of the amounts and of the rig's errors.
        """
        kind, place = next(
            (kind, int(np.flatnonzero(numbers == number)[0]))
            for kind, (numbers, _) in enumerate(self._blocks)
            if number in numbers
        )
        values, vectors = np.linalg.eigh(self._at_nodes.grams[kind][self._plain, place])
        projections = np.einsum("nij,ni->nj", vectors, self._at_nodes.projections[kind][self._plain, place])[:, None]
        v2 = np.square(SIZES)[:, None]
        grown = 1.0 + v2 * np.maximum(values, 0.0)[:, None]
        gain = (
            0.5 * np.sum(v2 * projections**2 / grown - np.log(grown), axis=-1) + self._at_nodes.base[self._plain, None]
        )
        share = np.exp(gain - _log_sum(gain))
        means = np.einsum("nij,nsj->nsi", vectors, -v2 * projections / grown)
        mean = np.einsum("ns,nsi->i", share, means)
        spread = np.einsum("nij,nj,nkj->ik", vectors, np.einsum("ns,nsj->nj", share, v2 / grown), vectors)
        return mean, spread + np.einsum("ns,nsi,nsj->ij", share, means - mean, means - mean)


@dataclass(frozen=True, eq=False)
class _AtNodes:
    """Evidence and inner products at each node, a combination of sizes of rig errors and the compound's deviation.

    P projects out the parameters and the compound's deviation, and whitens by the rig's errors.

    Args:
        base: natural log of node weight times evidence without a group, (nodes,).
        misfit: r^T P r of the residuals r, (nodes,).
        changes: square of the largest relative change of |K| by the compound's deviation, (nodes,).
        projections: U^T P r of the group columns U, one array (nodes, blocks, width) per block width.
        grams: U^T P U of the group columns U, one array (nodes, blocks, width, width) per block width.
    """

    base: Array
    misfit: Array
    changes: Array
    projections: list[Array]
    grams: list[Array]


def _log_sum(values: Array) -> float:
    """Natural log of the sum of exp(values); far faster than `scipy.special.logsumexp` for short arrays."""
    peak = values.max()
    return float(peak + np.log(np.sum(np.exp(values - peak))))


def _columns(rows: Array, chosen: Array) -> Array:
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


def _block_gains(gram: Array, projections: Array, units: Sequence[Array], senses: Array) -> tuple[Array, Array]:
    """Gains in log evidence and squared relative changes of |K| for blocks of columns that act together.

    Args:
        gram: inner products U^T P U within the blocks, (nodes, blocks, width, width).
        projections: inner products U^T P r with the residuals, (nodes, blocks, width).
        units: relative change of |K| per unit amount at p operating points, (width, p) for each block.
        senses: +1 for a block of one column whose amount must be positive, else 0, (blocks,).

    Returns:
        Gains and squared changes for each of `priors.SIZES`, (blocks, nodes, sizes) each.
    """
    single = gram.shape[-1] == 1
    values, vectors = (gram[..., 0], np.ones_like(gram)) if single else np.linalg.eigh(gram)
    projections = np.einsum("nmij,nmi->nmj", vectors, projections)[:, :, None]
    v2 = np.square(SIZES)[:, None]
    grown = 1.0 + v2 * np.maximum(values, 0.0)[:, :, None]
    gain = 0.5 * np.sum(v2 * projections**2 / grown - np.log(grown), axis=-1)
    amounts = -(v2 * projections / grown) @ vectors.swapaxes(-1, -2)
    if senses.any():
        standardised = senses[:, None] * (amounts * np.sqrt(grown) / np.sqrt(v2))[..., 0]
        gain = np.where(senses[:, None] != 0, gain + np.log(2.0) + log_ndtr(standardised), gain)
    if single:
        changes = np.square(amounts[..., 0] * np.array([np.abs(unit).max() for unit in units])[:, None])
    else:
        changes = np.stack(
            [np.square(np.abs(amounts[:, block] @ unit)).max(axis=-1) for block, unit in enumerate(units)], axis=1
        )
    return gain.swapaxes(0, 1), changes.swapaxes(0, 1)
