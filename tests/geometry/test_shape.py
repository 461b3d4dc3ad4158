"""The correction of the radial formulas: smooth, with the right limits, applied where it is asked for, only there."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bushfit.errors import ModelError
from bushfit.geometry import Bushing, Direction
from bushfit.geometry.shape import RADIUS_RATIO_RANGE, SLENDERNESS_RANGE, Correction, radial_correction

radius_ratios = st.floats(*RADIUS_RATIO_RANGE)
slendernesses = st.floats(*map(math.log, SLENDERNESS_RANGE)).map(
    lambda log: min(max(math.exp(log), SLENDERNESS_RANGE[0]), SLENDERNESS_RANGE[1])
)
moduli = st.floats(1e5, 1e7)


def correction(radius_ratio: float, slenderness: float) -> Correction:
    found = radial_correction(radius_ratio, slenderness)
    assert found is not None
    return found


def test_the_papers_bushing(bushing: Bushing) -> None:
    """274 per metre by Eq. 8, 168 of equal energy by the corrected stiffness; what friction sees lies between them."""
    calibrated = replace(bushing, shape="calibrated")
    stiffness, strain = calibrated.stiffness_per_modulus(Direction.RADIAL), calibrated.unit_strain(Direction.RADIAL)
    volume = math.pi * (bushing.outer_radius**2 - bushing.inner_radius**2) * bushing.length
    assert stiffness == pytest.approx(2.71771, rel=0.01)
    assert math.sqrt(stiffness / (4.0 * volume)) < strain < bushing.unit_strain(Direction.RADIAL)
    assert strain == pytest.approx(201.7, rel=0.01)
    assert bushing.correction is not None
    assert 0.004 < bushing.correction.lowering(1.09e6) < 0.007


def test_how_far_the_formulas_lie_off_over_all_shapes() -> None:
    grid = np.array([correction(a, b) for a in np.linspace(0.15, 0.92, 60) for b in np.geomspace(0.1, 60.0, 60)])
    off = 100.0 / grid[:, :2] - 100.0
    (least, lowest), (most, highest) = off.min(axis=0), off.max(axis=0)
    assert (round(least), round(most)) == (-6, 20)  # as the README says
    assert -35.0 < lowest < -20.0 < 1000.0 < highest


@given(radius_ratios, slendernesses, moduli, moduli)
def test_positive_and_smooth(radius_ratio: float, slenderness: float, mu: float, other: float) -> None:
    """A thickness or length that differs by 1 % changes it by a few per cent at most; harder rubber gives way more."""
    here = np.log(correction(radius_ratio, slenderness))
    assert np.all(np.isfinite(here))
    for there in ((1.01 * radius_ratio - 0.01, slenderness), (radius_ratio, slenderness * 0.99)):
        if (near := radial_correction(*there)) is not None:
            assert np.all(np.abs(np.log(near) - here) < (0.01, 0.03, 0.05))
    soft, hard = map(correction(radius_ratio, slenderness).lowering, sorted((mu, other)))
    assert 0.0 <= soft <= hard < 1.0


@pytest.mark.parametrize("radius_ratio", [0.2, 0.4, 0.6, 0.8, 0.9])
def test_limits(radius_ratio: float) -> None:
    """Long tubes are those of the paper's limit, thin ones push rubber out; flat tubes strain less than Eq. 8 says."""
    long = [correction(radius_ratio, slenderness) for slenderness in (15.0, 30.0, 60.0)]
    flat = correction(radius_ratio, 0.1)
    softer = [each.lowering(2e6) for each in long]
    assert abs(math.log(long[1].stiffness / long[0].stiffness)) < 0.06
    assert softer[0] <= softer[2] * 1.02
    assert all(each.strain > 1.0 for each in long)
    assert flat.strain < 1.0
    assert flat.lowering(1e6) < 0.03


@given(radius_ratios, slendernesses, st.sampled_from([Direction.AXIAL, Direction.TORSION]))
def test_only_the_radial_direction_is_corrected(radius_ratio: float, slenderness: float, direction: Direction) -> None:
    paper = Bushing("tube", radius_ratio, 1.0, slenderness)
    calibrated = replace(paper, shape="calibrated")
    assert calibrated.stiffness_per_modulus(direction) == paper.stiffness_per_modulus(direction)
    assert calibrated.unit_strain(direction) == paper.unit_strain(direction)
    assert paper.correction == calibrated.correction
    assert paper.correction is not None
    for method, expected in (
        (Bushing.stiffness_per_modulus, paper.correction.stiffness),
        (Bushing.unit_strain, paper.correction.strain),
    ):
        factor = method(calibrated, Direction.RADIAL) / method(paper, Direction.RADIAL)
        assert factor == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("inner", "length"), [(0.14, 1.0), (0.93, 1.0), (0.5, 0.09), (0.5, 61.0)])
def test_beyond_the_shapes_that_were_solved(inner: float, length: float) -> None:
    assert Bushing("tube", inner, 1.0, length).correction is None
    with pytest.raises(ModelError, match=re.escape("inner/outer 0.15 to 0.92 and length/outer 0.1 to 60")) as caught:
        Bushing("tube", inner, 1.0, length, "calibrated")
    assert caught.value.place == "shape"
    assert caught.value.hint


@pytest.mark.parametrize("ends", [(0.0015, 0.001), (0.0092, 0.6)])
def test_the_ends_of_the_ranges_belong_to_them(ends: tuple[float, float]) -> None:
    assert Bushing("tube", ends[0], 0.01, ends[1], "calibrated").correction is not None
