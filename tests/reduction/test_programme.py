"""Records of several amplitudes or rates: the parts that are found, their order, and fits to them. All is simulated."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from bushfit.effects.contract import Array
from bushfit.errors import BushfitError
from bushfit.fitting.prepare_loop import prepare_loop
from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.reading.measurement import Loop
from bushfit.reading.stated import LoopFile
from bushfit.reduction.programme import split_record
from bushfit.simulation import rig

STEP = 0.01


def cycles(count: float, size: float, frequency: float = 0.1, start: float = 0.0, shape: str = "sine") -> Array:
    """A motion of so many cycles and mm."""
    return 1e-3 * size * rig.wave(shape, start + np.arange(0.0, count, STEP * frequency))


def ramp(first: float, last: float, seconds: float) -> Array:
    return 1e-3 * np.linspace(first, last, int(seconds / STEP), endpoint=False)


def hold(seconds: float) -> Array:
    return np.zeros(int(seconds / STEP))


def recorded(model: Model, *motions: Array, seed: int = 0, noise: float = 3e-3) -> Loop:
    """Motions one after the other from rest, with noise relative to the largest force."""
    motion, random = np.concatenate(motions), np.random.default_rng(seed)
    clean = rig.simulate_motion(model, Direction.AXIAL, motion, STEP, 0.1)
    jitter = 2e-4 * np.abs(motion).max() * random.standard_normal(motion.size)
    scatter = noise * np.abs(clean.force).max() * random.standard_normal(motion.size)
    return Loop("loop", Direction.AXIAL, clean.time, motion + jitter, clean.force + scatter)


def slow(*sizes: float) -> list[tuple[float, float]]:
    """Parts of these amplitudes [mm], all at 0.1 Hz."""
    return [(size, 0.1) for size in sizes]


#: Motions, and amplitude [mm] and frequency [Hz] of each part that is to be found in them.
PROGRAMMES: dict[str, tuple[Sequence[Array], Sequence[tuple[float, float]]]] = {
    "two cycles": ([cycles(2, x) for x in (0.2, 0.5, 1)], slow(0.2, 0.5, 1)),
    "up and down": ([cycles(3, x) for x in (0.2, 0.5, 1, 0.5, 0.2)], slow(0.2, 0.5, 1, 0.5, 0.2)),
    "pauses": ([hold(5), cycles(5, 0.2), hold(10), cycles(5, 0.5), hold(20), cycles(5, 1), hold(5)], slow(0.2, 0.5, 1)),
    "ramps between peaks": (
        [cycles(4, 0.2, start=0.25), ramp(0.2, 1, 3), cycles(4, 1, start=0.25), ramp(1, 0, 9)],
        slow(0.2, 1),
    ),
    "rates changed at the peak": (
        [cycles(5, 0.5, f, start=0.25, shape="triangle") for f in (0.1, 0.2, 0.05)],
        [(0.5, 0.1), (0.5, 0.2), (0.5, 0.05)],
    ),
    "amplitudes at two rates": (
        [cycles(4, x, f) for f in (0.1, 0.3) for x in (0.2, 0.5, 1)],
        [(x, f) for f in (0.1, 0.3) for x in (0.2, 0.5, 1)],
    ),
    "one speed": (
        [cycles(3, x, 0.04 / x, shape="triangle") for x in (0.2, 0.5, 1)],
        [(x, 0.04 / x) for x in (0.2, 0.5, 1)],
    ),
    "growing between": (
        [cycles(n, x) for n, x in ((4, 0.2), (1, 0.3), (1, 0.4), (4, 0.5), (1, 0.7), (4, 1))],
        slow(0.2, 0.5, 1),
    ),
    "close": ([cycles(5, x) for x in (0.8, 0.9, 1)], slow(0.8, 0.9, 1)),
    "one comes again": ([cycles(4, x) for x in (1, 0.3, 1)], slow(1, 0.3, 1)),
    "a disturbance": (
        [cycles(4, 0.3), *(cycles(n, x) for n, x in ((4, 1), (1, 1.3), (4, 1)))],
        slow(0.3, 1.037),
    ),  # one part, with its larger cycle
    "about a mean": ([ramp(0, 1.5, 20), 1.5e-3 + cycles(4, 0.2), 1.5e-3 + cycles(4, 0.5)], slow(0.2, 0.5)),
}


@pytest.mark.parametrize("case", PROGRAMMES)
def test_each_steady_part_is_a_loop_in_its_order(paper_model, case):
    motions, expected = PROGRAMMES[case]
    record = recorded(paper_model, *motions)
    loops = split_record(record)
    prepared_loops = [prepare_loop(loop) for loop in loops]
    assert [loop.name for loop in loops] == [f"loop_part_{number}" for number in range(1, len(expected) + 1)]
    assert [1e3 * float(prepared.amplitude[0]) for prepared in prepared_loops] == pytest.approx(
        [x for x, _ in expected], rel=5e-3
    )
    assert [float(prepared.frequency[0]) for prepared in prepared_loops] == pytest.approx(
        [f for _, f in expected], rel=2e-3
    )
    # the first cycle of later parts remembers what came before, and goes where two more remain
    used = {"up and down": [3, 2, 2, 2, 2], "two cycles": [2, 2, 2], "pauses": [4, 4, 4]}.get(case)
    assert used is None or [prepared.cycles for prepared in prepared_loops] == pytest.approx(used, abs=0.2)
    if case == "pauses":
        sentences = [loop.part.left_out for loop in loops if loop.part and loop.part.left_out]
        assert [sentence.count("before the steady cycles") for sentence in sentences] == [1, 1, 1]
        assert [sentence.count("4.99 s after the steady cycles") for sentence in sentences] == [0, 0, 1]
    for loop in loops:
        rows = slice(loop.part.first_row, loop.part.first_row + loop.force.size)
        np.testing.assert_array_equal(loop.force, record.force[rows])


@pytest.mark.parametrize("rest", [1.0, 3.0, 10.0])
def test_cycles_that_rest_at_the_top_keep_their_size(paper_model, rest):
    """In the digits of a coarse converter, in which rows at rest are equal."""
    motion = np.concatenate([np.append(cycles(1, 1, start=0.25) - 1e-3, hold(rest))] * 3)
    record = rig.simulate_motion(paper_model, Direction.AXIAL, motion, STEP, 0.1)
    coarse = replace(record, displacement=np.round(motion, 6), force=np.round(record.force))
    (loop,) = split_record(coarse)
    assert 1e3 * float(prepare_loop(loop).amplitude[0]) == pytest.approx(1.0, rel=0.01)


MINUTE = np.arange(0.0, 60.0, STEP)
UNSTEADY = {
    "wide sweep": np.sin(2.0 * np.pi * (0.1 * MINUTE + 0.005 * MINUTE**2)),
    "narrow sweep": np.sin(2.0 * np.pi * (0.9 * MINUTE + 0.1 / 60.0 * MINUTE**2)),
    "narrower sweep": np.sin(2.0 * np.pi * (0.98 * MINUTE + 0.02 / 60.0 * MINUTE**2)),
    "modulated": (1.0 + 0.4 * np.sin(2.0 * np.pi * 0.05 * MINUTE)) * np.sin(2.0 * np.pi * MINUTE),
    "modulated by a tenth": (1.0 + 0.1 * np.sin(2.0 * np.pi * 0.2 * MINUTE)) * np.sin(2.0 * np.pi * MINUTE),
    "cycles of rising frequency": np.concatenate(
        [np.sin(2.0 * np.pi * f * np.arange(0.0, 1.0 / f, STEP)) for f in np.arange(0.5, 1.25, 0.1)]
    ),
    "two equal sines": np.sin(2.0 * np.pi * 0.1 * MINUTE) + np.sin(2.0 * np.pi * MINUTE),
    "two sines": np.sin(2.0 * np.pi * 0.1 * MINUTE) + 0.3 * np.sin(2.0 * np.pi * 5.0 * MINUTE),
}


@pytest.mark.parametrize("motion", UNSTEADY.values(), ids=UNSTEADY)
def test_unequal_cycles_are_no_loop(paper_model, motion):
    with pytest.raises(BushfitError, match=r"no part of the record is a loop|the cycles of the loop are not equal"):
        prepare_loop(split_record(recorded(paper_model, 1e-3 * motion))[0])


@pytest.mark.parametrize("case", ["pauses", "one speed"])
def test_without_time_parts_are_the_same(paper_model, case):
    motions, expected = PROGRAMMES[case]
    loops = split_record(
        replace(recorded(paper_model, *motions), has_recorded_time=False), LoopFile(file="", rate=1e-4)
    )
    sizes = [float(prepare_loop(loop).amplitude[0]) for loop in loops]
    assert [1e3 * size for size in sizes] == pytest.approx([x for x, _ in expected], rel=1e-2)
    for loop, size in zip(loops, sizes, strict=True):
        assert prepare_loop(loop).frequency == pytest.approx(1e-4 / (4.0 * size), rel=2e-2)


def virgin(loop: Loop, share: float) -> Loop:
    """The first cycle of each of three parts of five cycles stiffer by a share, as rubber is that never went so far."""
    at = loop.time / 10.0 % 5.0
    return replace(loop, force=loop.force * np.where(at < 1.0, 1.0 + share, 1.0))


def test_a_softening_is_told_of_each_part(paper_model):
    loops = split_record(virgin(recorded(paper_model, *[cycles(5, x) for x in (0.2, 0.5, 1)]), 0.12))
    found = [100.0 * (loop.softening or 0.0) for loop in loops]
    assert found == pytest.approx([12.0] * 3, abs=4.0)  # with what a springpot and friction make from rest
    assert any("stiffer than the last (Mullins)" in note for note in map(str, prepare_loop(loops[1]).notes))
    (one,) = split_record(virgin(recorded(paper_model, cycles(5, 1)), 0.12))
    assert one.softening == pytest.approx(0.12, abs=0.03)
