"""Strain and stiffness per displacement, and the correction of the radial formulas: limits, many digits, energy."""

import itertools
import math
import re
from dataclasses import replace

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bushfit.errors import ModelError
from bushfit.geometry import Bushing, Direction, Specimen, shared_labels, stiffness_per_modulus, unit_strain
from bushfit.geometry.shape import RADIUS_RATIO_RANGE, SLENDERNESS_RANGE

RATIOS = (0.1, 0.2, 0.35, 0.5, 0.5556, 0.7, 0.85, 0.93, 0.97)
LENGTHS = (0.05, 0.1, 0.3, 1.0, 1.889, 5.0, 20.0, 50.0, 100.0)
radius_ratios = st.floats(*RADIUS_RATIO_RANGE)
slendernesses = st.floats(*map(math.log, SLENDERNESS_RANGE)).map(lambda log: np.clip(math.exp(log), *SLENDERNESS_RANGE))


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
def test_radial_against_many_digits(stride):
    for ratio, slenderness in itertools.product(RATIOS[::stride], LENGTHS[::stride]):
        bushing = tube(ratio, slenderness)
        exact = radial_exact(bushing.inner_radius, bushing.outer_radius, bushing.length)
        long_and_thin = slenderness > 300.0 * (1.0 - ratio)  # length over thickness
        assert abs(float(radial(bushing) / exact - 1)) < (1e-7 if long_and_thin else 1e-9), (ratio, slenderness)


def test_within_the_finite_element_table(root):
    rows = np.loadtxt(root / "data/reference/radial_fe.csv", delimiter=",", skiprows=1)
    gaps = []
    for a, b, length, element, formula in rows:
        found = radial(Bushing("row", a / 1e3, b / 1e3, length / 1e3))
        gaps.append(100.0 * (found / element - 1.0))
        assert found == pytest.approx(formula, rel=1e-5)
    assert len(gaps) == 14
    assert -2.0 < min(gaps) < max(gaps) < 11.0


shapes = st.builds(
    tube, st.floats(0.1, 0.97), st.floats(math.log(0.05), math.log(100.0)).map(math.exp), st.floats(1e-3, 0.09)
)


@given(shapes, st.sampled_from([Direction.AXIAL, Direction.TORSION]))
def test_strain_and_stiffness_share_one_energy(bushing, direction):
    """k d^2/2 = V mu (2 e)^2/2: the equivalent strain holds the energy that the stiffness stores."""
    volume = math.pi * (bushing.outer_radius**2 - bushing.inner_radius**2) * bushing.length
    stored = volume * (2.0 * bushing.unit_strain(direction)) ** 2
    assert bushing.stiffness_per_modulus(direction) == pytest.approx(stored, rel=1e-12)


def test_a_block_in_shear_stores_the_energy_of_its_strain():
    """e/d = 1/(2 thickness): elements in parallel store k d^2/2."""
    mount = Specimen("mount", "shear", area=772e-6, thickness=6e-3, elements=2)
    stored = 2.0 * 772e-6 * 6e-3 * (2.0 * unit_strain(None, mount)) ** 2
    assert stiffness_per_modulus(None, mount) == pytest.approx(stored, rel=1e-12)


@given(shapes)
def test_radial_strain_is_eq_8(bushing):
    with mpmath.workdps(50):
        a, b = mpmath.mpf(bushing.inner_radius), mpmath.mpf(bushing.outer_radius)
        exact = mpmath.sqrt((a**2 + b**2) / ((b**4 - a**4) * mpmath.log(b / a) - (a**2 - b**2) ** 2))
        assert abs(float(bushing.unit_strain(Direction.RADIAL) / exact - 1)) < 1e-12


def test_the_papers_bushing(bushing):
    """274 per metre by Eq. 8, 168 of equal energy by the corrected stiffness; what friction sees lies between them."""
    calibrated = replace(bushing, shape="calibrated")
    stiffness, strain = calibrated.stiffness_per_modulus(Direction.RADIAL), calibrated.unit_strain(Direction.RADIAL)
    volume = math.pi * (bushing.outer_radius**2 - bushing.inner_radius**2) * bushing.length
    assert stiffness == pytest.approx(2.71771, rel=0.01)
    assert math.sqrt(stiffness / (4.0 * volume)) < strain < bushing.unit_strain(Direction.RADIAL)
    assert strain == pytest.approx(201.7, rel=0.01)
    assert 0.004 < bushing.correction.stiffness_decrease(1.09e6) < 0.007


@given(radius_ratios, slendernesses, st.sampled_from([Direction.AXIAL, Direction.TORSION]))
def test_only_the_radial_direction_is_corrected(radius_ratio, slenderness, direction):
    paper = Bushing("tube", radius_ratio, 1.0, slenderness)
    calibrated = replace(paper, shape="calibrated")
    assert calibrated.stiffness_per_modulus(direction) == paper.stiffness_per_modulus(direction)
    assert calibrated.unit_strain(direction) == paper.unit_strain(direction)
    assert paper.correction == calibrated.correction
    for method, expected in (
        (Bushing.stiffness_per_modulus, paper.correction.stiffness),
        (Bushing.unit_strain, paper.correction.strain),
    ):
        factor = method(calibrated, Direction.RADIAL) / method(paper, Direction.RADIAL)
        assert factor == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("inner", "length"), [(0.14, 1.0), (0.93, 1.0), (0.5, 0.09), (0.5, 61.0)])
def test_beyond_the_shapes_that_were_solved(inner, length):
    assert Bushing("tube", inner, 1.0, length).correction is None
    with pytest.raises(ModelError, match=re.escape("inner/outer 0.15 to 0.92 and length/outer 0.1 to 60")) as caught:
        Bushing("tube", inner, 1.0, length, "calibrated")
    assert caught.value.place == "shape"
    assert caught.value.hint
    for a, b in ((0.0015, 0.001), (0.0092, 0.6)):  # the ends of the ranges belong to them
        assert Bushing("tube", a, 0.01, b, "calibrated").correction is not None


def test_an_effect_on_the_first_of_two_bodies_is_the_opposite_of_one_on_the_second():
    bodies = [Specimen.of_bushing(Bushing(name, 0.01, 0.018, 0.034))[:2] for name in ("a", "b", "c")]
    single = [f"{name} {axis}" for name in "abc" for axis in ("axial", "radial")]
    assert shared_labels(bodies[0] + bodies[1]) == [*single[:4], "b", "axial", "radial"]
    assert shared_labels([place for body in bodies for place in body]) == [*single, "a", "b", "c", "axial", "radial"]
