"""Strain and stiffness per displacement: limits, sixty-digit arithmetic, a finite-element solution, energy."""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bushfit.errors import ModelError
from bushfit.geometry import Bushing, Direction

RATIOS = (0.1, 0.2, 0.35, 0.5, 0.5556, 0.7, 0.85, 0.93, 0.97)
LENGTHS = (0.05, 0.1, 0.3, 1.0, 1.889, 5.0, 20.0, 50.0, 100.0)


def radial_exact(a: float, b: float, length: float) -> mpmath.mpf:
    """k/mu of Eqs. 11 and 12 as they are written, with digits to spare."""
    with mpmath.workdps(60):
        a, b, length = mpmath.mpf(a), mpmath.mpf(b), mpmath.mpf(length)
        alpha = mpmath.sqrt(60) / length
        x, y = alpha * a, alpha * b
        i, k = mpmath.besseli, mpmath.besselk
        numerator = (
            4 * (b**2 + a**2)
            - y * (b**2 + 3 * a**2) * (i(1, y) * k(0, x) + i(0, x) * k(1, y))
            - x * (3 * b**2 + a**2) * (i(1, x) * k(0, y) + i(0, y) * k(1, x))
        )
        last = i(1, y) * k(1, x) - i(1, x) * k(1, y)
        d = numerator / (alpha**2 * a * b * (b**2 + a**2) * last)
        q = (b**2 - a**2) / (b**2 + a**2)
        return 10 * mpmath.pi * length / (mpmath.mpf(7) / 2 * mpmath.log(b / a) - mpmath.mpf(3) / 2 * q + d)


def tube(ratio: float, slenderness: float, outer: float = 0.018) -> Bushing:
    return Bushing("tube", ratio * outer, outer, slenderness * outer)


def radial(bushing: Bushing) -> float:
    return bushing.stiffness_per_modulus(Direction.RADIAL)


@pytest.mark.parametrize("stride", [4, pytest.param(1, marks=pytest.mark.slow)])
def test_radial_against_many_digits(stride: int) -> None:
    worst = {True: (0.0, ""), False: (0.0, "")}
    for ratio in RATIOS[::stride]:
        for slenderness in LENGTHS[::stride]:
            bushing = tube(ratio, slenderness)
            exact = radial_exact(bushing.inner_radius, bushing.outer_radius, bushing.length)
            error = abs(float(radial(bushing) / exact - 1))
            extreme = slenderness > 300.0 * (1.0 - ratio)  # length over thickness
            worst[extreme] = max(worst[extreme], (error, f"a/b = {ratio}, L/b = {slenderness}"))
    for extreme, (error, where) in worst.items():
        label = "long and thin" if extreme else "other"
        print(f"Eq. 11, {label} tubes: {-math.log10(error):.1f} digits at worst, {where}")
    assert worst[False][0] < 1e-9
    assert worst[True][0] < 1e-7


@pytest.mark.parametrize("ratio", RATIOS)
def test_long_and_short_limits(ratio: float) -> None:
    """4 pi L/(ln(b/a) - q) for L -> inf and 10 pi L/(7/2 ln(b/a) - 3/2 q) for L -> 0, approached from one side."""
    log, q = math.log(1.0 / ratio), (1.0 - ratio**2) / (1.0 + ratio**2)
    long = [radial(b) / (4.0 * math.pi * b.length / (log - q)) for b in (tube(ratio, s) for s in (25.0, 50.0, 100.0))]
    thickness = 1.0 - ratio
    short = [
        radial(b) / (10.0 * math.pi * b.length / (3.5 * log - 1.5 * q))
        for b in (tube(ratio, s) for s in (0.2, 0.1, 0.05))
    ]
    print(f"a/b = {ratio}: over the long limit {long[-1]:.6f}, over the short limit {short[-1]:.6f}")
    gaps = [1.0 - value for value in long]
    assert all(gap > 0.0 for gap in gaps)
    assert gaps[0] / gaps[1] == pytest.approx(4.0, rel=0.05)  # the gap closes as 1/L^2
    assert gaps[1] / gaps[2] == pytest.approx(4.0, rel=0.05)
    assert gaps[-1] < 1e-2
    assert all(value > 1.0 for value in short)
    assert short[0] > short[1] > short[2]
    assert short[-1] - 1.0 < 0.45 * 0.05 / thickness


def test_within_the_finite_element_table(root: Path) -> None:
    with (root / "data/reference/radial_fe.csv").open(newline="") as stream:
        rows = list(csv.reader(stream))[1:]
    gaps = []
    for row in rows:
        a, b, length, element, formula = map(float, row)
        found = radial(Bushing("row", a / 1e3, b / 1e3, length / 1e3))
        gaps.append(100.0 * (found / element - 1.0))
        print(f"a {a:g} b {b:g} L {length:g} mm: Eq. 11 {gaps[-1]:+.2f} % from the finite elements")
        assert found == pytest.approx(formula, rel=1e-5)
    assert len(gaps) == 14
    assert min(gaps) > -2.0
    assert max(gaps) < 11.0


