"""Covariance of a sweep's deviations: scatter from point to point, and errors shared by a block or a line.

A block is a run: the points of one recording at one held amplitude or frequency. A line is the set of the runs with the
same held value. A model error may be added to the noise: independent between operating points, shared by repeats.

Notes:
    Within a block of points with scatter s_i and a shared error t the covariance is V = diag(s_i^2) + t^2 1 1^T. All
    runs of a line may also share an error, u^2 1 1^T over the line. Let a_i = 1/s_i. A deviation is whitened by
    dividing it by s_i and subtracting the share 1 - 1/sqrt(1 + t^2 sum a_i^2) of its component along a; then the error
    shared by a line is removed in the same way. A point of weight w has s_i^2 = s^2/w; a point of weight 0 has no
    effect, on shared errors either. Gains and phases are independent: deviations are real, (..., 2 n), gains first.

    With a model error of standard deviation e the whitening covariance is diag(s_i^2) + e^2 R R^T, where R = 1 if a row
    belongs to an operating point. Errors shared by runs and lines are not part of these weights: the model's error
    also differs from level to level, and a level must not lose weight because of a smaller error of the rig.
"""

from collections.abc import Hashable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.noise import SweepNoise


@dataclass(frozen=True, eq=False)
class SharedError:
    """Error shared by all deviations of a group (run, line or operating point), in addition to independent noise.

    Args:
        starts: index of the first deviation of each group, (g,).
        unit: change of each deviation, in units of noise, by an error of 1, (m,).
        variance: variance of the shared error of each group, (g,).
    """

    starts: Array
    unit: Array
    variance: Array

    @cached_property
    def group(self) -> Array:
        """Index of the group (run, line or operating point) of each of the m gain or phase deviations, (m,)."""
        return np.repeat(np.arange(self.starts.size), np.diff(self.starts, append=self.unit.size))

    @cached_property
    def weight(self) -> Array:
        """Squared norm of the change of each group's deviations, in units of noise, by a shared error of 1, (g,)."""
        return np.maximum(np.add.reduceat(self.unit**2, self.starts), np.finfo(float).tiny)

    @cached_property
    def share(self) -> Array:
        """Fraction, 0 to 1, of each group's shared component that whitening subtracts, (g,)."""
        return 1.0 - 1.0 / np.sqrt(1.0 + self.variance * self.weight)

    def components(self, rows: Array) -> Array:
        """Project deviations in units of noise, (..., m), on the shared error of each of g groups (such as runs).

        Returns:
            Inner products of the deviations with their change by a shared error of 1, (..., g).
        """
        return np.add.reduceat(rows * self.unit, self.starts, axis=-1)

    def whiten(self, rows: Array) -> Array:
        """Whiten deviations in units of noise, (..., m): subtract a share of the component that each group shares."""
        if not self.variance.any():
            return rows
        return rows - (self.components(rows) / self.weight * self.share)[..., self.group] * self.unit


