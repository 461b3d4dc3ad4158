"""The FMU against the rig: sweeps, loops and random motions in every direction, and each effect that runs in time."""

import importlib.util
from dataclasses import replace

import numpy as np
import pytest
from fmpy.validation import validate_fmu
from fmus import LEVELS, Running, off, request_of, wandering, written

from bushfit.effects import LIBRARY, Branch, Layer, Level, get_parameter, qualified_name
from bushfit.effects.contract import Array, RubberConditions
from bushfit.errors import ModelError, OutputError
from bushfit.export.fmu import export
from bushfit.export.in_time import FIELDS, time_model
from bushfit.geometry import Bushing, Direction
from bushfit.model.model import Model
from bushfit.simulation.rig import simulate_motion, wave
from bushfit.units import CELSIUS

#: Root mean square error that the force may have, relative: asked for.
LARGEST = 0.01
#: Effects that the model of every law has at their neutral values, to be set one by one.
SETTABLE = [
    "asymmetry", "strain_stiffening", "fifth_power_stiffening", "second_friction", "sliders",
    "distributed_sliders", "strain_scale.radial", "clearance", "interface_slip", "bump_stop", "one_sided_stop",
    "stiffness_factor.radial", "preload_stiffening.radial", "sleeve_compliance", "sleeve_compliance.radial",
]  # fmt: skip
#: Effects that Maxwell arms stand for, besides the springpot, at sizes that show.
FADING = {
    "viscous.eta": 150.0, "maxwell.mu1": 8e4, "maxwell.tau": 3e-3, "second_maxwell.mu1": 5e4,
    "second_maxwell.tau": 0.2, "second_springpot.m": 3e3, "second_springpot.alpha": 0.6, "fractional_zener.c": 0.1,
}  # fmt: skip
OF_THE_RIG = [name for name, effect in LIBRARY.items() if effect.level is Level.INSTRUMENT]


def motions(what: str, level: int) -> tuple[Array, float, float]:
    """Displacements of all directions, (n, 3), at a level, the time step [s] and the frequency [Hz]."""
    sizes = np.array([amplitudes[level] for amplitudes in LEVELS.values()])
    kind, _, number = what.partition(" ")
    if kind == "random":
        step, shape, frequency = 2e-4, wandering(10_001, 2e-4, seed=level), 10.0
    else:
        frequency, (steps, cycles) = float(number), {"sweep": (1024, 4), "sine": (2048, 2), "triangle": (2048, 2)}[kind]
        step = 1.0 / (frequency * steps)
        shape = wave("triangle" if kind == "triangle" else "sine", np.arange(steps * cycles + 1) / steps)
    return shape[:, None] * sizes, step, frequency


def on_the_rig(model: Model, motion: Array, step: float, frequency: float) -> Array:
    """Forces of all directions, (n, 3)."""
    return np.stack(
        [simulate_motion(model, place, motion[:, k], step, frequency).force for k, place in enumerate(LEVELS)], axis=-1
    )


def worst(running: Running, model: Model, what: str, level: int = 1, values: dict[str, float] | None = None) -> float:
    """Largest error of the force in any direction against the rig, relative to its root mean square."""
    motion, step, frequency = motions(what, level)
    pairs = zip(running.run(motion, step, values).T, on_the_rig(model, motion, step, frequency).T, strict=True)
    errors = [off(*pair) for pair in pairs]
    return max(errors)


@pytest.mark.parametrize("level", range(3))
@pytest.mark.parametrize("what", ["sweep 5", "sweep 55", "sweep 155", "sine 0.1", "triangle 0.1", "random"])
def test_force_follows_the_rig_in_every_direction(paper, paper_model, what, level):
    motion, _, _ = motions(what, level)
    assert np.sum(np.diff(np.sign(np.diff(motion[:, 0]))) != 0.0) > 100 or what != "random", "turning points"
    assert worst(paper, paper_model, what, level) < LARGEST


@pytest.fixture(scope="module")
def every(paper_model, tmp_path_factory) -> tuple[Model, Running]:
    """A model with every law at its neutral values, and its FMU."""
    folder = tmp_path_factory.mktemp("every")
    model = Model.with_defaults(paper_model.bushing, (*paper_model.effects, *SETTABLE), paper_model.values)
    return model, Running(written(request_of(model), folder), folder / "open")


