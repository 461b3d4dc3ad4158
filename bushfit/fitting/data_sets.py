"""Residuals in units of noise: one data set per measured loop, one per sweep.

A data set knows its data and their noise; asked with a model it returns whitened residuals (model less measured),
which are independent with unit variance where the model is right, and their derivatives.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from bushfit.effects.contract import Array, Values
from bushfit.fitting.drive import drive_of
from bushfit.fitting.loop_data import LoopData, kept
from bushfit.fitting.noise import SweepNoise, sweep_noise
from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.model.sensitivity import stiffness_jacobian
from bushfit.reading.measurement import Loop, Source, Sweep

__all__ = ["DataSet", "LoopData", "Residuals", "SweepData", "loop_data", "sweep_data"]

Residuals = Literal["complex", "magnitude_loss_factor"]


@dataclass(frozen=True, eq=False)
class SweepData:
    """Dynamic stiffness, as relative complex residual or as magnitude and loss factor.

    The residual (K - K_meas)/K_meas has the gain error in its real and the phase error in its imaginary part.
    Within a block of points with random parts s_i and a shared part t the covariance is V = diag(s_i^2) + t^2 1 1^T.
    With a_i = 1/s_i, divided by s_i and less the share 1 - 1/sqrt(1 + t^2 sum a_i^2) of what lies along a, it is white.
    A point of weight w has s_i^2 = s^2/w; without weight it is not there, for the block's shared error either.
    Of a sweep in part, `part` holds the rows of the whole, (n,).
    """

    sweep: Sweep
    noise: SweepNoise
    residuals: Residuals = "complex"
    weight: Array | None = None
    part: Array | None = None
    kind: Literal["sweep"] = "sweep"

    @property
    def name(self) -> str:
        return self.sweep.name

    @property
    def size(self) -> int:
        return 2 * int(self.sweep.frequency.size)

    @property
    def counted(self) -> int:
        """Residuals that carry weight."""
        return 2 * int(np.count_nonzero(self.weights))

    @property
    def direction(self) -> Direction:
        return self.sweep.direction

    @property
    def source(self) -> Source | None:
        return self.sweep.source

    @property
    def relative_noise(self) -> float:
        """Standard deviation of one point, relative to |K|, root mean square over levels."""
        return float(np.sqrt(np.mean(np.square(list(self.noise.random.values())))))

    def at_amplitudes(self, amplitudes: Sequence[float]) -> SweepData:
        """The part of the sweep at some of its levels, with the same noise."""
        return self._part(np.isin(self.sweep.amplitude, amplitudes))

    def standing(self) -> SweepData:
        """The part of the sweep that carries weight."""
        kept = np.empty(self.frequency.size, dtype=bool)
        kept[self.order] = self.weights > 0.0
        return self if kept.all() else self._part(kept)

    def _part(self, kept: Array) -> SweepData:
        sweep = replace(
            self.sweep,
            frequency=self.sweep.frequency[kept],
            amplitude=self.sweep.amplitude[kept],
            stiffness=self.sweep.stiffness[kept],
            repeat=self.sweep.repeat[kept],
            reached=self.sweep.amplitude_reached[kept],
        )
        weight = None if self.weight is None else self.weight[kept[self.order]]
        return replace(self, sweep=sweep, weight=weight, part=self._whole[kept])

    def weighted(self, weight: Array) -> SweepData:
        """The same test with the weight of each point, (n,) in `order`, times a share."""
        return replace(self, weight=self.weights * weight)

    def noise_free(self, model: Model) -> SweepData:
        """The same test as the model would have it, without noise."""
        stiffness = np.empty_like(self.sweep.stiffness)
        stiffness[self.order] = self.stiffness(model)
        return replace(self, sweep=replace(self.sweep, stiffness=stiffness))

    @cached_property
    def order(self) -> Array:
        """Rows of the sweep sorted by block (amplitude, repeat), then frequency."""
        return np.lexsort((self.sweep.frequency, self.sweep.repeat, self.sweep.amplitude))

    @property
    def rows(self) -> Array:
        """Row of the whole sweep at which each point stands, from 0, (n,) in `order`."""
        return self._whole[self.order]

    @property
    def _whole(self) -> Array:
        return np.arange(self.sweep.frequency.size) if self.part is None else self.part

    @cached_property
    def frequency(self) -> Array:
        return self.sweep.frequency[self.order]

    @cached_property
    def amplitude(self) -> Array:
        return self.sweep.amplitude[self.order]

    @cached_property
    def measured(self) -> Array:
        return self.sweep.stiffness[self.order]

    @cached_property
    def block_starts(self) -> Array:
        """Index of the first point of each block, in `order`."""
        label = np.stack((self.amplitude, self.sweep.repeat[self.order].astype(float)))
        return np.concatenate(([0], 1 + np.flatnonzero(np.any(np.diff(label), axis=0))))

    def stiffness(self, model: Model, values: Values | None = None) -> Array:
        """Model stiffness at the points, sorted by block; what repeats is computed once."""
        return self._stiffness(model) if values is None else self._stiffness_of(model, values)

    @kept
    def _stiffness(self, model: Model) -> Array:
        return self._stiffness_of(model, model.values)

    def _stiffness_of(self, model: Model, values: Values) -> Array:
        frequency, amplitude, place = self._distinct
        return model.stiffness(self.sweep.direction, frequency, amplitude, values=values)[..., place]

    @cached_property
    def _distinct(self) -> tuple[Array, Array, Array]:
        """Frequency and reached amplitude of the distinct operating points, and the place of each point among them."""
        points = self.frequency + 1j * self.sweep.amplitude_reached[self.order]
        distinct, place = np.unique(points, return_inverse=True)
        return distinct.real, distinct.imag, place

    def relative(self, model: Model) -> Array:
        """|K - K_meas| / |K_meas| of the points that carry weight, for NRMSE."""
        return np.abs(self.stiffness(model) / self.measured - 1.0)[self.weights > 0.0]

    def distance(self, model: Model) -> Array:
        """How far each point lies off the model less what its block shares, in units of noise: one number for gain and
        phase, their root mean square, (n,)."""
        return self.apart(self.deviation(model)) / np.sqrt(2.0)

    def change(self, one: Model, other: Model) -> float:
        """Largest difference between two models, relative to |K| as measured."""
        return float(np.max(np.abs((self.stiffness(one) - self.stiffness(other)) / self.measured)))

    def apart(self, deviation: Array, *, shared: bool = True) -> Array:
        """Length of deviations, (n,), in units of the random noise, less the likeliest error that a block shares."""
        return np.hypot(*self._own(deviation, shared=shared))

    def _own(self, deviation: Array, *, shared: bool = True) -> Array:
        parts = _parts(deviation)
        if shared:
            mean = np.add.reduceat(parts * self._scale**2, self.block_starts, axis=-1) / self._block_weight
            parts = parts - ((1.0 - (1.0 - self._share) ** 2) * mean)[:, self._block]
        return parts / self._random

    def shown(self, model: Model) -> Array:
        """As `residual`, and of points without weight how far they lie off, in units of noise, (2 n,)."""
        deviation = self.deviation(model)
        return np.where(np.tile(self.weights > 0.0, 2), self.whiten(deviation), self._own(deviation).ravel())

    def deviation(self, model: Model, values: Values | None = None) -> Array:
        """Residual before whitening: gain in the real, phase (or loss factor) in the imaginary part, (..., n)."""
        return self._deviation(self.stiffness(model, values))

    def residual(self, model: Model, values: Values | None = None) -> Array:
        """(..., 2 n): all gain residuals, then all phase residuals."""
        return self._residual(model) if values is None else self.whiten(self.deviation(model, values))

    @kept
    def _residual(self, model: Model) -> Array:
        return self.whiten(self.deviation(model))

    def jacobian(self, model: Model, names: Sequence[str]) -> Array:
        """(len(names), 2 n)"""
        return self._jacobian(model, tuple(names))

    @kept
    def _jacobian(self, model: Model, names: tuple[str, ...]) -> Array:
        frequency, amplitude, place = self._distinct
        slopes = stiffness_jacobian(model, self.sweep.direction, frequency, amplitude, names)[:, place]
        if self.residuals == "complex":
            return self.whiten(slopes / self.measured)
        stiffness = self.stiffness(model)
        relative = slopes / stiffness
        gain = np.abs(stiffness / self.measured) * relative.real
        loss = relative.imag * (np.abs(stiffness) / stiffness.real) ** 2
        return self.whiten(gain + 1j * loss * self._loss_scale)

    def _deviation(self, stiffness: Array) -> Array:
        if self.residuals == "complex":
            return stiffness / self.measured - 1.0
        gain = np.abs(stiffness / self.measured) - 1.0
        loss = stiffness.imag / stiffness.real - self.measured.imag / self.measured.real
        return gain + 1j * loss * self._loss_scale

    @cached_property
    def _loss_scale(self) -> Array:
        """Phase per loss factor, 1/(1 + eta^2)."""
        return (self.measured.real / np.abs(self.measured)) ** 2

    def whiten(self, deviation: Array) -> Array:
        """Residuals in units of noise, shared block errors taken out: (..., n) complex -> (..., 2 n)."""
        return _flat(self._less_shared(_parts(deviation) * self._scale))

    def _less_shared(self, parts: Array) -> Array:
        """Residuals over their noise, (..., 2, n), less the share of what lies along it in each block."""
        along = np.add.reduceat(parts * self._scale, self.block_starts, axis=-1) / self._block_weight
        return parts - (along * self._share)[..., self._block] * self._scale

    def unsure(self, influence: Array) -> dict[Hashable, Array]:
        """Per estimated variance of the noise, what reacts to the whitened residuals by `influence`, (k, 2 n), times
        the whitened derivative of their covariance by that variance, times its standard error: (k, 2 n).

        Within a block V = s^2 I + t^2 1 1^T has the derivatives I and 1 1^T, whitened W^2 and (W 1)(W 1)^T. The
        estimate of t^2 is a mean of `freedom` squares that expect t^2 + s^2/n, and scatters no further down than to 0.
        """
        parts = influence.reshape(-1, 2, self.frequency.size)
        reactions = {}
        if self.noise.scatter_freedom:
            twice = self._less_shared(self._less_shared(parts))
            reactions["scatter"] = twice * np.sqrt(2.0 / self.noise.scatter_freedom)
        if self.noise.freedom:
            variance = np.square(self.noise.shared)[:, None]
            expected = variance + self._random[:, self.block_starts] ** 2 / np.bincount(self._block)
            error = np.minimum(expected * np.sqrt(2.0 / self.noise.freedom), variance) * (1.0 - self._share) ** 2
            along = np.add.reduceat(parts * self._scale, self.block_starts, axis=-1)
            reactions["shared"] = (along * error)[..., self._block] * self._scale
        return {
            (kind, which): _flat(reaction * only)
            for kind, reaction in reactions.items()
            for which, only in enumerate(np.eye(2)[..., None])
        }

    @cached_property
    def _block(self) -> Array:
        """Number of the block that each point belongs to, (n,)."""
        return np.repeat(np.arange(self.block_starts.size), np.diff(self.block_starts, append=self.frequency.size))

    @cached_property
    def weights(self) -> Array:
        """Share of its weight that each point has, (n,)."""
        return np.ones(self.frequency.size) if self.weight is None else self.weight

    @cached_property
    def _random(self) -> Array:
        """Standard deviation of each point's gain and phase, as if it had all its weight, (2, n)."""
        levels = [self.noise.random[self.sweep.name, float(x)] for x in self.amplitude[self.block_starts]]
        return np.array(levels).T[:, self._block]

    @cached_property
    def _scale(self) -> Array:
        """One over the noise of each point's gain and phase, (2, n)."""
        return np.sqrt(self.weights) / self._random

    @cached_property
    def _block_weight(self) -> Array:
        """Sum of the squares of one over the noise in each block, (2, blocks)."""
        return np.maximum(np.add.reduceat(self._scale**2, self.block_starts, axis=-1), np.finfo(float).tiny)

    @cached_property
    def _share(self) -> Array:
        """Share of what lies along the noise in a block that is taken out, (2, blocks)."""
        return 1.0 - 1.0 / np.sqrt(1.0 + np.square(self.noise.shared)[:, None] * self._block_weight)


def _parts(deviation: Array) -> Array:
    """Gain and phase, complex (..., n) -> (..., 2, n)."""
    return np.stack((deviation.real, deviation.imag), axis=-2)


def _flat(parts: Array) -> Array:
    """All gains, then all phases, (..., 2, n) -> (..., 2 n)."""
    return parts.reshape(*parts.shape[:-2], -1)


DataSet = LoopData | SweepData


def loop_data(loops: Sequence[Loop], *, without_wild: bool = False) -> list[LoopData]:
    """One data set per loop; rows that are wild carry no weight where they are to be left out."""
    return [LoopData(drive_of(loop, without_wild=without_wild)) for loop in loops]


def sweep_data(sweeps: Sequence[Sweep], residuals: Residuals = "complex") -> list[SweepData]:
    """One data set per sweep; their noise is estimated together."""
    if not sweeps:
        return []
    noise = sweep_noise(sweeps)
    return [SweepData(sweep, noise, residuals) for sweep in sweeps]
