"""Covariance of a sweep's deviations: scatter from point to point, and errors that a block or a line shares.

Beside the noise a model error may count, independent from operating point to operating point; repeats share it.

Notes:
    Within a block of points with random parts s_i and a shared part t the covariance is V = diag(s_i^2) + t^2 1 1^T.
    All runs of a line may share an error besides, u^2 1 1^T over the line. With a_i = 1/s_i, divided by s_i and less
    the share 1 - 1/sqrt(1 + t^2 sum a_i^2) of what lies along a, a deviation is white; of what all runs of a line share
    then, as much is taken out in the same way. A point of weight w has s_i^2 = s^2/w; without weight it is not there,
    for shared errors either. Gains and phases are independent: deviations are real, (..., 2 n), all gains first.

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
class SharedError:
    """An error that all deviations of a group share, beside independent noise.

    Args:
        starts: index of the first deviation of each group, (g,).
        unit: change of each deviation, in units of noise, by a unit of the error, (m,).
        variance: of the error of each group, (g,).
    """

    starts: Array
    unit: Array
    variance: Array

    @cached_property
    def group(self) -> Array:
        """Number of the group that each deviation belongs to, (m,)."""
        return np.repeat(np.arange(self.starts.size), np.diff(self.starts, append=self.unit.size))

    @cached_property
    def weight(self) -> Array:
        """Sum of the squares of the unit error of each group, (g,)."""
        return np.maximum(np.add.reduceat(self.unit**2, self.starts), np.finfo(float).tiny)

    @cached_property
    def share(self) -> Array:
        """Share of the component along the unit error of a group that is taken out, (g,)."""
        return 1.0 - 1.0 / np.sqrt(1.0 + self.variance * self.weight)

    def components(self, rows: Array) -> Array:
        """Components along the unit error of each group, (..., m) -> (..., g)."""
        return np.add.reduceat(rows * self.unit, self.starts, axis=-1)

    def whiten(self, rows: Array) -> Array:
        """White deviations, (..., m): less the share of their component along the unit error."""
        if not self.variance.any():
            return rows
        return rows - (self.components(rows) / self.weight * self.share)[..., self.group] * self.unit


@dataclass(frozen=True, eq=False)
class Whitening:
    """Covariance of the deviations of a sweep, block by block.

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
        """Deviations in units of noise, shared errors taken out, complex (..., n) -> (..., 2 n)."""
        rows = np.concatenate((deviation.real, deviation.imag), axis=-1) * self._block.unit
        return self._less_points(rows) if self.model_error else self._line.whiten(self._block.whiten(rows))

    def uncounted(self, influence: Array) -> Array:
        """Covariance that the noise adds to an estimate beside what is counted with a model error in the weights.

        Args:
            influence: of each whitened residual, (k, 2 n).

        Returns:
            Effect of the errors that runs and lines share, less that of the independent model error, (k, k).
        """
        rows = self._less_points(influence) * self._block.unit
        order, starts = self._by_point
        added = np.zeros((len(rows), len(rows)))
        for variance, sums in (
            (np.full(starts.size, -(self.model_error**2)), np.add.reduceat(rows[:, order], starts, axis=-1)),
            (self._block.variance, np.add.reduceat(rows, self._block.starts, axis=-1)),
            (self._line.variance, np.add.reduceat(rows, self._line.starts, axis=-1)),
        ):
            added += (sums * variance) @ sums.T
        return added

    def error_products(self, deviation: Array) -> ErrorProducts:
        """Inner products of deviations, complex (m, n), in noise that no run shares, with a model error."""
        unit, (order, starts) = self._block.unit, self._by_point
        rows = np.concatenate((deviation.real, deviation.imag), axis=-1) * unit
        components = np.add.reduceat((rows * unit)[:, order], starts, axis=-1)
        return ErrorProducts(rows @ rows.T, components, self._point.weight)

    @property
    def log_size(self) -> float:
        """Natural log of the determinant of the covariance beside a model error, over that of the random noise."""
        return float(np.sum(np.log1p(self._point.variance * self._point.weight)))

    def scaled(self, deviation: Array, *, shared: bool = True) -> Array:
        """Deviations in units of the random noise.

        Args:
            deviation: complex (n,).
            shared: True to take out the likeliest error of each block.

        Returns:
            Gain and phase of each point, (2, n).
        """
        rows, block = np.concatenate((deviation.real, deviation.imag)), self._block
        if shared:
            mean = block.components(rows * block.unit) / block.weight
            level = np.repeat(np.square(self.noise.level), self.starts.size)
            weight = (block.variance + level) * block.weight
            rows = rows - (weight / (1.0 + weight) * mean)[block.group]
        return rows.reshape(2, -1) / self.random

    def unsure(self, influence: Array) -> dict[Hashable, Array]:
        """Reaction of an estimator to each estimated variance of the noise, (k, 2 n) each.

        Returns:
            Reactions by variance, (k, 2 n) each.

        Notes:
            Within a block V has the derivatives I by s^2 and 1 1^T by t^2, whitened W^2 and (W 1)(W 1)^T. The estimate
            of t^2 is a mean of `freedom` squares that expect t^2 + s^2/n, and scatters no further down than to 0. So
            with what lines share.
        """
        block, line, noise = self._block, self._line, self.noise
        rows, reactions = line.whiten(influence), {}
        if noise.scatter_freedom:
            reactions["scatter"] = line.whiten(block.whiten(block.whiten(rows))) * np.sqrt(2.0 / noise.scatter_freedom)
        if noise.freedom:
            expected = block.variance + self.random.ravel()[block.starts] ** 2 / np.bincount(block.group)
            error = np.minimum(expected * np.sqrt(2.0 / noise.freedom), block.variance) * (1.0 - block.share) ** 2
            reactions["shared"] = line.whiten((block.components(rows) * error)[:, block.group] * block.unit)
        if noise.level_freedom:
            expected = line.variance + 1.0 / line.weight
            error = np.minimum(expected * np.sqrt(2.0 / noise.level_freedom), line.variance) * (1.0 - line.share)
            reactions["level"] = (line.components(rows) * error)[:, line.group] * line.unit
        is_gain = np.arange(rows.shape[-1]) < self.weights.size
        return {
            (id(noise), kind, part): reaction * only
            for kind, reaction in reactions.items()
            for part, only in enumerate((is_gain, ~is_gain))
        }

    @cached_property
    def _block(self) -> SharedError:
        """Error that the points of a block share, in units of their noise."""
        unit = (np.sqrt(self.weights) / self.random).ravel()
        starts = np.concatenate((self.starts, self.starts + self.weights.size))
        return SharedError(starts, unit, np.repeat(np.square(self.noise.shared), self.starts.size))

    @cached_property
    def _line(self) -> SharedError:
        """Error that the blocks of a line share, less what is taken out of each block."""
        starts = np.concatenate((self.lines, self.lines + self.weights.size))
        unit = (1.0 - self._block.share)[self._block.group] * self._block.unit
        return SharedError(starts, unit, np.repeat(np.square(self.noise.level), self.lines.size))

    @cached_property
    def _by_point(self) -> tuple[Array, Array]:
        """Deviations ordered by operating point, gains first, (2 n,), and the place where each point begins."""
        labels = np.concatenate((self.points, self.points + self.points.max() + 1))
        order = np.argsort(labels, kind="stable")
        return order, np.concatenate(([0], 1 + np.flatnonzero(np.diff(labels[order]))))

    @cached_property
    def _point(self) -> SharedError:
        """Error that the rows of an operating point share, in their order, in units of their noise."""
        order, starts = self._by_point
        return SharedError(starts, self._block.unit[order], np.full(starts.size, self.model_error**2))

    def _less_points(self, rows: Array) -> Array:
        remainder, order = np.empty_like(rows), self._by_point[0]
        remainder[..., order] = self._point.whiten(rows[..., order])
        return remainder