shapes = st.builds(
    tube, st.floats(0.1, 0.97), st.floats(math.log(0.05), math.log(100.0)).map(math.exp), st.floats(1e-3, 0.09)
)


@given(shapes, st.sampled_from([Direction.AXIAL, Direction.TORSION]))
def test_strain_and_stiffness_share_one_energy(bushing: Bushing, direction: Direction) -> None:
    """k d^2/2 = V mu (2 e)^2/2: the equivalent strain holds the energy that the stiffness stores."""
    volume = math.pi * (bushing.outer_radius**2 - bushing.inner_radius**2) * bushing.length
    stored = volume * (2.0 * bushing.unit_strain(direction)) ** 2
    assert bushing.stiffness_per_modulus(direction) == pytest.approx(stored, rel=1e-12)


@given(shapes)
def test_radial_strain_is_eq_8(bushing: Bushing) -> None:
    with mpmath.workdps(50):
        a, b = mpmath.mpf(bushing.inner_radius), mpmath.mpf(bushing.outer_radius)
        exact = mpmath.sqrt((a**2 + b**2) / ((b**4 - a**4) * mpmath.log(b / a) - (a**2 - b**2) ** 2))
        assert abs(float(bushing.unit_strain(Direction.RADIAL) / exact - 1)) < 1e-12


@given(shapes, st.floats(0.1, 10.0))
def test_stiffness_scales_with_size(bushing: Bushing, factor: float) -> None:
    lengths = (bushing.inner_radius, bushing.outer_radius, bushing.length)
    larger = Bushing("larger", *(factor * length for length in lengths))
    for direction, power in ((Direction.AXIAL, 1), (Direction.RADIAL, 1), (Direction.TORSION, 3)):
        expected = factor**power * bushing.stiffness_per_modulus(direction)
        assert larger.stiffness_per_modulus(direction) == pytest.approx(expected, rel=1e-6)
    assert larger.unit_strain(Direction.RADIAL) == pytest.approx(bushing.unit_strain(Direction.RADIAL) / factor)


@given(shapes)
def test_radial_stiffness_lies_above_its_short_and_below_its_long_formula(bushing: Bushing) -> None:
    a, b = bushing.inner_radius, bushing.outer_radius
    log, q = math.log(b / a), (b * b - a * a) / (b * b + a * a)
    long = 4.0 * math.pi * bushing.length / (log - q)
    short = 10.0 * math.pi * bushing.length / (3.5 * log - 1.5 * q)
    assert short * (1.0 - 1e-7) < radial(bushing) < long * (1.0 + 1e-7)


def test_friction_sees_four_times_the_axial_strain_in_radial(bushing: Bushing) -> None:
    ratio = bushing.unit_strain(Direction.RADIAL) / bushing.unit_strain(Direction.AXIAL)
    print(f"radial over axial strain: {ratio:.3f}")
    assert ratio == pytest.approx(4.4, abs=0.05)


@pytest.mark.parametrize(
    ("lengths", "words"),
    [
        ((0.018, 0.010, 0.034), "inner_radius below outer_radius"),
        ((0.018, 0.018, 0.034), "inner_radius below outer_radius"),
        ((0.0, 0.018, 0.034), "inner_radius: impossible bushing"),
        ((0.010, -0.018, 0.034), "outer_radius: impossible bushing"),
        ((0.010, 0.018, math.nan), "length: impossible bushing"),
        ((0.010, math.inf, 0.034), "outer_radius: impossible bushing"),
    ],
)
def test_nonsense_is_refused(lengths: tuple[float, float, float], words: str) -> None:
    with pytest.raises(ModelError, match=re.escape(words)):
        Bushing("nonsense", *lengths)


@pytest.mark.parametrize("lengths", [(0.0010, 0.018, 0.034), (0.0178, 0.018, 0.034), (0.01, 0.018, 2.0)])
def test_radial_is_refused_beyond_the_checked_shapes(lengths: tuple[float, float, float]) -> None:
    bushing = Bushing("extreme", *lengths)
    assert np.isfinite(bushing.stiffness_per_modulus(Direction.AXIAL))
    with pytest.raises(ModelError, match="not checked for this shape"):
        radial(bushing)


def test_directions_name_their_units() -> None:
    assert [d.motion.displacement_unit for d in Direction] == ["m", "m", "rad"]
    assert [d.motion.force_unit for d in Direction] == ["N", "N", "N*m"]
    assert [d.motion.stiffness_unit for d in Direction] == ["N/m", "N/m", "N*m/rad"]
