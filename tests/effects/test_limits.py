"""Effects against simpler ones, and against numbers worked out without them."""

from __future__ import annotations

import math
from dataclasses import replace

import mpmath
import numpy as np
import pytest
from scipy.integrate import quad

from bushfit.effects import BASE, LIBRARY, Effect, History, qualified, sliders
from bushfit.effects.contract import Circumstances
from bushfit.effects.dead_zone import dead_zone, first_harmonic
from bushfit.effects.maxwell import relax
from bushfit.effects.temperature import log_shift
from bushfit.geometry import Bushing, Direction
from bushfit.model.model import Model
from bushfit.units import CELSIUS

PLAIN = Model(
    Bushing("CMP 15 961", 0.010, 0.018, 0.034),
    BASE,
    {"mu": 1.09e6, "m": 2.0e5, "alpha": 0.24, "sigma_fmax": 1.46e4, "eps_half": 1.3e-2},
)
#: Operating points [Hz] and [m].
FREQUENCY = np.array([5.0, 55.0, 155.0])
AMPLITUDE = np.array([1e-4, 2e-4, 5e-4])
LOOP = History.steady(5e-4 * np.cos(2.0 * np.pi * np.arange(512) / 512), 5.0)
STARTED = History(5e-4 * np.sin(2.0 * np.pi * np.arange(20480) / 2048), 1.0 / (20.0 * 2048), False, 20.0)


def same(one: Model, other: Model, tolerance: float) -> None:
    """Both models answer alike in both faces, relative to the largest answer."""
    pairs = [(m.stiffness("radial", FREQUENCY, AMPLITUDE) for m in (one, other))]
    pairs += [(m.force("radial", history) for m in (one, other)) for history in (LOOP, STARTED)]
    for found, expected in pairs:
        assert np.max(np.abs(found - expected)) <= tolerance * np.max(np.abs(expected))


def test_a_fast_maxwell_arm_is_a_dashpot() -> None:
    tau, eta = 1.1e-5, 100.0
    arm = PLAIN.with_effect("maxwell", {"maxwell.tau": tau, "maxwell.mu1": eta / tau})
    same(arm, PLAIN.with_effect("viscous", {"viscous.eta": eta}), 1e-2)


def test_a_slow_maxwell_arm_is_a_spring() -> None:
    arm = PLAIN.with_effect("maxwell", {"maxwell.tau": 99.0, "maxwell.mu1": 1e5})
    spring = PLAIN.with_values({"mu": PLAIN.values["mu"] + 1e5})
    same(arm, spring, 2e-3)


def test_a_viscous_branch_is_a_springpot_of_order_one() -> None:
    eta = 150.0
    pot = PLAIN.with_values({"m": 2.0 * eta, "alpha": 1.0})
    dashpot = PLAIN.with_values({"m": 0.0}).with_effect("viscous", {"viscous.eta": eta})
    expected = pot.stiffness("axial", FREQUENCY, AMPLITUDE)
    np.testing.assert_allclose(dashpot.stiffness("axial", FREQUENCY, AMPLITUDE), expected, rtol=1e-14)


def test_a_second_friction_like_the_first_doubles_it() -> None:
    same(
        PLAIN.with_effect(
            "second_friction", {"second_friction.sigma_fmax": 1.46e4, "second_friction.eps_half": 1.3e-2}
        ),
        PLAIN.with_values({"sigma_fmax": 2.92e4}),
        1e-14,
    )


def test_a_stiff_fixture_is_a_mass() -> None:
    fixture = {"mass": 0.1, "frequency": 1e4, "damping": 0.1}
    stiff = PLAIN.with_effect("fixture_resonance", {f"fixture_resonance.{k}": v for k, v in fixture.items()})
    same(stiff, PLAIN.with_effect("inertia", {"inertia.mass": 0.1}), 1e-4)


