"""Effects against simpler ones and numbers worked out without them; friction against a walk from point to point."""

import math

import numpy as np
import pytest
import scipy.stats
from paper import CMP_15961, TABLE_1

from bushfit.effects import BASE, History, distributed_sliders, sliders
from bushfit.effects.contract import RubberConditions
from bushfit.effects.dead_zone import first_harmonic
from bushfit.effects.temperature import log_shift
from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.reading.preload import Preload
from bushfit.units import CELSIUS

PLAIN = Model(CMP_15961, BASE, TABLE_1)
#: Operating points [Hz] and [m].
FREQUENCY = np.array([5.0, 55.0, 155.0])
AMPLITUDE = np.array([1e-4, 2e-4, 5e-4])
AXIAL, RADIAL = (("axial", FREQUENCY, AMPLITUDE), ("radial", FREQUENCY, AMPLITUDE))
LOOP = History.steady(5e-4 * np.cos(2.0 * np.pi * np.arange(512) / 512), 5.0)
STARTED = History(5e-4 * np.sin(2.0 * np.pi * np.arange(20480) / 2048), 1.0 / (20.0 * 2048), False, 20.0)
SLIDERS = {"sigma": 2.5e4, "e_s": 0.015, "spread": 1.3}
VALUES = {name: TABLE_1[name] for name in ("sigma_fmax", "eps_half")}


def added(name: str, model: Model = PLAIN, **values: float) -> Model:
    """The model with an effect of these values; one of a place has a `factor`."""
    return model.with_effect(name, {name if key == "factor" else f"{name}.{key}": values[key] for key in values})


def same(one: Model, other: Model, tolerance: float) -> None:
    """Both models answer alike in both faces, relative to the largest answer."""
    pairs = [(m.stiffness(*RADIAL) for m in (one, other))]
    pairs += [(m.force("radial", history) for m in (one, other)) for history in (LOOP, STARTED)]
    for found, expected in pairs:
        assert np.max(np.abs(found - expected)) <= tolerance * np.max(np.abs(expected))


@pytest.mark.parametrize(
    ("one", "other", "tolerance"),
    [
        (added("maxwell", tau=1.1e-5, mu1=100.0 / 1.1e-5), added("viscous", eta=100.0), 1e-2),
        (added("maxwell", tau=99.0, mu1=1e5), PLAIN.with_values({"mu": 1.19e6}), 2e-3),
        (added("second_friction", **VALUES), PLAIN.with_values({"sigma_fmax": 2.92e4}), 1e-14),
        (added("fixture_resonance", mass=0.1, frequency=1e4, damping=0.1), added("inertia", mass=0.1), 1e-4),
    ],
    ids=["fast arm: dashpot", "slow arm: spring", "second friction like the first: twice it", "stiff fixture: mass"],
)
def test_at_the_end_of_its_range_an_effect_is_a_simpler_one(one, other, tolerance):
    same(one, other, tolerance)


@pytest.mark.parametrize("shift", [0.01, 0.03, 0.13])
def test_warm_rubber_is_softer_and_faster(shift):
    """At 33 degC with 0.3 % a kelvin: moduli times exp(-0.03), the spring's times 306.15/296.15, the springpot's also
    times a_T^alpha; and so is the second one, with its own order."""
    warm_test = RubberConditions(
        33.0 + CELSIUS, session_time=0.5, largest_strain=0.1, previous_strain=0.1, rest_time=0.02
    )
    c2 = min(np.sqrt(2072.1 / shift), 296.15)
    a_t = np.exp(-shift * 10.0 * c2 / (c2 + 10.0))
    plain = added("second_springpot", m=3e3, alpha=0.7)
    faster = {"m": a_t ** PLAIN.values["alpha"], "second_springpot.m": a_t**0.7, "sigma_fmax": 1.0}
    by_hand = {"mu": 306.15 / 296.15, **{name: np.exp(-0.03) * factor for name, factor in faster.items()}}
    expected = plain.with_values({name: factor * plain.values[name] for name, factor in by_hand.items()})
    warm = added("temperature", plain, softening=3e-3, shift=shift)
    np.testing.assert_allclose(warm.stiffness(*AXIAL, conditions=warm_test), expected.stiffness(*AXIAL), rtol=1e-5)
    np.testing.assert_allclose(
        warm.force("axial", LOOP, conditions=warm_test), expected.force("axial", LOOP), rtol=1e-5
    )
    same(warm, plain, 0.0)


def test_the_shift_factor_is_that_of_williams_landel_and_ferry():
    """With 17.44 and 51.6 K at a glass transition of -50 degC; of a small shift it is Arrhenius' law, and below the
    glass transition it goes on along a line."""
    kelvin, glass = np.array([233.15, 263.15, 296.15, 326.15, 373.15]), 223.15

    def universal(at: np.ndarray) -> np.ndarray:
        return -17.44 * np.log(10.0) * (at - glass) / (51.6 + at - glass)

    slope = 17.44 * np.log(10.0) * 51.6 / (51.6 + 73.0) ** 2
    np.testing.assert_allclose(log_shift(slope, kelvin), universal(kelvin) - universal(np.array(296.15)), rtol=1e-9)
    np.testing.assert_allclose(log_shift(0.01, kelvin), 0.01 * 296.15**2 * (1.0 / kelvin - 1.0 / 296.15), rtol=1e-9)
    below = log_shift(slope, np.array([203.15, 193.15, 183.15]))
    assert np.diff(below) == pytest.approx([np.diff(below)[0]] * 2)


