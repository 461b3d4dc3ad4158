"""One law for the whole family: what every effect of the library has to obey, whatever it is."""

import itertools
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from random_models import ADDED, sized

from bushfit.effects import (
    LIBRARY,
    Effect,
    History,
    Level,
    Modifier,
    Parameter,
    effects_for_places,
    get_effect,
    twins_of,
)
from bushfit.errors import ModelError
from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.model.sensitivity import force_and_slopes, stiffness_and_slopes
from bushfit.model.structure import structure_of
from bushfit.simulation.rig import lock_in, simulate_cycles
from bushfit.testing import CONDITIONS, check_effect, operating_point, random_model

HARMONIC_ONLY = tuple(name for name in ADDED if LIBRARY[name].harmonic_only)
#: The reversal of dry friction falls on a sample only to the accuracy of the sampling.
SAMPLES = 2**14


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20240607)


@pytest.fixture(params=ADDED)
def effect(request) -> Effect:
    return LIBRARY[request.param]


def drawn(rng: np.random.Generator, *names: str) -> tuple[Model, Model, Direction, float, float]:
    """A random model, the same with effects of a size that matters, and a direction, frequency and amplitude."""
    plain = random_model(rng)
    direction, frequency, amplitude = operating_point(plain, rng)
    model = plain
    for name in dict.fromkeys(names):
        model = sized(model, name, direction, amplitude, rng)
    return plain, model, direction, frequency, amplitude


def beside(plain: Model, name: str) -> Model:
    """The model that an effect is added to: without the branch that it replaces."""
    kept = [other for other in plain.effects if other != LIBRARY[name].replaces]
    return Model.with_defaults(plain.bushing, kept, plain.values)


def steady_sine(amplitude: float, frequency: float, samples: int = SAMPLES) -> History:
    return History.steady(amplitude * np.cos(2.0 * np.pi * np.arange(samples) / samples), frequency)


def harmonic_gap(model: Model, direction: Direction, frequency: float, amplitude: float) -> float:
    """First harmonic of the steady time face against the frequency face, relative."""
    force = model.force(direction, steady_sine(amplitude, frequency), conditions=CONDITIONS)
    timed = 2.0 * np.fft.rfft(force)[..., 1] / (SAMPLES * amplitude)
    return float(
        np.ravel(np.abs(timed / model.stiffness(direction, frequency, amplitude, conditions=CONDITIONS) - 1.0))[0]
    )


def harmonic_error(model: Model) -> float:
    return sum(effect.harmonic_error for effect in model.records)


def sized_in_another_time(model: Model, name: str, *point: Any) -> Model:
    return sized(sized(model, name, *point), "loop_clock", *point)


@pytest.mark.parametrize("add", [sized, sized_in_another_time], ids=["alone", "in another time"])
def test_the_effect_keeps_its_contract(effect, add):
    check_effect(effect.name, add=sized if effect.name == "loop_clock" else add)


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("viscous", {"sentence": "no stop"}, "full stop"),
        ("viscous", {"harmonic_error": -0.1}, "first harmonic and stiffness differ"),
        ("viscous", {"modulus": lambda p, omega, _: 1j * np.asarray(omega) * (p["eta"] + 1.0)}, "at the neutral value"),
        ("viscous", {"modulus": lambda p, omega, _: 1j * omega[0] * p["eta"]}, "."),
        ("strain_stiffening", {"stress": lambda _, history: 0.0 * history.value}, "differ by 0."),
    ],
)
def test_a_broken_effect_is_found(name, change, words, monkeypatch):
    monkeypatch.setitem(LIBRARY, name, replace(get_effect(name), **change))
    structure_of.cache_clear()
    with pytest.raises((AssertionError, IndexError), match=words):
        check_effect(name)
    structure_of.cache_clear()


@pytest.mark.parametrize("name", [name for name in ADDED if name not in {"fixture_resonance", *HARMONIC_ONLY}])
def test_the_rig_from_rest_finds_the_frequency_face(name, rng):
    """To the errors of the rig: Gruenwald-Letnikov is first order in the step, and friction takes cycles to settle."""
    plain = random_model(rng)
    direction, frequency, amplitude = operating_point(plain, rng)
    amplitude = 0.02 / plain.bushing.unit_strain(direction)
    model = sized(plain, name, direction, amplitude, rng)
    errors = []
    for each in (plain, model):
        measured = simulate_cycles(
            each, direction, frequency, amplitude, cycles=1, run_in=12, steps_per_cycle=2048, conditions=CONDITIONS
        )
        closed = np.ravel(each.stiffness(direction, frequency, amplitude, conditions=CONDITIONS))[0]
        errors.append(lock_in(measured, frequency) / closed - 1.0)
    assert abs(errors[1] - errors[0]) <= LIBRARY[name].harmonic_error + 3e-4