@pytest.mark.parametrize("name", SETTABLE)
def test_each_effect_follows_the_rig(every, name):
    """At the sample of a turn itself dry friction has the sense of the step before it, and the rig that of both: such
    samples do not count."""
    neutral, running = every
    effect = LIBRARY[name]
    values = {qualified_name(effect, parameter): parameter.value_at_share(1.0) for parameter in effect.parameters}
    values |= {key: 1.5e-4 for key in values if key.endswith(".gap")}
    model = neutral.with_values(values)
    motion, step, frequency = motions("random", 1)
    before = np.diff(motion[:, 0], prepend=0.0)
    counted = (np.sign(before) == np.sign(np.gradient(motion[:, 0]))) | (name != "interface_slip")
    expected, plain = (on_the_rig(each, motion, step, frequency)[counted] for each in (model, neutral))
    errors = [off(*pair) for pair in zip(running.run(motion, step, values)[counted].T, expected.T, strict=True)]
    changed = max(off(*pair) for pair in zip(plain.T, expected.T, strict=True))
    assert max(errors) < LARGEST
    assert changed > 1e-3
    assert counted.mean() > 0.98


def test_what_fades_with_memory_or_a_preload_follows_the_rig(paper_model, tmp_path):
    names = tuple(dict.fromkeys(name.partition(".")[0] for name in FADING))
    model = Model.with_defaults(paper_model.bushing, (*paper_model.effects, *names), {**paper_model.values, **FADING})
    running = Running(written(request_of(model, accuracy=2e-3), tmp_path), tmp_path / "fading")
    assert worst(running, model, "random") < LARGEST
    doubled = {"maxwell.mu1": 2.0 * FADING["maxwell.mu1"]}
    assert worst(running, model.with_values(doubled), "random", values=doubled) < LARGEST
    model = paper_model.with_effect("elastic_preload.radial", {"elastic_preload.radial": 1.2})
    running = Running(written(request_of(model), tmp_path), tmp_path / "preload")
    assert {"mu.axial", "mu.radial", "mu.torsion"} <= set(running.reference)
    assert worst(running, model, "random") < LARGEST


def test_an_fmu_is_of_the_temperature_asked_for(paper_model, tmp_path):
    """Springs that soften, and a springpot that shifts as well."""
    values = {"temperature.softening": 4e-3, "temperature.shift": 0.08}
    model = paper_model.with_effect("temperature", values)
    plain, at, frequency = request_of(model), 60.0 + CELSIUS, 55.0
    running = Running(written(replace(plain, temperature=at), tmp_path), tmp_path / "warm")
    amplitude, phase = LEVELS[Direction.AXIAL][1], np.arange(30 * 64 + 1) / 64
    motion = np.zeros((phase.size, 3))
    motion[:, 0] = amplitude * np.sin(2.0 * np.pi * phase)
    force = running.run(motion, 1.0 / (64 * frequency))[-64:, 0]
    found = 2.0 * np.mean(force * np.exp(-2j * np.pi * phase[-64:])) / (-1j * amplitude)
    warm = model.stiffness("axial", frequency, amplitude, conditions=RubberConditions(at))
    assert abs(found / warm - 1.0) < LARGEST < 0.2 * abs(found / model.stiffness("axial", frequency, amplitude) - 1.0)


def test_the_description_is_valid(paper):
    assert validate_fmu(str(paper.file)) == []
    variables = {each.name: each for each in paper.description.modelVariables}
    assert paper.inputs == ["displacement.axial", "displacement.radial", "rotation.torsion"]
    assert paper.outputs == ["force.axial", "force.radial", "moment.torsion"]
    assert {"mu", "m", "sigma_fmax", "eps_half"} <= {n for n, v in variables.items() if v.causality == "parameter"}
    low, high = get_parameter("mu").bounds
    assert float(variables["mu"].min) <= low < float(variables["mu"].max) == high
    assert (variables["alpha"].variability, float(variables["alpha"].start)) == ("constant", 0.24)


def test_every_effect_is_written_or_refused_in_one_error_and_every_law_is_tested():
    """No effect of the library is left out without a word: what is not in the sources has another way."""
    for effect in LIBRARY.values():
        known = effect.name if "." not in effect.name else f"{effect.name.partition('.')[0]}."
        ways = (
            known in FIELDS,
            isinstance(effect, Branch) and effect.size is not None,
            effect.harmonic_only,
            effect.is_transient,
            effect.level is Level.INSTRUMENT,
            not isinstance(effect, Branch | Layer),
        )
        assert any(ways), effect.name
    kinds = {name if "." not in name else f"{name.partition('.')[0]}." for name in SETTABLE}
    assert kinds | {"elastic", "friction"} == set(FIELDS)