def test_mullins_softens_below_the_largest_strain_so_far_and_not_there():
    softened = added("mullins_levels", share=0.2)
    strain = np.full(3, AMPLITUDE[1] * PLAIN.unit_strain(Direction.AXIAL))
    ratio = softened.stiffness(*AXIAL, conditions=RubberConditions(largest_strain=strain)) / PLAIN.stiffness(*AXIAL)
    np.testing.assert_allclose(ratio, [1.0 - 0.2 * math.erf(0.75), 1.0, 1.0], rtol=1e-12)
    same(softened, PLAIN, 0.0)


def test_changes_of_one_parameter_by_two_conditions_multiply():
    strain = np.full(3, 2.0 * AMPLITUDE.max() * PLAIN.unit_strain(Direction.AXIAL))
    conditions = RubberConditions(33.0 + CELSIUS, largest_strain=strain)
    warm, soft = added("temperature", softening=3e-3, shift=0.03), added("mullins_levels", share=0.2)
    both = added("mullins_levels", warm, share=0.2)
    mu = [model.values_at("axial", 5.0, 1e-4, conditions.select(0))["mu"] for model in (PLAIN, warm, soft, both)]
    assert mu[3] / mu[0] == pytest.approx(mu[1] / mu[0] * mu[2] / mu[0], rel=1e-12)
    assert min(abs(mu[1] / mu[0] - 1.0), abs(mu[2] / mu[0] - 1.0)) > 1e-3


def test_friction_recovers_after_a_larger_strain():
    """Left at twice the strain, three quarters of the share are lost at first, 1/e of that a time constant later."""
    broken = added("filler_recovery", share=0.4, tau=0.1)
    previous_strain = 2.0 * AMPLITUDE * PLAIN.unit_strain(Direction.AXIAL)
    for rested, lost in ((0.0, 0.3), (0.1, 0.3 / math.e), (100.0, 0.0)):
        weak = PLAIN.with_values({"sigma_fmax": (1.0 - lost) * PLAIN.values["sigma_fmax"]})
        stiffness = broken.stiffness(
            *AXIAL, conditions=RubberConditions(previous_strain=previous_strain, rest_time=rested)
        )
        np.testing.assert_allclose(stiffness, weak.stiffness(*AXIAL), rtol=1e-12)
    same(broken, PLAIN, 0.0)


def test_about_a_preload_a_spring_has_the_first_harmonic_of_the_whole_elastic_law():
    spring = Model(PLAIN.bushing, ("elastic",), {"mu": 1e6})
    loaded = added("preload", spring, c2=0.5, c3=8.0)
    wave, unit_strain = np.cos(2.0 * np.pi * np.arange(64) / 64), PLAIN.unit_strain(Direction.AXIAL)
    strain = unit_strain * (1e-3 + AMPLITUDE[:, None] * wave)
    slope = 2.0 * np.mean((strain + 0.5 * strain**2 + 8.0 * strain**3) * wave, axis=1) / (unit_strain * AMPLITUDE)
    found = loaded.stiffness(*AXIAL, conditions=RubberConditions(preload=Preload(1e-3, "m")))
    np.testing.assert_allclose(found, slope * spring.stiffness(*AXIAL), rtol=1e-9)


def test_a_spring_alone_under_a_force_channel_that_saturates():
    """Its force is a sine, of which the describing function tells what lies beyond the level."""
    spring = Model(PLAIN.bushing, ("elastic",), {"mu": 1e6})
    k = spring.stiffness(*AXIAL)
    found = added("force_saturation", spring, share=0.3, level=40.0).stiffness(*AXIAL)
    np.testing.assert_allclose(found, k * (1.0 - 0.3 * first_harmonic(np.abs(k) * AMPLITUDE, 40.0)), rtol=1e-12)
    np.testing.assert_array_equal(np.abs(found) < np.abs(k), np.abs(k) * AMPLITUDE > 40.0)


def jenkins_element(r: np.ndarray) -> np.ndarray:
    """First harmonic of a spring in series with a slider that yields at r times the strain amplitude, r <= 1."""
    t = np.arccos(1.0 - 2.0 * r)
    return (t - 0.5 * np.sin(2.0 * t)) / np.pi + 4.0j / np.pi * r * (1.0 - r)


@pytest.mark.parametrize("strain", [1e-6, 2e-3, 5e-3, 0.015, 0.05, 0.1, 1.0])
def test_sliders_are_the_mean_of_very_many(strain):
    """Below the range of their yield strains, in it and beyond: uniform in the logarithm, and normal."""
    share, omega = (np.arange(100_000) + 0.5) / 100_000, np.array([30.0])
    uniform = SLIDERS["e_s"] * np.exp(SLIDERS["spread"] * (2.0 * share - 1.0))
    many = 0.5 * SLIDERS["sigma"] * np.mean(jenkins_element(np.minimum(uniform / strain, 1.0)) / uniform)
    np.testing.assert_allclose(sliders.modulus(SLIDERS, omega, np.array([strain])), many, rtol=1e-8)
    normal = 0.01 * np.exp(0.9 * scipy.stats.norm.ppf(share))
    many = 5e5 * np.mean(jenkins_element(np.minimum(normal / strain, 1.0)))
    values = {"delta": 5e5, "e_s": 0.01, "spread": 0.9}
    np.testing.assert_allclose(distributed_sliders.modulus(values, omega, np.array([strain])), many, rtol=2e-4)