@pytest.mark.parametrize("name", HARMONIC_ONLY)
def test_what_has_no_law_in_time_answers_the_first_harmonic_and_the_rig_refuses_it(name, rng):
    plain = random_model(rng)
    direction, frequency, amplitude = operating_point(plain, rng)
    model, plain = sized(plain, name, direction, amplitude, rng), beside(plain, name)
    phase = np.arange(512) / 512
    motion = amplitude * (0.3 + np.cos(2.0 * np.pi * phase) + 0.2 * np.cos(6.0 * np.pi * phase))
    cycles = [History.steady(np.tile(motion, count), frequency, cycles=count) for count in (1, 3)]
    extra = [model.force(direction, each) - plain.force(direction, each) for each in cycles]
    spectrum = np.abs(np.fft.rfft(extra[0]))
    assert np.max(np.delete(spectrum, 1)) < 1e-9 * spectrum[1]
    np.testing.assert_allclose(extra[1], np.tile(extra[0], 3), atol=1e-9 * np.ptp(extra[0]))
    started = History(np.tile(motion, 2), 1.0 / (512 * frequency), periodic=False, frequency=frequency)
    late = model.force(direction, started) - plain.force(direction, started)
    np.testing.assert_allclose(late, np.tile(extra[0], 2), atol=1e-9 * np.ptp(extra[0]))
    with pytest.raises(ModelError, match="has no law in time"):
        simulate_cycles(model, direction, frequency, amplitude, cycles=1)


def random_cycle(rng: np.random.Generator, amplitude: float) -> History:
    """One closed cycle: a triangle, or a sine with overtones."""
    phase = np.arange(4096) / 4096
    if rng.random() < 0.4:
        value = 2.0 / np.pi * np.arcsin(np.sin(2.0 * np.pi * phase))
    else:
        value = sum(rng.normal() / h**2 * np.cos(2.0 * np.pi * (h * phase + rng.random())) for h in range(1, 5))
    return History.steady(amplitude * value / np.max(np.abs(value)), float(rng.choice([0.1, 30.0, 155.0])))


@pytest.mark.parametrize("name", [name for name in ADDED if name != "delay"])  # a late channel is not passive
def test_passive_effects_dissipate_in_any_closed_cycle(name, rng):
    for _ in range(15):
        _, model, direction, frequency, amplitude = drawn(rng, name)
        if not isinstance(LIBRARY[name], Modifier):
            model = model.with_values({key: 0.0 for key in ("m", "sigma_fmax") if key in model.values})
        history = random_cycle(rng, amplitude)
        force = model.force(direction, history, kind="loop")
        velocity = np.fft.irfft(1j * history.harmonics * np.fft.rfft(history.value), n=history.value.size)
        work = np.mean(force * velocity) / np.sqrt(np.mean(force**2) * np.mean(velocity**2))
        loss = np.imag(model.stiffness(direction, frequency, amplitude, kind="loop"))
        assert min(float(work), float(np.ravel(loss)[0])) >= -1e-5


def scale(parameter: Parameter, value: float) -> float:
    return value if parameter.log else parameter.typical


def five_point(model: Model, key: str, respond: object, relative: float = 2e-3) -> np.ndarray:
    """Derivative by the five-point rule with steps a thousand times those of the model's own differences."""
    value, step = model.values[key], relative * scale(model.parameters[key], model.values[key])
    at = [respond(model.with_values({key: value + k * step})) for k in (-2, -1, 1, 2)]  # type: ignore[operator]
    return (at[0] - 8.0 * at[1] + 8.0 * at[2] - at[3]) / (12.0 * step)


