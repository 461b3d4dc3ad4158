"""Maxwell arms: their number and error, that they give off no energy, and what they cannot stand for."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from bushfit.effects.contract import Array
from bushfit.errors import ModelError
from bushfit.geometry import Direction
from bushfit.model.arms import Arms, fitted_arms, model_arms, part_modulus


def springpot(alpha: float, band: tuple[float, float], accuracy: float) -> Arms:
    return fitted_arms(lambda omega: 0.5 * (1j * omega) ** alpha, band, accuracy)


def modulus_of(arms: Arms, omega: Array) -> Array:
    """Complex modulus of springs and dashpots in series."""
    return sum(g * 1j * omega * t / (1.0 + 1j * omega * t) for g, t in zip(arms.modulus, arms.time, strict=True))


def error_of(arms: Arms, alpha: float) -> float:
    """Largest relative error, worked out apart from the fit, between its frequencies too."""
    omega = 2.0 * np.pi * np.geomspace(*arms.band, 3001)
    return float(np.abs(modulus_of(arms, omega) / (0.5 * (1j * omega) ** alpha) - 1.0).max())


@pytest.mark.parametrize(
    ("band", "count", "largest"), [((5.0, 155.0), 4, 0.01), ((5.0, 155.0), 6, 0.002), ((0.05, 300.0), 8, 0.007)]
)
def test_so_many_arms_leave_so_much(band, count, largest):
    """No more arms than others found for these errors, alpha 0.24."""
    arms = springpot(0.24, band, largest)
    assert arms.time.size <= count
    assert arms.error <= largest
    assert error_of(arms, 0.24) == pytest.approx(arms.error, rel=0.03)


@example(alpha=0.7721080689591432, decades=3.2421875, accuracy=0.002)  # a step of a fit went far beyond numbers
@given(alpha=st.floats(0.05, 0.95), decades=st.floats(0.5, 4.0), accuracy=st.sampled_from([0.05, 0.01, 0.002]))
def test_arms_keep_within_their_error_and_give_off_no_energy(alpha, decades, accuracy):
    arms = springpot(alpha, (1.0, 10.0**decades), accuracy)
    assert np.all(arms.modulus > 0.0)
    assert np.all(arms.time > 0.0)
    assert np.all(modulus_of(arms, np.geomspace(1e-6, 1e9, 200)).imag > 0.0)
    assert error_of(arms, alpha) <= accuracy * 1.03


def test_the_springpot_and_the_spring_in_series_are_one_part(paper_model):
    model = paper_model.with_effect("fractional_zener", {"fractional_zener.c": 0.3})
    (part,) = model_arms(model, (1.0, 1000.0), 0.005)
    assert part.replaced_effects == "springpot and fractional_zener"
    omega = 2.0 * np.pi * np.geomspace(1.0, 1000.0, 50)
    shape = model.stiffness_per_modulus(Direction.AXIAL)
    whole = model.stiffness(Direction.AXIAL, omega / (2.0 * np.pi), 1.0) / shape
    rest = paper_model.without("springpot").stiffness(Direction.AXIAL, 1.0, 1.0) / shape
    np.testing.assert_allclose(part_modulus(model, "m", omega), whole - rest, rtol=1e-6)
    assert np.abs(modulus_of(part, omega) / (whole - rest) - 1.0).max() <= 0.005


def test_what_no_passive_arms_can_do_is_refused():
    with pytest.raises(ModelError, match="no set of springs and dashpots") as refused:
        fitted_arms(lambda omega: 1e4j + 0.0 * omega, (5.0, 155.0), 0.01)
    assert "an error of" in str(refused.value)
