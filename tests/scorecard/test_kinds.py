"""What the campaigns are made of: kinds of discrepancy of the size asked for, rubbers of other laws, the rig in time.

Against tables from outside, closed forms, and bushfit's: three roads to one number.
"""

import numpy as np
import pandas as pd
import pytest
from kinds import SIZES, Bench, largest, sized
from lab_campaign import KINDS, RUBBERS, OtherRubber, a_specimen, campaign
from rubber_card import evaluate
from time_rig import DIRECTIONS, Bushing, Rubber, Tests, friction, respond

from bushfit import geometry
from bushfit.effects import BASE
from bushfit.model.model import Model

RUBBER = Rubber(1.09e6, 2.0e5, 0.24, 1.46e4, 1.3e-2)
CMP = Bushing(0.010, 0.018, 0.034)
PHASE = 2.0 * np.pi * np.arange(512) / 512


def a_session() -> Tests:
    """A loop, then two directions of three levels, twice."""
    swept = [
        (f, x / (1 + 3 * direction), direction, level, repeat, False)
        for direction in (0, 1)
        for level, x in enumerate((1e-4, 2e-4, 5e-4))
        for repeat in (1, 2)
        for f in np.arange(5.0, 156.0, 10.0)
    ]
    rows = [(0.1, 1e-3, 0, 0, 1, True), *swept]
    return Tests(CMP, *(np.array(column) for column in zip(*rows, strict=True)))


@pytest.mark.parametrize("name", [name for name, kind in KINDS.items() if kind.in_sizes])
def test_a_kind_comes_in_three_sizes(name):
    """Those that go in steps, rows or cycles, come within a factor of two."""
    for size in SIZES:
        bench = Bench(a_session(), RUBBER, np.random.default_rng(5))
        change = sized(bench, KINDS[name], size)
        found = largest(bench, respond(bench.tests, RUBBER, change), change)
        assert 0.5 * size < found < 2.0 * size


@pytest.mark.parametrize("name", ["", "row_shift"])
def test_the_same_seed_writes_the_same_campaign(name, tmp_path):
    first, second = (campaign(name, 0.04, 3, tmp_path / each) for each in "ab")
    assert first == second
    for file in (tmp_path / "a").iterdir():
        assert file.read_bytes() == (tmp_path / "b" / file.name).read_bytes()


def points(bushing: Bushing, frequency: object, amplitude: object, direction: object) -> Tests:
    f, x, d = (np.atleast_1d(values) for values in np.broadcast_arrays(frequency, amplitude, direction))
    nothing = np.zeros(f.size, int)
    return Tests(bushing, f.astype(float), x.astype(float), d, nothing, nothing + 1, nothing > 0)


def test_it_measures_the_table_of_the_paper_s_bushing(root):
    table = pd.read_csv(root / "data/reference/stiffness_table1.csv")
    direction, frequency, amplitude, stiffness, loss = (table[name].to_numpy() for name in table.columns)
    places = [DIRECTIONS.index(name) for name in direction]
    k = respond(points(CMP, frequency, amplitude, places), RUBBER).stiffness
    assert np.max(np.abs(np.abs(k) / stiffness - 1.0)) < 2e-4
    assert np.max(np.abs(k.imag / k.real - loss)) < 2e-4


def test_it_has_eq_11_of_every_shape(root):
    for inner, outer, length, _, equation in pd.read_csv(root / "data/reference/radial_fe.csv").to_numpy():
        assert Bushing(inner / 1e3, outer / 1e3, length / 1e3).stiffness("radial") == pytest.approx(equation, rel=1e-5)


@pytest.mark.parametrize("seed", range(3))
def test_bushfit_s_closed_form_meets_it(seed):
    bushing, rubber = a_specimen(np.random.default_rng(seed))
    model = Model(geometry.Bushing("any", bushing.inner, bushing.outer, bushing.length), BASE, vars(rubber))
    frequency, amplitude = np.geomspace(0.1, 200.0, 12), np.geomspace(1e-5, 1e-3, 12)
    for number, name in enumerate(DIRECTIONS[:2]):
        measured = respond(points(bushing, frequency, amplitude, number), rubber).stiffness
        closed = model.stiffness(geometry.Direction(name), frequency, amplitude)
        assert np.max(np.abs(measured / closed - 1.0)) < 2e-4


def test_friction_with_further_turns_is_that_walked_from_rest():
    wave = 0.01 * (np.cos(PHASE) + 0.5 * np.cos(3.0 * PHASE))
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


@pytest.mark.parametrize("rubber", RUBBERS)
def test_every_rubber_is_stiffer_when_fast_and_softer_when_far(rubber):
    law = OtherRubber(RUBBERS[rubber](np.random.default_rng(3)), 1e6)
    frequency, amplitude = np.array([5.0, 100.0, 5.0]), np.array([1e-4, 1e-4, 5e-4])
    tests = points(CMP, frequency, amplitude, 0)
    slow, fast, far = respond(tests, law).stiffness
    assert abs(far) < abs(slow) < abs(fast)
    for value in (slow, fast, far):
        assert 0.02 < value.imag / value.real < 0.3


def test_a_campaign_is_evaluated_as_by_its_user():
    misfit, least, covered, half_width = evaluate(("two_springpots", 538641422))
    assert misfit >= 0.999 * least > 0.005
    assert covered > 0.9
    assert 0.005 < half_width < 0.03
