"""Ripples on a slow motion, points far off the curve, and sizes that no test has: simulated, and reported."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commandline import Run
from shell import CAMPAIGN

from bushfit.effects.contract import Array
from bushfit.model.file import load_result

HEADER = "time [s],displacement [mm],force [N]"
FREQUENCY = np.linspace(5.0, 155.0, 10)
SWEEP_HEADER = "frequency [Hz],amplitude [mm],stiffness [N/mm],loss factor [-]"


def record(file: Path, time: Array, motion: Array, force: Array) -> None:
    np.savetxt(file, np.column_stack((time, motion, force)), "%.6g", ",", header=HEADER, comments="")


def measured(root: Path) -> tuple[Array, Array, Array]:
    """Time [s], displacement [mm] and force [N] of the paper's loop: three cycles of 1 mm at 0.1 Hz."""
    return tuple(np.loadtxt(root / "data/cmp_15961/loop_axial_1.csv", delimiter=",", skiprows=1).T)


def sine(time: Array, percent: float, frequency: float) -> Array:
    """A ripple in percent of an amplitude of 1 mm."""
    return percent / 100.0 * np.sin(2.0 * np.pi * frequency * time + 0.3)


def inspected(typed: Run, file: str) -> dict[str, Any]:
    (seen,) = json.loads(typed("inspect", file, "--json", "--no-plots").stdout)["files"]
    return seen


@pytest.mark.parametrize(
    "ripple",
    [
        *[(percent, frequency) for percent in (0.1, 0.5) for frequency in (5.0, 12.3, 25.0, 49.3)],
        *["hunting at the reversals", "ringing after the reversals", "a sensor that flickers at an end stop"],
    ],
    ids=str,
)
def test_a_ripple_is_no_loop(typed, root, tmp_path, ripple):
    time, motion, force = measured(root)
    amplitude = 1.0
    if ripple == "hunting at the reversals":
        motion = motion + np.where(np.abs(motion) > 0.97, sine(time, 0.4, 5.0), 0.0)
    elif ripple == "ringing after the reversals":
        since = (time - 2.5) % 5.0
        motion = motion + np.where(time > 2.5, np.exp(-2.0 * since) * sine(since, 0.4, 8.0), 0.0)
    elif ripple == "a sensor that flickers at an end stop":
        amplitude, sign = 0.9, np.random.default_rng(1).choice([-1.0, 1.0], time.size)
        motion = np.where(np.abs(motion) > 0.9, 0.9 * np.sign(motion) + 0.004 * sign, motion)
    else:
        motion = motion + sine(time, *ripple)
    record(tmp_path / "axial.csv", time, motion, force)
    seen = inspected(typed, "axial.csv")
    assert seen["kind"] == "loop"
    assert seen["facts"]["cycles"].startswith("3,")
    assert seen["facts"]["frequency"].startswith("0.1 Hz")
    assert float(seen["facts"]["amplitude"].split()[0]) == pytest.approx(amplitude, rel=6e-3)
    said = [sentence for sentence in seen["odd"] if sentence.startswith("a ripple of about")]
    assert len(said) == 1
    if isinstance(ripple, tuple):
        assert f"at {ripple[1]:g} Hz" in said[0]
        assert ("mains hum" in said[0]) == (ripple[1] == 49.3)
        assert float(said[0].split()[4]) == pytest.approx(ripple[0] / 100.0, rel=0.25)


def repeated(motion: Array, rest: Array, sets: int) -> Array:
    return np.concatenate([motion, *[np.concatenate((rest, motion))] * (sets - 1)])


@pytest.mark.parametrize("noise", [0.0, 0.005])
@pytest.mark.parametrize(
    ("count", "sets", "rest", "shape"),
    [
        *[(3, 2, seconds, "sine") for seconds in (1.5, 5.0, 10.0, 20.0, 100.0)],
        *[(1, 4, seconds, "sine") for seconds in (1.5, 10.0)],
        (2, 3, 10.0, "triangle"),
        (3, 2, 10.0, "creep"),
        (3, 2, 10.0, "at the top"),
    ],
)
def test_cycles_are_between_rests(typed, tmp_path, count, sets, rest, shape, noise):
    phase = np.arange(0.0, count, 0.002) + 0.25 * (shape == "at the top")
    cycles = np.sin(2.0 * np.pi * phase)
    if shape == "triangle":
        cycles = 2.0 / np.pi * np.arcsin(cycles)
    still = cycles[0] + 0.01 * (shape == "creep") * np.linspace(0.0, 1.0, int(rest / 0.02))
    motion = repeated(cycles, still, sets)
    time, random = 0.02 * np.arange(motion.size), np.random.default_rng(1).standard_normal((2, motion.size))
    force = 500.0 * motion + 80.0 * np.gradient(motion, time)
    record(tmp_path / "axial.csv", time, motion + noise * random[0], force + random[1])
    facts, odd = (inspected(typed, "axial.csv")[key] for key in ("facts", "odd"))
    assert float(facts["cycles"].split(",")[0]) == pytest.approx(count, abs=0.51)
    assert float(facts["frequency"].split()[0]) == pytest.approx(0.1, rel=5e-3)
    assert float(facts["amplitude"].split()[0]) == pytest.approx(1.0, rel=0.01)
    assert any("more of the same amplitude and rate are not" in sentence for sentence in odd)


