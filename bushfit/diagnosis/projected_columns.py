"""Columns of explanations and of the compound's deviation, with their inner products beside errors of the rig."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np

from bushfit.diagnosis.explanations import Group
from bushfit.diagnosis.rig_errors import RigErrors
from bushfit.effects.contract import Array

#: Largest array of products, over noise cases or groups, that is computed at once: 4 million numbers, 32 MB.
AT_ONCE = 4_000_000


@dataclass(frozen=True, eq=False)
class RigRows:
    """Rows of m residual columns, with their inner products X^T S^-1 Y; S is the covariance of scatter and rig errors.

    Args:
        rows: the columns as rows, (m, n).
        rig: errors of the rig.
    """

    rows: Array
    rig: RigErrors

    @cached_property
    def halves(self) -> list[Array]:
        """Parts of the rows at residuals whose scatter differs between noise cases, and at all others."""
        scatters = np.zeros(self.rows.shape[1], dtype=bool)
        for block in self.rig.blocks:
            scatters[block.rows] |= block.scatters
        return [_select_columns(self.rows, mask) for mask in (scatters, ~scatters)]

    @cached_property
    def shared(self) -> Array:
        """Inner products of the rows with the w errors of each block of the rig, (blocks, w, m)."""
        shared = np.zeros((len(self.rig.blocks), self.rig.roots[0].shape[-1], len(self.rows)))
        for number, block in enumerate(self.rig.blocks):
            shared[number, : len(block.kinds)] = block.columns @ self.rows[:, block.rows].T
        return shared

    def inner(self, other: RigRows, combinations: Array) -> Array:
        """Inner products with other rows.

        Args:
            other: m2 other rows.
            combinations: indices of c combinations of sizes of the rig's errors, (c,).

        Returns:
            Products, (c, m, m2).
        """
        if len(self.rows) > len(other.rows):  # the smaller set is weighted
            return other.inner(self, combinations).swapaxes(1, 2)
        roots = self.rig.roots[0][combinations]
        count = self.shared.shape[0] * self.shared.shape[1]
        weighted = (roots.swapaxes(-1, -2) @ (roots @ self.shared)).reshape(len(roots), count, len(self.rows))
        scattering, steady = (first @ second.T for first, second in zip(self.halves, other.halves, strict=True))
        among_errors = weighted.swapaxes(1, 2) @ other.shared.reshape(count, len(other.rows))
        return self.rig.precision[combinations, None, None] * scattering + steady - among_errors


@dataclass(frozen=True, eq=False)
class CompoundDeviation:
    """Deviation of the compound beside the errors of a rig, decomposed once for all fitted models.

    Args:
        group: q columns of the deviation at unit size.
        rig: errors of the rig.
    """

    group: Group
    rig: RigErrors

    @cached_property
    def rows(self) -> RigRows:
        """Columns of the deviation, with their inner products."""
        return RigRows(self.group.whole, self.rig)

    @cached_property
    def modes(self) -> tuple[Array, Array]:
        """Eigenvalues, (combinations, q), and eigenvectors, (combinations, q, q), of D^T S^-1 D for the columns D."""
        values, vectors = np.linalg.eigh(self.rows.inner(self.rows, np.arange(len(self.rig.combinations[0]))))
        return np.maximum(values, 0.0), vectors

    def inner(self, rows: RigRows, combinations: Array) -> Array:
        """Inner products of the q modes with m rows, for c combinations of sizes of the rig's errors, (c, q, m)."""
        return self.modes[1][combinations].swapaxes(1, 2) @ self.rows.inner(rows, combinations)

    def largest_changes(self, amounts: Array, combinations: Array) -> Array:
        """Square of the largest relative change of |K| due to deviations.

        Args:
            amounts: amounts of the q modes, (cases, q).
            combinations: index of the combination of sizes of the rig's errors in each case, (cases,).
        """
        vectors = self.modes[1][combinations]
        return np.square(np.abs(np.einsum("nij,nj->ni", vectors, amounts) @ self.group.unit)).max(axis=-1)


