"""Marginal likelihood of the tests under each explanation of a gap.

Notes:
    Around a fitted model the whitened residuals are r = noise + W e + J p + U a: errors e of the rig, independent and
    of unit variance times a size that is not known; parameters p, with a flat prior or one of known precision; and
    amounts a of what may be missing. With S = k^2 I + W D W^T and the parameters projected out,
    P = S^-1 - S^-1 J (J^T S^-1 J)^-1 J^T S^-1, the logarithm of the restricted likelihood is
    -(r^T P r + ln|S| + ln|J^T S^-1 J|)/2 but for a constant (Patterson and Thompson, 1971). Amounts of variance v^2
    along columns U add, with the eigenvalues l of U^T P U and the components b of U^T P r along its eigenvectors,
    sum (v^2 b^2/(1 + v^2 l) - ln(1 + v^2 l))/2. Sizes of the rig's errors and of amounts are summed over nodes with
    weights of a prior. Only inner products enter; errors of the rig stay within blocks of rows, so that what a node
    costs is solved once for all models of the same tests.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.special import chdtrc, log_ndtr, logsumexp

from bushfit.diagnosis.priors import SIZES
from bushfit.diagnosis.rig_errors import RigErrors
from bushfit.effects.contract import Array

#: Share of a parameter's information that is added to it, so that what the tests leave open can be inverted.
_ROUNDING = 1e-9
#: Change of |K| by a unit of an amount, below which the tests do not see it.
_UNSEEN = 1e-9
#: Numbers that errors of the rig at all nodes together, or columns of groups, may take at once: 32 MB.
_AT_ONCE = 4_000_000


@dataclass(frozen=True, eq=False)
class Group:
    """Columns with a Gaussian prior, whose amounts are relative to |K|.

    Args:
        columns: whitened residuals of a unit of each amount, (c, n).
        unit: share of |K| that a unit changes, (c,); of columns that move together complex at some points, (c, p).
        together: whether the amounts are independent of one size; else one column is chosen, each as likely.
        sense: +1 where only positive amounts make sense, of columns of which one is chosen.
        among: the rows that the columns have, and of how many, where they have not all of them.
    """

    columns: Array
    unit: Array
    together: bool
    sense: int = 0
    among: tuple[slice, int] | None = None

    @property
    def whole(self) -> Array:
        """The columns over all rows, (c, n)."""
        if self.among is None:
            return self.columns
        rows, count = self.among
        found = np.zeros((len(self.columns), count))
        found[:, rows] = self.columns
        return found


@dataclass(frozen=True, eq=False)
class GroupEvidence:
    """Evidence of the tests for a group of columns.

    Args:
        log_evidence: of the tests with it, of all sizes and nodes together.
        size: of what it changes, relative to |K|, as the tests leave it.
        likeliest: the size at which the tests are likeliest.
        by_node: logarithm of the evidence at each node, best size, (nodes,).
        beside: the same beside a deviation of the compound; None without.
    """

    log_evidence: float
    size: float
    likeliest: float
    by_node: Array
    beside: "GroupEvidence | None" = None

    @property
    def whole(self) -> float:
        """ln evidence, with a deviation of the compound and without."""
        if self.beside is None:
            return self.log_evidence
        return float(np.logaddexp(self.log_evidence, self.beside.log_evidence))


@dataclass(frozen=True, eq=False)
class LinearModel:
    """Everything linear about one fitted model and its tests.

    Args:
        residual: whitened by the points' own scatter alone, (n,).
        jacobian: by the parameters and what else moves freely, (k, n).
        precision: prior precision of each of these; 0 where the prior is flat, (k,).
        groups: what may be missing.
        at: numbers of the rig's nodes that count; all where it is None.
        compound: the compound's own deviation at unit size, a part of every hypothesis; None without.
    """

    residual: Array
    jacobian: Array
    precision: Array
    rig: RigErrors
    groups: Sequence[Group] = ()
    at: Array | None = None
    compound: Group | None = None

    @cached_property
    def _smooth(self) -> Array:
        """Columns of the compound's own deviation, (q, n)."""
        return np.zeros((0, self.residual.size)) if self.compound is None else self.compound.whole

    @property
    def _first(self) -> int:
        """Number of the first row of a group among all."""
        return 1 + len(self.jacobian) + len(self._smooth)

    @cached_property
    def _at(self) -> Array:
        every = np.arange(len(self.rig.nodes)) if self.at is None else self.at
        return every if self.compound is not None else every[self.rig.compound[every] == 0.0]

    @cached_property
    def _plain(self) -> Array:
        """Mask of the nodes without level errors beyond the rig's class and without a deviation of the compound."""
        return self.rig.within_class[self._at] & ~self._bent

    @cached_property
    def _bent(self) -> Array:
        """Mask of the nodes with a deviation of the compound."""
        return np.asarray(self.rig.compound[self._at] > 0.0)

    @cached_property
    def _every(self) -> Array:
        """Residual, derivatives, and columns of the compound and of all groups, (1 + k + q + c, n)."""
        return np.concatenate(
            [self.residual[None], self.jacobian, self._smooth, *(group.whole for group in self.groups)]
        )

    @cached_property
    def _scatters(self) -> Array:
        """Mask of the rows that scatter as points of sweeps do, (n,)."""
        scatters = np.zeros(self.residual.size, dtype=bool)
        for block in self.rig.blocks:
            scatters[block.rows] |= block.scatters
        return scatters

    @cached_property
    def _places(self) -> list[Array]:
        """Numbers of the rows of each group among all."""
        ends = self._first + np.cumsum([0, *(len(group.columns) for group in self.groups)])
        return [np.arange(*pair) for pair in pairwise(ends.tolist())]

    @cached_property
    def _alike(self) -> list[tuple[list[int], Array]]:
        """Groups that move together, those with as many columns side by side: their numbers, (m,), and rows, (m, g)."""
        sizes: dict[int, list[int]] = {}
        for number, group in enumerate(self.groups):
            if group.together:
                sizes.setdefault(len(group.columns), []).append(number)
        return [(own, np.array([self._places[number] for number in own])) for own in sizes.values()]

    @cached_property
    def _products(self) -> "_Products":
        every, scatters = self._every, self._scatters
        first = self._first
        parts = [_columns(every, scatters), _columns(every, ~scatters)]
        along = np.zeros((len(self.rig.blocks), self.rig.width, len(every)))
        for number, block in enumerate(self.rig.blocks):
            along[number, : len(block.kinds)] = block.columns @ every[:, block.rows].T
        return _Products(
            tuple(part[:first] @ part.T for part in parts),
            tuple(np.einsum("cn,cn->c", part, part) for part in parts),
            [tuple(_grams(part, own) for part in parts) for _, own in self._alike],
            along,
            int(scatters.sum()),
        )

    @cached_property
    def _solved(self) -> "_Solved":
        """At every node what the tests say without a group, and along all groups; some nodes at a time, as memory has
        it."""
        rows = len(self.rig.blocks) * self.rig.width * self._every.shape[0]
        own, sizes = self.rig.combination[self._at], self.rig.compound[self._at]
        every = np.unique(own)
        found = []
        for part in np.array_split(every, max(1, min(every.size, every.size * rows // _AT_ONCE))):
            errors = self._with_errors(part)
            for size in np.unique(sizes[np.isin(own, part)]):
                nodes = np.flatnonzero((sizes == size) & np.isin(own, part))
                solved = self._solved_at(self._at[nodes], errors.at(np.searchsorted(part, own[nodes])), float(size))
                found.append((nodes, solved))
        order = np.argsort(np.concatenate([nodes for nodes, _ in found]))
        arrays = zip(*((each.base, each.misfit, each.size, each.along, each.moved) for _, each in found), strict=True)
        base, misfit, size, along, moved = (np.concatenate(array)[order] for array in arrays)
        grams = [np.concatenate(kind)[order] for kind in zip(*(each.grams for _, each in found), strict=True)]
        return _Solved(base, misfit, size, along, grams, moved)

    def _with_errors(self, combinations: Array) -> "_WithErrors":
        """Inner products of rows by the covariance of noise and errors of the rig, at some combinations of sizes of
        these."""
        products, first = self._products, self._first
        scatter, roots = self.rig.distinct_scatter[combinations], self.rig.roots[0][combinations]
        share = 1.0 / np.square(scatter)[:, None, None]
        left = (roots @ products.along).reshape(len(scatter), -1, len(self._every))
        gram = share * products.rows[0] + products.rows[1] - left[..., :first].swapaxes(1, 2) @ left
        square = share[..., 0] * products.squares[0] + products.squares[1] - np.einsum("nwc,nwc->nc", left, left)
        grams = []
        for (_, own), parts in zip(self._alike, products.grams, strict=True):
            there = np.moveaxis(left[..., own], 1, -1)  # (combinations, groups, columns, errors)
            grams.append(share[..., None] * parts[0] + parts[1] - there @ there.swapaxes(-1, -2))
        log_size = self.rig.roots[1][combinations] + 2.0 * products.count * np.log(scatter)
        return _WithErrors(gram, square, grams, log_size)

    def _solved_at(self, nodes: Array, errors: "_WithErrors", size: float) -> "_Solved":
        """At some nodes, all with a deviation of the compound of one size: it moves as parameters of known precision
        do."""
        products, flat, first = self._products, len(self.jacobian), self._first
        chosen = np.arange(first if size else 1 + flat)
        precision = np.concatenate((self.precision, np.ones(chosen.size - 1 - flat)))
        known = precision > 0.0
        grow = np.concatenate((np.ones(1 + flat), np.full(first - 1 - flat, size), np.ones(len(self._every) - first)))
        gram = errors.gram[:, chosen] * grow[chosen, None] * grow
        told = np.diag((products.rows[0] + products.rows[1])[1:, 1:])[: chosen.size - 1] * np.square(grow[chosen[1:]])
        scale = np.sqrt(np.maximum(told + precision, np.finfo(float).tiny))
        information = gram[:, 1:, chosen[1:]] + np.diag(precision)
        root = np.linalg.cholesky(information / np.outer(scale, scale) + _ROUNDING * np.eye(scale.size))
        free = np.linalg.solve(root, gram[:, 1:] / scale[:, None])
        rest = gram[:, 0] - np.einsum("nk,nkc->nc", free[..., 0], free)
        log_size = errors.log_size + 2.0 * np.sum(np.log(np.einsum("nkk->nk", root) * scale), axis=1)
        log_size -= np.sum(np.log(precision[known]))
        square = errors.square - np.einsum("nkc,nkc->nc", free, free)
        grams = []
        for (_, own), gram_of in zip(self._alike, errors.grams, strict=True):
            there = np.moveaxis(free[..., own], 1, -1)  # (nodes, groups, columns, free)
            grams.append(gram_of - there @ there.swapaxes(-1, -2))
        weight = np.array([self.rig.nodes[node].log_weight for node in nodes.tolist()])
        base = weight - 0.5 * (rest[:, 0] + log_size)
        moved = np.zeros(len(nodes))
        if size and self.compound is not None:
            back = np.linalg.solve(root.swapaxes(1, 2), free[..., :1])[..., 0] / scale
            moved = np.square(np.abs(back[:, flat:] * size @ self.compound.unit)).max(axis=-1)
        return _Solved(base, rest[:, 0], np.maximum(square[:, first:], 0.0), rest[:, first:], grams, moved)

    def group_evidence_of(self, groups: Sequence[Group]) -> list[GroupEvidence]:
        """Evidence for other groups, computed in parts to limit the memory."""
        whole = np.cumsum([len(group.columns) for group in groups]) * self.residual.size // _AT_ONCE
        ends = [0, *(np.flatnonzero(np.diff(whole)) + 1).tolist(), len(groups)]
        return [
            evidence for own in pairwise(ends) for evidence in replace(self, groups=groups[slice(*own)]).group_evidence
        ]

    @property
    def log_evidence(self) -> float:
        """Log evidence of the tests if nothing is missing and the rig's errors are within its class."""
        return float(logsumexp(self._solved.base[self._plain]))

    @property
    def log_evidence_bent(self) -> float:
        """Log evidence of the tests with a deviation of the compound."""
        return float(logsumexp(self._solved.base[self._bent])) if self._bent.any() else -np.inf

    @property
    def deviation(self) -> tuple[float, float]:
        """Relative change by a deviation of the compound, estimated from the tests, and its most probable size."""
        base = self._solved.base[self._bent]
        share = np.exp(base - logsumexp(base))
        sizes = self.rig.compound[self._at][self._bent]
        likeliest = max(np.unique(sizes), key=lambda size: share[sizes == size].sum())
        return float(np.sqrt(share @ self._solved.moved[self._bent])), float(likeliest)

    @property
    def log_evidence_wide(self) -> float:
        """Log evidence of the tests with level errors beyond the rig's class."""
        beyond = ~(self._plain | self._bent)
        return float(logsumexp(self._solved.base[beyond])) if beyond.any() else -np.inf

    def likely(self, far: float) -> Array:
        """Nodes of the rig's errors at which a further group of columns may contribute.

        Args:
            far: difference in log evidence from the best node, beyond which a node is left out.

        Returns:
            Indices of the nodes that are near the best without a further group, or with one of the groups. Without a
            deviation of the compound, nodes that such a deviation makes likely are included.
        """
        base, plain, own = self._solved.base, self._plain, self.rig.combination[self._at]
        base = np.where(plain | self._bent, base, -np.inf)
        best = np.full(own.max() + 1, -np.inf)
        np.maximum.at(best, own, base)
        near = (base > base.max() - far) | (plain & (base > base[plain].max() - far))
        beside = np.max([base, *(evidence.by_node for evidence in self.group_evidence)], axis=0)
        led = (best[own] > best.max() - far) | (beside > beside[plain].max() - far)
        return self._at[near | (plain & led)]

    def chance(self, *, bent: bool = False) -> float:
        """Probability that tests of this model and rig leave more than these do, over the nodes as likely as they are;
        `bent` beside a deviation of the compound.

        Notes: a posterior predictive check on r^T P r (Gelman, Meng and Stern, 1996).
        """
        base = np.where(self._bent if bent else self._plain, self._solved.base, -np.inf)
        freedom = max(self.residual.size - int(np.count_nonzero(self.precision == 0.0)), 1)
        return float(np.exp(base - logsumexp(base)) @ chdtrc(freedom, self._solved.misfit))

    @cached_property
    def group_evidence(self) -> list[GroupEvidence]:
        """Evidence for each group, with the rig's errors within its class."""
        found: dict[int, GroupEvidence] = {}
        first = self._first
        for (numbers, own), gram in zip(self._alike, self._solved.grams, strict=True):
            units = [self.groups[number].unit for number in numbers]
            gains, moved = _of_all(gram, self._solved.along[:, own - first], units)
            for place, number in enumerate(numbers):
                found[number] = self._worth(gains[:, place, None], moved[:, place, None])
        for number, (group, own) in enumerate(zip(self.groups, self._places, strict=True)):
            if not group.together:
                there = self._solved.size[:, own - first, None], self._solved.along[:, own - first, None]
                found[number] = self._worth(*_of_one(group, *there))
        return [found[number] for number in range(len(self.groups))]

    def amounts(self, number: int) -> tuple[Array, Array]:
        """Posterior of the amounts of a group whose columns move together.

        Args:
            number: index of the group.

        Returns:
            Mean, (g,), and covariance, (g, g), over all sizes and the nodes within the class of the rig.
        """
        kind, place = next((kind, own.index(number)) for kind, (own, _) in enumerate(self._alike) if number in own)
        size, vectors = np.linalg.eigh(self._solved.grams[kind][self._plain, place])
        along = self._solved.along[self._plain][:, self._places[number] - self._first]
        along = np.einsum("nij,ni->nj", vectors, along)[:, None]
        v2 = np.square(SIZES)[:, None]
        grown = 1.0 + v2 * np.maximum(size, 0.0)[:, None]
        gain = 0.5 * np.sum(v2 * along**2 / grown - np.log(grown), axis=-1) + self._solved.base[self._plain, None]
        share = np.exp(gain - logsumexp(gain))
        means = np.einsum("nij,nsj->nsi", vectors, -v2 * along / grown)
        mean = np.einsum("ns,nsi->i", share, means)
        spread = np.einsum("nij,nj,nkj->ik", vectors, np.einsum("ns,nsj->nj", share, v2 / grown), vectors)
        return mean, spread + np.einsum("ns,nsi,nsj->ij", share, means - mean, means - mean)

    def _worth(self, gains: Array, moved: Array) -> GroupEvidence:
        """Evidence for a group from the gains in log evidence and the squared changes, (nodes, columns, sizes)."""
        whole = self._solved.base[:, None, None] + gains
        by_node = whole.max(axis=(1, 2))

        def evidence_at(chosen: Array, beside: GroupEvidence | None = None) -> GroupEvidence:
            """Evidence over the chosen nodes.

            Returns:
                Log evidence, change and likeliest size.
            """
            own = whole[chosen]
            if not own.size:
                return GroupEvidence(-np.inf, 0.0, float(SIZES[0]), by_node, beside)
            share = np.exp(own - own.max())
            total = share.sum()
            size = float(np.sqrt(np.sum(share * moved[chosen]) / total))
            likeliest = float(SIZES[int(np.argmax(share.sum(axis=(0, 1))))])
            log_evidence = float(own.max() + np.log(total) - np.log(whole.shape[1] * SIZES.size))
            return GroupEvidence(log_evidence, size, likeliest, by_node, beside)

        return evidence_at(self._plain, evidence_at(self._bent) if self._bent.any() else None)


def _columns(every: Array, chosen: Array) -> Array:
    """Some columns of all rows, (n,) bool; without a copy where they stand side by side."""
    places = np.flatnonzero(chosen)
    if places.size and places[-1] - places[0] + 1 == places.size:
        return every[:, places[0] : places[-1] + 1]
    return every[:, places]


def _grams(part: Array, own: Array) -> Array:
    """Inner products of the rows of each group, (m, g) -> (m, g, g); most have nothing in loops, or in sweeps."""
    there = np.any(np.any(part, axis=1)[own], axis=1)
    found, rows = np.zeros((*own.shape, own.shape[1])), part[own[there]]
    found[there] = rows @ rows.swapaxes(-1, -2)
    return found


def _of_one(group: Group, size: Array, along: Array) -> tuple[Array, Array]:
    """Gain in ln evidence, and square of the change relative to |K|, of one of a group's columns, (nodes, c, sizes)."""
    seen = group.unit > _UNSEEN
    v2 = np.square(SIZES * np.where(seen, 1.0 / np.where(seen, group.unit, 1.0), 0.0)[:, None])
    grown = 1.0 + v2 * size
    gain = 0.5 * (v2 * along**2 / grown - np.log(grown))
    mean = -v2 * along / grown
    if group.sense:
        error = np.sqrt(np.where(seen[:, None], v2, 1.0) / grown)
        gain = gain + np.log(2.0) + log_ndtr(group.sense * mean / error)
    return gain, np.square(mean * group.unit[:, None])


def _of_all(gram: Array, along: Array, units: Sequence[Array]) -> tuple[Array, Array]:
    """Gains in log evidence and largest squared changes of groups whose columns move together.

    Returns:
        Gains and squared changes, (nodes, groups, sizes) each.
    """
    size, vectors = np.linalg.eigh(gram)
    along = np.einsum("nmij,nmi->nmj", vectors, along)[:, :, None]
    size, v2 = np.maximum(size, 0.0)[:, :, None], np.square(SIZES)[:, None]
    grown = 1.0 + v2 * size
    gain = 0.5 * np.sum(v2 * along**2 / grown - np.log(grown), axis=-1)
    amounts = (v2 * along / grown) @ vectors.swapaxes(-1, -2)
    moved = [np.square(np.abs(amounts[:, place] @ unit)).max(axis=-1) for place, unit in enumerate(units)]
    return gain, np.stack(moved, axis=1)


@dataclass(frozen=True, eq=False)
class _Products:
    """Inner products of rows, of those that scatter and of the others.

    Args:
        rows: of residual and derivatives with all rows, (1 + k, 1 + k + c) each.
        squares: of each row with itself.
        grams: of the columns of groups that move together, (m, g, g) each.
        along: of each block's errors with all rows, (blocks, w, c).
        count: residuals that scatter.
    """

    rows: tuple[Array, ...]
    squares: tuple[Array, ...]
    grams: list[tuple[Array, ...]]
    along: Array
    count: int


@dataclass(frozen=True, eq=False)
class _WithErrors:
    """Inner products by the covariance of noise and errors of the rig, at some combinations of their sizes: of
    residual, derivatives and the compound with all rows; of each row with itself; of the columns of groups that move
    together; and the logarithm of the determinant of that covariance."""

    gram: Array
    square: Array
    grams: list[Array]
    log_size: Array

    def at(self, numbers: Array) -> "_WithErrors":
        """Inner products at some of the combinations."""
        grams = [gram[numbers] for gram in self.grams]
        return _WithErrors(self.gram[numbers], self.square[numbers], grams, self.log_size[numbers])


@dataclass(frozen=True, eq=False)
class _Solved:
    """At every node: ln evidence without a group, misfit, and U^T P U (its diagonal, and whole of groups that move
    together) and U^T P r of the columns; and the square of what the compound's deviation changes at the most."""

    base: Array
    misfit: Array
    size: Array
    along: Array
    grams: list[Array]
    moved: Array