@dataclass(frozen=True, eq=False)
class Whitening:
    """Covariance of the deviations (residuals in gain and phase) of a sweep, to whiten them.

    Args:
        starts: index of the first point of each block (run), (blocks,).
        lines: index of the first point of each line (adjacent blocks with one held value), (lines,).
        random: standard deviation of the gain and phase of each point at full weight, (2, n).
        noise: noise of the campaign's sweeps: shared errors, and degrees of freedom of the estimates.
        weights: weight of each point, 0 to 1, (n,).
        points: index of the operating point of each point, from 0, (n,).
        model_error: standard deviation of the relative error of the model at each operating point, in phase and in
            quadrature; 0 for noise alone.
    """

    starts: Array
    lines: Array
    random: Array
    noise: SweepNoise
    weights: Array
    points: Array
    model_error: float = 0.0

    def whiten(self, deviation: Array) -> Array:
        """Whiten deviations by scatter and shared errors, complex (..., n) -> (..., 2 n), gains, then phases."""
        rows = np.concatenate((deviation.real, deviation.imag), axis=-1) * self._block.unit
        return self._less_points(rows) if self.model_error else self._line.whiten(self._block.whiten(rows))

    def extra_covariance(self, influence: Array) -> Array:
        """Covariance of k parameter estimates that the weights of residuals do not include beside a model error.

        Args:
            influence: weight of each whitened residual in the k estimates, (k, 2 n).

        Returns:
            Covariance by the errors shared by runs and lines, minus that of the independent model error, which the
            Gaussian process of the model error already includes, (k, k).
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

    def error_products(self, rows: Array) -> tuple[Array, Array, Array]:
        """Compute what determines the size of a model error.

        Args:
            rows: residuals of a model, and their derivatives by its k parameters, in units of the scatter, (m, 2 n).

        Returns:
            Inner products of these m = k + 1 rows, (m, m); their components along the c independent directions of the
            model error, (m, c); and the variance along each direction if the error has size 1, (c,).
        """
        order, starts = self._by_point
        components = np.add.reduceat((rows * self._block.unit)[:, order], starts, axis=-1)
        return rows @ rows.T, components, self._point.weight

    @property
    def log_det_covariance(self) -> float:
        """Natural log of the determinant of the covariance with model error, relative to that of the scatter alone."""
        return float(np.sum(np.log1p(self._point.variance * self._point.weight)))

    def scaled(self, deviation: Array, *, shared: bool = True) -> Array:
        """Scale deviations by the scatter of each point, without whitening.

        Args:
            deviation: deviations, complex (n,).
            shared: True to subtract the likeliest shared error of each block.

        Returns:
            Gain and phase of each point in units of the scatter, (2, n).
        """
        rows, block = np.concatenate((deviation.real, deviation.imag)), self._block
        if shared:
            mean = block.components(rows * block.unit) / block.weight
            level = np.repeat(np.square(self.noise.level), self.starts.size)
            weight = (block.variance + level) * block.weight
            rows = rows - (weight / (1.0 + weight) * mean)[block.group]
        return rows.reshape(2, -1) / self.random

    def noise_sensitivity(self, influence: Array) -> dict[Hashable, Array]:
        """Sensitivity of k parameter estimates to the error of each estimated noise variance.

        Args:
            influence: weight of each whitened residual in the estimates, (k, 2 n).

        Returns:
            Sensitivity by identifier of the noise variance, (k, 2 n) each; see `MeasuredLoop.noise_sensitivity`.

        Notes:
            Within a block V has the derivatives I by s^2 and 1 1^T by t^2, whitened W^2 and (W 1)(W 1)^T. The estimate
            of t^2 is a mean of `freedom` squares with expectation t^2 + s^2/n; its error is limited to t^2. The same
            applies to errors shared by lines.
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
        """Error shared by the points of a block (run), acting on deviations in units of their scatter."""
        unit = (np.sqrt(self.weights) / self.random).ravel()
        starts = np.concatenate((self.starts, self.starts + self.weights.size))
        return SharedError(starts, unit, np.repeat(np.square(self.noise.shared), self.starts.size))

    @cached_property
    def _line(self) -> SharedError:
        """Error shared by the blocks of a line (level), acting on deviations whose blocks are already whitened."""
        starts = np.concatenate((self.lines, self.lines + self.weights.size))
        unit = (1.0 - self._block.share)[self._block.group] * self._block.unit
        return SharedError(starts, unit, np.repeat(np.square(self.noise.level), self.lines.size))

    @cached_property
    def _by_point(self) -> tuple[Array, Array]:
        """Indices that sort the 2 n deviations by operating point, gains first, and the first index of each group."""
        labels = np.concatenate((self.points, self.points + self.points.max() + 1))
        order = np.argsort(labels, kind="stable")
        return order, np.concatenate(([0], 1 + np.flatnonzero(np.diff(labels[order]))))

    @cached_property
    def _point(self) -> SharedError:
        """Model error shared by the repeats of an operating point, acting on deviations sorted by operating point."""
        order, starts = self._by_point
        return SharedError(starts, self._block.unit[order], np.full(starts.size, self.model_error**2))

    def _less_points(self, rows: Array) -> Array:
        remainder, order = np.empty_like(rows), self._by_point[0]
        remainder[..., order] = self._point.whiten(rows[..., order])
        return remainder
