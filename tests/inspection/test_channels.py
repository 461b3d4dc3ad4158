"""Recorded channels: gaps, stuck rows, cut-off tops and outliers told with their row, and nothing of a sound one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bushfit.geometry import Direction
from bushfit.inspection.channels import clock, odd_channels
from bushfit.reading.measurement import Loop

TIME = np.arange(3000) / 100.0


@pytest.fixture
def sound() -> Loop:
    """Three cycles of a sine, 0.1 % noise in both channels."""
    noise = 1e-3 * np.random.default_rng(0).standard_normal((2, TIME.size))
    phase = 2.0 * np.pi * 0.1 * TIME
    return Loop("l", Direction.AXIAL, TIME, 1e-3 * (np.sin(phase) + noise[0]), 500.0 * (np.sin(phase + 0.1) + noise[1]))


def test_of_a_sound_record_nothing_is_said(sound: Loop) -> None:
    assert list(odd_channels(sound)) == []


def test_a_gap_is_told_by_the_clock_or_where_there_is_none_by_the_motion(sound: Loop) -> None:
    kept = np.r_[0:500, 540:3000]
    holed = replace(sound, time=TIME[kept], displacement=sound.displacement[kept], force=sound.force[kept])
    (told,) = odd_channels(holed)
    assert told.startswith("1 gap in time, the first after data row 500: 0.41 s without a row, else mostly 0.01 s")
    (told,) = odd_channels(replace(holed, time=np.arange(kept.size) / 100.0, timed=False))
    assert told.startswith("1 gap in the motion, the first after data row 500: the displacement goes from")


def test_stuck_and_cut_off_channels_are_told(sound: Loop) -> None:
    rows = (TIME >= 5.0) & (TIME < 5.5)
    held = replace(
        sound,
        displacement=np.where(rows, sound.displacement[500], sound.displacement),
        force=np.where(rows, sound.force[500], sound.force),
    )
    assert any(line.startswith("50 rows from data row 501 on repeat one") for line in odd_channels(held))
    top, *_ = odd_channels(replace(sound, force=np.minimum(sound.force, 400.0)))
    assert top.startswith("the force is cut off at its top: ")
    assert top.endswith("rows hold exactly 400 N")


def test_outliers_are_listed_with_their_neighbours_three_at_most(sound: Loop) -> None:
    force = sound.force.copy()
    force[[100, 900, 1700, 2500]] += 100.0
    (told,) = odd_channels(replace(sound, force=force))
    assert told.startswith("the force has outliers at data row 101 (")
    assert "data row 1701 (" in told
    assert told.endswith(" and 1 more")


def test_the_clock_in_words(sound: Loop) -> None:
    assert clock(sound) == "even, every 0.01 s"
    uneven = np.cumsum(np.where(np.arange(3000) % 10 == 0, 0.02, 0.01))
    assert clock(replace(sound, time=uneven)) == "uneven, every 0.01 to 0.02 s, mostly 0.01 s"
