"""What is stepped in a sweep, and the levels of amplitudes as they were reached."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bushfit.reading.runs import nominal, runs_of

AMPLITUDES = np.geomspace(1e-5, 1e-3, 15)
FREQUENCIES = np.array([5.0, 20.0, 80.0])


def swept(amplitudes: np.ndarray, frequencies: np.ndarray, repeats: int, scatter: float, seed: int) -> list[np.ndarray]:
    """Frequency, amplitude reached, amplitude meant and repeat of amplitude sweeps, in the order they were recorded."""
    random = np.random.default_rng(seed)
    frequency, repeat, meant = (
        axis.ravel() for axis in np.meshgrid(frequencies, np.arange(1, repeats + 1), amplitudes, indexing="ij")
    )
    return [frequency, meant * (1.0 + scatter * random.uniform(-1.0, 1.0, meant.size)), meant, repeat]


@given(st.integers(1, 3), st.sampled_from([0.0, 1e-3, 0.01, 0.03, 0.08]), st.integers(0, 10_000), st.booleans())
def test_amplitude_sweeps_as_reached_have_their_levels_back(repeats, scatter, seed, numbered):
    frequency, reached, meant, repeat = swept(AMPLITUDES, FREQUENCIES, repeats, scatter, seed)
    runs = runs_of(frequency, reached, repeat if numbered else None)
    assert runs.stepped == "amplitude"
    assert np.array_equal(runs.repeat, repeat)
    assert np.unique(runs.amplitude).size == AMPLITUDES.size
    assert np.allclose(runs.amplitude, meant, rtol=scatter + 1e-12)


@pytest.mark.parametrize("order", ["by amplitude", "shuffled"])
def test_repeats_in_any_order_have_their_levels_back(order):
    """Levels that miss by less than 4 % at each frequency, and by more over all of them."""
    frequency, reached, meant, _ = swept(AMPLITUDES, FREQUENCIES, 3, 0.035, 7)
    reached = reached * np.where(frequency == 80.0, 0.95, 1.0)
    rows = np.lexsort((reached, frequency))
    rows = rows if order == "by amplitude" else np.random.default_rng(1).permutation(rows)
    runs = runs_of(frequency[rows], reached[rows], None)
    assert runs.stepped == "amplitude"
    assert np.unique(runs.amplitude).size == AMPLITUDES.size
    assert np.allclose(runs.amplitude, meant[rows], rtol=0.05)
    assert np.bincount(runs.repeat).tolist() == [0, 45, 45, 45]
    of_uneven = runs_of(frequency[rows][1:], reached[rows][1:], None)
    assert np.array_equal(of_uneven.amplitude, reached[rows][1:])


@given(st.permutations(["level", "repeat"]), st.booleans(), st.booleans(), st.floats(0.01, 1.0), st.integers(0, 10_000))
def test_frequency_sweeps_as_reached_have_their_levels_and_repeats_back(outer, falling, numbered, share, seed):
    """Three levels in three repeats, in either order: what each run reached at one frequency it reached at no other.

    With numbered repeats they may miss by a tenth, without by 6 %: 1 in 100 is not told apart at 8 %.
    """
    scatter = share * (0.1 if numbered else 0.06)
    frequencies = np.arange(5.0, 156.0, 10.0)[:: -1 if falling else 1]
    axes = {"level": np.array([1e-4, 2e-4, 5e-4]), "repeat": np.arange(1, 4), "frequency": frequencies}
    names = [*outer, "frequency"]
    grid = dict(zip(names, np.meshgrid(*(axes[name] for name in names), indexing="ij"), strict=True))
    level, repeat, frequency = (grid[name].ravel() for name in axes)
    reached = level * (1.0 + scatter * np.random.default_rng(seed).uniform(-1.0, 1.0, level.size))
    runs = runs_of(frequency, reached, repeat if numbered else None)
    assert runs.stepped == "frequency"
    assert np.array_equal(runs.repeat, repeat)
    assert np.unique(runs.amplitude).size == 3
    assert np.allclose(runs.amplitude, level, rtol=scatter + 1e-12)


def test_a_mass_on_a_mount_holds_neither_and_each_pass_is_a_run():
    frequency = np.tile(np.linspace(100.0, 300.0, 50), 2)
    amplitude = 1e-5 / (1.0 + ((frequency - 200.0) / 20.0) ** 2) * np.repeat([1.0, 3.0], 50)
    runs = runs_of(frequency, amplitude, None)
    assert runs.stepped is None
    assert np.array_equal(runs.repeat, np.repeat([1, 2], 50))
    assert np.array_equal(runs.amplitude, amplitude)


def test_amplitudes_that_nothing_groups_are_their_own_levels_and_one_that_falls_short_is_one_run():
    for amplitudes in (np.geomspace(1e-5, 1e-3, 40), [1e-4, 1.1e-4, 1.48e-4, 1.63e-4], [1e-4, 2e-4, 5e-4], [1e-4]):
        assert np.array_equal(nominal(np.array(amplitudes)), amplitudes)
    frequency = np.geomspace(0.01, 100.0, 28)
    runs = runs_of(frequency, 0.15 * frequency**-0.03, None)
    assert runs.stepped == "frequency"
    assert np.unique(runs.amplitude).size == 1


@pytest.mark.parametrize("stepped", ["frequency", "amplitude"])
@pytest.mark.parametrize("counts", [(4, 8), (5, 5), (15, 8), (15, 15), (8, 40)], ids=str)
@pytest.mark.parametrize("repeats", [1, 2])
def test_the_order_of_the_rows_tells_what_is_stepped(stepped, counts, repeats):
    levels, steps = np.geomspace(1e-5, 1e-3, counts[0]), np.geomspace(5.0, 150.0, counts[1])
    axes = (levels, np.arange(repeats), steps) if stepped == "frequency" else (steps, np.arange(repeats), levels)
    held, _, step = (axis.ravel() for axis in np.meshgrid(*axes, indexing="ij"))
    frequency, amplitude = (step, held) if stepped == "frequency" else (held, step)
    assert runs_of(frequency, amplitude, None).stepped == stepped


def test_a_table_of_three_amplitudes_that_was_sorted_by_frequency_steps_the_frequency():
    frequency, amplitude = (axis.ravel() for axis in np.meshgrid(np.arange(5.0, 156.0, 10.0), [1e-4, 2e-4, 5e-4]))
    order = np.lexsort((amplitude, frequency))
    assert runs_of(frequency[order], amplitude[order], None).stepped == "frequency"
    assert runs_of(frequency[order], amplitude[order], None, "amplitude").stepped == "amplitude"
