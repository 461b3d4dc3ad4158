"""The clock of a loop: many cycles at any sampling, one closed cycle of few rows, and a cycle and a little more."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from bushfit.errors import FitError
from bushfit.fitting.loop_cycles import fundamental, thinned
from bushfit.geometry import Direction
from bushfit.reading.measurement import Loop

FREQUENCY = 0.1


def sine(phase: np.ndarray) -> np.ndarray:
    return np.sin(2.0 * np.pi * phase)


def triangle(phase: np.ndarray) -> np.ndarray:
    return 4.0 * np.abs((phase + 0.25) % 1.0 - 0.5) - 1.0


def found(motion: np.ndarray, time: np.ndarray, seed: int = 0) -> float:
    """Frequency over the true one."""
    noisy = 1e-3 * (motion + 3e-3 * np.random.default_rng(seed).standard_normal(motion.size))
    loop = Loop("loop", Direction.AXIAL, time, noisy, noisy)
    return fundamental(loop, *thinned(loop))[0] / FREQUENCY


@pytest.mark.parametrize(
    ("rows", "cycles"), [(50, 1000), (100, 500), (100, 1000), (200, 500), (200, 1000), (250, 400), (500, 200)]
)
def test_rows_that_keep_time_with_the_cycles_do_no_harm(rows: int, cycles: int) -> None:
    """So many rows that some stand for all: every n-th of them may come at the same few phases again and again."""
    time = np.arange(rows * cycles) / (rows * FREQUENCY)
    assert abs(found(sine(time * FREQUENCY), time) - 1.0) * cycles < 1e-3


@pytest.mark.parametrize("begin", [0.0, 0.1, 0.25, 0.4, 0.75])
@pytest.mark.parametrize("rows", [30, 60, 150])
def test_one_closed_cycle_of_a_triangle(rows: int, begin: float) -> None:
    time = np.arange(rows) / (rows * FREQUENCY)
    assert found(triangle(time * FREQUENCY + begin), time) == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize("wave", [sine, triangle])
@pytest.mark.parametrize("cycles", [1.005, 1.02, 1.03, 1.1, 1.4])
@pytest.mark.parametrize("begin", [0.0, 0.1, 0.4, 0.6])
def test_a_cycle_and_a_little_more_is_no_longer_cycle(
    wave: Callable[[np.ndarray], np.ndarray], cycles: float, begin: float
) -> None:
    time = np.linspace(0.0, cycles / FREQUENCY, 2000)
    assert found(wave(time * FREQUENCY + begin), time) == pytest.approx(1.0, abs=2e-3)


def test_less_than_a_cycle_is_refused() -> None:
    time = np.linspace(0.0, 0.9 / FREQUENCY, 2000)
    with pytest.raises(FitError, match="does not hold a whole cycle"):
        found(sine(time * FREQUENCY), time)
