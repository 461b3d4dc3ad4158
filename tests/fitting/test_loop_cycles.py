"""The cycles of a loop: what comes before and after is left out, and the frequency is right at any sampling."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bushfit.effects.contract import Array
from bushfit.errors import FitError
from bushfit.fitting.data_sets import LoopData
from bushfit.fitting.drive import drive_of
from bushfit.fitting.loop_cycles import steady_cycles
from bushfit.geometry import Direction
from bushfit.model import rig
from bushfit.model.model import Model
from bushfit.reading.measurement import Loop

PERIOD, AMPLITUDE = 10.0, 1e-3


def frequency_found(waveform: str, phase: Array) -> float:
    """Frequency over the true one, of a motion at even times with 0.3 % noise."""
    noise = 3e-3 * np.random.default_rng(0).standard_normal(phase.size)
    motion = AMPLITUDE * (rig.wave(waveform, phase) + noise)
    loop = Loop("loop", Direction.AXIAL, (phase - phase[0]) * PERIOD, motion, motion)
    return steady_cycles(loop).frequency * PERIOD


@pytest.mark.parametrize(("rows", "cycles"), [(50, 1000), (200, 500), (500, 200)])
def test_rows_that_keep_time_with_the_cycles_do_no_harm(rows: int, cycles: int) -> None:
    """So many rows that some stand for all: every n-th of them may come at the same few phases again and again."""
    assert abs(frequency_found("sine", np.arange(rows * cycles) / rows) - 1.0) * cycles < 1e-3


@pytest.mark.parametrize("begin", [0.0, 0.1, 0.25, 0.4, 0.75])
@pytest.mark.parametrize("rows", [30, 150])
def test_one_closed_cycle_of_a_triangle(rows: int, begin: float) -> None:
    assert frequency_found("triangle", begin + np.arange(rows) / rows) == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize("waveform", ["sine", "triangle"])
@pytest.mark.parametrize("cycles", [1.005, 1.02, 1.03, 1.1, 1.2, 1.4, 1.7])
def test_a_cycle_and_a_part_is_not_one_longer_cycle(waveform: str, cycles: float) -> None:
    starts = np.arange(0.0, 1.0, 0.05) if cycles > 1.1 else (0.0, 0.1, 0.4, 0.6)  # at an extreme a little is not seen
    found = [frequency_found(waveform, np.linspace(a, a + cycles, 2000)) for a in starts]
    assert found == pytest.approx([1.0] * len(starts), abs=2e-3)


def test_less_than_a_cycle_is_refused() -> None:
    with pytest.raises(FitError, match=r"does not hold a whole cycle[\s\S]*at least one closed cycle"):
        frequency_found("sine", np.linspace(0.0, 0.9, 2000))


def sine(cycles: float, share: float = 1.0, start: float = 0.0) -> Array:
    return share * AMPLITUDE * np.sin(2.0 * np.pi * (start + np.arange(0.0, cycles, 1e-3)))


def ramp(first: float, last: float, seconds: float) -> Array:
    return AMPLITUDE * np.linspace(first, last, int(seconds * 100), endpoint=False)


RUN_INS = {
    "ramp to the peak": [ramp(0, 1, 12.0), sine(3, start=0.25)],
    "ramp, hold, cycles": [ramp(0, 1, 3.0), ramp(1, 1, 20.0), sine(4, start=0.25)],
    "hold at zero": [ramp(0, 0, 15.0), sine(4)],
    "smaller cycles": [sine(2, 0.3), sine(2, 0.6), sine(4)],
    "growing cycles": [*(sine(1, share) for share in (0.2, 0.4, 0.6, 0.8)), sine(5)],
    "two cycles after a ramp": [ramp(0, -1, 4.0), sine(2, start=0.75)],
    "back to zero at the end": [sine(3.25), ramp(1, 0, 15.0)],
    "run-in and run-out": [ramp(0, -1, 15.0), sine(4, start=0.75), ramp(-1, 0, 15.0)],
}


def recorded(model: Model, *motions: Array, noise: float = 3e-3) -> Loop:
    """A motion that starts from rest, put through the rig's equations."""
    clean = rig.imposed(model, Direction.AXIAL, np.concatenate(motions), PERIOD / 1000, 1.0 / PERIOD)
    scatter = noise * np.ptp(clean.force) / 2.0 * np.random.default_rng(0).standard_normal(clean.time.size)
    return Loop("loop", Direction.AXIAL, clean.time, clean.displacement, clean.force + scatter)


@pytest.mark.parametrize("case", RUN_INS)
def test_the_true_model_leaves_only_noise_of_the_steady_cycles(paper_model: Model, case: str) -> None:
    drive = drive_of(recorded(paper_model, *RUN_INS[case]))
    gap = float(np.sqrt(np.mean(np.square(LoopData(drive).relative(paper_model)))))
    print(f"{case}: {drive.notes}; true model within {100 * gap:.2f} % of half the force range, noise 0.3 %")
    (note,) = drive.notes
    assert "left out" in note
    assert drive.frequency == pytest.approx(1.0 / PERIOD, rel=2e-3)
    assert drive.amplitude == pytest.approx(AMPLITUDE, rel=1e-2)
    assert drive.cycles == pytest.approx(round(drive.cycles * 4) / 4, abs=0.05)
    assert gap < 6e-3  # a long hold is remembered for longer than a cycle


@pytest.mark.parametrize("motion", [sine(3), sine(1, start=0.25), sine(2.6, start=0.4), sine(1.1, start=0.1)])
def test_a_steady_record_is_left_alone(motion: Array) -> None:
    """From rest, one closed cycle, broken cycles and a little more than one; also with noise and outliers."""
    rng = np.random.default_rng(1)
    noisy = motion + 5e-3 * AMPLITUDE * rng.standard_normal(motion.size)
    for one in (motion, noisy, np.where(rng.random(motion.size) < 0.003, 0.0, motion)):
        loop = Loop("loop", Direction.AXIAL, np.arange(motion.size) * PERIOD / 1000, one, one)
        found = steady_cycles(loop)
        assert (found.loop, found.left_out) == (loop, None)


BACKWARDS: dict[str, Callable[[Loop], Loop]] = {
    "swapped": lambda loop: replace(loop, displacement=1e-6 * loop.force, force=1e6 * loop.displacement),
    "backwards": lambda loop: replace(loop, displacement=loop.displacement[::-1], force=loop.force[::-1]),
}


@pytest.mark.parametrize("case", BACKWARDS)
def test_a_loop_that_gives_energy_is_refused(paper_model: Model, case: str) -> None:
    with pytest.raises(FitError, match=r"gives energy[\s\S]*swapped, or do the rows run backwards"):
        drive_of(BACKWARDS[case](recorded(paper_model, sine(4))))
