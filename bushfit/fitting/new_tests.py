"""Data sets of tests that are not made yet, as a model would have them."""

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.drive import Drive
from bushfit.fitting.loop_data import LoopData
from bushfit.fitting.noise import SweepNoise
from bushfit.fitting.sweep_data import SweepData
from bushfit.geometry import Place
from bushfit.model.model import Model
from bushfit.reading.measurement import Loop, Sweep


def new_loop(
    model: Model,
    place: Place,
    frequency: float,
    amplitude: float,
    noise: float,
    *,
    cycles: float = 1.0,
    rows: int,
    from_rest: bool = False,
) -> LoopData:
    """A sinusoidal loop of so many rows in all.

    Args:
        frequency: [Hz].
        amplitude: zero-to-peak [m or rad].
        noise: standard deviation of one row, relative to half the force range.
    """
    phase, nil = cycles * np.arange(rows) / rows, np.zeros(rows)
    motion = amplitude * np.sin(2.0 * np.pi * phase)
    silent = Drive(
        loop=Loop("new", place, phase / frequency, motion, nil),
        frequency=frequency,
        cycles=cycles,
        from_rest=from_rest,
        phase=phase,
        force=nil,
        weight=np.ones(rows),
        noise=1.0,
        coefficients=np.array([0.0, -1j * amplitude]),
        half_range=1.0,
    )
    return LoopData(silent).noise_free(model).with_noise(noise)


def new_sweep(
    model: Model,
    place: Place,
    frequency: Array,
    amplitude: Array,
    scatter: tuple[float, float],
    shared: tuple[float, float],
) -> SweepData:
    """A sweep at operating points [Hz, m or rad], (n,) each, a run for each amplitude.

    Args:
        scatter, shared: standard deviations of gain and phase, from point to point and of a run.
    """
    noise = SweepNoise({("new", float(x)): scatter for x in np.unique(amplitude)}, shared, "stated", 0)
    return SweepData(Sweep("new", place, frequency, amplitude, model.stiffness(place, frequency, amplitude)), noise)
