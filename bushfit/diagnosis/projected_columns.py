"""Columns of explanations and of the compound's deviation, with their inner products beside errors of the rig."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import groupby
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from bushfit.diagnosis.explanations import Signature
from bushfit.diagnosis.rig_errors import RigErrors
from bushfit.effects.contract import Array


@dataclass(frozen=True, eq=False)
class RigRows:
    """Changes of the residuals by m causes, for inner products weighted by the inverse covariance of the rig's errors.

    Args:
        rows: change X of consecutive residuals by each of m causes, such as explanations of a gap, (m, n).
        rig: errors of the rig.
        first: index of the first of these residuals; the causes change no others.
    """

    rows: Array
    rig: RigErrors
    first: int = 0

    @cached_property
    def shared(self) -> Array:
        """Inner products of the m changes with the rig's errors, weighted by the random noise only.

        Returns:
            Products for each assumed size of the random noise, each block of residuals that share errors, and each of
            its w errors, (sizes, blocks, w, m).
        """
        weights, kernels = self.rig.weights[0], self.rig.kernels[0]
        shared = np.zeros((len(weights), len(kernels), kernels.shape[-1], len(self.rows)))
        for number, block in enumerate(self.rig.blocks):
            changed = (self.first <= block.rows) & (block.rows < self.first + self.rows.shape[1])
            rows = block.rows[changed]
            weighted = block.columns[:, changed] * weights[:, None, rows]
            shared[:, number, : len(block.kinds)] = weighted @ self.rows[:, rows - self.first].T
        return shared

    def inner(self, second: RigRows, combinations: Array) -> Array:
        """Inner products X^T S^-1 Y with other changes Y, where S is the covariance of noise and rig errors.

        Args:
            second: the other m2 changes.
            combinations: indices of c combinations of sizes of the rig's errors in `RigErrors.combinations`, (c,).

        Returns:
            Products, (c, m, m2).
        """
        if len(self.rows) > len(second.rows):  # the smaller set is weighted
            return second.inner(self, combinations).swapaxes(1, 2)
        weights, scatter = self.rig.weights
        size, products = len(self.rows), np.empty((len(combinations), len(self.rows), len(second.rows)))
        begin = max(self.first, second.first)  # of the residuals that both sets change
        end = max(min(sets.first + sets.rows.shape[1] for sets in (self, second)), begin)
        own_rows, second_rows = (sets.rows[:, begin - sets.first : end - sets.first] for sets in (self, second))
        for number in np.unique(scatter[combinations]):
            chosen = scatter[combinations] == number
            kernels = self.rig.kernels[0][:, combinations[chosen]]
            blocks, count, width, _ = kernels.shape
            errors = kernels.reshape(blocks, count * width, width) @ self.shared[number]
            errors = errors.reshape(blocks, count, width, size).transpose(1, 3, 0, 2)
            shared = second.shared[number].reshape(blocks * width, len(second.rows))
            among_errors = errors.reshape(count * size, blocks * width) @ shared  # one product, for speed
            among_errors = among_errors.reshape(count, size, len(second.rows))
            of_scatter = own_rows * weights[number, begin:end] @ second_rows.T
            products[chosen] = np.subtract(of_scatter, among_errors, out=among_errors)
        return products


@dataclass(frozen=True, eq=False)
class CompoundDeviation:
    """Smooth deviation of the rubber from the model's laws, as q modes with independent amounts under a rig's errors.

    Args:
        signature: q changes of the residuals, each by one standard deviation of a pattern, for a size of 100 % of |K|.
        rig: errors of the rig.
    """

    signature: Signature
    rig: RigErrors

    @cached_property
    def rows(self) -> RigRows:
        """Change of the residuals by each of the q patterns of the deviation, (q, n)."""
        return RigRows(self.signature.whole, self.rig)

    @cached_property
    def modes(self) -> tuple[Array, Array]:
        """Modes of the deviation: combinations of its q patterns whose amounts are independent given the rig's errors.

        Returns:
            Eigenvalues, (combinations, q), and eigenvectors, (combinations, q, q), of D^T S^-1 D for each combination
            of assumed sizes of the rig's errors. D are the changes of the residuals by the q patterns, and S is the
            covariance of the residuals.
        """
        values, vectors = np.linalg.eigh(self.rows.inner(self.rows, np.arange(len(self.rig.combinations[0]))))
        return np.maximum(values, 0.0), vectors

    def inner(self, rows: RigRows, combinations: Array) -> Array:
        """Inner products of the q modes of the deviation with other changes of the residuals.

        The products are weighted by the inverse covariance of the residuals, as in `RigRows.inner`.

        Args:
            rows: m changes of the residuals, such as their derivatives with respect to parameters.
            combinations: indices of c combinations of sizes of the rig's errors, (c,).

        Returns:
            Products, (c, q, m).
        """
        return self.modes[1][combinations].swapaxes(1, 2) @ self.rows.inner(rows, combinations)

    def squared_changes(self, amounts: Array, combinations: Array) -> Array:
        """Squared relative change of |K| by the deviation, at the operating point where the deviation is largest.

        Args:
            amounts: amount of each of the q `modes` in each noise case, (cases, q).
            combinations: index of the rig errors that each noise case assumes in `RigErrors.combinations`, (cases,).

        Returns:
            Squared relative change in each noise case, (cases,).
        """
        changes = np.einsum("nij,nj->ni", self.modes[1][combinations], amounts) @ self.signature.stiffness_change
        return np.square(np.abs(changes)).max(axis=-1)


class Batch(NamedTuple):
    """Blocks of residual changes with equal numbers of columns and equal change of the stiffness, stored as arrays.

    A block is a set of columns of residual changes that act together. An explanation has one block, or one block for
    each alternative column.

    Args:
        signatures: index of the explanation of each block, ascending, (blocks,).
        columns: indices of the columns of each block among those of all signatures, (blocks, width).
        signs: +1 for a block of one column whose amount must be positive, else 0, (blocks,).
        stiffness_change: relative change of the stiffness per unit amount at p operating points, (width, p).
    """

    signatures: Array
    columns: Array
    signs: Array
    stiffness_change: Array


@dataclass(frozen=True, eq=False)
class SignatureSet:
    """Explanations to compare, with the inner products of their residual changes, cached for all fitted models.

    Args:
        signatures: residual changes of each explanation, all of the same residuals; g columns in all.
        rig: errors of the rig.
    """

    signatures: Sequence[Signature]
    rig: RigErrors
    _within: dict[int, list[Array]] = field(default_factory=dict)
    _modes: dict[tuple[CompoundDeviation, int], Array] = field(default_factory=dict)

    @classmethod
    def split(cls, signatures: Iterable[Signature | None], rig: RigErrors) -> list[SignatureSet]:
        """Build sets of the signatures that are not None, in the same order; each changes the same residuals."""
        return [cls(list(members), rig) for _, members in groupby(filter(None, signatures), attrgetter("rows"))]

    @cached_property
    def rows(self) -> RigRows:
        """Scaled residual changes of all signatures, (g, rows)."""
        scaled = np.concatenate([signature.scaled for signature in self.signatures])
        return RigRows(scaled, self.rig, self.signatures[0].rows.start)

    @cached_property
    def batches(self) -> list[Batch]:
        """Blocks of columns, by width: one for each signature whose columns act together, one for each other column."""
        first, by_shape = 0, defaultdict[tuple[int, bytes], list[tuple[int, Array, int]]](list)
        changes = dict[tuple[int, bytes], Array]()
        for number, signature in enumerate(self.signatures):
            rows = np.arange(first, first := first + len(signature.columns))
            change = signature.stiffness_change if signature.act_together else np.eye(1)
            blocks = rows[None] if signature.act_together else rows[:, None]
            key = blocks.shape[1], change.tobytes()
            changes[key] = change
            by_shape[key] += [(number, block, signature.sign) for block in blocks]
        arrays = [[np.array(values) for values in zip(*blocks, strict=True)] for blocks in by_shape.values()]
        return [
            Batch(signatures, columns, signs, change)
            for (signatures, columns, signs), change in zip(arrays, changes.values(), strict=True)
        ]

    @cached_property
    def _products_within(self) -> list[Array]:
        """Inner products U^T N^-1 U of the columns U of each block, with the variances N of the random noise.

        Returns:
            One array for each batch, (sizes, blocks, width, width), for each assumed size of the random noise.
        """
        by_batch = []
        for batch in self.batches:
            rows = self.rows.rows[batch.columns]
            weights = self.rig.weights[0][:, self.signatures[0].rows]
            by_batch.append(np.array([rows * weight @ rows.swapaxes(-1, -2) for weight in weights]))
        return by_batch

    def within(self, combinations: Array) -> list[Array]:
        """Inner products U^T S^-1 U of the columns of each block, S the covariance of noise and rig errors; cached.

        Args:
            combinations: indices of c combinations of sizes of the rig's errors, (c,).

        Returns:
            Products for each batch of blocks, (c, blocks, width, width).
        """
        for n in combinations.tolist():
            if n not in self._within:
                scatter = self.rig.weights[1][n]
                shared, errors = self.rows.shared[scatter], self.rig.kernels[0][:, n] @ self.rows.shared[scatter]
                shared, errors = (array.reshape(-1, len(self.rows.rows)).T for array in (shared, errors))
                self._within[n] = [
                    products[scatter] - shared[batch.columns] @ errors[batch.columns].swapaxes(-1, -2)
                    for batch, products in zip(self.batches, self._products_within, strict=True)
                ]
        return [np.stack(arrays) for arrays in zip(*(self._within[n] for n in combinations.tolist()), strict=True)]

    def with_modes(self, compound: CompoundDeviation, combinations: Array) -> Array:
        """Inner products of the modes of the rubber's deviation with all columns; cached.

        Args:
            compound: smooth deviation of the rubber, with q modes.
            combinations: indices of c combinations of sizes of the rig's errors, (c,).

        Returns:
            Products of the q modes of the deviation with the g columns of all signatures, (c, q, g).
        """
        keys = [(compound, n) for n in combinations.tolist()]
        if missing := [key for key in keys if key not in self._modes]:
            products = compound.inner(self.rows, np.array([n for _, n in missing]))
            self._modes.update(zip(missing, products, strict=True))
        return np.stack([self._modes[key] for key in keys])