def test_a_fixture_from_rest_rings_down_to_its_steady_state() -> None:
    mode = {"mass": 0.1, "frequency": 60.0, "damping": 0.2}
    model = PLAIN.with_effect("fixture_resonance", {f"fixture_resonance.{k}": v for k, v in mode.items()})
    last = slice(-2048, None)
    tail = History.steady(STARTED.value[last], 20.0)
    extra = (model.force("axial", STARTED) - PLAIN.force("axial", STARTED))[last]
    steady = model.force("axial", tail) - PLAIN.force("axial", tail)
    assert np.max(np.abs(extra - steady)) < 1e-4 * np.max(np.abs(steady))


def test_a_compliant_rig_over_a_spring_is_two_springs_in_series() -> None:
    spring = PLAIN.with_values({"m": 0.0, "sigma_fmax": 0.0})
    stiffness = spring.stiffness("radial", np.array([1.0]), np.array([1e-4]))[0]
    soft = spring.with_effect("rig_compliance", {"rig_compliance.compliance": 1.0 / float(stiffness.real)})
    np.testing.assert_allclose(soft.stiffness("radial", 1.0, 1e-4), stiffness / 2.0, rtol=1e-14)
    for history in (LOOP, STARTED):
        np.testing.assert_allclose(
            soft.force("radial", history), stiffness.real / 2.0 * history.value, rtol=0.0, atol=1e-11
        )


def test_compliances_in_series_add() -> None:
    both = PLAIN.with_effect("sleeve_compliance", {"sleeve_compliance.compliance": 2e-8})
    both = both.with_effect("sleeve_compliance.axial", {"sleeve_compliance.axial": 3e-8})
    one = PLAIN.with_effect("sleeve_compliance", {"sleeve_compliance.compliance": 5e-8})
    np.testing.assert_array_equal(both.stiffness("axial", 20.0, 1e-4), one.stiffness("axial", 20.0, 1e-4))
    forces = [model.force("axial", replace(LOOP, solved={})) for model in (both, one)]
    np.testing.assert_allclose(*forces, rtol=1e-10)


@pytest.mark.parametrize("history", [LOOP, STARTED], ids=["steady", "from rest"])
@pytest.mark.parametrize("inside", ["strain_stiffening", "viscous", "bump_stop", "clearance", "self_heating"])
def test_rig_and_bushing_share_the_motion(inside: str, history: History) -> None:
    """x = x_b + c F, where F is what the bushing alone answers to x_b."""
    sizes = {
        "strain_stiffening": {"c3": 60.0},
        "viscous": {"eta": 300.0},
        "bump_stop": {"gap": 3e-4, "stiffness": 1e6},
        "clearance": {"delta": 4e-5},
        "self_heating": {"beta": 1e-2},
    }
    alone = PLAIN.with_effect(inside, {f"{inside}.{key}": value for key, value in sizes[inside].items()})
    compliance = 4e-8
    rigged = alone.with_effect("rig_compliance", {"rig_compliance.compliance": compliance})
    force = rigged.force("radial", replace(history, solved={}))
    again = alone.force("radial", history.with_value(history.value - compliance * force))
    assert np.max(np.abs(again - force)) < 1e-9 * np.max(np.abs(force))


def test_the_amplitude_at_the_bushing_closes_the_circle() -> None:
    compliance = 1e-7
    inner = PLAIN.with_effect("strain_stiffening", {"strain_stiffening.c3": 100.0})
    seen = inner.with_effect("rig_compliance", {"rig_compliance.compliance": compliance}).stiffness(
        "radial", FREQUENCY, AMPLITUDE
    )
    reached = AMPLITUDE * np.abs(1.0 - compliance * seen)
    bushing = inner.stiffness("radial", FREQUENCY, reached)
    np.testing.assert_allclose(seen, bushing / (1.0 + compliance * bushing), rtol=1e-13)


def test_mullins_softening_fades_over_the_cycles() -> None:
    model = PLAIN.with_effect("mullins_softening", {"mullins_softening.share": 0.2})
    phase = np.arange(4 * 256) / 256
    history = History.steady(1e-3 * np.sin(2.0 * np.pi * phase), 0.1, cycles=4)
    extra = (model.force("axial", history) - PLAIN.force("axial", history)).reshape(4, 256)
    peaks = extra.max(axis=1)
    np.testing.assert_allclose(peaks[1:] / peaks[:-1], np.exp(-1.0), rtol=1e-10)
    work = np.sum(extra * np.diff(history.value, append=0.0).reshape(4, 256))
    assert work > 0.0


