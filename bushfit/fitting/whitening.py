"""Deviations of a sweep's points in units of noise: what scatters from point to point, and what a block shares.

Beside the noise a model error may count, independent from operating point to operating point; repeats share it.

Notes:
    Within a block of points with random parts s_i and a shared part t the covariance is V = diag(s_i^2) + t^2 1 1^T.
    All runs of a line may share an error besides, u^2 1 1^T over the line. With a_i = 1/s_i, divided by s_i and less
    the share 1 - 1/sqrt(1 + t^2 sum a_i^2) of what lies along a, a deviation is white; of what all runs of a line share
    then, as much is taken out in the same way. A point of weight w has s_i^2 = s^2/w; without weight it is not there,
    for shared errors either.

    Beside a model error of standard deviation e the covariance that whitens is diag(s_i^2) + e^2 R R^T, R = 1 where a
    row repeats an operating point. What runs and lines share stays out of these weights: the model's own error differs
    from level to level as well, and a level must not count less for an error of the rig that is smaller.
"""

from collections.abc import Hashable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.common_error import ErrorProducts
from bushfit.fitting.noise import SweepNoise


@dataclass(frozen=True, eq=False)
class _Shared:
    """An error that the points of each group share, groups side by side; what else they have is white.

    Args:
        starts: index of the first point of each group, (groups,).
        unit: what a unit of the error makes of each point's gain and phase, in units of noise, (2, n).
        variance: of the error, in gain and in phase, (2, 1).
    """

    starts: Array
    unit: Array
    variance: Array

    @cached_property
    def group(self) -> Array:
        """Number of the group that each point belongs to, (n,)."""
        return np.repeat(np.arange(self.starts.size), np.diff(self.starts, append=self.unit.shape[-1]))

    @property
    def log_size(self) -> float:
        """Natural log of the determinant of 1 + variance unit unit^T, all groups."""
        return float(np.sum(np.log1p(self.variance * self.weight)))

    @cached_property
    def weight(self) -> Array:
        """Sum of the squares of the unit error of each group, (2, groups)."""
        return np.maximum(np.add.reduceat(self.unit**2, self.starts, axis=-1), np.finfo(float).tiny)

    @cached_property
    def share(self) -> Array:
        """Share of what lies along the unit error of a group that is taken out, (2, groups)."""
        return 1.0 - 1.0 / np.sqrt(1.0 + self.variance * self.weight)

    def components(self, parts: Array) -> Array:
        """Components along the unit error of each group, (..., 2, n) -> (..., 2, groups)."""
        return np.add.reduceat(parts * self.unit, self.starts, axis=-1)

    def deviations(self, error: Array) -> Array:
        """Deviations by an error of each group, (..., 2, groups) -> (..., 2, n)."""
        return error[..., self.group] * self.unit

    def whiten(self, parts: Array) -> Array:
        """Deviations less the share of what lies along the unit error, which makes them white, (..., 2, n)."""
        return (
            parts - self.deviations(self.components(parts) / self.weight * self.share) if self.variance.any() else parts
        )


