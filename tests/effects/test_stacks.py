"""Many models at once answer as they do one after the other, whatever effects they have."""

from collections.abc import Mapping

import numpy as np
import pytest
from random_models import UNDER, operating_point, random_model, sized

from bushfit.effects import Effect, History, qualified
from bushfit.effects.contract import Circumstances
from bushfit.model.model import Model


def stacked(models: list[Model]) -> Mapping[str, np.ndarray]:
    return {name: np.array([[model.values[name]] for model in models]) for name in models[0].parameters}


@pytest.mark.parametrize("beside", [(), ("loop_clock",)], ids=["alone", "in another time each"])
def test_a_stack_of_values_equals_one_after_the_other(
    effect: Effect, beside: tuple[str, ...], rng: np.random.Generator
) -> None:
    plain = random_model(rng)
    direction, _, amplitude = operating_point(plain, rng)
    model = sized(plain, effect.name, direction, amplitude, rng)
    for other in {*beside} - {effect.name}:
        model = sized(model, other, direction, amplitude, rng)
    models = [
        model.with_values({name: value * rng.uniform(0.9, 1.1) for name, value in model.values.items()})
        for _ in range(3)
    ]
    frequency, amplitudes = np.array([0.1, 40.0, 155.0, 155.0]), amplitude * np.array([1.0, 0.5, 1.5, 0.0])
    turns = np.linspace(0.0, 1.0, 4)
    each_point = Circumstances(295.0 + turns, turns, 0.1 * turns, 0.1 * turns, 0.1 - 0.1 * turns)
    both = model.stiffness(direction, frequency, amplitudes, kind="loop", values=stacked(models), under=each_point)
    assert both.shape == (3, 4)
    for row, each in zip(both, models, strict=True):
        for i, one in enumerate(row):
            under = each_point.at(i)
            alone = each.stiffness(direction, frequency[i], amplitudes[i], kind="loop", under=under)
            np.testing.assert_allclose(one, alone, rtol=1e-12)
    phase = np.arange(600) / 200
    motion = amplitude * np.sin(2.0 * np.pi * phase)
    for history in (
        History.steady(motion, 5.0, cycles=3),
        History(motion, 1e-3, periodic=False, frequency=5.0),
    ):
        answer = model.force(direction, history, kind="loop", values=stacked(models), under=UNDER)
        both = np.broadcast_to(answer, (3, 600))
        for row, each in zip(both, models, strict=True):
            expected = each.force(direction, history, kind="loop", under=UNDER)
            np.testing.assert_allclose(row, expected, rtol=1e-10, atol=1e-10 * np.ptp(expected))


@pytest.mark.parametrize("other", ["clearance", "force_saturation", "rig_compliance"])
def test_a_stack_of_its_amount_alone_does_so_in_sweeps(effect: Effect, other: str, rng: np.random.Generator) -> None:
    """What bends the waveform asks whole cycles, in which the amount may act where it does not in the stiffness."""
    plain = random_model(rng)
    direction, _, amplitude = operating_point(plain, rng)
    model = sized(plain, effect.name, direction, amplitude, rng)
    for bending in {other} - {effect.name}:
        model = sized(model, bending, direction, amplitude, rng)
    amount = qualified(effect, effect.amount)
    amounts = model.values[amount] * np.array([0.9, 1.0, 1.1])
    frequency, amplitudes = np.array([0.1, 40.0, 155.0, 155.0]), amplitude * np.array([1.0, 0.5, 1.5, 0.0])
    at = (direction, frequency, amplitudes)
    both = model.stiffness(*at, values={**model.values, amount: amounts[:, None]}, under=UNDER)
    for row, each in zip(np.broadcast_to(both, (3, 4)), amounts, strict=True):
        alone = model.with_values({amount: float(each)}).stiffness(*at, under=UNDER)
        np.testing.assert_allclose(row, alone, rtol=1e-10)
