"""The virtual test rig: it imposes a motion on a model, records the force, and evaluates both as a real rig does.

It steps Eqs. (3) and (5) through time from rest, with the full memory of the springpot and the turning points of the
friction, and evaluates force and displacement by lock-in. It shares no formula with the closed form of the steady
state, so the two can be checked against each other.
"""

from functools import partial

import numpy as np

from bushfit.effects.contract import UNKNOWN, Array, RubberConditions
from bushfit.effects.history import History
from bushfit.geometry import Place
from bushfit.model.model import Kind, Model
from bushfit.reading.measurement import Loop
from bushfit.reduction.harmonics import cycle_harmonics

#: Default number of time steps per cycle: within 0.03 % of the closed form at 20 Hz.
STEPS_PER_CYCLE = 2048


def wave(waveform: str, phase: Array) -> Array:
    """Waveform of amplitude 1 at phases [cycles] of any shape, "sine" or "triangle", rising from 0 at phase 0.

    >>> wave("triangle", np.array([0.0, 0.125, 0.25, 0.75])).round(6)
    array([ 0. ,  0.5,  1. , -1. ])
    """
    if waveform == "sine":
        return np.sin(2.0 * np.pi * phase)
    return 2.0 / np.pi * np.arcsin(np.clip(np.sin(2.0 * np.pi * phase), -1.0, 1.0))


def simulate_cycles(
    model: Model,
    direction: Place,
    frequency: float,
    amplitude: float,
    *,
    cycles: int,
    run_in: int = 0,
    steps_per_cycle: int = STEPS_PER_CYCLE,
    waveform: str = "sine",
    kind: Kind = "sweep",
    conditions: RubberConditions = UNKNOWN,
) -> Loop:
    """Simulate a cyclic test from rest: impose `run_in + cycles` cycles and record the last `cycles`.

    Args:
        model: model under test, with the effects of the rig.
        direction: direction or specimen.
        frequency: frequency of the motion [Hz].
        amplitude: zero-to-peak amplitude [m or rad].
        cycles: number of recorded cycles.
        run_in: number of cycles before the record.
        steps_per_cycle: time steps per cycle; the error of the Gruenwald-Letnikov sum is inversely proportional to it.
        waveform: "sine" or "triangle".
        kind: "loop" or "sweep"; only effects of the instrument depend on it.
        conditions: temperature and history of the rubber, one number each.

    Returns:
        Time from 0, displacement and force of the last `cycles`.
    """
    motion = amplitude * wave(waveform, np.arange((run_in + cycles) * steps_per_cycle + 1) / steps_per_cycle)
    step = 1.0 / (frequency * steps_per_cycle)
    rows = slice(run_in * steps_per_cycle, None)
    return simulate_motion(model, direction, motion, step, frequency, rows=rows, kind=kind, conditions=conditions)


def simulate_motion(
    model: Model,
    direction: Place,
    motion: Array,
    step: float,
    frequency: float,
    *,
    rows: slice = slice(None),
    kind: Kind = "loop",
    conditions: RubberConditions = UNKNOWN,
) -> Loop:
    """Simulate a test with an arbitrary motion from rest.

    Args:
        model: model under test, with the effects of the rig.
        direction: direction or specimen.
        motion: displacement [m or rad], (n,).
        step: time between samples [s].
        frequency: frequency of the cycles [Hz], for effects that depend on it.
        rows: samples to record.
        kind: "loop" or "sweep"; only effects of the instrument depend on it.
        conditions: temperature and history of the rubber, one number each.

    Returns:
        Time from 0, displacement and force at the recorded samples.

    Raises:
        ModelError: an effect of the model has no equation in time.
    """
    model.require_time_law()
    history = History(motion, step, periodic=False, frequency=frequency)
    force = model.force(direction, history, kind=kind, conditions=conditions)
    time = (np.arange(motion.size) * step)[rows]
    return Loop("simulated", direction, time - time[0], motion[rows], force[rows])


def lock_in(measured: Loop, frequency: float) -> complex:
    """Complex dynamic stiffness [N/m or N m/rad] of a record, from its first harmonics at a frequency [Hz]."""
    channels = np.column_stack((measured.displacement, measured.force))
    _, (displacement, force), _ = cycle_harmonics(measured.time * frequency, channels, 1)
    return complex(force / displacement)


def dynamic_stiffness(
    model: Model,
    direction: Place,
    frequency: Array,
    amplitude: Array,
    *,
    run_in: int = 10,
    steps_per_cycle: int = STEPS_PER_CYCLE,
    conditions: RubberConditions = UNKNOWN,
) -> Array:
    """Simulate a stepped-sine test, one cycle per operating point after a run-in, evaluated at the first harmonic.

    Args:
        model: model under test, with the effects of the rig.
        direction: direction or specimen.
        frequency: frequency [Hz], (n,).
        amplitude: zero-to-peak amplitude [m or rad], (n,).
        run_in: number of cycles before the measured cycle.
        steps_per_cycle: time steps per cycle.
        conditions: temperature and history of the rubber, numbers or (n,).

    Returns:
        Complex dynamic stiffness [N/m or N m/rad], (n,).

    >>> measured = dynamic_stiffness(paper, "axial", 20.0, 1e-3)
    >>> bool(abs(measured / paper.stiffness("axial", 20.0, 1e-3) - 1.0).max() < 1e-3)
    True
    """
    measured = partial(simulate_cycles, model, direction, cycles=1, run_in=run_in, steps_per_cycle=steps_per_cycle)
    points = enumerate(zip(np.atleast_1d(frequency), np.atleast_1d(amplitude), strict=True))
    return np.array([lock_in(measured(f, x, conditions=conditions.select(number)), f) for number, (f, x) in points])
