"""Loops made ready: the motion behind a noisy displacement, whatever its waveform, sampling and length."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bushfit.errors import FitError
from bushfit.fitting.data_sets import LoopData
from bushfit.fitting.drive import drive_of
from bushfit.fitting.loop_harmonics import MOST_ROWS
from bushfit.geometry import Direction
from bushfit.model import rig
from bushfit.model.model import Model
from bushfit.reading.measurement import Loop

FREQUENCY, AMPLITUDE = 0.1, 1e-3


def measured(
    model: Model,
    *,
    waveform: str = "sine",
    cycles: float = 1.0,
    start: float = 0.0,
    rows: int = 1000,
    uneven: bool = False,
    noise: float = 3e-3,
    jitter: float = 1e-3,
    offset: float = 0.0,
    preload: float = 0.0,
    seed: int = 0,
) -> Loop:
    """A settled loop: displacement noise `jitter` of the amplitude, force noise `noise` of the half range."""
    whole = rig.record(model, Direction.AXIAL, FREQUENCY, AMPLITUDE, cycles=6, run_in=8, waveform=waveform, kind="loop")
    rng = np.random.default_rng(seed)
    count = round(rows * cycles)
    share = np.sort(rng.random(count)) if uneven else np.arange(count) / count
    time = (start + cycles * share) / FREQUENCY
    motion, force = (np.interp(time, whole.time, column) for column in (whole.displacement, whole.force))
    return Loop(
        "loop",
        Direction.AXIAL,
        time - time[0],
        motion + offset + jitter * AMPLITUDE * rng.standard_normal(count),
        force + preload + noise * np.ptp(force) / 2.0 * rng.standard_normal(count),
    )


CASES: dict[str, dict[str, Any]] = {
    "sine": {},
    "triangle": {"waveform": "triangle"},
    "several": {"cycles": 4.0},
    "fractional": {"cycles": 2.37, "start": 0.11},
    "starts at a peak": {"start": 0.25},
    "uneven": {"uneven": True, "cycles": 2.0},
    "uneven triangle": {"uneven": True, "cycles": 3.0, "waveform": "triangle", "start": 0.4},
    "coarse": {"rows": 40, "cycles": 3.0},
    "offset": {"offset": 2e-4, "cycles": 2.0},
    "preloaded": {"offset": -2e-4, "preload": -80.0, "cycles": 2.0},
    "very noisy displacement": {"jitter": 1e-2, "cycles": 3.0},
}


@pytest.mark.parametrize("case", CASES)
def test_the_motion_is_cleared_and_the_true_model_leaves_only_noise(paper_model: Model, case: str) -> None:
    """One peak and one trough a cycle, where the motion has them, although the sensor turns at every other row."""
    loop = measured(paper_model, **CASES[case])
    data_set = LoopData(drive_of(loop))
    cycle = data_set.drive.history(settles=False).value
    turns = np.flatnonzero(np.diff(np.sign(np.diff(np.append(cycle, cycle[0])))) != 0)
    residual = data_set.residual(paper_model)
    reduced = float(residual @ residual) / residual.size
    print(f"{case}: f {data_set.drive.frequency:.6f} Hz, turns {turns.size}, reduced chi-square {reduced:.3f}")
    assert data_set.drive.frequency == pytest.approx(FREQUENCY, rel=2e-3)
    assert turns.size
    assert np.all(np.abs(cycle[turns]) > 0.95 * AMPLITUDE)
    assert (cycle.max(), -cycle.min()) == pytest.approx((AMPLITUDE, AMPLITUDE), rel=1.5e-2)
    assert data_set.relative_noise == pytest.approx(3e-3, rel=0.35)
    assert reduced < 1.0 + 6.0 * np.sqrt(2.0 / residual.size) + 0.1


def test_from_rest_the_virgin_curve_is_followed(paper_model: Model) -> None:
    whole = rig.record(paper_model, Direction.AXIAL, FREQUENCY, AMPLITUDE, cycles=3, steps_per_cycle=1000)
    loop = Loop("loop", Direction.AXIAL, whole.time, whole.displacement, whole.force)
    drive = drive_of(loop)
    assert drive.from_rest
    assert not drive.history(settles=False).periodic
    gap = np.max(np.abs(LoopData(drive).force(paper_model) - loop.force)) / drive.half_range
    print(f"from rest: model within {gap:.1e} of the record")
    assert gap < 2e-3
    settled = drive_of(measured(paper_model))
    assert not settled.from_rest


@pytest.mark.parametrize(("cycles", "amplitude"), [(1, 1e-4), (1, 1e-3), (4, 1e-3), (3.5, 1e-4)])
def test_rest_may_be_a_preload(paper_model: Model, cycles: float, amplitude: float) -> None:
    whole = rig.record(paper_model, Direction.AXIAL, FREQUENCY, amplitude, cycles=4, steps_per_cycle=1000)
    rows = slice(round(1000 * cycles) + 1)
    noise = 3e-3 * np.ptp(whole.force) * np.random.default_rng(0).standard_normal(whole.force.size)
    force, settled = whole.force + 640.0 + noise, slice(2000, None)
    loop = Loop("loop", Direction.AXIAL, whole.time[rows], whole.displacement[rows] + 1.2e-3, force[rows])
    data_set = LoopData(drive_of(loop))
    residual = data_set.residual(paper_model)
    reduced = float(residual @ residual) / data_set.counted
    print(f"{cycles} cycles of {1e3 * amplitude:g} mm from rest about a preload: reduced chi-square {reduced:.3f}")
    assert data_set.drive.from_rest
    assert reduced < 1.2
    assert "recorded about a mean displacement of 1.2 mm" in " ".join(data_set.notes)
    later = Loop("loop", Direction.AXIAL, whole.time[settled], whole.displacement[settled] + 1.2e-3, force[settled])
    assert not drive_of(later).from_rest


def test_many_rows_are_binned_without_loss(paper_model: Model) -> None:
    loop = measured(paper_model, cycles=5.0, rows=40_000)
    drive = drive_of(loop)
    assert drive.force.size <= 5 * 1024 + 1
    assert 0.99 * loop.force.size < drive.weight.sum() < loop.force.size  # the turning points carry none
    assert loop.force.size > MOST_ROWS
    residual = LoopData(drive).residual(paper_model)
    reduced = float(residual @ residual) / residual.size
    print(f"{loop.force.size} rows in {drive.force.size} bins: reduced chi-square {reduced:.3f}")
    assert 0.9 < reduced < 1.15
    few = drive_of(measured(paper_model, cycles=5.0, rows=500))
    assert drive.first_harmonic() == pytest.approx(few.first_harmonic(), rel=2e-3)


def test_a_wrong_zero_of_the_load_cell_alone_stays_visible(paper_model: Model) -> None:
    """Only where the displacement is off zero too is the mean force taken for unknown."""
    data_set = LoopData(drive_of(measured(paper_model, preload=5.0)))
    assert np.mean(data_set.drive.force - data_set.force(paper_model)) == pytest.approx(5.0, abs=0.3)


def test_jacobian_of_an_offset_loop(paper_model: Model) -> None:
    data_set = LoopData(drive_of(measured(paper_model, offset=3e-4, preload=40.0)))
    names = ("mu", "eps_half")
    for name, row in zip(names, data_set.jacobian(paper_model, names), strict=True):
        value = paper_model.values[name]
        high, low = (data_set.residual(paper_model.with_values({name: value * (1.0 + s)})) for s in (1e-5, -1e-5))
        np.testing.assert_allclose(row * value, (high - low) / 2e-5, atol=1e-4)


def test_stated_noise_is_taken(paper_model: Model) -> None:
    data_set = LoopData(drive_of(replace(measured(paper_model), noise=0.02)))
    assert data_set.relative_noise == pytest.approx(0.02)


def with_hole(loop: Loop, begin: float, end: float) -> Loop:
    """A loop without the rows from one cycle count to another."""
    kept = (loop.time * FREQUENCY < begin) | (loop.time * FREQUENCY >= end)
    return replace(loop, **{name: getattr(loop, name)[kept] for name in ("time", "displacement", "force")})


@pytest.mark.parametrize("waveform", ["sine", "triangle"])
@pytest.mark.parametrize("hole", [(1.0, 2.0), (1.3, 2.3), (1.3, 1.8), (1.3, 1.55), (0.5, 1.5), (1.3, 2.9)])
def test_rows_that_are_missing_do_not_change_the_frequency(
    paper_model: Model, waveform: str, hole: tuple[float, float]
) -> None:
    drive = drive_of(with_hole(measured(paper_model, waveform=waveform, cycles=3.0), *hole))
    assert drive.frequency == pytest.approx(FREQUENCY, rel=1e-3)
    assert drive.amplitude == pytest.approx(AMPLITUDE, rel=5e-3)
    if hole[1] - hole[0] > 0.4:
        (note,) = drive.notes
        assert "rows are missing" in note


def test_where_no_stroke_is_whole_the_hole_is_named(paper_model: Model) -> None:
    loop = with_hole(measured(paper_model, cycles=2.0, start=0.1), 0.3, 1.6)
    with pytest.raises(FitError, match=r"rows are missing inside the loop\n.*none from 2\.99 to 16 s"):
        drive_of(loop)
