"""One measured loop with its noise: force against time, the measured displacement driving the model."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from bushfit.effects.contract import Array, Values
from bushfit.effects.history import History
from bushfit.fitting.data_set import DataSet, Suspect, kept
from bushfit.fitting.drive import Drive
from bushfit.model.model import Model
from bushfit.model.result import Outlier
from bushfit.model.sensitivity import force_jacobian
from bushfit.reading.measurement import Loop

#: Harmonics of a loop that count as smooth misfit: beyond the fifth, physics makes next to nothing.
_SMOOTH_HARMONICS = 5


@dataclass(frozen=True, eq=False)
class LoopData(DataSet):
    """Force over the rows of a loop; see `DataSet` for its answers.

    Rows that are left out carry no weight from the start, see `drive_of`, and stay: the others need them to keep time.
    """

    drive: Drive
    kind = "loop"
    parts = 1

    @property
    def size(self) -> int:
        return int(self.drive.force.size)

    @cached_property
    def counted(self) -> int:
        return int(np.count_nonzero(self.drive.weight))

    @property
    def test(self) -> Loop:
        return self.drive.loop

    @property
    def notes(self) -> Sequence[str]:
        return self.drive.notes

    @property
    def frequency(self) -> Array:
        return np.array([self.drive.frequency])

    @property
    def amplitude(self) -> Array:
        return np.array([self.drive.amplitude])

    @cached_property
    def measured(self) -> Array:
        return np.array([self.drive.first_harmonic()])

    @property
    def relative_noise(self) -> float:
        return self.drive.noise / self.drive.half_range

    @kept
    def force(self, model: Model, values: Values | None = None) -> Array:
        """Model force at the rows [N or N m], (..., n)."""
        force = model.force(self.direction, self._history(model), kind="loop", values=values)
        return self.drive.at_rows(self.drive.from_datum(force)) + (self.drive.datum or 0.0)

    def residual(self, model: Model, values: Values | None = None) -> Array:
        return (self.force(model, values) - self.drive.force) * self._per_noise

    @kept
    def jacobian(self, model: Model, names: Sequence[str]) -> Array:
        slopes = force_jacobian(model, self.direction, self._history(model), names)
        return self.drive.at_rows(self.drive.from_datum(slopes)) * self._per_noise

    def _history(self, model: Model) -> History:
        return self.drive.history(any(effect.settles for effect in model.records))

    def noise_free(self, model: Model) -> Self:
        force = self.force(model)
        return replace(self, drive=replace(self.drive, force=force, half_range=float(np.ptp(force)) / 2.0))

    def with_noise(self, relative: float) -> Self:
        """The same loop with another standard deviation of one row, relative to half the force range."""
        return replace(self, drive=replace(self.drive, noise=relative * self.drive.half_range))

    def change(self, one: Model, other: Model) -> float:
        return float(np.max(np.abs(self.force(one) - self.force(other)))) / self.drive.half_range

    def relative(self, model: Model) -> Array:
        return ((self.force(model) - self.drive.force) / self.drive.half_range)[self.drive.weight > 0.0]

    def distance(self, model: Model) -> Array:
        return np.abs(self.residual(model))

    def shown(self, model: Model) -> Array:
        off = (self.force(model) - self.drive.force) / self.drive.noise
        return np.where(self.drive.weight > 0.0, self.residual(model), off)

    def weighted(self, weight: Array) -> Self:
        return replace(self, drive=replace(self.drive, weight=self.drive.weight * weight))

    def outlying(self, model: Model) -> Array:
        """Rows of the record, from 0, whose force stands out from the loop's own harmonics; no model is asked."""
        return self.drive.outliers["force"].rows

    def outliers(self, points: Array, model: Model) -> Iterator[Outlier]:
        file = str(self.source.file) if self.source else None
        before = self.drive.first_row + (self.test.part.first_row if self.test.part else 0)
        for column, (rows, distance) in self.drive.outliers.items():
            for row, off in zip(rows.tolist(), distance.tolist(), strict=True):
                yield Outlier(self.name, file, row + before + 1, column, off)

    def unsure(self, influence: Array) -> dict[Hashable, Array]:
        return {} if self.test.noise is not None else {self.name: np.sqrt(2.0 / self.counted) * influence}

    def contrasts(self) -> Array:
        """A constant force, and the cosine and sine of each harmonic, as whitened residuals, (11, n)."""
        scale = self._per_noise * self.drive.half_range
        angle = 2.0 * np.pi * self.drive.phase
        waves = [wave(order * angle) for order in range(1, _SMOOTH_HARMONICS + 1) for wave in (np.cos, np.sin)]
        return scale * np.array([np.ones_like(angle), *waves])

    def smooth_misfit(self, model: Model) -> float:
        columns = self.contrasts()
        fitted = np.linalg.lstsq(columns.T, self.residual(model), rcond=None)[0] @ columns
        weighty = self.drive.weight > 0.0
        scale = self.drive.noise / (self.drive.half_range * np.sqrt(self.drive.weight[weighty]))
        return float(np.abs(fitted[weighty] * scale).max())

    def suspects(self, residual: Array) -> Iterator[Suspect]:
        """The loop as a whole, wrong in gain or offset."""
        columns = [self.drive.force * self._per_noise, self.drive.half_range * self._per_noise]
        ends = (self.drive.frequency,) * 2, (self.drive.amplitude,) * 2
        yield Suspect(f"the loop {self.name}", "loop", columns, self.direction, *ends)

    def columns(self) -> dict[str, Any]:
        unit, factor = self.direction.display.displacement
        return {
            "time [s]": self.drive.phase / self.drive.frequency,
            "frequency [Hz]": self.drive.frequency,
            f"amplitude [{unit}]": self.drive.amplitude * factor,
        }

    def components(self, residual: Array) -> dict[str, Array]:
        return {"force": residual}

    @cached_property
    def _per_noise(self) -> Array:
        return np.sqrt(self.drive.weight) / self.drive.noise
