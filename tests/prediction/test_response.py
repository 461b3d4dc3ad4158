"""Force over time: against the virtual rig at a tenth of the step, its band, its ranges, and long histories."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import chirp

from bushfit.commands.respond import respond
from bushfit.effects.contract import Array
from bushfit.effects.history import History
from bushfit.effects.unnamed import Patch, SmoothCorrection
from bushfit.errors import MeasurementError
from bushfit.geometry import Direction
from bushfit.model.covariance import Covariance
from bushfit.model.result import Range, Result
from bushfit.prediction.response import time_response
from bushfit.reduction.displacement import noise_and_highest_frequency
from bushfit.simulation import rig

STEP, ROWS, FINER = 1e-3, 3000, 10
TIME = np.arange(ROWS) * STEP
_RANDOM = np.random.default_rng(54)
_FREQUENCIES, _PHASES = _RANDOM.uniform(0.5, 25.0, 30), _RANDOM.uniform(0.0, 2.0 * np.pi, 30)


def random(time: Array) -> Array:
    sines = np.sin(2.0 * np.pi * _FREQUENCIES * time[:, None] + _PHASES).sum(axis=1)
    return np.asarray(1.5e-4 * np.minimum(time / 0.2, 1.0) * sines)


def dual_sine(time: Array) -> Array:
    return np.asarray(8e-4 * np.sin(2.0 * np.pi * time) + 1e-4 * np.sin(2.0 * np.pi * 25.0 * time))


def ramp_and_hold(time: Array) -> Array:
    return np.interp(time, [0.0, 0.5, 1.5, 1.8], [0.0, 1e-3, 1e-3, -5e-4])


def steps(time: Array) -> Array:
    return np.interp(time, TIME, np.select([TIME < 0.5, TIME < 2.0], [0.0, 1e-3], 3e-4))


def sweep(time: Array) -> Array:
    return np.asarray(4e-4 * np.minimum(time / 0.1, 1.0) * chirp(time, 0.5, 3.0, 25.0, phi=-90))


def rounded_trapezoid(time: Array) -> Array:
    corners = [0.0, 0.2, 0.7, 1.4, 1.9, 3.0], [0.0, 0.0, 8e-4, 8e-4, -3e-4, -3e-4]
    shifts = np.linspace(-0.05, 0.05, 201)
    return np.asarray(sum(np.interp(time - shift, *corners) for shift in shifts) / shifts.size)


def decaying_sine(time: Array) -> Array:
    return np.asarray(1e-3 * np.exp(-1.5 * time) * np.sin(2.0 * np.pi * 8.0 * time))


#: Motions of the axial channel, and of the channel in torsion.
MOTIONS = ((random, sweep), (dual_sine, rounded_trapezoid), (ramp_and_hold, decaying_sine), (steps, random))
LAWS: dict[str, dict[str, float]] = {
    "paper": {},
    "fractional_zener": {"fractional_zener.c": 0.2},
    "maxwell": {"maxwell.mu1": 5e4},
    "second_springpot": {"second_springpot.m": 2000.0},
    "sliders": {},
    "sleeve_compliance": {"sleeve_compliance.compliance": 3e-7},
    "clearance": {"clearance.delta": 2e-5},
    "strain_stiffening": {"strain_stiffening.c3": 40.0},
}
FURTHER = {
    "viscous": {"viscous.eta": 100.0},
    "second_friction": {"second_friction.sigma_fmax": 2000.0},
    "distributed_sliders": {},
    "bump_stop": {},
    "interface_slip": {"interface_slip.force": 5.0},
    "mullins_softening": {"mullins_softening.share": 0.05},
    "asymmetry": {"asymmetry.c2": 3.0},
    "rate_dependent_friction": {"rate_dependent_friction.n": 0.05},
}


@pytest.mark.parametrize("motions", MOTIONS)
@pytest.mark.parametrize("law", [*LAWS, *(pytest.param(name, marks=pytest.mark.slow) for name in FURTHER)])
def test_the_force_of_two_channels_is_that_of_the_rig_at_a_tenth_of_the_step(paper_model, law, motions):
    model = paper_model if law == "paper" else paper_model.with_effect(law, {**LAWS, **FURTHER}[law])
    fine = np.arange((ROWS - 1) * FINER + 1) * STEP / FINER
    turn = model.unit_strain(Direction.AXIAL) / model.unit_strain(Direction.TORSION)
    channels = {"axial": motions[0](TIME), "torsion": turn * motions[1](TIME)}
    output = respond(Result(model), channels, step=STEP)
    for response, motion, scale in zip(output.responses, motions, (1.0, turn), strict=True):
        place, frequency = response.direction, response.history.frequency
        record = rig.simulate_motion(model, place, scale * motion(fine), STEP / FINER, frequency)
        expected = record.force[::FINER]
        error = np.sqrt(np.mean((response.force.value - expected) ** 2) / np.mean(expected**2))
        assert error < 0.003, f"{motion.__name__}, {place}: {error:.3%} rms"


@pytest.mark.parametrize("corrected", [False, True])
def test_a_steady_state_is_that_of_the_closed_form(paper_model, corrected):
    amplitude, cycles = 2e-4, 4
    if corrected:
        patch = Patch(("radial",), (5.0, 20.0), (0.01, 0.02), (0.04, 0.05), (0.02, 0.01), (0.001,) * 2, (0.001,) * 2)
        effects = [*paper_model.effects, "unnamed"]
        unnamed = SmoothCorrection(0.05, (1.0, 1.0), (patch,))
        paper_model = paper_model.with_defaults(paper_model.bushing, effects, paper_model.values, unnamed)
    motion = amplitude * np.sin(2.0 * np.pi * 10.0 * np.arange(400 * cycles) / 4000.0)
    late = paper_model.with_effect("delay", {"delay.tau": 1e-4})
    result = Result(late, ("delay.tau",), Covariance(("delay.tau",), np.array([[1e-10]])))
    response = time_response(result, Direction.RADIAL, History.sampled(motion, 1 / 4000, periodic=True))
    stiffness = paper_model.stiffness("radial", 10.0, amplitude)
    assert np.fft.rfft(response.force.value)[cycles] / np.fft.rfft(motion)[cycles] == pytest.approx(stiffness, rel=1e-3)
    energy = response.summary["energy_per_second"] / (np.pi * 10.0 * amplitude**2 * stiffness.imag)
    assert energy == pytest.approx(1.0, rel=1e-3)
    assert response.history.frequency == pytest.approx(10.0, rel=1e-3)


@pytest.mark.parametrize("layer", [None, "sleeve_compliance"])
def test_the_band_is_what_the_covariance_makes_of_the_force(paper_model, layer):
    model = paper_model.with_effect(layer, {"sleeve_compliance.compliance": 3e-7}) if layer else paper_model
    covariance = Covariance(("mu", "alpha"), np.array([[4e8, 3.0], [3.0, 1e-6]]))
    history = History.sampled(dual_sine(TIME), STEP)
    force = time_response(Result(model, ("mu", "alpha"), covariance), Direction.AXIAL, history).force
    exact, slopes = replace(history, accuracy=1e-10), []
    for name, change in (("mu", 100.0), ("alpha", 1e-4)):
        ends = [model.with_values({name: model.values[name] + sign * change}).force("axial", exact) for sign in (-1, 1)]
        slopes.append((ends[1] - ends[0]) / (2.0 * change))
    half = 1.96 * np.sqrt(np.einsum("in,ij,jn->n", slopes, covariance.matrix, slopes))
    np.testing.assert_allclose(force.high - force.value, half, atol=2e-3 * half.max())
    np.testing.assert_allclose(force.value - force.low, half, atol=2e-3 * half.max())


def test_ranges_beyond_the_tests_are_stated(paper_model):
    unit_strain = paper_model.unit_strain(Direction.AXIAL)
    result = Result(paper_model, measured=Range((0.1, 20.0), (1e-4 * unit_strain, 5e-4 * unit_strain), ("axial",)))
    inside = time_response(result, Direction.AXIAL, History.sampled(4e-4 * np.sin(10.0 * TIME), STEP))
    assert [*inside.summary.values()][-2:] == [0.0, 0.0]
    assert not inside.warnings
    small = time_response(result, Direction.AXIAL, History.sampled(4e-6 * np.sin(10.0 * TIME), STEP))
    assert tuple(map(str, small.warnings)) == (
        "axial: 100 % of the travel is in strokes shorter than the shortest tested, 0.2 mm: extrapolated outside this "
        "range",
    )
    large = time_response(result, Direction.AXIAL, History.sampled(2.5e-3 * np.sin(60.0 * TIME), STEP))
    # |sin| > 0.2 in 87.2 % of a cycle; the rate 0.15 m/s exceeds 2 pi 20 Hz 0.5 mm = 0.0628 m/s in 72.5 %
    assert [*large.summary.values()][-2:] == pytest.approx([0.872, 0.725], abs=0.005)
    assert large.warnings[0].text.startswith("axial: predicted at strains of")
    assert large.warnings[1].text.startswith("axial: strain rates up to 9.24 1/s")
    coarse = time_response(result, Direction.AXIAL, History.sampled(4e-4 * np.sin(30.0 * TIME[::20]), 20 * STEP))
    assert coarse.warnings[0].text.startswith("axial: the history has 11 samples in a mean cycle")


@pytest.mark.parametrize(
    ("history", "step", "problem"),
    [
        ({}, STEP, "no direction"),
        ({"axial": [0.0, 1e-4, 0.0]}, STEP, r"axial: \(3,\)"),
        ({"axial": np.ones((2, 50))}, STEP, r"axial: \(2, 50\)"),
        ({"axial": random(TIME), "radial": random(TIME)[1:]}, STEP, r"radial: \(2999,\)"),
        ({"axial": 1e200 * random(TIME)}, STEP, "axial: this is not a motion"),
        ({"axial": np.where(TIME[-1] == TIME, np.nan, TIME)}, STEP, "axial: this is not a motion"),
        ({"axial": random(TIME)}, np.inf, "seconds above zero"),
    ],
)
def test_arrays_that_are_no_history_are_one_error(paper_model, history, step, problem):
    with pytest.raises(MeasurementError, match=problem):
        respond(Result(paper_model), history, step=step)


@pytest.mark.parametrize("noise", [0.002, 0.01])
def test_a_low_pass_removes_the_noise_that_friction_would_follow(paper_model, noise):
    """A displacement of the rig with known noise; the force is that of the true motion at a tenth of the step."""
    fine = np.arange((ROWS - 1) * FINER + 1) * STEP / FINER
    expected = rig.simulate_motion(paper_model, Direction.AXIAL, random(fine), STEP / FINER, 10.0).force[::FINER]
    true, size = random(TIME), float(np.std(random(TIME)))
    measured = true + noise * size * np.random.default_rng(5).standard_normal(ROWS)
    plain, smooth = (
        respond(Result(paper_model), {"axial": measured}, step=STEP, lowpass=frequency) for frequency in (None, 60.0)
    )
    errors = [np.std(output.responses[0].force.value - expected) / np.std(expected) for output in (plain, smooth)]
    print(f"noise {noise:.1%}: force errs by {errors[0]:.2%} rms, low-passed {errors[1]:.2%}")
    assert errors[1] < 0.01
    assert errors[1] < 0.7 * errors[0]
    estimate, highest = noise_and_highest_frequency(measured, STEP)
    assert estimate == pytest.approx(noise * size, rel=0.1)
    assert 20.0 < highest < 45.0


def test_what_has_no_law_for_the_motion_is_named(paper_model):
    model = paper_model.with_effect("mullins_softening", {"mullins_softening.share": 0.1})
    model = model.with_effect("rate_dependent_friction", {"rate_dependent_friction.n": 0.05})
    model = model.with_effect("inertia", {"inertia.mass": 5.0})
    motion = 1e-4 * np.sin(2.0 * np.pi * 10.0 * TIME)
    steady = time_response(Result(model), Direction.AXIAL, History.sampled(motion, STEP, periodic=True))
    plain = model.without("mullins_softening", "inertia")
    expected = plain.force("axial", History.steady(motion, 10.0, cycles=30))
    np.testing.assert_allclose(steady.force.value, expected, atol=2e-4 * expected.max())
    assert tuple(map(str, steady.warnings)) == (
        "axial: mullins_softening left out, because no law describes this motion",
        "axial: rate_dependent_friction constant, as in a sine of 10 Hz and 0.1 mm",
    )
