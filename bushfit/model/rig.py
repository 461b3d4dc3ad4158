"""The virtual test rig: the time-domain road, from a displacement history to a measured stiffness.

It steps Eqs. (3) and (5) through time from rest, with the full memory of the springpot and the turning points
of the friction, and evaluates force and displacement as a rig's controller does, by lock-in. It shares no
formula with the closed form of the steady state, so each checks the other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bushfit.effects.contract import Array
from bushfit.effects.history import History
from bushfit.geometry import Direction
from bushfit.model.model import Kind, Model


@dataclass(frozen=True)
class Record:
    """What a rig writes: time [s], displacement [m or rad] and force [N or N m], each (n,)."""

    time: Array
    displacement: Array
    force: Array


def wave(waveform: str, phase: Array) -> Array:
    """Unit sine or triangle of a phase [cycles], starting upward from zero."""
    if waveform == "sine":
        return np.sin(2.0 * np.pi * phase)
    return 2.0 / np.pi * np.arcsin(np.clip(np.sin(2.0 * np.pi * phase), -1.0, 1.0))


def record(
    model: Model,
    direction: Direction,
    frequency: float,
    amplitude: float,
    *,
    cycles: int,
    run_in: int = 0,
    steps_per_cycle: int = 2048,
    waveform: str = "sine",
    kind: Kind = "sweep",
) -> Record:
    """Impose `run_in + cycles` cycles from rest and keep the last `cycles`.

    Args:
        model: what is on the rig, with whatever effects it has.
        direction: direction of the test.
        frequency: [Hz].
        amplitude: zero-to-peak [m or rad].
        cycles: cycles that are kept.
        run_in: cycles before them that are not recorded.
        steps_per_cycle: the Gruenwald-Letnikov sum is first order in 1/steps_per_cycle.
        waveform: sine or triangle.
        kind: which of the rig's force chains records it.
    """
    step = 1.0 / (frequency * steps_per_cycle)
    count = (run_in + cycles) * steps_per_cycle + 1
    index = np.arange(count)
    motion = amplitude * wave(waveform, index / steps_per_cycle)
    history = History(motion, step, periodic=False, frequency=frequency)
    force = model.force(direction, history, kind=kind)
    kept = slice(run_in * steps_per_cycle, None)
    return Record((index * step)[kept] - index[kept][0] * step, motion[kept], force[kept])


def first_harmonic(time: Array, signal: Array, frequency: float) -> complex:
    """Complex amplitude c of the least-squares fit signal ~ mean + Re(c exp(i omega t))."""
    phase = 2.0 * np.pi * frequency * time
    basis = np.stack([np.ones_like(phase), np.cos(phase), -np.sin(phase)], axis=1)
    _, real, imag = np.linalg.lstsq(basis, signal, rcond=None)[0]
    return complex(real, imag)


def lock_in(measured: Record, frequency: float) -> complex:
    """Complex dynamic stiffness K = F~/X~ at the excitation frequency, overtones dropped (Eq. 9)."""
    force = first_harmonic(measured.time, measured.force, frequency)
    return force / first_harmonic(measured.time, measured.displacement, frequency)


def dynamic_stiffness(
    model: Model,
    direction: Direction,
    frequency: Array,
    amplitude: Array,
    *,
    run_in: int = 10,
    steps_per_cycle: int = 2048,
) -> Array:
    """Stepped sine: one settled cycle per operating point, evaluated by lock-in; complex (n,) [N/m or N m/rad]."""
    points = zip(np.atleast_1d(frequency), np.atleast_1d(amplitude), strict=True)
    return np.array(
        [
            lock_in(
                record(model, direction, f, x, cycles=1, run_in=run_in, steps_per_cycle=steps_per_cycle),
                f,
            )
            for f, x in points
        ]
    )
