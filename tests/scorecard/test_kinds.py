"""What the campaigns are made of: kinds of discrepancy of the size asked for, rubbers of other laws, the rig in time.

Against tables from outside, closed forms, and bushfit's: three roads to one number.
"""

import numpy as np
import pandas as pd
import pytest
from kinds import SIZES, Bench, largest, sized
from lab_campaign import KINDS
from rubber_card import evaluate
from time_rig import DIRECTIONS, Bushing, Rubber, Tests, respond

RUBBER = Rubber(1.09e6, 2.0e5, 0.24, 1.46e4, 1.3e-2)
CMP = Bushing(0.010, 0.018, 0.034)


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


def test_a_campaign_is_evaluated_as_by_its_user():
    misfit, least, covered, half_width = evaluate(("two_springpots", 538641422))
    assert misfit >= 0.999 * least > 0.005
    assert covered > 0.9
    assert 0.005 < half_width < 0.03
