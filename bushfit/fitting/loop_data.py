"""Residuals in units of noise of one measured loop: force against time, the measured displacement driving the model."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, wraps
from typing import Any, Literal

import numpy as np

from bushfit.effects.contract import Array, Values
from bushfit.fitting.drive import Drive
from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.model.sensitivity import force_jacobian
from bushfit.reading.measurement import Loop, Source


def kept(answer: Callable[..., Array]) -> Callable[..., Array]:
    """Keeps what a data set answered to the last model: residuals, derivatives and quality ask for the same again."""
    place = f"_last{answer.__name__}"

    @wraps(answer)
    def asked(data_set: Any, model: Model, *rest: Any) -> Array:
        last = data_set.__dict__.get(place)
        if last is None or last[0] is not model or last[1] != rest:
            last = data_set.__dict__[place] = (model, rest, answer(data_set, model, *rest))
            last[2].flags.writeable = False
        return last[2]

    return asked


@dataclass(frozen=True, eq=False)
class LoopData:
    """Force against time, with the measured displacement driving the model."""

    drive: Drive
    kind: Literal["loop"] = "loop"

    @property
    def name(self) -> str:
        return self.loop.name

    @property
    def size(self) -> int:
        return int(self.drive.force.size)

    @cached_property
    def counted(self) -> int:
        """Residuals that carry weight."""
        return int(np.count_nonzero(self.drive.weight))

    @property
    def loop(self) -> Loop:
        return self.drive.loop

    @property
    def direction(self) -> Direction:
        return self.loop.direction

    @property
    def source(self) -> Source | None:
        return self.loop.source

    @property
    def frequency(self) -> Array:
        """[Hz], (1,)"""
        return np.array([self.drive.frequency])

    @property
    def amplitude(self) -> Array:
        """Zero-to-peak [m or rad], (1,)."""
        return np.array([self.drive.amplitude])

    @cached_property
    def measured(self) -> Array:
        """Complex stiffness of the loop's fundamental, (1,)."""
        return np.array([self.drive.first_harmonic()])

    @property
    def relative_noise(self) -> float:
        """Standard deviation of one row, relative to half the force range."""
        return self.drive.noise / self.drive.half_range

    def force(self, model: Model, values: Values | None = None) -> Array:
        """Model force at the rows [N or N m]."""
        return self._force(model) if values is None else self._force_of(model, values)

    @kept
    def _force(self, model: Model) -> Array:
        return self._force_of(model, model.values)

    def _force_of(self, model: Model, values: Values) -> Array:
        history = self.drive.history(_settles(model))
        force = model.force(self.loop.direction, history, kind="loop", values=values)
        return self.drive.at_rows(self.drive.from_datum(force)) + (self.drive.datum or 0.0)

    def residual(self, model: Model, values: Values | None = None) -> Array:
        """(..., n)"""
        return (self.force(model, values) - self.drive.force) * self._per_noise

    def jacobian(self, model: Model, names: Sequence[str]) -> Array:
        """(len(names), n)"""
        return self._jacobian(model, tuple(names))

    @kept
    def _jacobian(self, model: Model, names: tuple[str, ...]) -> Array:
        history = self.drive.history(_settles(model))
        slopes = force_jacobian(model, self.loop.direction, history, names)
        return self.drive.at_rows(self.drive.from_datum(slopes)) * self._per_noise

    def noise_free(self, model: Model) -> LoopData:
        """The same test as the model would have it, without noise."""
        force = self.force(model)
        return replace(self, drive=replace(self.drive, force=force, half_range=float(np.ptp(force)) / 2.0))

    def change(self, one: Model, other: Model) -> float:
        """Largest difference between two models, relative to half the force range."""
        return float(np.max(np.abs(self.force(one) - self.force(other)))) / self.drive.half_range

    def relative(self, model: Model) -> Array:
        """Difference relative to half the force range, for NRMSE, where the rows carry weight."""
        return ((self.force(model) - self.drive.force) / self.drive.half_range)[self.drive.weight > 0.0]

    def distance(self, model: Model) -> Array:
        """How far each row lies off the model, in units of noise, (n,)."""
        return np.abs(self.residual(model))

    def shown(self, model: Model) -> Array:
        """As `residual`, and of rows without weight how far one row lies off, in units of noise, (n,)."""
        off = (self.force(model) - self.drive.force) / self.drive.noise
        return np.where(self.drive.weight > 0.0, self.residual(model), off)

    def weighted(self, weight: Array) -> LoopData:
        """The same test with the weight of each row, (n,), times a share."""
        return replace(self, drive=replace(self.drive, weight=self.drive.weight * weight))

    def unsure(self, influence: Array) -> dict[Hashable, Array]:
        """Per estimated variance of the noise, what reacts to the whitened residuals by `influence`, (k, n), times the
        whitened derivative of their covariance by that variance, times its standard error: (k, n)."""
        return {} if self.loop.noise is not None else {self.name: np.sqrt(2.0 / self.counted) * influence}

    @cached_property
    def _per_noise(self) -> Array:
        return np.sqrt(self.drive.weight) / self.drive.noise


def _settles(model: Model) -> bool:
    return any(effect.settles for effect in model.records)
