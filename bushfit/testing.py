"""Checks of an effect, for authors of effects outside the package, and for the library itself."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from bushfit.effects import BASE, Effect, History, get_effect, qualified_name
from bushfit.effects.contract import RubberConditions
from bushfit.effects.temperature import REFERENCE
from bushfit.geometry import Bushing, Direction
from bushfit.model.file import from_document, to_document
from bushfit.model.model import Model
from bushfit.model.result import Result

#: Conditions of the checks: a warm test, late in the session and after a large strain.
CONDITIONS = RubberConditions(
    temperature=303.0, session_time=0.7, largest_strain=0.08, previous_strain=0.08, rest_time=0.03
)
#: Number of samples of a cycle: the reversal of dry friction falls on a sample only to the accuracy of the sampling.
_SAMPLES = 2**14
#: Function that adds an effect to a model with values at which the effect matters: (model, name of the effect,
#: direction, amplitude [m], random generator) -> model.
AddEffect = Callable[[Model, str, Direction, float, np.random.Generator], Model]


def random_model(rng: np.random.Generator) -> Model:
    """Make a model (elastic, springpot, friction) of a random bushing with random but typical parameters of rubber."""
    inner = rng.uniform(6e-3, 22e-3)
    bushing = Bushing("random", inner, inner * rng.uniform(1.3, 2.2), rng.uniform(20e-3, 70e-3))
    ranges = {"mu": (0.6e6, 2e6), "m": (0.8e5, 3.5e5), "alpha": (0.15, 0.3), "sigma_fmax": (5e3, 3e4)}
    values = {name: rng.uniform(*limits) for name, limits in (ranges | {"eps_half": (7e-3, 2e-2)}).items()}
    return Model(bushing, BASE, values)


def operating_point(model: Model, rng: np.random.Generator) -> tuple[Direction, float, float]:
    """Draw a direction (axial or radial), a frequency from 5 to 155 [Hz], and an amplitude of 0.3 to 6 % strain [m]."""
    direction = list(Direction)[rng.integers(2)]
    frequency, strain = float(rng.uniform(5.0, 155.0)), 10 ** rng.uniform(-2.5, -1.2)
    return direction, frequency, strain / model.unit_strain(direction)


def with_typical_values(model: Model, name: str, rng: np.random.Generator) -> Model:
    """Add an effect with random values of 0.5 to 1.5 times the typical distance from its neutral values.

    Args:
        model: model without the effect.
        name: name of the effect.
        rng: random number generator.
    """
    effect = get_effect(name)
    values = {
        qualified_name(effect, parameter): parameter.value_at_share(rng.uniform(0.5, 1.5))
        for parameter in effect.parameters
    }
    return model.with_effect(name, values)


def check_effect(name: str, *, add: AddEffect | None = None, seed: int = 20240607) -> None:
    """Check that an effect fulfils the contract on which fits, diagnosis and files rely.

    The record must be complete. At the neutral value the effect must vanish, in stiffness and in force. The first
    harmonic of the force over a steady cycle must agree with the stiffness. Arrays of parameter values must give the
    same numbers as single values. A model must survive writing and reading of its file.

    Args:
        name: name of the effect in the library, with installed packages and registered files.
        add: function that adds the effect to a model, with values at which the effect matters; by default
            `with_typical_values`.
        seed: seed of the random bushings, rubbers and operating points.

    Raises:
        AssertionError: the effect breaks the contract; the message says where.
        ModelError: no effect has this name.
    """
    effect, rng = get_effect(name), np.random.default_rng(seed)
    _check_record(effect)
    for _ in range(12):
        plain = random_model(rng)
        direction, frequency, amplitude = operating_point(plain, rng)
        model = add(plain, name, direction, amplitude, rng) if add else with_typical_values(plain, name, rng)
        _check_neutral(plain, effect, direction, amplitude)
        _check_harmonic(model, effect, direction, frequency, amplitude)
    _check_arrays(model, direction, amplitude, rng)
    copy = from_document(json.loads(json.dumps(to_document(Result(model))))).model
    assert (copy.values, {*copy.effects}) == (model.values, {*model.effects}), (
        f"{name}: the effect or its values differ after writing and reading a model file"
    )


def _check_record(effect: Effect) -> None:
    """Check that an effect has a sentence, an equation and a source, and parameters with consistent bounds."""
    assert effect.sentence.endswith((".", ".)")), f"{effect.name}: the sentence has no full stop"
    assert effect.equation, f"{effect.name}: no equation"
    assert effect.source, f"{effect.name}: no source"
    neutral = [parameter for parameter in effect.parameters if parameter.neutral is not None]
    assert neutral, f"{effect.name}: no parameter has a neutral value, at which the effect vanishes"
    for parameter in effect.parameters:
        place, (low, high) = f"{effect.name}.{parameter.name}", parameter.bounds
        assert low < parameter.value_at_share(1.0) < high, f"{place}: the typical value is not inside the bounds"
        assert parameter.log == (parameter.neutral is None), f"{place}: log is for parameters without a neutral value"
        assert low > 0.0 or not parameter.log, f"{place}: the lower bound of a logarithm is not positive"
        assert parameter.neutral is None or low <= parameter.neutral <= high, f"{place}: neutral value outside bounds"


def _check_neutral(plain: Model, effect: Effect, direction: Direction, amplitude: float) -> None:
    """Check that the effect at its neutral value changes nothing, at the reference temperature."""
    neutral = plain.with_effect(effect.name, {qualified_name(effect, effect.amount): effect.amount.value_at_share(0.0)})
    kept = [name for name in plain.effects if name != effect.replaces]
    models = Model.with_defaults(plain.bushing, kept, plain.values), neutral
    conditions = replace(CONDITIONS, temperature=REFERENCE)
    frequency, amplitudes = np.meshgrid([0.1, 5.0, 155.0, 900.0], amplitude * np.array([0.0, 0.1, 1.0, 3.0]))
    triangle = amplitude * np.concatenate([np.linspace(-1.0, 1.0, 300), np.linspace(1.0, -1.0, 300)[1:-1]])
    from_rest = History(triangle + amplitude, 1e-3, periodic=False, frequency=1.0)
    histories = History.steady(triangle, 0.1), History.steady(np.tile(triangle, 3), 0.1, cycles=3), from_rest
    for kind in ("sweep", "loop"):
        first, second = (
            m.stiffness(direction, frequency, amplitudes, kind=kind, conditions=conditions) for m in models
        )
        assert np.array_equal(first, second), f"{effect.name}: the stiffness is changed at the neutral value"
        for history in histories:
            first, second = (m.force(direction, history, kind=kind, conditions=conditions) for m in models)
            assert np.array_equal(first, second), f"{effect.name}: the force is changed at the neutral value"


def _check_harmonic(model: Model, effect: Effect, direction: Direction, frequency: float, amplitude: float) -> None:
    """Check that the first harmonic of the force over a steady sine of displacement equals the stiffness."""
    motion = History.steady(amplitude * np.cos(2.0 * np.pi * np.arange(_SAMPLES) / _SAMPLES), frequency)
    force = model.force(direction, motion, conditions=CONDITIONS)
    harmonic = 2.0 * np.fft.rfft(force)[..., 1] / (_SAMPLES * amplitude)
    stiffness = model.stiffness(direction, frequency, amplitude, conditions=CONDITIONS)
    error = float(np.max(np.abs(harmonic / stiffness - 1.0)))
    expected = effect.harmonic_error + 1e-6
    point = f"{direction}, {frequency:.4g} Hz, {1e3 * amplitude:.4g} mm"
    assert error <= expected, f"{effect.name}: first harmonic and stiffness differ by {error:.2g} at {point}"


def _check_arrays(model: Model, direction: Direction, amplitude: float, rng: np.random.Generator) -> None:
    """Check that arrays of parameter values give the same stiffness and force as single values."""
    models = [
        model.with_values({name: value * rng.uniform(0.9, 1.1) for name, value in model.values.items()})
        for _ in range(3)
    ]
    values = {name: np.array([[one.values[name]] for one in models]) for name in model.parameters}
    frequency, amplitudes = np.array([0.1, 40.0, 155.0, 155.0]), amplitude * np.array([1.0, 0.5, 1.5, 0.0])
    turns = np.linspace(0.0, 1.0, 4)
    conditions = RubberConditions(295.0 + turns, turns, 0.1 * turns, 0.1 * turns, 0.1 - 0.1 * turns)
    together = model.stiffness(direction, frequency, amplitudes, kind="loop", values=values, conditions=conditions)
    assert together.shape == (3, 4), "the stiffness of three sets of values at four points is not of shape (3, 4)"
    for row, one in zip(together, models, strict=True):
        for point, stiffness in enumerate(row):
            at_point = conditions.select(point)
            alone = one.stiffness(direction, frequency[point], amplitudes[point], kind="loop", conditions=at_point)
            np.testing.assert_allclose(stiffness, alone, rtol=1e-12, err_msg="stiffness of arrays of values")
    motion = amplitude * np.sin(2.0 * np.pi * np.arange(600) / 200)
    for history in (History.steady(motion, 5.0, cycles=3), History(motion, 1e-3, periodic=False, frequency=5.0)):
        forces = model.force(direction, history, kind="loop", values=values, conditions=CONDITIONS)
        for row, one in zip(np.broadcast_to(forces, (3, 600)), models, strict=True):
            alone = one.force(direction, history, kind="loop", conditions=CONDITIONS)
            np.testing.assert_allclose(row, alone, rtol=1e-10, atol=1e-10 * np.ptp(alone), err_msg="force of arrays")
