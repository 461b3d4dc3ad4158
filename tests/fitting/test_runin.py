"""What comes before and after the steady cycles of a loop does not spoil its fit, and is said."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bushfit.effects.contract import Array
from bushfit.effects.history import History
from bushfit.errors import FitError
from bushfit.fitting.data_sets import LoopData
from bushfit.fitting.drive import drive_of
from bushfit.fitting.loop_cycles import steady_part, thinned
from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.reading.measurement import Loop

PERIOD, AMPLITUDE = 10.0, 1e-3


def sine(cycles: float, amplitude: float = AMPLITUDE, start: float = 0.0) -> Array:
    return amplitude * np.sin(2.0 * np.pi * (start + np.arange(0.0, cycles, 1e-3)))


def ramp(first: float, last: float, seconds: float) -> Array:
    return np.linspace(first, last, int(seconds * 100), endpoint=False)


def joined(*parts: Array) -> Array:
    return np.concatenate(parts)


RUN_INS: dict[str, Array] = {
    "ramp to the peak": joined(ramp(0, AMPLITUDE, 12.0), sine(3, start=0.25)),
    "ramp, hold, cycles": joined(ramp(0, AMPLITUDE, 3.0), ramp(AMPLITUDE, AMPLITUDE, 20.0), sine(4, start=0.25)),
    "hold at zero": joined(np.zeros(1500), sine(4)),
    "smaller cycles": joined(sine(2, 0.3e-3), sine(2, 0.6e-3), sine(4)),
    "growing cycles": joined(*(sine(1, share * AMPLITUDE) for share in (0.2, 0.4, 0.6, 0.8)), sine(5)),
    "two cycles after a ramp": joined(ramp(0, -AMPLITUDE, 4.0), sine(2, start=0.75)),
    "back to zero at the end": joined(sine(3.25), ramp(AMPLITUDE, 0, 15.0)),
    "run-in and run-out": joined(ramp(0, -AMPLITUDE, 15.0), sine(4, start=0.75), ramp(-AMPLITUDE, 0, 15.0)),
}


def recorded(model: Model, motion: Array, noise: float = 3e-3) -> Loop:
    """A motion that starts from rest, put through the rig's equations."""
    time = np.arange(motion.size) * PERIOD / 1000
    history = History(motion, time[1], periodic=False, frequency=1.0 / PERIOD)
    force = model.force(Direction.AXIAL, history, kind="loop")
    scatter = noise * np.ptp(force) / 2.0 * np.random.default_rng(0).standard_normal(time.size)
    return Loop("loop", Direction.AXIAL, time, motion, force + scatter)


@pytest.mark.parametrize("case", RUN_INS)
def test_the_true_model_leaves_only_noise_of_the_steady_cycles(paper_model: Model, case: str) -> None:
    loop = recorded(paper_model, RUN_INS[case])
    drive = drive_of(loop)
    data_set = LoopData(drive)
    gap = float(np.sqrt(np.mean(np.square(data_set.relative(paper_model)))))
    print(f"{case}: {drive.notes}; true model within {100 * gap:.2f} % of half the force range, noise 0.3 %")
    (note,) = drive.notes
    assert "left out" in note
    assert drive.frequency == pytest.approx(1.0 / PERIOD, rel=2e-3)
    assert drive.amplitude == pytest.approx(AMPLITUDE, rel=1e-2)
    assert drive.cycles == pytest.approx(round(drive.cycles * 4) / 4, abs=0.05)
    assert gap < 6e-3  # a long hold is remembered for longer than a cycle


STEADY: dict[str, Array] = {
    "from rest": sine(3),
    "one closed cycle": sine(1, start=0.25),
    "broken cycles": sine(2.6, start=0.4),
    "a little more than one": sine(1.1, start=0.1),
}


@pytest.mark.parametrize("case", STEADY)
def test_a_steady_record_is_left_alone(paper_model: Model, case: str) -> None:
    loop = recorded(paper_model, STEADY[case])
    rng = np.random.default_rng(1)
    noisy = replace(loop, displacement=loop.displacement + 5e-3 * AMPLITUDE * rng.standard_normal(loop.time.size))
    spiked = replace(loop, displacement=np.where(rng.random(loop.time.size) < 0.003, 0.0, loop.displacement))
    for one in (loop, noisy, spiked):
        same, note = steady_part(one, *thinned(one))
        assert same is one
        assert note is None


BACKWARDS: dict[str, Callable[[Loop], Loop]] = {
    "swapped": lambda loop: replace(loop, displacement=1e-6 * loop.force, force=1e6 * loop.displacement),
    "backwards": lambda loop: replace(loop, displacement=loop.displacement[::-1], force=loop.force[::-1]),
}


@pytest.mark.parametrize("case", BACKWARDS)
def test_a_loop_that_gives_energy_is_refused(paper_model: Model, case: str) -> None:
    loop = BACKWARDS[case](recorded(paper_model, sine(4)))
    with pytest.raises(FitError, match=r"gives energy[\s\S]*swapped, or do the rows run backwards"):
        drive_of(loop)
