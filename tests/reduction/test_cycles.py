"""Cycles of a long motion: found whatever the noise, cut where a steady state ends, and faults of a record told."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bushfit.reduction.arrays import scatter
from bushfit.reduction.cycles import Cycles, least_prominence, lone_outliers, mean_from_steady, turning_points

TIME = np.arange(4000) / 1000.0


def test_runs_end_where_the_amplitude_jumps_or_rows_are_missing() -> None:
    motion = np.where(TIME < 2.0, 1e-4, 3e-4) * np.sin(2.0 * np.pi * 10.0 * TIME)
    first, *_, last = Cycles.of(TIME, motion).runs()
    assert (first.start, first.stop) == (0, pytest.approx(20, abs=1))
    assert last.stop - last.start == pytest.approx(19, abs=1)
    time = np.delete(TIME, slice(1000, 1095))
    assert len(Cycles.of(time, np.sin(2.0 * np.pi * 10.0 * time)).runs()) == 2


@pytest.mark.parametrize("transient", [0, 6])
def test_cycles_that_are_not_steady_are_left_out_at_the_start(transient: int) -> None:
    settling = 1.0 + 0.3 * np.exp(-np.arange(40) / 2.0) * (transient > 0)
    motion = settling + 1e-3 * np.random.default_rng(1).standard_normal(40)
    steady = mean_from_steady(motion.astype(complex), np.ones(40, dtype=complex), 3)
    assert transient <= steady.start <= transient + 10
    assert steady.stop - steady.start >= 20


@pytest.mark.parametrize("size", [0.0, 1e-3, 0.1])
def test_noise_makes_no_turning_point(size: float) -> None:
    """The least turn lies above what noise does from row to row, and below the motion."""
    motion = np.sin(5.0 * np.pi * TIME) + size * np.random.default_rng(2).standard_normal(TIME.size)
    least = least_prominence(motion)
    assert least < 2.0
    assert turning_points(motion, least).size == pytest.approx(21, abs=1)


def test_a_row_alone_far_off_its_neighbours_is_an_outlier() -> None:
    motion = np.sin(10.0 * np.pi * TIME) + 5e-4 * np.random.default_rng(0).standard_normal(TIME.size)
    assert not lone_outliers(TIME, motion).any()
    motion[700] += 0.2
    assert np.flatnonzero(lone_outliers(TIME, motion)).tolist() == [700]
    corner = np.abs((TIME * 10.0) % 2.0 - 1.0)
    assert not lone_outliers(TIME, corner).any()


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


def test_wild_values_hardly_move_the_scatter() -> None:
    values = 3.0 + 0.5 * np.random.default_rng(0).standard_normal(100_000)
    values[:1000] = 1e6
    assert scatter(values) == pytest.approx((3.0, 0.5), abs=0.02)