@dataclass(frozen=True, eq=False)
class GroupSet:
    """Explanations to compare, with the inner products of their columns that are the same for every fitted model.

    Args:
        groups: candidate explanations, each a group of residual columns; g columns in all.
        rig: errors of the rig.
    """

    groups: Sequence[Group]
    rig: RigErrors
    _within: dict[int, list[Array]] = field(default_factory=dict)
    _modes: dict[tuple[CompoundDeviation, int], Array] = field(default_factory=dict)

    @classmethod
    def split(cls, groups: Sequence[Group], rig: RigErrors) -> list[GroupSet]:
        """Build sets of the groups, in the same order, each small enough for the memory."""
        part = np.cumsum([len(group.columns) * group.row_count for group in groups]) // AT_ONCE
        ends = [0, *(np.flatnonzero(np.diff(part)) + 1).tolist(), len(groups)]
        return [cls(groups[start:stop], rig) for start, stop in pairwise(ends) if stop > start]

    @cached_property
    def rows(self) -> RigRows:
        """Columns of all groups, with their inner products."""
        return RigRows(np.concatenate([group.scaled for group in self.groups]), self.rig)

    @cached_property
    def blocks(self) -> list[tuple[Array, Array]]:
        """Blocks of columns that act together, by width: those of a group are one block, or one block each.

        Returns:
            For each width, the index of each block's group, (blocks,), and the indices of its columns among those of
            all groups, (blocks, width).
        """
        ends = np.cumsum([0, *(len(group.columns) for group in self.groups)])
        by_width: dict[int, list[tuple[int, Array]]] = {}
        for number, (group, (start, stop)) in enumerate(zip(self.groups, pairwise(ends.tolist()), strict=True)):
            rows = np.arange(start, stop)
            for block in rows[None] if group.act_together else rows[:, None]:
                by_width.setdefault(block.size, []).append((number, block))
        return [tuple(map(np.array, zip(*blocks, strict=True))) for blocks in by_width.values()]  # type: ignore[misc]

    @cached_property
    def _products_within(self) -> list[Array]:
        """Inner products within the blocks of each width, of both halves of the rows, (2, blocks, width, width)."""
        by_width = []
        for _, blocks in self.blocks:
            products = np.zeros((2, *blocks.shape, blocks.shape[1]))
            for product, half in zip(products, self.rows.halves, strict=True):
                filled = np.asarray(half.any(axis=1))[blocks].any(axis=1)  # others are skipped for speed
                product[filled] = half[blocks[filled]] @ half[blocks[filled]].swapaxes(-1, -2)
            by_width.append(products)
        return by_width

    def within(self, combinations: Array) -> list[Array]:
        """Inner products within the blocks for c combinations of sizes of the rig's errors, computed once for each.

        Returns:
            Products for each width of blocks, (c, blocks, width, width).
        """
        for n in combinations.tolist():
            if n not in self._within:
                errors = (self.rig.roots[0][n] @ self.rows.shared).reshape(-1, len(self.rows.rows)).T
                self._within[n] = [
                    self.rig.precision[n] * scattering + steady - errors[block] @ errors[block].swapaxes(-1, -2)
                    for (_, block), (scattering, steady) in zip(self.blocks, self._products_within, strict=True)
                ]
        return [np.stack(arrays) for arrays in zip(*(self._within[n] for n in combinations.tolist()), strict=True)]

    def with_modes(self, compound: CompoundDeviation, combinations: Array) -> Array:
        """Inner products of a deviation's q modes with the g columns, computed once for each combination of rig errors.

        Returns:
            Products, (combinations, q, g).
        """
        if not len(compound.group.columns):
            return np.zeros((len(combinations), 0, len(self.rows.rows)))
        keys = [(compound, n) for n in combinations.tolist()]
        if missing := [key for key in keys if key not in self._modes]:
            products = compound.inner(self.rows, np.array([n for _, n in missing]))
            self._modes.update(zip(missing, products, strict=True))
        return np.stack([self._modes[key] for key in keys])


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
