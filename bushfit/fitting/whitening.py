"""Covariance of a sweep's deviations: scatter from point to point, and errors shared by a block or a line.

A block is a run: the points of one recording at one constant amplitude or frequency. A line is the set of all runs with
the same constant value.

Notes:
    Within a block of points with scatter s_i and a shared error t the covariance is V = diag(s_i^2) + t^2 1 1^T. All
    runs of a line may also share an error, u^2 1 1^T over the line. A deviation is whitened by dividing it by s_i and
    removing the error shared by its block; then the error shared by its line is removed in the same way. A point of
    weight w has s_i^2 = s^2/w; a point of weight 0 has no effect, not even on shared errors. Gains and phases are
    independent: deviations are real, (..., 2 n), gains first.
"""

from collections.abc import Hashable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.noise import SweepNoise
from bushfit.fitting.shared_errors import SharedErrors


@dataclass(frozen=True, eq=False)
class Whitening:
    """Covariance matrix of the noise of a sweep's deviations (residuals in gain and phase), to whiten them.

    Args:
        run: index of the run (block) of each point, from 0, (n,).
        line: index of the line (runs with one constant value) of each point, from 0, (n,).
        random: standard deviation of the gain and phase of each point at full weight, (2, n).
        noise: noise of the campaign's sweeps: shared errors, and degrees of freedom of the estimates.
        weights: weight of each point, 0 to 1, (n,).
    """

    run: Array
    line: Array
    random: Array
    noise: SweepNoise
    weights: Array

    @cached_property
    def per_scatter(self) -> Array:
        """Reciprocal of the scatter of each deviation, (2 n,); 0 for points without weight."""
        return (np.sqrt(self.weights) / self.random).ravel()

    def whiten(self, rows: Array) -> Array:
        """Remove the correlation by errors that points share from deviations in units of scatter, (..., 2 n)."""
        return self._line_errors.whiten(self.runs.whiten(rows))

    def scaled(self, deviation: Array, *, shared: bool = True) -> Array:
        """Divide the deviations in gain and phase by the scatter of each point, without whitening.

        Args:
            deviation: relative differences in |K| + i differences in phase [rad], (n,).
            shared: True to subtract the likeliest error that the points of each run share.

        Returns:
            Gain and phase of each point in units of the scatter, (2, n).
        """
        rows = np.concatenate((deviation.real, deviation.imag))
        if shared:
            squares = np.square(self.per_scatter)
            sums, weights = (np.bincount(self._run_of_residual, values) for values in (rows * squares, squares))
            variance = np.repeat(np.square(self.noise.shared) + np.square(self.noise.level), weights.size // 2)
            rows = rows - (sums * variance / (1.0 + variance * weights))[self._run_of_residual]
        return rows.reshape(2, -1) / self.random

    def noise_sensitivity(self, influence: Array) -> dict[Hashable, Array]:
        """Change of k parameter estimates by an error of each noise variance that was estimated from the tests.

        Args:
            influence: weight of each whitened residual in the estimates, (k, 2 n).

        Returns:
            Sensitivity by identifier of the noise variance, (k, 2 n) each; see `MeasuredLoop.noise_sensitivity`.

        Notes:
            Within a block the derivatives of V are I with respect to s^2 and 1 1^T with respect to t^2; whitened, W^2
            and (W 1)(W 1)^T. The estimate of t^2 is a mean of `freedom` squares with expectation t^2 + s^2/n; its error
            is limited to t^2. The same applies to errors shared by lines.
        """
        runs, lines, noise = self.runs, self._line_errors, self.noise
        rows, reactions = lines.whiten(influence), {}
        if noise.scatter_freedom:
            reactions["scatter"] = lines.whiten(runs.whiten(runs.whiten(rows))) * np.sqrt(2.0 / noise.scatter_freedom)
        if noise.freedom:
            group, variance = self._run_of_residual, np.square(runs.deviations)
            _, first, counts = np.unique(group, return_index=True, return_counts=True)
            scatter = np.bincount(group, np.square(self.per_scatter)) * np.square(self.random.ravel()[first]) / counts
            error = np.minimum((variance + scatter) * np.sqrt(2.0 / noise.freedom), variance) / (1.0 + variance)
            reactions["shared"] = lines.whiten(runs.multiply(rows, error))
        if noise.level_freedom:
            variance = np.square(lines.deviations)
            error = np.minimum((variance + 1.0) * np.sqrt(2.0 / noise.level_freedom), variance)
            reactions["level"] = lines.multiply(rows, error / np.hypot(1.0, lines.deviations))
        is_gain = np.arange(rows.shape[-1]) < self.weights.size
        return {
            (id(noise), kind, part): reaction * only
            for kind, reaction in reactions.items()
            for part, only in enumerate((is_gain, ~is_gain))
        }

    @cached_property
    def runs(self) -> SharedErrors:
        """Errors shared by the points of each run, acting on deviations in units of their scatter."""
        return SharedErrors.of_groups(self.run, self.per_scatter, self.noise.shared)

    @cached_property
    def _line_errors(self) -> SharedErrors:
        """Errors shared by the runs of each line, acting on deviations already whitened by the errors of runs."""
        shrunk = self.per_scatter / np.hypot(1.0, self.runs.deviations)[self._run_of_residual]
        return SharedErrors.of_groups(self.line, shrunk, self.noise.level)

    @cached_property
    def _run_of_residual(self) -> Array:
        """Index of the run of each residual: of n gains, then of n phases, (2 n,)."""
        return np.concatenate((self.run, self.run + self.run.max() + 1))