def test_heating_counts_the_loss_of_the_unheated_bushing() -> None:
    beta, frequency, amplitude = 2e-3, 100.0, 1e-3
    cold = PLAIN.stiffness("axial", frequency, amplitude)
    power = np.pi * frequency * amplitude**2 * cold.imag
    hot = PLAIN.with_effect("self_heating", {"self_heating.beta": beta}).stiffness("axial", frequency, amplitude)
    np.testing.assert_allclose(hot, cold / (1.0 + beta * power), rtol=1e-14)


def test_instrument_masses_springs_and_offsets_do_not_act_in_torsion() -> None:
    sizes = {
        "inertia": {"mass": 0.1},
        "fixture_resonance": {"mass": 0.1},
        "rig_compliance": {"compliance": 1e-7},
        "force_offset": {"offset": 10.0},
        "bump_stop": {"gap": 1e-4, "stiffness": 1e6},
        "clearance": {"delta": 5e-5},
    }
    model = PLAIN
    for name, values in sizes.items():
        model = model.with_effect(name, {f"{name}.{key}": value for key, value in values.items()})
    at = (Direction.TORSION, FREQUENCY, AMPLITUDE)
    assert np.array_equal(model.stiffness(*at), PLAIN.stiffness(*at))
    assert np.array_equal(model.force(Direction.TORSION, LOOP), PLAIN.force(Direction.TORSION, LOOP))


def test_force_gain_tells_loops_from_sweeps() -> None:
    model = PLAIN.with_effect("force_gain", {"force_gain.gain": 0.02})
    assert np.array_equal(model.force("axial", LOOP, kind="sweep"), PLAIN.force("axial", LOOP))
    np.testing.assert_allclose(model.force("axial", LOOP, kind="loop"), 1.02 * PLAIN.force("axial", LOOP), rtol=1e-15)


def test_radial_factor_leaves_the_other_directions_alone() -> None:
    model = PLAIN.with_effect("stiffness_factor.radial", {"stiffness_factor.radial": 0.92})
    for direction, factor in ((Direction.AXIAL, 1.0), (Direction.RADIAL, 0.92), (Direction.TORSION, 1.0)):
        plain = PLAIN.stiffness(direction, FREQUENCY, AMPLITUDE)
        np.testing.assert_allclose(model.stiffness(direction, FREQUENCY, AMPLITUDE), factor * plain, rtol=1e-15)
        np.testing.assert_allclose(model.force(direction, LOOP), factor * PLAIN.force(direction, LOOP), rtol=1e-14)


def test_a_delay_shifts_the_record() -> None:
    shifted = PLAIN.with_effect("delay", {"delay.tau": 3.0 * STARTED.step}).force("axial", STARTED)
    np.testing.assert_allclose(shifted[3:], PLAIN.force("axial", STARTED)[:-3], rtol=0.0, atol=1e-9)
    assert np.all(np.abs(shifted[:3]) < 1e-9)
    late = PLAIN.with_effect("delay", {"delay.tau": 4.0 * LOOP.step}).force("axial", LOOP)
    np.testing.assert_allclose(late, np.roll(PLAIN.force("axial", LOOP), 4), rtol=0.0, atol=1e-9)


def test_relaxation_of_a_ramp_is_exact() -> None:
    step, tau = 1e-3, 7e-3
    time = step * np.arange(200)
    np.testing.assert_allclose(relax(1.0 / tau, 3.0 * time, step), 3.0 * tau * -np.expm1(-time / tau), rtol=1e-12)