def test_slow_cycles_before_fast_ones_are_a_loop_too(typed, tmp_path):
    phase = np.concatenate([np.arange(0.0, 3.0, 0.002), np.arange(0.0, 20.0, 0.04)])
    time, motion = 0.02 * np.arange(phase.size), np.sin(2.0 * np.pi * phase)
    record(tmp_path / "axial.csv", time, motion, 500.0 * motion + np.gradient(motion, time))
    assert "2 loops in one record: 1 mm at 0.1, 2 Hz" in inspected(typed, "axial.csv")["facts"]["programme"]


@pytest.mark.parametrize("kind", ["ripple", "rest"])
def test_a_fit_is_the_same_with_a_ripple_or_after_a_rest(bushfit, work, own, kind):
    time, motion, force = measured(own)
    if kind == "ripple":
        motion = motion + sine(time, 0.5, 25.0)
    else:
        relaxing = force[-1] * np.exp(-time[1:1001] / 3.0)
        motion, force = repeated(motion, np.zeros(1000), 2), repeated(force, relaxing, 2)
        time = time[1] * np.arange(motion.size)
    record(own / "data/cmp_15961/loop_axial_1.csv", time, motion, force)
    bushfit("fit", own / CAMPAIGN, "-o", own / kind, "--no-plots")
    clean, changed = (load_result(folder / "model.json") for folder in (work / "model", own / kind))
    assert changed.quality.nrmse == pytest.approx(clean.quality.nrmse, rel=0.05)
    assert dict(changed.model.values) == pytest.approx(dict(clean.model.values), rel=0.02)


def small_tests(levels: Sequence[float], mean: float, wait: float) -> tuple[Array, Array]:
    """A preload, a pause, and ten cycles at 5 Hz of each amplitude [mm]: time [s] and motion [mm]."""
    step = 0.005
    cycles = np.sin(2.0 * np.pi * np.arange(0.0, 10.0, 5.0 * step))
    ramp = mean * np.arange(0.0, 1.0, step / 5.0)
    parts = [ramp, np.full(int(wait / step), mean)]
    for level in levels:
        parts += [mean + level * cycles, np.full(int(1.0 / step), mean)]
    motion = np.concatenate([*parts, ramp[::-1]])
    return step * np.arange(motion.size), motion + 2e-5 * np.random.default_rng(3).standard_normal(motion.size)


@pytest.mark.parametrize(("levels", "mean"), [((0.02,), 5.0), ((0.02, 0.05, 0.1), 5.0), ((0.02, 1.0), 0.0)])
def test_a_small_test_with_time_for_itself_is_read(typed, tmp_path, levels, mean):
    time, motion = small_tests(levels, mean, wait=20.0)
    record(tmp_path / "axial.csv", time, motion, 300.0 * motion + 0.4 * np.gradient(motion, time))
    typed("reduce", "axial.csv", "-o", "x", "--no-plots")
    points = np.genfromtxt(tmp_path / "x/sweep.csv", delimiter=",", names=True, deletechars="", encoding="utf-8")
    names = points.dtype.names or ()
    reached = np.atleast_1d(points[next(name for name in names if "amplitude" in name)])
    assert sorted(reached) == pytest.approx(levels, rel=0.01)


def odd(typed: Run, folder: Path, header: str, stiffness: np.ndarray, frequency: np.ndarray = FREQUENCY) -> list[str]:
    columns = (frequency, np.full(frequency.size, 0.1), stiffness, np.full(frequency.size, 0.1))
    np.savetxt(folder / "axial.csv", np.column_stack(columns), "%.6g", ",", header=header, comments="")
    return inspected(typed, "axial.csv")["odd"]


@pytest.mark.parametrize("row", [0, 1, 5, 9])
@pytest.mark.parametrize("factor", [10.0, 0.1, 1.3])
def test_an_outlier_without_repeats_is_found(typed, tmp_path, row, factor):
    scatter = 1.0 + 2e-3 * np.random.default_rng(row).standard_normal(10)
    stiffness = 594.0 * (FREQUENCY / 5.0) ** 0.06 * scatter
    assert odd(typed, tmp_path, SWEEP_HEADER, stiffness) == []
    stiffness[row] *= factor
    (sentence,) = odd(typed, tmp_path, SWEEP_HEADER, stiffness)
    assert sentence.startswith(f"data row {row + 1} (")
    assert "from the smooth curve through the others" in sentence


def test_a_bent_curve_is_no_outlier(typed, tmp_path):
    frequency = np.geomspace(0.1, 1000.0, 25)
    stiffness = 600.0 + 900.0 / (1.0 + (100.0 / frequency) ** 1.5)
    assert not [line for line in odd(typed, tmp_path, SWEEP_HEADER, stiffness, frequency) if "smooth curve" in line]


@pytest.mark.parametrize(
    ("header", "words"),
    [
        (SWEEP_HEADER.replace("[mm]", "[Mm]"), "amplitude of 1e8 mm"),
        (SWEEP_HEADER.replace("[Hz]", "[MHz]"), "frequency of 5000000 to 1.55e8 Hz"),
        ("frequency [Hz],strain [-],G' [mPa],tan delta [-]", "modulus of"),
        ("frequency [Hz],strain [km/m],G' [MPa],tan delta [-]", "strain of 10000 %"),
    ],
)
def test_a_size_that_no_test_has_is_odd(typed, tmp_path, header, words):
    (sentence,) = odd(typed, tmp_path, header, 500.0 + 0.5 * FREQUENCY)
    assert sentence.startswith(words)
    assert "is the unit in the header right?" in sentence