def test_another_shape_is_set_by_its_two_numbers(paper, paper_model):
    other = Bushing("other", 0.012, 0.020, 0.05)
    values = {
        **{f"unit_strain.{place}": other.unit_strain(place) for place in Direction},
        **{f"stiffness_per_modulus.{place}": other.stiffness_per_modulus(place) for place in Direction},
    }
    model = Model(other, paper_model.effects, paper_model.values)
    assert worst(paper, model, "random", values=values) < LARGEST


def test_instances_do_not_see_each_other_and_a_state_is_taken_up_again(paper):
    motion = 2e-4 * wandering(300, 1e-3, seed=3)[:, None] * np.array([1.0, 1.0, 50.0])
    expected = paper.run(motion, 1e-3)
    first, second = (paper.begun(paper.instance()) for _ in range(2))
    half = paper.follow(first, motion[:150], 1e-3)
    np.testing.assert_array_equal(paper.follow(second, motion, 1e-3), expected)
    np.testing.assert_array_equal(half, expected[:150])
    first.reset()
    np.testing.assert_array_equal(paper.follow(paper.begun(first), motion, 1e-3), expected)
    for each in (first, second):
        each.terminate()
        each.freeInstance()
    motion = 2e-4 * wandering(300, 1e-3, seed=4)[:, None] * np.array([1.0, 1.0, 50.0])
    made = paper.begun(paper.instance())
    paper.follow(made, motion[:150], 1e-3)
    state = made.getFMUState()
    kept = made.serializeFMUState(state)
    once = paper.follow(made, motion[149:], 1e-3)
    made.setFMUState(state)
    np.testing.assert_array_equal(paper.follow(made, motion[149:], 1e-3), once)
    other = paper.begun(paper.instance())
    revived = other.deSerializeFMUstate(kept)
    other.setFMUState(revived)
    np.testing.assert_array_equal(paper.follow(other, motion[149:], 1e-3), once)
    made.freeFMUState(state)
    other.freeFMUState(revived)
    made.freeInstance()
    other.freeInstance()


@pytest.mark.parametrize("name", ["kraus", "hysteretic_loss"])
def test_effects_without_a_law_in_time_are_refused(paper_model, name):
    with pytest.raises(ModelError, match="for which this effect has no law") as refused:
        time_model(request_of(paper_model.with_effect(name)))
    assert refused.value.place == name


def test_effects_of_the_rig_are_left_out_and_what_is_held_is_said_with_its_error(paper_model):
    plain, *others = (
        [value.name for value in time_model(request_of(model, (Direction.AXIAL,))).values]
        for model in (paper_model, *(paper_model.with_effect(name) for name in OF_THE_RIG))
    )
    assert dict(zip(OF_THE_RIG, others, strict=True)) == dict.fromkeys(OF_THE_RIG, plain)
    # m (e0/0.01)^-q, held at the geometric middle of 0.1 and 0.5 mm: the whole error is that of the springpot.
    model = paper_model.with_effect("coupled_breakdown", {"coupled_breakdown.q": 0.3})
    found = time_model(request_of(model, (Direction.AXIAL,)))
    (line,) = (line for line in map(str, found.omissions) if "coupled_breakdown" in line)
    strain = np.array(LEVELS[Direction.AXIAL])[:, None] * model.unit_strain(Direction.AXIAL)
    middle = np.sqrt(strain[0] * strain[-1])
    frequency = np.arange(5.0, 156.0, 10.0)
    whole = model.stiffness("axial", frequency, np.array(LEVELS[Direction.AXIAL])[:, None])
    springpot = 0.5 * 2e5 * (2j * np.pi * frequency) ** 0.24 * model.stiffness_per_modulus(Direction.AXIAL)
    error = np.abs(springpot * ((middle / 0.01) ** -0.3 - (strain / 0.01) ** -0.3) / whole).max()
    assert f"error of the stiffness up to {100.0 * error:.2g} %" in line
    held = next(value for value in found.values if value.name == "m")
    assert held.value == pytest.approx(2e5 * (middle.item() / 0.01) ** -0.3)
    soft = time_model(request_of(paper_model.with_effect("mullins_softening", {"mullins_softening.share": 0.1})))
    assert [line for line in map(str, soft.omissions) if "mullins_softening: error of the stiffness up to" in line]


def test_without_a_compiler_it_is_said_how_to_get_one(paper_model, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    with pytest.raises(OutputError, match="no compiler") as refused:
        export(request_of(paper_model))
    assert refused.value.hint == 'pip install "bushfit[fmu]"'
