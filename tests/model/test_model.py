"""Model: independent numbers, broadcasting, derivatives, the examples of docstrings; and the rig's steps through time,
which share no formula with it."""

import doctest
import pkgutil
from importlib import import_module
from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import t

from bushfit import effects, geometry, model, reduction
from bushfit.effects.contract import Array, Setting
from bushfit.geometry import Direction
from bushfit.model.covariance import Z95, Covariance
from bushfit.model.model import FIVE
from bushfit.model.sensitivity import stepped_values, stiffness_and_slopes
from bushfit.simulation import rig

PACKAGES = (effects, geometry, model, reduction)
FREQUENCY = np.array([0.1, 5.0, 55.0, 155.0])
AMPLITUDE = np.array([1e-3, 1e-4, 2e-4, 5e-4])


def test_the_whole_reference_table(paper_model, root):
    """192 points of an independent computation."""
    table = np.loadtxt(root / "data/reference/stiffness_table1.csv", delimiter=",", skiprows=1, dtype=str)
    assert len(table) == 192
    assert set(table[:, 0]) == set(Direction)
    for direction in Direction:
        frequency, amplitude, magnitude, loss = table[table[:, 0] == direction, 1:].astype(float).T
        found = paper_model.stiffness(direction, frequency, amplitude)
        gaps = np.abs(np.abs(found) / magnitude - 1.0), np.abs(found.imag / found.real / loss - 1.0)
        assert np.max(gaps) < 2e-4


def test_extrapolated_to_no_step_and_no_transient_it_is_the_closed_form(paper_model):
    point, errors = (Direction.RADIAL, 5.0, 2e-4), []
    for steps in (256, 512, 1024):
        record = rig.simulate_cycles(paper_model, *point, cycles=1, run_in=200, steps_per_cycle=steps)
        errors.append(rig.lock_in(record, 5.0) / complex(paper_model.stiffness(*point)) - 1.0)
    first = [2.0 * fine - coarse for coarse, fine in pairwise(errors)]
    assert abs(4.0 * first[1] - first[0]) / 3.0 < 2e-6


MODULES = [
    *(package.__name__ for package in PACKAGES),
    *(found.name for package in PACKAGES for found in pkgutil.iter_modules(package.__path__, f"{package.__name__}.")),
]


def spring(omega: Array, amplitude: Array) -> float:
    """A response below a layer: 500 N/mm, whatever the test."""
    return 5e5


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_are_right(name, paper_model):
    """Each effect has one; contract.py says what the names in them stand for."""
    tests = {kind: Setting(paper_model.bushing, Direction.AXIAL, kind) for kind in ("sweep", "loop")}
    known = {"np": np, "paper": paper_model, "spring": spring, **tests}
    done = doctest.testmod(import_module(name), extraglobs=known)
    assert done.failed == 0
    assert done.attempted or not name.startswith("bushfit.effects.")


def test_derivatives_of_the_paper_model_have_five_digits(paper_model):
    """mu adds to the modulus itself, m in proportion to (i omega)^alpha, and alpha as the logarithm of i omega."""
    at, omega = (Direction.AXIAL, FREQUENCY, AMPLITUDE), 2.0 * np.pi * FREQUENCY
    _, slopes = stiffness_and_slopes(paper_model, *at, FIVE)
    shape, values = paper_model.stiffness_per_modulus(Direction.AXIAL), paper_model.values
    by_m = 0.5 * shape * (1j * omega) ** values["alpha"]
    for name, expected in {"mu": shape, "m": by_m, "alpha": values["m"] * by_m * np.log(1j * omega)}.items():
        np.testing.assert_allclose(slopes[FIVE.index(name)], np.broadcast_to(expected, omega.shape), rtol=1e-5)
    assert np.array_equal(stiffness_and_slopes(paper_model, *at, ("eps_half", "mu"))[1], slopes[[4, 0]])


def test_one_sided_at_a_bound(paper_model):
    """alpha = 1 may not be exceeded; the neutral mass 0 may be left both ways or one."""
    edge = paper_model.with_values({"alpha": 1.0})
    at, omega = (Direction.AXIAL, FREQUENCY, AMPLITUDE), 2.0 * np.pi * FREQUENCY
    assert np.max(stepped_values(edge, ["alpha"], Direction.AXIAL)[0]["alpha"]) == 1.0
    modulus = 0.5 * edge.values["m"] * edge.stiffness_per_modulus(Direction.AXIAL) * 1j * omega
    np.testing.assert_allclose(stiffness_and_slopes(edge, *at, ["alpha"])[1], [modulus * np.log(1j * omega)], rtol=1e-4)
    heavy = paper_model.with_effect("inertia")
    slope = stiffness_and_slopes(heavy, *at, ["inertia.mass"])[1][0]
    np.testing.assert_allclose(slope, -((2.0 * np.pi * FREQUENCY) ** 2), rtol=1e-6, atol=1e-2)


def test_intervals_are_as_wide_as_an_estimated_variance_needs():
    """A variance of 3 and one of 5 degrees of freedom: alone Student's t, in a sum between the two and the normal."""
    one, other = np.diag([4.0, 0.0]), np.diag([0.0, 9.0])
    spread = (one * np.sqrt(2.0 / 3.0), other * np.sqrt(2.0 / 5.0))
    covariance = Covariance(("mu", "m"), one + other, spread)
    found = covariance.half_width(np.array([[1.0, 0.0, 1.0], [0.0, 1.0, 1.0]]))
    summed = 2.0 * 13.0**2 / (4.0**2 * 2.0 / 3.0 + 9.0**2 * 2.0 / 5.0)
    expected = [t.ppf(0.975, freedom) * np.sqrt(variance) for freedom, variance in ((3, 4), (5, 9), (summed, 13))]
    np.testing.assert_allclose(found, expected)
    np.testing.assert_allclose(covariance.select(["m"]).half_width(np.ones((1, 1))), found[1:2])
    known = Covariance(("mu", "m"), one + other)
    np.testing.assert_allclose(known.half_width(np.eye(2)), [Z95 * 2.0, Z95 * 3.0], rtol=1e-4)


def test_intervals(result):
    """Of a positive parameter symmetric in its logarithm; Student's t with hundreds of degrees of freedom."""
    low, high = result.interval("mu") or (0.0, 0.0)
    value = result.model.values["mu"]
    assert low * high == pytest.approx(value**2)
    assert 1.0 <= np.log(high / value) / (Z95 * (result.covariance.stderr("mu") or 0.0) / value) < 1.05
    low, high = result.interval("alpha") or (0.0, 0.0)
    assert (low + high) / 2.0 == pytest.approx(result.model.values["alpha"])
