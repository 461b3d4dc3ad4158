"""Cycles of a long motion: found whatever the noise, cut where a steady state ends, and faults of a record told."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bushfit.reduction.cycles import (
    Cycles,
    keeps_changing,
    least_prominence,
    lone_outliers,
    mean_from_steady,
    pieces,
    turning_points,
)

RATE = 1000.0


def chirped(frequency: np.ndarray, amplitude: float | np.ndarray, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Time and motion of a sine of that frequency [Hz] at each row, with 0.05 % of noise."""
    phase = 2.0 * np.pi * np.cumsum(frequency) / RATE
    noise = np.random.default_rng(seed).standard_normal(phase.size)
    return np.arange(phase.size) / RATE, amplitude * (np.sin(phase) + 5e-4 * noise)


def test_cycles_of_a_noisy_sine_are_counted_and_measured() -> None:
    time, motion = chirped(np.full(4000, 7.0), 2e-4)
    cycles = Cycles.of(time, motion)
    np.testing.assert_allclose(np.diff(cycles.edges), 1.0 / 7.0, rtol=2e-3)
    assert cycles.range.size in (26, 27)
    np.testing.assert_allclose(cycles.range, 4e-4, rtol=5e-3)
    assert cycles.runs() == [slice(0, cycles.range.size)]
    size = np.abs(cycles.fundamentals(slice(0, 20), motion))
    np.testing.assert_allclose(size, 2e-4, rtol=1e-3)
    assert np.array_equal(cycles.time[cycles.first_rows] >= cycles.edges, np.ones(cycles.edges.size, dtype=bool))


def test_a_record_that_never_turns_has_no_cycles() -> None:
    time = np.arange(100) / RATE
    cycles = Cycles.of(time, time**2)
    assert cycles.range.size == 0
    assert cycles.runs() == []


def test_runs_end_where_the_amplitude_jumps_or_rows_are_missing() -> None:
    time, motion = chirped(np.full(4000, 10.0), np.where(np.arange(4000) < 2000, 1e-4, 3e-4))
    first, *_, last = Cycles.of(time, motion).runs()
    assert (first.start, first.stop) == (0, pytest.approx(20, abs=1))
    assert last.stop - last.start == pytest.approx(19, abs=1)
    kept = np.r_[0:1000, 1095:4000]
    holed = Cycles.of(time[kept], np.sin(2.0 * np.pi * 10.0 * time[kept]))
    assert len(holed.runs()) == 2


@pytest.mark.parametrize(("second", "share"), [(12.1, 1.0), (12.0, 1.05), (12.0, 1.0)])
def test_a_run_is_cut_where_frequency_or_amplitude_step(second: float, share: float) -> None:
    step = np.arange(6000) < 3000
    time, motion = chirped(np.where(step, 12.0, second), np.where(step, 1e-3, 1e-3 * share))
    cycles = Cycles.of(time, motion)
    (run,) = cycles.runs()
    size = np.log(np.abs(cycles.fundamentals(run, motion)))
    found = pieces(cycles.edges, size)
    cuts = [part.start for part in found[1:]]
    assert bool(cuts) == ((second, share) != (12.0, 1.0))
    assert all(abs(cut - 36) <= 3 for cut in cuts)
    assert (found[0].start, found[-1].stop) == (0, size.size)
    assert not keeps_changing(cycles.edges, found)


def test_a_swept_frequency_keeps_changing_and_a_stepped_one_does_not() -> None:
    for steps in (False, True):
        frequency = 20.0 * np.exp(np.linspace(0.0, 0.2, 8000))
        if steps:
            frequency = np.repeat(frequency[500::1000], 1000)
        cycles = Cycles.of(*chirped(frequency, 1e-3))
        size = np.log(np.abs(cycles.fundamentals(slice(0, cycles.range.size), chirped(frequency, 1e-3)[1])))
        found = pieces(cycles.edges, size)
        assert len(found) >= 4
        assert keeps_changing(cycles.edges, found) is not steps


@pytest.mark.parametrize("transient", [0, 6])
def test_cycles_that_are_not_steady_are_left_out_at_the_start(transient: int) -> None:
    number, random = np.arange(40), np.random.default_rng(1)
    settling = 1.0 + 0.3 * np.exp(-number / 2.0) * (transient > 0)
    motion = settling + 1e-3 * random.standard_normal(40)
    steady = mean_from_steady(motion.astype(complex), np.ones(40, dtype=complex), 3)
    assert steady.start >= transient
    assert steady.start <= transient + 10
    assert steady.stop - steady.start >= 20


@pytest.mark.parametrize("size", [0.0, 1e-3, 0.1])
def test_noise_makes_no_turning_point(size: float) -> None:
    """The least turn lies above what noise does from row to row, and below the motion."""
    motion = np.sin(np.arange(4000) * 2.0 * np.pi / 400.0)
    motion = motion + size * np.random.default_rng(2).standard_normal(motion.size)
    least = least_prominence(motion)
    assert least < 2.0
    assert turning_points(motion, least).size == pytest.approx(21, abs=1)


def test_a_row_alone_far_off_its_neighbours_is_an_outlier() -> None:
    time, motion = chirped(np.full(2000, 5.0), 1e-3)
    assert not lone_outliers(time, motion).any()
    motion[700] += 2e-4
    assert np.flatnonzero(lone_outliers(time, motion)).tolist() == [700]
    corner = 1e-3 * np.abs((time * 10.0) % 2.0 - 1.0)
    assert not lone_outliers(time, corner).any()


@given(st.lists(st.integers(-6, 6), min_size=2, max_size=60), st.integers(1, 6))
def test_turning_points_alternate_and_stand_out(values: list[int], least: int) -> None:
    series = np.array(values, dtype=float)
    turns = turning_points(series, least)
    heights = np.diff(series[turns])
    if turns.size > 2:
        assert np.abs(heights).min() >= least
        assert np.all(heights[1:] * heights[:-1] < 0)
    if np.ptp(series) >= least:
        assert series[turns].max() == series.max()
        assert series[turns].min() == series.min()
