"""Loops and sweeps in memory: columns of one length, and a time rebuilt where a loop was recorded without it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from texts import loop_from

from bushfit.errors import MeasurementError
from bushfit.geometry import Direction
from bushfit.reading.measurement import Loop, Sweep, rebuild_time


def test_columns_of_different_length_are_refused_by_name() -> None:
    with pytest.raises(MeasurementError, match=r"the columns of slow differ in shape[\s\S]*\(3,\)[\s\S]*\(2,\)"):
        Loop("slow", Direction.AXIAL, np.zeros(3), np.zeros(3), np.zeros(2))
    with pytest.raises(MeasurementError, match="the columns of fast differ in shape"):
        Sweep("fast", Direction.AXIAL, np.zeros((2, 1)), np.zeros((2, 1)), np.zeros((2, 1), dtype=complex))


@pytest.mark.parametrize("waveform", ["sine", "triangle"])
@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_time_rebuilt_from_frequency(waveform: Any, noise: float) -> None:
    time = np.sort(np.random.default_rng(1).uniform(0.0, 30.0, 3000))
    sine = np.sin(2 * np.pi * 0.1 * (time - time[0]))
    displacement = sine if waveform == "sine" else 2 / np.pi * np.arcsin(sine)
    displacement += noise * np.random.default_rng(2).standard_normal(time.size)
    rebuilt = rebuild_time(displacement, frequency=0.1, waveform=waveform)
    assert np.all(np.diff(rebuilt) > 0)
    np.testing.assert_allclose(rebuilt, time - time[0], atol=0.02 if noise == 0 else 0.2)


def test_time_rebuilt_from_rate(tmp_path: Path) -> None:
    text = "\n".join(["displacement [mm],force [N]", *(f"{x},{x}" for x in [0, 1, 2, 2, 1, 0, -1, -2, -1, 0])])
    loop = loop_from(text, tmp_path, rate=1e-3)
    assert loop.time[-1] == pytest.approx(8.0)
    assert np.all(np.diff(loop.time) > 0)


@given(arrays(float, st.integers(2, 60), elements=st.integers(-5, 5).map(float)).filter(lambda x: np.ptp(x) > 0))
def test_rebuilt_time_always_increases(displacement: Any) -> None:
    for waveform in ("sine", "triangle"):
        assert np.all(np.diff(rebuild_time(displacement, frequency=1.0, waveform=waveform)) > 0)