@dataclass(frozen=True, eq=False)
class Whitening:
    """Covariance of a sweep's deviations, gain and phase apart, block by block.

    Args:
        starts: index of the first point of each block, (blocks,).
        lines: index of the first point of each line, whose blocks stand side by side, (lines,).
        random: standard deviation of each point's gain and phase, as if it had all its weight, (2, n).
        noise: of the campaign's sweeps: its shared part, and how well either part is known.
        weights: share of its weight that each point has, (n,).
        points: number of the operating point of each row, from 0, (n,).
        model_error: standard deviation of the relative error of the model at each operating point, in phase and in
            quadrature; 0 where noise is all that counts.
    """

    starts: Array
    lines: Array
    random: Array
    noise: SweepNoise
    weights: Array
    points: Array
    model_error: float = 0.0

    def whiten(self, deviation: Array) -> Array:
        """Deviations in units of noise, shared errors taken out, complex (..., n) -> (..., 2 n), all gains first."""
        parts = _gain_and_phase(deviation) * self._block.unit
        if self.model_error:
            return _flat(self._less_points(parts))
        return _flat(self._line.whiten(self._block.whiten(parts)))

    def uncounted(self, influence: Array) -> Array:
        """Covariance that the noise adds to an estimate beside what is counted with a model error in the weights.

        Args:
            influence: of each whitened residual, (k, 2 n).

        Returns:
            (k, k): what runs and lines share, less the independent model error.
        """
        parts = self._less_points(influence.reshape(-1, 2, self.weights.size)) * self._block.unit
        order, starts = self._by_point
        added = np.zeros((len(parts), len(parts)))
        for variance, sums in (
            (-np.full((2, 1), self.model_error**2), np.add.reduceat(parts[..., order], starts, axis=-1)),
            (self._block.variance, np.add.reduceat(parts, self.starts, axis=-1)),
            (self._line.variance, np.add.reduceat(parts, self.lines, axis=-1)),
        ):
            added += np.einsum("icp,cq,jcp->ij", sums, variance, sums)
        return added

    def error_products(self, deviation: Array) -> ErrorProducts:
        """Inner products of deviations, complex (m, n), in noise that no run shares, with a model error."""
        parts = _gain_and_phase(deviation) * self._block.unit
        order, starts = self._by_point
        components = np.add.reduceat((parts * self._block.unit)[..., order], starts, axis=-1)
        return ErrorProducts(_flat(parts) @ _flat(parts).T, _flat(components), self._point.weight.ravel())

    @property
    def log_size(self) -> float:
        """Natural log of the determinant of the covariance beside a model error, over that of the random noise."""
        return self._point.log_size

    @cached_property
    def _by_point(self) -> tuple[Array, Array]:
        """Rows ordered by operating point, (n,), and the place where each begins, (points,)."""
        order = np.argsort(self.points, kind="stable")
        return order, np.concatenate(([0], 1 + np.flatnonzero(np.diff(self.points[order]))))

    @cached_property
    def _point(self) -> _Shared:
        """Error that the rows of an operating point share, in their order, in units of their noise."""
        order, starts = self._by_point
        return _Shared(starts, self._block.unit[:, order], np.full((2, 1), self.model_error**2))

    def _less_points(self, parts: Array) -> Array:
        order, _ = self._by_point
        remainder = np.empty_like(parts)
        remainder[..., order] = self._point.whiten(parts[..., order])
        return remainder

    def scaled(self, deviation: Array, *, shared: bool = True) -> Array:
        """Deviations over the random noise, complex (n,) -> (2, n), with `shared` less the block's likeliest error."""
        parts, block = _gain_and_phase(deviation), self._block
        if shared:
            mean = block.components(parts * block.unit) / block.weight
            weight = (block.variance + self._line.variance) * block.weight
            parts = parts - (weight / (1.0 + weight) * mean)[:, block.group]
        return parts / self.random

    def unsure(self, influence: Array) -> dict[Hashable, Array]:
        """Reactions of an estimator to each variance of the noise, (k, 2 n) each, as `MeasuredTest.unsure`.

        Returns:
            Reactions by variance, (k, 2 n) each.

        Notes:
            Within a block V has the derivatives I by s^2 and 1 1^T by t^2, whitened W^2 and (W 1)(W 1)^T. The estimate
            of t^2 is a mean of `freedom` squares that expect t^2 + s^2/n, and scatters no further down than to 0. So
            with what lines share.
        """
        block, line, noise = self._block, self._line, self.noise
        parts = line.whiten(influence.reshape(-1, 2, self.weights.size))
        reactions = {}
        if noise.scatter_freedom:
            reactions["scatter"] = line.whiten(block.whiten(block.whiten(parts))) * np.sqrt(2.0 / noise.scatter_freedom)
        if noise.freedom:
            expected = block.variance + self.random[:, self.starts] ** 2 / np.bincount(block.group)
            error = np.minimum(expected * np.sqrt(2.0 / noise.freedom), block.variance) * (1.0 - block.share) ** 2
            reactions["shared"] = line.whiten(block.deviations(block.components(parts) * error))
        if noise.level_freedom:
            expected = line.variance + 1.0 / line.weight
            error = np.minimum(expected * np.sqrt(2.0 / noise.level_freedom), line.variance) * (1.0 - line.share)
            reactions["level"] = line.deviations(line.components(parts) * error)
        return {
            (id(noise), kind, column): _flat(reaction * only)
            for kind, reaction in reactions.items()
            for column, only in enumerate(np.eye(2)[..., None])
        }

    @cached_property
    def _block(self) -> _Shared:
        """Error that the points of a block share, in units of their noise."""
        return _Shared(self.starts, np.sqrt(self.weights) / self.random, np.square(self.noise.shared)[:, None])

    @cached_property
    def _line(self) -> _Shared:
        """Error that the blocks of a line share, less what is taken out of each block."""
        unit = (1.0 - self._block.share)[:, self._block.group] * self._block.unit
        return _Shared(self.lines, unit, np.square(self.noise.level)[:, None])


def _gain_and_phase(deviation: Array) -> Array:
    """Gain and phase, complex (..., n) -> (..., 2, n)."""
    return np.stack((deviation.real, deviation.imag), axis=-2)


def _flat(parts: Array) -> Array:
    """All gains, then all phases, (..., 2, n) -> (..., 2 n)."""
    return parts.reshape(*parts.shape[:-2], parts.shape[-2] * parts.shape[-1])
