"""The rig in time against tables from outside and bushfit's closed forms: three roads to one stiffness."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from lab_campaign import a_specimen
from time_rig import DIRECTIONS, Bushing, Rubber, Tests, friction, respond, springpot

from bushfit import geometry
from bushfit.effects import BASE
from bushfit.model.model import Model

TABLE_1 = Rubber(1.09e6, 2.0e5, 0.24, 1.46e4, 1.3e-2)
CMP = Bushing(0.010, 0.018, 0.034)


def points(bushing: Bushing, frequency: object, amplitude: object, direction: object) -> Tests:
    f, x, d = (np.atleast_1d(values) for values in np.broadcast_arrays(frequency, amplitude, direction))
    nothing = np.zeros(f.size, int)
    return Tests(bushing, f.astype(float), x.astype(float), d, nothing, nothing + 1, nothing > 0)


def test_it_measures_the_table_of_the_paper_s_bushing(root: Path) -> None:
    table = pd.read_csv(root / "data/reference/stiffness_table1.csv")
    direction, frequency, amplitude, stiffness, loss = (table[name].to_numpy() for name in table.columns)
    places = [DIRECTIONS.index(name) for name in direction]
    k = respond(points(CMP, frequency, amplitude, places), TABLE_1).stiffness
    assert np.max(np.abs(np.abs(k) / stiffness - 1.0)) < 2e-4
    assert np.max(np.abs(k.imag / k.real - loss)) < 2e-4


def test_it_has_eq_11_of_every_shape(root: Path) -> None:
    for inner, outer, length, _, equation in pd.read_csv(root / "data/reference/radial_fe.csv").to_numpy():
        assert Bushing(inner / 1e3, outer / 1e3, length / 1e3).stiffness("radial") == pytest.approx(equation, rel=1e-5)


@pytest.mark.parametrize("seed", range(3))
def test_bushfit_s_closed_form_meets_it(seed: int) -> None:
    bushing, rubber = a_specimen(np.random.default_rng(seed))
    model = Model(geometry.Bushing("any", bushing.inner, bushing.outer, bushing.length), BASE, vars(rubber))
    frequency, amplitude = np.geomspace(0.1, 200.0, 12), np.geomspace(1e-5, 1e-3, 12)
    for number, name in enumerate(DIRECTIONS[:2]):
        measured = respond(points(bushing, frequency, amplitude, number), rubber).stiffness
        closed = model.stiffness(geometry.Direction(name), frequency, amplitude)
        assert np.max(np.abs(measured / closed - 1.0)) < 2e-4


def test_the_springpot_s_sum_over_the_past_is_that_of_eq_3() -> None:
    """Weights one by one from rest, over many cycles: what is left of the start fades as a power of time.

    3/2 - 2z + z^2/2 = 3/2 (1 - z)(1 - z/3): the weights of Eq. 3 twice, the second time of z/3.
    """
    alpha, count, cycles = 0.3, 256, 60
    wave = -np.cos(2.0 * np.pi * np.arange(count) / count) + 0.3 * np.sin(6.0 * np.pi * np.arange(count) / count)
    j = np.arange(1, count * cycles)
    euler = np.concatenate([[1.0], np.cumprod((j - 1.0 - alpha) / j)])
    start = np.convolve(euler, euler * (1.0 / 3.0) ** np.arange(euler.size))[: euler.size] * 1.5**alpha
    stress = np.convolve(start, np.tile(wave, cycles))[count * (cycles - 1) : count * cycles] * (count * 7.0) ** alpha
    steady = springpot(wave[None, :], np.array([7.0]), 1.0, alpha)[0]
    assert np.max(np.abs(stress - steady)) < 2e-3 * np.max(np.abs(steady))


def test_friction_with_further_turns_is_that_walked_from_rest() -> None:
    phase = 2.0 * np.pi * np.arange(512) / 512
    wave = 0.01 * (np.cos(phase) + 0.5 * np.cos(3.0 * phase))
    largest, half = 2.0e4, 0.008
    turn, turned, before, stress, sense = 0.0, 0.0, 0.0, 0.0, 0.0
    walked = []
    for value in np.tile(wave, 60):
        now = np.sign(value - before)
        if now and now != sense:
            turn, turned, sense = before, stress, now
        gone = value - turn
        if sense:
            stress = turned + gone * (largest - sense * turned) / (
                half * (1.0 - sense * turned / largest) + sense * gone
            )
        walked.append(stress)
        before = value
    assert np.allclose(friction(wave[None, :], largest, half)[0], walked[-512:], atol=1e-5 * largest)