@pytest.mark.parametrize("ratio", [1e-6, 0.1, 0.499999, 0.500001, 0.9, 1.0 - 1e-6, 1.0 - 1e-12])
def test_describing_function_against_sixty_digits(ratio: float) -> None:
    mpmath.mp.dps = 60
    r = mpmath.mpf(ratio)
    exact = 1 - 2 / mpmath.pi * (mpmath.asin(r) + r * mpmath.sqrt(1 - r * r))
    assert abs(float(first_harmonic(np.array(1.0), ratio)) / float(exact) - 1.0) < 1e-13


def test_describing_function_against_quadrature() -> None:
    for ratio in (0.0, 0.3, 0.8):
        value, _ = quad(
            lambda t, r=ratio: float(dead_zone(np.cos(t), r)) * np.cos(t), 0.0, np.pi, points=[np.arccos(ratio)]
        )
        assert abs(2.0 / np.pi * value - float(first_harmonic(np.array(1.0), ratio))) < 1e-9


@pytest.mark.parametrize("amplitude", [0.0, 1e-9, 0.99e-4, 1e-4])
def test_nothing_happens_within_the_gap(amplitude: float) -> None:
    stop = PLAIN.with_effect("bump_stop", {"bump_stop.gap": 1e-4, "bump_stop.stiffness": 1e7})
    assert np.array_equal(stop.stiffness("axial", 50.0, amplitude), PLAIN.stiffness("axial", 50.0, amplitude))
    loose = PLAIN.with_effect("clearance", {"clearance.delta": 1e-4})
    assert np.all(loose.stiffness("axial", 50.0, amplitude) == 0.0)


@pytest.mark.parametrize("ratio", [0.01, 0.1, 0.25, 0.5])
@pytest.mark.parametrize("direction", ["axial", "radial"])
def test_play_bends_the_waveform_and_friction_answers_to_it(direction: Direction, ratio: float) -> None:
    """The stated error, where the describing function alone would be wrong by up to a hundred times as much."""
    amplitude, samples = 2e-4, 2**14
    model = PLAIN.with_effect("clearance", {"clearance.delta": ratio * amplitude})
    sine = History.steady(amplitude * np.cos(2.0 * np.pi * np.arange(samples) / samples), 20.0)
    exact = 2.0 * np.fft.rfft(model.force(direction, sine))[1] / (samples * amplitude)
    peak = PLAIN.stiffness(direction, 20.0, amplitude * (1.0 - ratio)) * first_harmonic(np.array(1.0), ratio)
    found = model.stiffness(direction, 20.0, amplitude)
    error = np.abs(found / exact - 1.0).max()
    print(f"{direction}, delta/X = {ratio}: {error:.1e}; at the peak alone {np.abs(peak / exact - 1.0).max():.1e}")
    assert error < model.records[-1].harmonic_error


@pytest.mark.parametrize("effect", [effect for effect in LIBRARY.values() if effect.corrects], ids=lambda one: one.name)
def test_what_corrects_a_formula_scales_that_direction_and_no_other(effect: Effect) -> None:
    (parameter,) = effect.parameters
    model = PLAIN.with_effect(effect.name, {qualified(effect, parameter): parameter.sized(1.0)})
    for direction in Direction:
        ratio = model.stiffness(direction, FREQUENCY, AMPLITUDE) / PLAIN.stiffness(direction, FREQUENCY, AMPLITUDE)
        assert np.ptp(np.abs(ratio)) < 1e-12, "a factor"
        assert (abs(ratio[0] - 1.0) > 1e-6) == (direction == effect.corrects)


WARM = Circumstances(33.0 + CELSIUS, turn=0.5, strained=0.1, left=0.1, rested=0.02)


