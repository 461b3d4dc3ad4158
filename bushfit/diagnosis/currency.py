"""What every explanation of a gap is worth: the logarithm of the marginal likelihood of the tests under it.

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
class Worth:
    """What a group is worth.

    Args:
        log_evidence: of the tests with it, of all sizes and nodes together.
        size: of what it changes, relative to |K|, as the tests leave it.
        likeliest: the size at which the tests are likeliest.
        by_node: logarithm of the evidence at each node, best size, (nodes,).
    """

    log_evidence: float
    size: float
    likeliest: float
    by_node: Array


@dataclass(frozen=True, eq=False)
class Ledger:
    """Everything linear about one fitted model and its tests.

    Args:
        residual: whitened by the points' own scatter alone, (n,).
        jacobian: by the parameters and what else moves freely, (k, n).
        precision: prior precision of each of these; 0 where the prior is flat, (k,).
        groups: what may be missing.
        at: numbers of the rig's nodes that count; all where it is None.
    """

    residual: Array
    jacobian: Array
    precision: Array
    rig: RigErrors
    groups: Sequence[Group] = ()
    at: Array | None = None

    @cached_property
    def _at(self) -> Array:
        return np.arange(len(self.rig.nodes)) if self.at is None else self.at

    @cached_property
    def _within(self) -> Array:
        return self.rig.within[self._at]

    @cached_property
    def _every(self) -> Array:
        """Residual, derivatives and columns of all groups, (1 + k + c, n)."""
        return np.concatenate([self.residual[None], self.jacobian, *(group.whole for group in self.groups)])

    @cached_property
    def _scatters(self) -> Array:
        """Which rows scatter as sweeps' points do, (n,) bool."""
        scatters = np.zeros(self.residual.size, dtype=bool)
        for block in self.rig.blocks:
            scatters[block.rows] |= block.scatters
        return scatters

    @cached_property
    def _places(self) -> list[Array]:
        """Numbers of the rows of each group among all."""
        ends = 1 + len(self.jacobian) + np.cumsum([0, *(len(group.columns) for group in self.groups)])
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
        first = 1 + len(self.jacobian)
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
        parts = np.array_split(self._at, max(1, min(len(self._at), len(self._at) * rows // _AT_ONCE)))
        found = [self._solved_at(part) for part in parts]
        arrays = zip(*((each.base, each.misfit, each.size, each.along) for each in found), strict=True)
        base, misfit, size, along = map(np.concatenate, arrays)
        grams = [np.concatenate(kind) for kind in zip(*(each.grams for each in found), strict=True)]
        return _Solved(base, misfit, size, along, grams)

    def _solved_at(self, nodes: Array) -> "_Solved":
        k, products, known = len(self.jacobian), self._products, self.precision > 0.0
        told = np.diag((products.rows[0] + products.rows[1])[1:, 1 : 1 + k]) + self.precision  # the same at every node
        scale = np.sqrt(np.maximum(told, np.finfo(float).tiny))
        scatter, (roots, log_sizes) = self.rig.scatter[nodes], self.rig.roots
        share = 1.0 / np.square(scatter)[:, None, None]
        left = (roots[nodes] @ products.along).reshape(len(nodes), -1, len(self._every))
        gram = share * products.rows[0] + products.rows[1] - left[..., : 1 + k].swapaxes(1, 2) @ left
        information = gram[:, 1:, 1 : 1 + k] + np.diag(self.precision)
        root = np.linalg.cholesky(information / np.outer(scale, scale) + _ROUNDING * np.eye(k))
        free = np.linalg.solve(root, gram[:, 1:] / scale[:, None])
        rest = gram[:, 0] - np.einsum("nk,nkc->nc", free[..., 0], free)
        log_size = log_sizes[nodes] + 2.0 * products.count * np.log(scatter)
        log_size += 2.0 * np.sum(np.log(np.einsum("nkk->nk", root) * scale), axis=1)
        log_size -= np.sum(np.log(self.precision[known]))
        taken = np.concatenate((left, free), axis=1)
        square = share[..., 0] * products.squares[0] + products.squares[1] - np.einsum("nwc,nwc->nc", taken, taken)
        grams = []
        for (_, own), parts in zip(self._alike, products.grams, strict=True):
            there = np.moveaxis(taken[..., own], 1, -1)  # (nodes, groups, columns, taken)
            grams.append(share[..., None] * parts[0] + parts[1] - there @ there.swapaxes(-1, -2))
        weight = np.array([self.rig.nodes[node].log_weight for node in nodes.tolist()])
        base = weight - 0.5 * (rest[:, 0] + log_size)
        return _Solved(base, rest[:, 0], np.maximum(square[:, 1 + k :], 0.0), rest[:, 1 + k :], grams)

    def worths_of(self, groups: Sequence[Group]) -> list[Worth]:
        """What other groups are worth, some at a time, as memory has it."""
        whole = np.cumsum([len(group.columns) for group in groups]) * self.residual.size // _AT_ONCE
        ends = [0, *(np.flatnonzero(np.diff(whole)) + 1).tolist(), len(groups)]
        return [worth for own in pairwise(ends) for worth in replace(self, groups=groups[slice(*own)]).worths]

    @property
    def log_evidence(self) -> float:
        """Of the tests with nothing missing, errors of the rig within what its class allows."""
        return float(logsumexp(self._solved.base[self._within]))

    @property
    def log_evidence_wide(self) -> float:
        """The same with errors of levels beyond the class."""
        beyond = ~self._within
        return float(logsumexp(self._solved.base[beyond])) if beyond.any() else -np.inf

    def likely(self, far: float) -> Array:
        """Numbers of the nodes that nothing missing, or one of the groups, brings so near the best in ln evidence."""
        alone = self._solved.base
        best = np.max(np.array([alone, *(worth.by_node for worth in self.worths)]), axis=0)
        within = self._within
        kept = (alone > alone[within].max() - far) | (best > best[within].max() - far)
        return self._at[kept]

    @property
    def chance(self) -> float:
        """Probability that tests of this model and rig leave more than these do, over the nodes as likely as they are.

        Notes: a posterior predictive check on r^T P r (Gelman, Meng and Stern, 1996).
        """
        base = np.where(self._within, self._solved.base, -np.inf)
        freedom = max(self.residual.size - int(np.count_nonzero(self.precision == 0.0)), 1)
        return float(np.exp(base - logsumexp(base)) @ chdtrc(freedom, self._solved.misfit))

    @cached_property
    def worths(self) -> list[Worth]:
        """What each group is worth, errors of the rig within what its class allows."""
        found: dict[int, Worth] = {}
        first = 1 + len(self.jacobian)
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
        """Mean, (g,), and covariance, (g, g), of the amounts of a group whose columns move together, over all sizes and
        the nodes within the class of the rig."""
        kind, place = next((kind, own.index(number)) for kind, (own, _) in enumerate(self._alike) if number in own)
        size, vectors = np.linalg.eigh(self._solved.grams[kind][self._within, place])
        along = self._solved.along[self._within][:, self._places[number] - 1 - len(self.jacobian)]
        along = np.einsum("nij,ni->nj", vectors, along)[:, None]
        v2 = np.square(SIZES)[:, None]
        grown = 1.0 + v2 * np.maximum(size, 0.0)[:, None]
        gain = 0.5 * np.sum(v2 * along**2 / grown - np.log(grown), axis=-1) + self._solved.base[self._within, None]
        share = np.exp(gain - logsumexp(gain))
        means = np.einsum("nij,nsj->nsi", vectors, -v2 * along / grown)
        mean = np.einsum("ns,nsi->i", share, means)
        spread = np.einsum("nij,nj,nkj->ik", vectors, np.einsum("ns,nsj->nj", share, v2 / grown), vectors)
        return mean, spread + np.einsum("ns,nsi,nsj->ij", share, means - mean, means - mean)

    def _worth(self, gains: Array, moved: Array) -> Worth:
        """From gains in ln evidence and squares of the change, (nodes, columns, sizes)."""
        whole = self._solved.base[:, None, None] + gains
        within = whole[self._within]
        top = within.max()
        share = np.exp(within - top)
        total = share.sum()
        size = float(np.sqrt(np.sum(share * moved[self._within]) / total))
        likeliest = float(SIZES[int(np.argmax(share.sum(axis=(0, 1))))])
        log_evidence = float(top + np.log(total) - np.log(whole.shape[1] * SIZES.size))
        return Worth(log_evidence, size, likeliest, whole.max(axis=(1, 2)))


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
    """The same of groups whose columns move together, of the change its largest value, (nodes, groups, sizes)."""
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
class _Solved:
    """At every node: ln evidence without a group, misfit, and U^T P U (its diagonal, and whole of groups that move
    together) and U^T P r of the columns."""

    base: Array
    misfit: Array
    size: Array
    along: Array
    grams: list[Array]
