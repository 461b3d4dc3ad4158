"""Histories: the derivatives, harmonics and turning points of a motion, steady or from rest."""

from __future__ import annotations

import numpy as np
import pytest

from bushfit.effects.history import History, reversals

COUNT, FREQUENCY = 1024, 2.0
PHASE = 2.0 * np.pi * np.arange(COUNT) / COUNT


def test_derivatives_are_those_of_the_motion() -> None:
    history = History.steady(np.sin(PHASE), FREQUENCY)
    np.testing.assert_allclose(history.rate, history.omega * np.cos(PHASE), atol=1e-4 * history.omega)
    from_rest = History(np.sin(PHASE), history.step, periodic=False, frequency=FREQUENCY)
    np.testing.assert_allclose(from_rest.acceleration[2:-2], -(history.omega**2) * np.sin(PHASE)[2:-2], atol=0.01)


def test_a_sine_turns_at_its_top_and_bottom_wherever_it_begins() -> None:
    for shift in (0, 100, 700):
        history = History.steady(np.roll(np.sin(PHASE), shift), FREQUENCY)
        turning = history.turning
        assert turning.strides.tolist() == [-2.0, 2.0]
        begins = turning.at_samples(np.array([1.0, -1.0]))
        np.testing.assert_allclose(begins + turning.travel, history.value, atol=1e-15)


def test_a_motion_from_rest_begins_at_zero() -> None:
    history = History(np.array([[1.0, 2.0, 1.0, 3.0], [1.0, 2.0, 2.5, 3.0]]), 0.1, periodic=False, frequency=1.0)
    turning = history.turning
    assert turning.strides.tolist() == [[2.0, -1.0, 2.0], [3.0, 0.0, 0.0]]
    assert turning.piece.tolist() == [[0, 1, 2, 2], [0, 0, 0, 0]]
    assert turning.travel.tolist() == [[1.0, 0.0, 0.0, 2.0], [1.0, 2.0, 2.5, 3.0]]


@pytest.mark.parametrize(
    ("values", "turned"),
    [
        ([0, 1, 2, 1], [False, False, True]),
        ([0, 1, 1, 0], [False, False, True]),
        ([0, 1, 1, 2], [False, False, False]),
        ([0, 1, 0, 1], [False, True, True]),
    ],
)
def test_of_level_stretches_the_last_sample_turns(values: list[float], turned: list[bool]) -> None:
    assert reversals(np.array(values, dtype=float)).tolist() == turned


def test_the_sense_is_that_of_the_motion_that_drives() -> None:
    slowed = History.steady(np.sin(PHASE), FREQUENCY).driven().with_value(np.cos(PHASE))
    assert np.array_equal(slowed.sense, np.sign(History.steady(np.sin(PHASE), FREQUENCY).rate))
    assert slowed.scaled(2.0) is slowed.scaled(2.0)
    assert np.array_equal(slowed.scaled(2.0).value, 2.0 * np.cos(PHASE))