def test_sensitivities_match_finite_differences(effect, rng):
    _, model, direction, _, amplitude = drawn(rng, effect.name)
    names = list(model.parameters)
    frequency = np.array([5.0, 60.0, 155.0])
    amplitudes = amplitude * np.array([0.91, 1.07, 2.1])
    loop, swept_at = steady_sine(amplitude, 0.1, 512), (direction, frequency, amplitudes)
    _, swept = stiffness_and_slopes(model, direction, frequency, amplitudes, names, conditions=CONDITIONS)
    _, looped = force_and_slopes(model, direction, loop, names, CONDITIONS)
    worst = 0.0
    for i, key in enumerate(names):
        size = scale(model.parameters[key], model.values[key])
        stiffness = five_point(model, key, lambda m: m.stiffness(*swept_at, conditions=CONDITIONS))
        force, wider = (
            five_point(model, key, lambda m: m.force(direction, loop, kind="loop", conditions=CONDITIONS), step)
            for step in (2e-3, 3e-3)
        )
        largest = np.max(np.abs(model.force(direction, loop)))
        smooth = np.abs(force - wider) * size < 1e-6 * largest  # the force does not bend within these steps
        assert np.mean(smooth) > 0.9
        for found, expected, largest_of_all in (
            (swept[i], stiffness, np.max(np.abs(model.stiffness(direction, frequency, amplitudes)))),
            (looped[i][smooth], force[smooth], largest),
        ):
            worst = max(worst, float(np.max(np.abs(found - expected)) * size / largest_of_all))
    assert worst < 2e-6


def test_near_its_lower_limits_derivatives_are_about_the_force_of_the_model(effect, rng):
    plain, model, direction, _, amplitude = drawn(rng, effect.name)
    for key in model.values.keys() - plain.values.keys():
        low = model.parameters[key].bounds[0]
        if np.isfinite(low):
            model = model.with_values({key: low + 1e-12 * scale(model.parameters[key], model.values[key])})
    if not model.without_time_law:
        names = [name for name in plain.values if name in model.values]
        force, _ = force_and_slopes(model, direction, steady_sine(amplitude, 0.1), names)
        expected = model.force(direction, steady_sine(amplitude, 0.1), kind="loop")
        np.testing.assert_allclose(force, expected, atol=1e-6 * np.max(np.abs(expected)))


def test_twins_answer_alike_in_both_faces_and_only_the_bushings_is_proposed(rng):
    sets = [twins_of(name) for name, each in LIBRARY.items() if each.twins]
    assert len(sets) == 5
    proposed = effects_for_places(["radial", "axial", "mount", "torsion"])
    for names in (*sets, twins_of("stiffness_factor.mount"), twins_of("sleeve_compliance.axial")):
        assert all(twins_of(name) == names for name in names)
        assert [name for name in names if name in proposed] == [names[0]]
        levels = [get_effect(name).level for name in names]
        assert levels[0] is Level.COMPONENT
        assert Level.INSTRUMENT in levels
    for name, *twins in sets:
        plain = random_model(rng).with_effect("inertia", {"inertia.mass": 0.02})
        _, frequency, amplitude = operating_point(plain, rng)
        model = sized(plain, name, Direction.RADIAL, amplitude, rng)
        motion = amplitude * np.sin(2.0 * np.pi * np.arange(600) / 200)
        for twin in twins:
            other = model.with_twin(twin)
            assert (set(other.effects) ^ set(model.effects)) == {name, twin}
            for direction, kind in itertools.product(Direction, ("sweep", "loop")):
                at = (direction, frequency, amplitude * np.array([0.8, 1.0, 2.0]))
                assert np.array_equal(other.stiffness(*at, kind=kind), model.stiffness(*at, kind=kind))
                steady = History.steady(motion[:200], 5.0)
                for history in (steady, History(motion, 1e-3, periodic=False, frequency=5.0)):
                    forces = [each.force(direction, replace(history, solved={}), kind=kind) for each in (model, other)]
                    assert np.array_equal(*forces)


@pytest.mark.slow
def test_any_two_compose(effect, rng):
    for other in ADDED[ADDED.index(effect.name) + 1 :]:
        plain, model, direction, frequency, amplitude = drawn(rng, effect.name)
        both = sized(model, other, direction, amplitude, rng)
        turned = plain.with_effect(other).with_effect(effect.name).with_values(both.values)
        at = (direction, frequency, amplitude)
        assert np.array_equal(both.stiffness(*at, conditions=CONDITIONS), turned.stiffness(*at, conditions=CONDITIONS))
        assert both.records == turned.records
        gap = harmonic_gap(both, *at)
        assert gap <= 2.0 * harmonic_error(both) + 1e-6, (other, gap)


def test_a_model_survives_processes(effect, rng):
    model = sized(random_model(rng), effect.name, Direction.AXIAL, 2e-4, rng)
    copy = pickle.loads(pickle.dumps(model))
    assert copy.effects == tuple(e.name for e in model.records)
    assert copy.values == model.values
    assert np.array_equal(copy.stiffness("axial", 50.0, 1e-4), model.stiffness("axial", 50.0, 1e-4))