@pytest.mark.parametrize("shift", [0.01, 0.03, 0.13])
def test_warm_rubber_is_softer_and_faster(shift: float) -> None:
    """At 33 degC with 0.3 % a kelvin: moduli times exp(-0.03), the spring's times 306.15/296.15, the springpot's also
    times a_T^alpha; and so is the second one, with its own order."""
    c2 = min(np.sqrt(2072.1 / shift), 296.15)
    a_t = np.exp(-shift * 10.0 * c2 / (c2 + 10.0))
    plain = PLAIN.with_effect("second_springpot", {"second_springpot.m": 3e3, "second_springpot.alpha": 0.7})
    faster = {"m": a_t ** PLAIN.values["alpha"], "second_springpot.m": a_t**0.7, "sigma_fmax": 1.0}
    by_hand = {"mu": 306.15 / 296.15, **{name: np.exp(-0.03) * factor for name, factor in faster.items()}}
    expected = plain.with_values({name: factor * plain.values[name] for name, factor in by_hand.items()})
    warm = plain.with_effect("temperature", {"temperature.softening": 3e-3, "temperature.shift": shift})
    stiffness = warm.stiffness("axial", FREQUENCY, AMPLITUDE, under=WARM)
    np.testing.assert_allclose(stiffness, expected.stiffness("axial", FREQUENCY, AMPLITUDE), rtol=1e-5)
    np.testing.assert_allclose(warm.force("axial", LOOP, under=WARM), expected.force("axial", LOOP), rtol=1e-5)
    same(warm, plain, 0.0)


def test_the_shift_factor_is_that_of_williams_landel_and_ferry() -> None:
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


def test_drift_is_in_proportion_to_the_turn() -> None:
    drifting = PLAIN.with_effect("drift", {"drift.gain": 0.04})
    turns = Circumstances(turn=np.array([0.0, 0.5, 1.0]))
    ratio = drifting.stiffness("axial", FREQUENCY, AMPLITUDE, under=turns) / PLAIN.stiffness(
        "axial", FREQUENCY, AMPLITUDE
    )
    np.testing.assert_allclose(ratio, [1.0, 1.02, 1.04], rtol=1e-12)
    same(drifting, PLAIN, 0.0)


def test_mullins_softens_below_the_largest_strain_so_far_and_not_there() -> None:
    softened = PLAIN.with_effect("mullins_levels", {"mullins_levels.share": 0.2})
    strain = AMPLITUDE * PLAIN.unit_strain(Direction.AXIAL)
    under = Circumstances(strained=np.full(3, strain[1]))
    ratio = softened.stiffness("axial", FREQUENCY, AMPLITUDE, under=under) / PLAIN.stiffness(
        "axial", FREQUENCY, AMPLITUDE
    )
    assert np.all(np.abs(ratio.imag) < 1e-12)
    assert ratio.real[0] == pytest.approx(1.0 - 0.2 * math.erf(0.75))
    np.testing.assert_allclose(ratio[1:], 1.0, rtol=1e-12)
    same(softened, PLAIN, 0.0)


def test_friction_recovers_after_a_larger_strain() -> None:
    """Left at twice the strain, three quarters of the share are lost at first, 1/e of that a time constant later."""
    values = {"filler_recovery.share": 0.4, "filler_recovery.tau": 0.1}
    broken = PLAIN.with_effect("filler_recovery", values)
    left = 2.0 * AMPLITUDE * PLAIN.unit_strain(Direction.AXIAL)
    for rested, lost in ((0.0, 0.3), (0.1, 0.3 / math.e), (100.0, 0.0)):
        weak = PLAIN.with_values({"sigma_fmax": (1.0 - lost) * PLAIN.values["sigma_fmax"]})
        stiffness = broken.stiffness("axial", FREQUENCY, AMPLITUDE, under=Circumstances(left=left, rested=rested))
        np.testing.assert_allclose(stiffness, weak.stiffness("axial", FREQUENCY, AMPLITUDE), rtol=1e-12)
    same(broken, PLAIN, 0.0)


def test_a_loop_clock_that_runs_slow_is_a_faster_loop() -> None:
    off = PLAIN.with_effect("loop_clock", {"loop_clock.rate": math.log(10.0)})
    expected = PLAIN.stiffness("axial", 10.0 * FREQUENCY, AMPLITUDE)
    np.testing.assert_allclose(off.stiffness("axial", FREQUENCY, AMPLITUDE, kind="loop"), expected, rtol=1e-12)
    fast = replace(LOOP, step=LOOP.step / 10.0, frequency=10.0 * LOOP.frequency)
    np.testing.assert_allclose(off.force("axial", LOOP, kind="loop"), PLAIN.force("axial", fast), rtol=1e-12)
    same(off, PLAIN, 0.0)


