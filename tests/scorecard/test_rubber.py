"""Simulated rubber of other laws: its building blocks against closed forms, and what its card measures."""

import numpy as np
import pytest
from lab_campaign import RUBBERS, OtherRubber
from rubber_card import evaluate
from rubber_in_time import StrainHistory, fractional_derivative, relax, sliders
from time_rig import Bushing, Tests, first_harmonic, respond

PHASE = 2.0 * np.pi * np.arange(512) / 512


def steady(frequency: float, amplitude: float = 1.0) -> StrainHistory:
    return StrainHistory(amplitude * np.sin(PHASE)[None, :], np.array([[1.0 / (512 * frequency)]]), periodic=True)


def test_relaxation_is_that_of_a_maxwell_element() -> None:
    history = steady(2.0)
    stress = relax(history, history.rate, np.full_like(history.rate, 1.0 / 0.05))
    z = 2j * np.pi * 2.0 * 0.05
    assert first_harmonic(stress) / first_harmonic(history.strain) == pytest.approx(z / (1.0 + z), rel=1e-3)


def test_fractional_derivative_from_rest_becomes_the_steady_one() -> None:
    from_rest = StrainHistory(np.tile(np.sin(PHASE), 12)[None, :], np.array([[1.0 / 512]]), periodic=False)
    last = fractional_derivative(from_rest, 0.3)[:, -512:]
    assert first_harmonic(last) / -1j == pytest.approx((2j * np.pi) ** 0.3, rel=1e-2)


def test_a_slider_loses_four_times_its_yield_force_times_its_slip() -> None:
    history = steady(1.0, amplitude=0.05)
    stress = sliders(history, np.array([1e6]), np.array([0.01]))[0]
    loss = np.sum(0.5 * (stress + np.roll(stress, 1)) * np.diff(history.strain[0], prepend=history.strain[0, -1]))
    assert loss == pytest.approx(4.0 * 1e4 * (0.05 - 0.01), rel=2e-3)


@pytest.mark.parametrize("rubber", RUBBERS)
def test_every_rubber_is_stiffer_when_fast_and_softer_when_far(rubber: str) -> None:
    law = OtherRubber(RUBBERS[rubber](np.random.default_rng(3)), 1e6)
    frequency, amplitude = np.array([5.0, 100.0, 5.0]), np.array([1e-4, 1e-4, 5e-4])
    zeros = np.zeros(3, int)
    tests = Tests(Bushing(0.007, 0.016, 0.040), frequency, amplitude, zeros, zeros, zeros + 1, zeros > 0)
    slow, fast, far = respond(tests, law).stiffness
    assert abs(far) < abs(slow) < abs(fast)
    for value in (slow, fast, far):
        assert 0.02 < value.imag / value.real < 0.3


def test_a_campaign_is_evaluated_as_by_its_user() -> None:
    misfit, least, covered, half_width = evaluate(("two_springpots", 538641422))
    assert misfit >= 0.999 * least > 0.005
    assert covered > 0.9
    assert 0.005 < half_width < 0.03
