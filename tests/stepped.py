"""Raw stepped-sine histories as a rig writes them, by the time-domain road: steps with soft ends, joined by pauses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bushfit.effects.contract import Array
from bushfit.effects.history import History
from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.reading.measurement import Loop

#: A step: frequency [Hz] and zero-to-peak amplitude [m or rad].
Point = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Stepped:
    """A history without error, and what its steps should be reduced to."""

    history: Loop
    truth: Array

    def measured(
        self, random: np.random.Generator, noise: float, drift: float = 0.0, rows: Array | None = None
    ) -> Loop:
        """The history with white noise and a wandering zero in both channels, relative to their largest value.

        `rows` are those that are kept, for records that are coarse or uneven.
        """
        time = self.history.time
        turns = time / time[-1]
        wander = drift * (np.sin(2.3 * np.pi * turns + random.uniform(0, 6)) + turns)
        channels = [
            values + np.abs(values).max() * (wander + noise * random.standard_normal(values.size))
            for values in (self.history.displacement, self.history.force)
        ]
        kept = slice(None) if rows is None else rows
        return Loop("history", self.history.direction, time[kept], *(values[kept] for values in channels))


def stepped(
    model: Model,
    points: Sequence[Point],
    *,
    direction: Direction = Direction.AXIAL,
    step: float = 2e-5,
    cycles: int = 16,
    ramp: int = 2,
    pause: float = 0.2,
    every: int = 10,
) -> Stepped:
    """Impose steps of `cycles` full cycles with `ramp` cycles of growth before and decay after them, from rest.

    The rubber remembers all of the record. The truth is the closed form at each point, with the springpot as the rig's
    time step has it: (1 - exp(-i omega step))^alpha/step^alpha in place of (i omega)^alpha.
    """
    parts = [np.zeros(round(pause / step))]
    for frequency, amplitude in points:
        count = cycles + 2 * ramp
        turns = np.arange(round(count / frequency / step)) * step * frequency
        envelope = np.clip(np.minimum(turns, count - turns) / ramp, 0.0, 1.0) if ramp else 1.0
        parts += [amplitude * envelope * np.sin(2.0 * np.pi * turns), np.zeros(round(pause / step))]
    motion = np.concatenate(parts)
    force = model.force(direction, History(motion, step, periodic=False, frequency=points[0][0]))
    rows = slice(None, None, every)
    history = Loop("history", direction, (np.arange(motion.size) * step)[rows], motion[rows], force[rows])
    return Stepped(history, settled(model, direction, points, step))


def settled(model: Model, direction: Direction, points: Sequence[Point], step: float) -> Array:
    """Complex stiffness of the steady first harmonic at some points, with the rig's time step in the springpot."""
    frequency, amplitude = np.array(points).T
    omega, alpha = 2j * np.pi * frequency, model.values["alpha"]
    error = ((1.0 - np.exp(-omega * step)) / step) ** alpha - omega**alpha
    return model.stiffness(direction, frequency, amplitude) + (
        model.bushing.stiffness_per_modulus(direction) * model.values["m"] / 2.0 * error
    )
