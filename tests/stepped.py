"""Raw stepped-sine histories as a rig writes them, by the time-domain road: steps with soft ends, joined by pauses."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bushfit.effects.contract import Array
from bushfit.effects.history import History
from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.reading.measurement import Loop

#: A step: frequency [Hz] and zero-to-peak amplitude [m or rad].
Point = tuple[float, float]


def stepped(
    model: Model,
    points: Sequence[Point],
    *,
    direction: Direction = Direction.AXIAL,
    step: float = 2e-5,
    cycles: int = 16,
    pause: float = 0.2,
    every: int = 10,
) -> Loop:
    """Impose steps of `cycles` full cycles with two cycles of growth before and decay after them, from rest.

    The rubber remembers all of the record. One row is kept of `every` time steps.
    """
    parts = [np.zeros(round(pause / step))]
    for frequency, amplitude in points:
        count = cycles + 4
        turns = np.arange(round(count / frequency / step)) * step * frequency
        envelope = np.clip(np.minimum(turns, count - turns) / 2.0, 0.0, 1.0)
        parts += [amplitude * envelope * np.sin(2.0 * np.pi * turns), np.zeros(round(pause / step))]
    motion = np.concatenate(parts)
    force = model.force(direction, History(motion, step, periodic=False, frequency=points[0][0]))
    return Loop("history", direction, np.arange(motion.size) * step, motion, force).select(slice(None, None, every))


def measured(history: Loop, random: np.random.Generator, noise: float, drift: float = 0.0) -> Loop:
    """A history with white noise and a wandering zero in both channels, relative to their largest value."""
    turns = history.time / history.time[-1]
    wander = drift * (np.sin(2.3 * np.pi * turns + random.uniform(0, 6)) + turns)
    displacement, force = (
        values + np.abs(values).max() * (wander + noise * random.standard_normal(values.size))
        for values in (history.displacement, history.force)
    )
    return replace(history, displacement=displacement, force=force)


def settled(model: Model, direction: Direction, points: Sequence[Point], step: float) -> Array:
    """Complex stiffness of the steady first harmonic at some points, with the springpot as the rig's time step has it:
    (1 - exp(-i omega step))^alpha/step^alpha in place of (i omega)^alpha."""
    frequency, amplitude = np.array(points).T
    omega, alpha = 2j * np.pi * frequency, model.values["alpha"]
    error = ((1.0 - np.exp(-omega * step)) / step) ** alpha - omega**alpha
    return model.stiffness(direction, frequency, amplitude) + (
        model.bushing.stiffness_per_modulus(direction) * model.values["m"] / 2.0 * error
    )
