"""The springpot against the Gamma quotient of Eq. 3 and against the spring and the dashpot it lies between."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from bushfit.effects import History
from bushfit.effects.springpot import fractional_derivative, grunwald_letnikov_weights, modulus, stress


@pytest.mark.parametrize("alpha", [0.05, 0.24, 0.9])
def test_weights_are_the_gamma_quotient(alpha: float) -> None:
    found = grunwald_letnikov_weights(alpha, 5000)
    with mpmath.workdps(40):
        a = mpmath.mpf(alpha)
        exact = [mpmath.gamma(j - a) / (mpmath.gamma(-a) * mpmath.gamma(j + 1)) for j in (1, 2, 10, 4999)]
    np.testing.assert_allclose(found[[1, 2, 10, 4999]], [float(w) for w in exact], rtol=1e-12)
    assert found[0] == 1.0


def test_derivative_of_a_power_of_time() -> None:
    """D^alpha t^2 = Gamma(3)/Gamma(3 - alpha) t^(2 - alpha), the error halving with the step."""
    alpha, errors = 0.24, []
    for count in (500, 1000, 2000):
        time = np.arange(count + 1) / count
        exact = 2.0 / float(mpmath.gamma(3 - alpha)) * time[-1] ** (2.0 - alpha)
        errors.append(abs(fractional_derivative(alpha, time**2, 1.0 / count)[-1] / exact - 1.0))
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    print(f"D^0.24 t^2 at t = 1: errors {errors}, orders {orders}")
    np.testing.assert_allclose(orders, 1.0, atol=0.05)


def test_order_one_is_a_dashpot_and_order_zero_a_spring() -> None:
    time = np.arange(2000) * 1e-3
    strain = np.sin(time) ** 2
    history = History(strain, 1e-3, periodic=False, frequency=1.0)
    dashpot = stress({"m": 3.0, "alpha": 1.0}, history)
    np.testing.assert_allclose(dashpot[1:], 3.0 * np.diff(strain) / 1e-3, atol=1e-9)
    np.testing.assert_allclose(stress({"m": 3.0, "alpha": 0.0}, history), 3.0 * strain, atol=1e-12)
    omega = np.array([0.5, 20.0])
    np.testing.assert_allclose(modulus({"m": 3.0, "alpha": 1.0}, omega, omega), 1.5j * omega, atol=1e-12)
    np.testing.assert_allclose(modulus({"m": 3.0, "alpha": 0.0}, omega, omega), 1.5, atol=1e-15)


def test_steady_cycle_holds_every_harmonic_to_its_own_modulus() -> None:
    p, samples, frequency = {"m": 2.0e5, "alpha": 0.24}, 256, 7.0
    phase = 2.0 * np.pi * np.arange(samples) / samples
    cycle = 0.01 * np.cos(phase) + 0.003 * np.sin(3.0 * phase)
    spectrum = np.fft.rfft(stress(p, History.steady(cycle, frequency))) / np.where(
        np.isin(np.arange(129), (1, 3)), np.fft.rfft(cycle), 1.0
    )
    for harmonic in (1, 3):
        expected = 2.0 * modulus(p, np.array([2.0 * np.pi * frequency * harmonic]), np.ones(1))[0]
        assert spectrum[harmonic] == pytest.approx(expected, rel=1e-10)