def test_a_spring_alone_under_a_force_channel_that_saturates() -> None:
    """Its force is a sine, of which the describing function tells what lies beyond the level."""
    share, level = 0.3, 40.0
    own = {"force_saturation.share": share, "force_saturation.level": level}
    spring = Model(PLAIN.bushing, ("elastic",), {"mu": 1e6})
    k = spring.stiffness("axial", FREQUENCY, AMPLITUDE)
    expected = k * (1.0 - share * first_harmonic(np.abs(k) * AMPLITUDE, level))
    found = spring.with_effect("force_saturation", own).stiffness("axial", FREQUENCY, AMPLITUDE)
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    np.testing.assert_array_equal(np.abs(found) < np.abs(k), np.abs(k) * AMPLITUDE > level)


@pytest.mark.parametrize(
    ("bends", "of_it"),
    [
        ("clearance", {"clearance.delta": 2e-5}),
        ("force_saturation", {"force_saturation.share": 0.3, "force_saturation.level": 180.0}),
    ],
)
def test_circumstances_of_each_point_reach_the_rubber_through_a_bent_waveform(
    bends: str, of_it: dict[str, float]
) -> None:
    """Play asks for whole cycles of the bushing below it, a row for each operating point; a force channel that
    saturates only for those that come near its level, here the last two of three."""
    values = {"drift.gain": 0.1, "mullins_levels.share": 0.1, "temperature.softening": 0.01, **of_it}
    model = Model.started(PLAIN.bushing, (*BASE, bends, "drift", "mullins_levels", "temperature"), {})
    model = model.with_values({**PLAIN.values, **values})
    under = Circumstances(np.array([290.0, 300.0, 305.0]), np.array([0.0, 0.3, 1.0]), np.array([0.0, 0.02, 0.05]))
    together = model.stiffness("axial", FREQUENCY, AMPLITUDE, under=under)
    points = enumerate(zip(FREQUENCY, AMPLITUDE, strict=True))
    alone = [model.stiffness("axial", f, x, under=under.at(i)) for i, (f, x) in points]
    np.testing.assert_allclose(together, alone, rtol=1e-12)


SLIDERS = {"sigma": 2.5e4, "e_s": 0.015, "spread": 1.3}


@pytest.mark.parametrize("strain", [1e-6, 3e-3, 5e-3, 0.015, 0.05, 0.1, 1.0])
def test_sliders_are_the_mean_of_very_many(strain: float) -> None:
    """Below the range of their slip strains (4e-3 to 0.055), in it and beyond."""
    places = (np.arange(100_000) + 0.5) / 50_000 - 1.0
    slip = SLIDERS["e_s"] * np.exp(SLIDERS["spread"] * places)
    r = np.minimum(slip / strain, 1.0)
    t = np.arccos(1.0 - 2.0 * r)
    each = ((t - 0.5 * np.sin(2.0 * t)) / np.pi + 4.0j / np.pi * r * (1.0 - r)) / slip
    found = sliders.modulus(SLIDERS, np.array([30.0]), np.array([strain]))
    np.testing.assert_allclose(found, 0.5 * SLIDERS["sigma"] * np.mean(each), rtol=1e-8)


@pytest.mark.parametrize("amplitude", [3e-3, 0.015, 0.2])
def test_sliders_along_a_settled_motion_from_rest_are_those_of_the_steady_one(amplitude: float) -> None:
    """The one is followed slider by slider, the other is the first loading at twice its size."""
    count = 512
    phase = 2.0 * np.pi * np.arange(3 * count) / count
    steady = sliders.stress(SLIDERS, History.steady(amplitude * np.sin(phase[:count]), 5.0))
    rested = sliders.stress(SLIDERS, History(amplitude * np.sin(phase), 1.0 / (5.0 * count), False, 5.0))
    assert np.max(np.abs(rested[-count:] - steady)) < 3e-4 * np.max(np.abs(steady))
