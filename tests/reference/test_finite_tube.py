"""The finite elements against another's, against closed forms and finer meshes; the shipped correction against both."""

import numpy as np
import pytest
from agreement import digits
from finite_tube import Solution, corrections, solve_tube

from bushfit.geometry import Bushing, Direction
from bushfit.geometry.shape import INCOMPRESSIBLE, RADIUS_RATIO_RANGE, SLENDERNESS_RANGE

#: Angles of a quarter circle, and radii, at which the closed form is taken.
_ANGLES, _RADII = 64, 200


def kept_shapes(seed: int, count: int) -> list[tuple[float, float]]:
    """Random shapes, none of which the correction was fitted to."""
    random = np.random.default_rng(seed)
    low, high = np.log(SLENDERNESS_RANGE)
    slenderness = np.exp(random.uniform(low, high, count))
    return list(zip(random.uniform(*RADIUS_RATIO_RANGE, count).tolist(), slenderness.tolist(), strict=True))


def long_tube(inner: float, n: int) -> Solution:
    """An endless tube in closed form, per length: U = f/r and V = f' with f = A r + B r^3 + C/r + D r ln r, W = 0."""
    nodes, weights = np.polynomial.legendre.leggauss(_RADII)
    r, dr = inner + (1.0 - inner) * (nodes + 1.0) / 2.0, weights * (1.0 - inner) / 2.0
    if n == 0:
        squared = (0.5 / (r * np.log(1.0 / inner))) ** 2
    else:

        def at(x: float) -> list[list[float]]:
            return [[1.0, x**2, x**-2, np.log(x)], [1.0, 3.0 * x**2, -(x**-2), np.log(x) + 1.0]]

        _, B, C, D = np.linalg.solve(at(inner) + at(1.0), [1.0, 1.0, 0.0, 0.0])
        stretch, shear = 2.0 * B * r - 2.0 * C / r**3 + D / r, 2.0 * (B * r + C / r**3)
        angle = (np.arange(_ANGLES) + 0.5) * np.pi / (2.0 * _ANGLES)
        squared = np.outer(np.cos(angle) ** 2, stretch**2) + np.outer(np.sin(angle) ** 2, shear**2)
    energy = np.broadcast_to(squared * r * dr, np.shape(squared)).ravel()
    even = 2.0 * np.pi * energy.sum() / (1.0 if n == 0 else _ANGLES)
    return Solution(4.0 * even, np.pi * (1.0 - inner**2), np.sqrt(squared).ravel(), energy / energy.sum(), 0)


def test_against_finite_elements_of_others(agree, root):
    table = np.loadtxt(root / "data/reference/radial_fe.csv", delimiter=",", skiprows=1)[:, :4]
    rows = (table * (1e-3, 1e-3, 1e-3, 1.0)).tolist()
    solved = [b * solve_tube(a / b, length / b, fineness=0.5).stiffness for a, b, length, _ in rows]
    calibrated = [
        Bushing("row", a, b, length, "calibrated").stiffness_per_modulus(Direction.RADIAL) for a, b, length, _ in rows
    ]
    exact = [row[3] for row in rows]
    tables = {"finite elements of the tube, radial": solved, 'radial stiffness with `shape = "calibrated"`': calibrated}
    for name, found in tables.items():
        assert np.abs(np.array(found) / exact - 1.0).max() < 0.01
        agree(f"{name}, 14 shapes", [digits(found, exact)])


@pytest.mark.slow
@pytest.mark.parametrize("inner", [0.15, 10 / 18, 0.9])
def test_the_middle_of_a_long_tube(inner):
    """Between two lengths the stiffness grows by what the closed form says, Eqs. 8 and 7 being its strain."""
    tube = Bushing("tube", inner, 1.0, 1.0)
    for n, direction in ((1, Direction.RADIAL), (0, Direction.AXIAL)):
        exact = long_tube(inner, n)
        longer, shorter = (solve_tube(inner, length, n=n, bulk=1e7, fineness=0.7).stiffness for length in (24.0, 20.0))
        growth = (longer - shorter) / 4.0 / exact.stiffness
        even, friction = (
            strain / tube.unit_strain(direction) for strain in (exact.energy_strain, exact.friction_strain)
        )
        assert even == pytest.approx(1.0, rel=1e-9)
        assert growth == pytest.approx(1.0, rel=2e-3)
        assert 1.0 < friction < 1.5


@pytest.mark.slow
@pytest.mark.parametrize("shape", [(0.15, 0.1), (0.9, 0.1), (10 / 18, 34 / 18)])
def test_finer_meshes_change_nothing(shape):
    coarse, fine, finer = (solve_tube(*shape, fineness=fineness) for fineness in (0.7, 1.0, 1.7))
    for quantity in ("stiffness", "energy_strain", "friction_strain"):
        assert getattr(fine, quantity) == pytest.approx(getattr(finer, quantity), rel=2e-4)
        assert getattr(coarse, quantity) == pytest.approx(getattr(finer, quantity), rel=1e-3)


def test_the_papers_bushing():
    """What no correction ships: the axial formula supposes pure shear, and free ends are softer."""
    bushing = Bushing("CMP 15 961", 10.0 / 18.0, 1.0, 34.0 / 18.0)
    for n, direction in ((1, Direction.RADIAL), (0, Direction.AXIAL)):
        solved = solve_tube(bushing.inner_radius, bushing.length, n=n)
        off = bushing.stiffness_per_modulus(direction) / solved.stiffness - 1.0
        print(f"{direction}: formula {100.0 * off:+.1f} % in stiffness")
        assert solved.friction_misfit < 0.04
        assert solved.energy_strain < solved.friction_strain
    assert 0.04 < off < 0.07


@pytest.mark.parametrize(
    ("seed", "many", "fineness"), [(11, 1, 1.0), pytest.param(12, 12, 0.7, marks=pytest.mark.slow, id="many_kept")]
)
def test_the_correction_on_kept_shapes(seed, many, fineness):
    """Many on a coarser mesh, which moves no error by more than 0.02 % (see `test_finer_meshes_change_nothing`)."""
    kept = kept_shapes(seed, many)
    solved = corrections(kept, fineness=fineness)
    found = np.array([Bushing("tube", inner, 1.0, length).correction for inner, length in kept])
    stiffness, strain = 100.0 * np.abs(found / solved - 1.0).max(axis=0)[:2]
    assert stiffness < 1.0
    assert strain < 3.0


@pytest.mark.slow
def test_a_bulk_modulus_of_2_gpa():
    """Thick and thin, flat and long tubes: how much less stiff they are than incompressible ones."""
    for inner, length in ((0.2, 0.5), (0.6, 4.0), (0.85, 2.0), (0.9, 0.4), (0.9, 9.0)):
        hard = solve_tube(inner, length, bulk=1.0 / INCOMPRESSIBLE, fineness=0.7).stiffness
        correction = Bushing("tube", inner, 1.0, length).correction
        for mu, error in ((1e6, 0.005), (1e7, 0.02)):
            soft = solve_tube(inner, length, bulk=2e9 / mu, fineness=0.7).stiffness
            assert correction.stiffness_decrease(mu) == pytest.approx(1.0 - soft / hard, abs=error)
