"""The virtual test rig: it imposes a motion on a model, records the force, and evaluates both as a real rig does.

It steps Eqs. (3) and (5) through time from rest, with the full memory of the springpot and the turning points of the
friction, and evaluates force and displacement by lock-in. It shares no formula with the closed form of the steady
state, so each checks the other.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from bushfit.effects.contract import UNKNOWN, Array, Circumstances
from bushfit.effects.history import History
from bushfit.errors import ModelError
from bushfit.geometry import Place
from bushfit.model.model import Kind, Model
from bushfit.reduction.harmonics import cycle_harmonics

#: Time steps in a cycle, where none are asked for: within 0.03 % of the closed form at 20 Hz.
STEPS_PER_CYCLE = 2048


@dataclass(frozen=True)
class Record:
    """What a rig writes: time [s], displacement [m or rad] and force [N or N m], each (n,)."""

    time: Array
    displacement: Array
    force: Array


def wave(waveform: str, phase: Array) -> Array:
    """Sine or triangle of amplitude 1 at a phase [cycles], starting upward from zero; any shape.

    >>> wave("triangle", np.array([0.0, 0.125, 0.25, 0.75])).round(6)
    array([ 0. ,  0.5,  1. , -1. ])
    """
    if waveform == "sine":
        return np.sin(2.0 * np.pi * phase)
    return 2.0 / np.pi * np.arcsin(np.clip(np.sin(2.0 * np.pi * phase), -1.0, 1.0))


def record(
    model: Model,
    direction: Place,
    frequency: float,
    amplitude: float,
    *,
    cycles: int,
    run_in: int = 0,
    swell: tuple[int, float] = (0, 1.0),
    steps_per_cycle: int = STEPS_PER_CYCLE,
    waveform: str = "sine",
    kind: Kind = "sweep",
    under: Circumstances = UNKNOWN,
) -> Record:
    """Impose `run_in + cycles` cycles from rest and keep the last `cycles`.

    Args:
        frequency, amplitude: [Hz], and zero-to-peak [m or rad].
        swell: so many cycles before these swell to so many times the amplitude and die out again (a Hann window):
            friction then forgets where it began, and the springpot sees no step. Not for models whose parameters
            follow the amplitude, which is that of the whole motion.
        steps_per_cycle: the springpot's error falls in proportion: its Gruenwald-Letnikov sum is of first order.
        waveform: sine or triangle.
        kind: whether a loop or a sweep is recorded; only effects of the instrument tell them apart.
        under: what the test is made under, numbers.
    """
    before = swell[0] + run_in
    phase = np.arange((before + cycles) * steps_per_cycle + 1) / steps_per_cycle
    motion = amplitude * wave(waveform, phase)
    if swell[0]:
        motion *= 1.0 + (swell[1] - 1.0) * np.sin(np.pi * np.minimum(phase / swell[0], 1.0)) ** 2
    whole = imposed(model, direction, motion, 1.0 / (frequency * steps_per_cycle), frequency, kind=kind, under=under)
    kept = slice(before * steps_per_cycle, None)
    return Record(whole.time[kept] - whole.time[kept][0], whole.displacement[kept].copy(), whole.force[kept].copy())


def imposed(
    model: Model,
    direction: Place,
    motion: Array,
    step: float,
    frequency: float,
    *,
    kind: Kind = "loop",
    under: Circumstances = UNKNOWN,
) -> Record:
    """Impose any motion, in even steps of time [s] from rest: displacement [m or rad], (n,).

    The frequency of its cycles [Hz] is for effects that count them.

    Raises:
        ModelError: an effect has no law in time.
    """
    untimed = [effect.name for effect in model.records if effect.harmonic_only]
    if untimed:
        raise ModelError(
            "the rig follows a motion through time, for which there is no law",
            place=untimed[0],
            found="a law of the steady first harmonic alone",
            expected="effects with a law in time",
            hint="ask predict for the stiffness of the steady state",
        )
    history = History(motion, step, periodic=False, frequency=frequency)
    force = model.force(direction, history, kind=kind, under=under)
    return Record(np.arange(motion.size) * step, motion, force)


def lock_in(measured: Record, frequency: float) -> complex:
    """Complex dynamic stiffness of a record at its frequency [Hz], overtones dropped: [N/m or N m/rad] (Eq. 9)."""
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
    under: Circumstances = UNKNOWN,
) -> Array:
    """Complex dynamic stiffness by stepped sine, one settled cycle per operating point: (n,) [N/m or N m/rad].

    Frequencies are in Hz, amplitudes zero-to-peak in m or rad, (n,) each; circumstances are numbers or likewise.

    >>> measured = dynamic_stiffness(paper, "axial", 20.0, 1e-3)
    >>> bool(abs(measured / paper.stiffness("axial", 20.0, 1e-3) - 1.0).max() < 1e-3)
    True
    """
    measured = partial(record, model, direction, cycles=1, run_in=run_in, steps_per_cycle=steps_per_cycle)
    points = enumerate(zip(np.atleast_1d(frequency), np.atleast_1d(amplitude), strict=True))
    return np.array([lock_in(measured(f, x, under=under.select(number)), f) for number, (f, x) in points])
