"""Sweeps from files: every pair of columns gives the same stiffness, and every kind of damage has its one error."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from texts import SWEEP, SWEEP_HEADER, SWEEP_ROWS, refused, sweep_from

from bushfit.geometry import Specimen
from bushfit.reading.measurement import Sweep
from bushfit.reading.runs import runs_of

ONE_LEVEL = "\n".join(["frequency [Hz],stiffness [N/mm],loss factor [-]", *(f"{f},{500 + f},0.1" for f in (5, 15, 25))])
ONE_FREQUENCY = "\n".join(
    ["amplitude [mm],stiffness [N/mm],loss factor [-]", *(f"0.{a},{500 + a},0.1" for a in (1, 2, 5))]
)
DMA, TENSOR = Specimen("DMA", "modulus"), Specimen("DMA", "modulus", strain="tensor")
PHASE = SWEEP.replace("loss factor [-]", "phase [deg]")
AMPLITUDES = np.geomspace(1e-5, 1e-3, 15)
FREQUENCIES = np.array([5.0, 20.0, 80.0])


def test_repeats_and_errors_of_the_points_are_read(tmp_path):
    doubled = "\n".join([SWEEP_HEADER, *SWEEP_ROWS, *SWEEP_ROWS])
    assert sweep_from(doubled, tmp_path).repeat.tolist() == [1] * 8 + [2] * 8
    stated = "\n".join([SWEEP_HEADER + ",repeat", *(f"{row},3" for row in SWEEP_ROWS)])
    assert set(sweep_from(stated, tmp_path).repeat) == {3}
    stated = sweep_of(SWEEP_HEADER + ",relative error [%]", [f"{row},0.5" for row in SWEEP_ROWS], tmp_path)
    np.testing.assert_allclose(stated.relative_error, 0.005)
    assert sweep_from(SWEEP, tmp_path).relative_error is None


#: |K|, loss factor, phase, K' and K'' of the same stiffness, rounded as files are.
ALL_PAIRS = "\n".join(
    [
        f"{SWEEP_HEADER},phase [deg],K' [N/mm],K'' [N/mm]",
        *(
            f"{5 + 10 * i},0.1,{abs(k):.1f},{k.imag / k.real:.3f},"
            f"{np.degrees(np.angle(k)):.1f},{k.real:.0f},{k.imag:.0f}"
            for i, k in enumerate(np.array([600.0, 610.0, 620.0, 630.0]) * np.exp(0.11j))
        ),
    ]
)


def test_columns_that_say_the_same_may_be_rounded_and_losses_be_negative(tmp_path):
    stiffness = sweep_from(ALL_PAIRS, tmp_path).stiffness
    np.testing.assert_allclose(stiffness, 1e3 * np.array([600.0, 610.0, 620.0, 630.0]) * np.exp(0.11j), rtol=1e-3)
    assert np.array_equal(sweep_from(ALL_PAIRS.replace(",6.", ",-6."), tmp_path).stiffness, stiffness)
    # A delay of 0.1 ms takes 0.1 rad at 155 Hz from a loss factor of 0.08.
    assert np.median(sweep_from(SWEEP.replace("0.1\n", "-0.002\n"), tmp_path).stiffness.imag) < 0.0
    frequency = np.linspace(5.0, 155.0, 16)
    loss = np.tan(np.arctan(0.08) - 2.0 * np.pi * frequency * 1e-4)
    text = "\n".join([SWEEP_HEADER, *(f"{f},0.1,600,{eta:.5f}" for f, eta in zip(frequency, loss, strict=True))])
    assert (sweep_from(text, tmp_path).stiffness.imag < 0.0).any()


def sweep_of(header: str, rows: Iterable[str], folder: Path, **stated: Any) -> Sweep:
    return sweep_from("\n".join([header, *rows]), folder, **stated)


def test_what_a_file_has_no_column_for_is_stated(tmp_path):
    assert set(sweep_from(ONE_LEVEL, tmp_path, at_amplitude=2e-4).amplitude) == {2e-4}
    assert set(sweep_from(ONE_LEVEL, tmp_path, at_amplitude=2e-4, amplitude="peak-to-peak").amplitude) == {1e-4}
    assert set(sweep_from(ONE_FREQUENCY, tmp_path, at_frequency=10.0).frequency) == {10.0}
    near = "\n".join([SWEEP_HEADER, "5,0.098,600,0.1", "15,0.104,610,0.1", "25,0.1,620,0.1"])
    np.testing.assert_allclose(sweep_from(near, tmp_path, at_amplitude=1e-4).amplitude_reached, [9.8e-5, 1.04e-4, 1e-4])
    doubled = near.replace("amplitude [mm]", "amplitude p-p [mm]")
    assert sweep_from(doubled, tmp_path, at_amplitude=5e-5).amplitude_reached[0] == pytest.approx(4.9e-5)


@pytest.mark.parametrize(
    ("level", "reached", "factor"),
    [("amplitude", "p-p", 0.5), ("amplitude p-p", "", 0.5), ("amplitude p-p", "p-p", 0.5), ("amplitude", "", 1.0)],
)
def test_amplitudes_reached_count_as_their_header_says_or_else_as_the_levels(tmp_path, level, reached, factor):
    header = f"frequency [Hz],{level} [mm],amplitude reached {reached} [mm],stiffness [N/mm],loss factor [-]"
    sweep = sweep_of(header, ["5,0.1,0.099,600,0.1", "15,0.1,0.1,610,0.1", "25,0.1,0.101,620,0.1"], tmp_path)
    np.testing.assert_allclose(sweep.amplitude_reached, factor * np.array([9.9e-5, 1e-4, 1.01e-4]))


#: A simulated strain sweep, in the form of a DMA's export.
COUPON = "\n".join(
    [
        "run,freq_hz,temperature_C,G_storage_pa,G_loss_pa,G_abs_pa,tan_delta,force_dyn_N,strain_dyn_pct",
        *(
            f"sd,10,{t},{g.real},{g.imag},{abs(g)},{g.imag / g.real},1.5,{e}"
            for e, g, t in ((0.011, 5.2e6 + 4e5j, 22.1), (0.1, 4.5e6 + 5e5j, 22.3), (1.1, 3.1e6 + 6e5j, 22.2))
        ),
    ]
)


def test_a_coupon_gives_strain_and_modulus(tmp_path):
    sweep = sweep_from(COUPON, tmp_path, direction=DMA)
    np.testing.assert_allclose(sweep.amplitude, [1.1e-4, 1e-3, 1.1e-2])
    np.testing.assert_allclose(sweep.stiffness, [5.2e6 + 4e5j, 4.5e6 + 5e5j, 3.1e6 + 6e5j])
    assert sweep.source.conditions == {"temperature_degC": 22.2}
    np.testing.assert_allclose(sweep_from(COUPON, tmp_path, direction=TENSOR).amplitude, [2.2e-4, 2e-3, 2.2e-2])
    without = "\n".join(line.rpartition(",")[0] for line in COUPON.splitlines())
    assert set(sweep_from(without, tmp_path, direction=TENSOR, at_amplitude=1e-3).amplitude) == {2e-3}


def at_temperatures(*temperatures: float, unit: str = "degC") -> str:
    rows = [f"{f},0.1,{500 + f + t:.3f},0.1,{t}" for t in temperatures for f in (5, 15, 25)]
    return "\n".join([f"{SWEEP_HEADER},Temperature [{unit}]", *rows])


def test_the_rows_at_a_stated_temperature_are_taken_with_their_repeats(tmp_path):
    text = at_temperatures(-10.0, 18.4, 25.2)
    for stated, offset in ((291.55, 18.4), (300.0, 25.2)):
        sweep = sweep_from(text, tmp_path, temperature=stated)
        np.testing.assert_allclose(np.abs(sweep.stiffness) * 1e-3, [505 + offset, 515 + offset, 525 + offset])
    assert set(sweep.repeat) == {1}
    rows = [f"{f},0.1,{500 + f},0.1,{t},{n}" for n, t in ((1, -10), (2, 23), (3, 23)) for f in (5, 15, 25)]
    numbered = sweep_of(f"{SWEEP_HEADER},Temperature [degC],repeat", rows, tmp_path, temperature=296.15)
    assert numbered.repeat.tolist() == [2, 2, 2, 3, 3, 3]


@pytest.mark.parametrize(
    ("text", "stated", "words"),
    [
        (SWEEP, {"direction": DMA}, ["line 1", "test of displacement and force or stiffness", 'kind = "shear"']),
        (COUPON.replace("_dyn_pct", ""), {"direction": DMA}, ["the amplitude has no unit", 'write "strain [%]"']),
        (
            PHASE.replace("0.1\n", "-6.5\n"),
            {"phase_sign": 1},
            ["the loss has the opposite sign", '"phase [deg]"', "8 of 8", "phase_sign = -1"],
        ),
    ],
)
def test_what_is_stated_must_fit_the_file(text, stated, words, tmp_path):
    """Other mistakes are in tests/files/spoiled/tables.toml."""
    with refused("sweep.csv", *words):
        sweep_from(text, tmp_path, **stated)


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
