"""The friction branch against many-digit arithmetic and against a walk of Eq. 5 from point to point."""

import math

import mpmath
import numpy as np
import pytest

from bushfit.effects.friction import _strokes, harmonic_shape, harmonic_slope, mean_stress_decay, modulus

VALUES = {"sigma_fmax": 1.46e4, "eps_half": 1.3e-2}
X = np.concatenate([np.logspace(-8, 6, 561), [0.025, 0.02565, 0.026, 1.0]])


def exact_shape(x: float) -> tuple[mpmath.mpf, mpmath.mpf]:
    """(A, B)/(2 e0) with sigma_fmax = eps_half = 1, as model form."""
    x = mpmath.mpf(x)
    y = (mpmath.sqrt(x**2 + 6 * x + 1) - x - 1) / 2
    s = c = 1 + y
    big = 1 + c / x
    in_phase = 2 * s * (c / x) * (big / mpmath.sqrt(big**2 - 1) - 1)
    quadrature = 2 / mpmath.pi * (2 - s * (c / x) * mpmath.log((big + 1) / (big - 1)))
    return in_phase / (2 * x), quadrature / (2 * x)


def relative_error(found: float, exact: mpmath.mpf) -> float:
    return abs(float(mpmath.mpf(float(found)) / exact - 1))


def test_modulus_has_ten_digits_from_1e_8_to_1e6():
    found = harmonic_shape(X)
    with mpmath.workdps(60):
        exact = [exact_shape(x) for x in X]
        for part, side in enumerate((found.real, found.imag)):
            assert max(relative_error(value, e[part]) for value, e in zip(side, exact, strict=True)) <= 1e-10


def test_derivative_of_the_modulus():
    slope = harmonic_slope(X, harmonic_shape(X))
    with mpmath.workdps(60):
        for s, x in zip(slope[::5], X[::5], strict=True):
            parts = (lambda t: exact_shape(t)[0], lambda t: exact_shape(t)[1])
            exact = complex(*(mpmath.diff(part, mpmath.mpf(x), h=mpmath.mpf(x) / 10**15) for part in parts))
            assert max(abs(s.real - exact.real), abs(s.imag - exact.imag)) <= 1e-9 * abs(exact)


def test_limits_of_small_and_large_strain():
    half = VALUES["sigma_fmax"] / (2.0 * VALUES["eps_half"])
    omega = np.ones(1)
    assert modulus(VALUES, omega, np.zeros(1))[0] == half + 0j
    assert modulus(VALUES, omega, np.array([1e-12]))[0] == pytest.approx(half, rel=1e-9)
    assert abs(modulus(VALUES, omega, np.array([1e6 * VALUES["eps_half"]]))[0]) < 1e-2 * half / 1e3
    large = harmonic_shape(np.array([1e9, 1e6]))
    assert large.imag[0] * 1e9 == pytest.approx(2.0 / np.pi, rel=1e-6)  # a square wave of height sigma_fmax
    assert np.all(np.isfinite(large))


@pytest.mark.parametrize("x", [1e-3, 0.3, 1.0, 20.0])
def test_a_cycle_lowers_a_mean_stress_as_the_walk_along_it_does(x):
    begin = 2.0 * x / (math.sqrt(x * (x + 6.0) + 1.0) + x + 1.0)
    path = _strokes([-1.0, 1.0], [2.0 * x, 2.0 * x], begin)
    end, _, kept = path[-1]
    assert end == pytest.approx(begin, rel=1e-12)
    assert -math.log(kept) == pytest.approx(float(mean_stress_decay(np.array(x))), rel=1e-9)
