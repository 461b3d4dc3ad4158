"""Deviations of a sweep's points in units of noise: what scatters from point to point, and what a block shares.

Notes:
    Within a block of points with random parts s_i and a shared part t the covariance is V = diag(s_i^2) + t^2 1 1^T.
    With a_i = 1/s_i, divided by s_i and less the share 1 - 1/sqrt(1 + t^2 sum a_i^2) of what lies along a, a deviation
    is white. A point of weight w has s_i^2 = s^2/w; without weight it is not there, for the block's shared error
    either.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.noise import SweepNoise


@dataclass(frozen=True, eq=False)
class Whitening:
    """Covariance of a sweep's deviations, gain and phase apart, block by block.

    Args:
        starts: index of the first point of each block, (blocks,).
        random: standard deviation of each point's gain and phase, as if it had all its weight, (2, n).
        noise: of the campaign's sweeps: its shared part, and how well either part is known.
        weights: share of its weight that each point has, (n,).
    """

    starts: Array
    random: Array
    noise: SweepNoise
    weights: Array

    def whiten(self, deviation: Array) -> Array:
        """Deviations in units of noise, shared errors taken out, complex (..., n) -> (..., 2 n), all gains first."""
        return _flat(self._less_shared(_gain_and_phase(deviation) * self._scale))

    def own(self, deviation: Array, *, shared: bool = True) -> Array:
        """Deviations over the random noise, complex (n,) -> (2, n), with `shared` less the block's likeliest error."""
        parts = _gain_and_phase(deviation)
        if shared:
            mean = np.add.reduceat(parts * self._scale**2, self.starts, axis=-1) / self._block_weight
            parts = parts - ((1.0 - (1.0 - self._share) ** 2) * mean)[:, self._block]
        return parts / self.random

    def unsure(self, influence: Array) -> dict[Hashable, Array]:
        """As `DataSet.unsure`, (k, 2 n).

        Notes:
            Within a block V has the derivatives I by s^2 and 1 1^T by t^2, whitened W^2 and (W 1)(W 1)^T. The estimate
            of t^2 is a mean of `freedom` squares that expect t^2 + s^2/n, and scatters no further down than to 0.
        """
        parts = influence.reshape(-1, 2, self.weights.size)
        reactions = {}
        if self.noise.scatter_freedom:
            twice = self._less_shared(self._less_shared(parts))
            reactions["scatter"] = twice * np.sqrt(2.0 / self.noise.scatter_freedom)
        if self.noise.freedom:
            variance = np.square(self.noise.shared)[:, None]
            expected = variance + self.random[:, self.starts] ** 2 / np.bincount(self._block)
            error = np.minimum(expected * np.sqrt(2.0 / self.noise.freedom), variance) * (1.0 - self._share) ** 2
            along = np.add.reduceat(parts * self._scale, self.starts, axis=-1)
            reactions["shared"] = (along * error)[..., self._block] * self._scale
        return {
            (id(self.noise), kind, which): _flat(reaction * only)
            for kind, reaction in reactions.items()
            for which, only in enumerate(np.eye(2)[..., None])
        }

    def _less_shared(self, parts: Array) -> Array:
        """Deviations over their noise, (..., 2, n), less the share of what lies along it in each block."""
        along = np.add.reduceat(parts * self._scale, self.starts, axis=-1) / self._block_weight
        return parts - (along * self._share)[..., self._block] * self._scale

    @cached_property
    def _block(self) -> Array:
        """Number of the block that each point belongs to, (n,)."""
        return np.repeat(np.arange(self.starts.size), np.diff(self.starts, append=self.weights.size))

    @cached_property
    def _scale(self) -> Array:
        """One over the noise of each point's gain and phase, (2, n)."""
        return np.sqrt(self.weights) / self.random

    @cached_property
    def _block_weight(self) -> Array:
        """Sum of the squares of one over the noise in each block, (2, blocks)."""
        return np.maximum(np.add.reduceat(self._scale**2, self.starts, axis=-1), np.finfo(float).tiny)

    @cached_property
    def _share(self) -> Array:
        """Share of what lies along the noise in a block that is taken out, (2, blocks)."""
        return 1.0 - 1.0 / np.sqrt(1.0 + np.square(self.noise.shared)[:, None] * self._block_weight)


def _gain_and_phase(deviation: Array) -> Array:
    """Gain and phase, complex (..., n) -> (..., 2, n)."""
    return np.stack((deviation.real, deviation.imag), axis=-2)


def _flat(parts: Array) -> Array:
    """All gains, then all phases, (..., 2, n) -> (..., 2 n)."""
    return parts.reshape(*parts.shape[:-2], -1)
