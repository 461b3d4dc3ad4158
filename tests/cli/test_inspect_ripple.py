"""Fast ripples on a slow motion: the loop is the slow motion, and the ripple is reported. The ripples are simulated."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from shell import CAMPAIGN, Run

from bushfit.effects.contract import Array
from bushfit.model.file import load_result

HEADER = "time [s],displacement [mm],force [N]"


def record(file: Path, time: Array, motion: Array, force: Array) -> None:
    np.savetxt(file, np.column_stack((time, motion, force)), "%.6g", ",", header=HEADER, comments="")


def measured(root: Path) -> tuple[Array, Array, Array]:
    """Time [s], displacement [mm] and force [N] of the paper's loop: three cycles of 1 mm at 0.1 Hz."""
    return tuple(np.loadtxt(root / "data/cmp_15961/loop_axial_1.csv", delimiter=",", skiprows=1).T)


def sine(time: Array, percent: float, frequency: float) -> Array:
    """A ripple in percent of an amplitude of 1 mm."""
    return percent / 100.0 * np.sin(2.0 * np.pi * frequency * time + 0.3)


def inspected(typed: Run, file: str) -> dict[str, object]:
    (seen,) = json.loads(typed("inspect", file, "--json", "--no-plots").stdout)["files"]
    return seen


@pytest.mark.parametrize(
    "ripple",
    [
        *[(percent, frequency) for percent in (0.1, 0.5) for frequency in (5.0, 12.3, 25.0)],
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
        assert float(said[0].split()[4]) == pytest.approx(ripple[0] / 100.0, rel=0.25)


@pytest.mark.parametrize("shape", ["triangle", "trapezoid", "zero to full", "one cycle"])
def test_other_slow_motions_with_a_ripple(typed, tmp_path, shape):
    cycles = {"one cycle": 1.0}.get(shape, 3.0)
    time = np.arange(0.0, 50.0 * cycles, 0.02)
    phase = 0.02 * time
    triangle = 2.0 / np.pi * np.arcsin(np.sin(2.0 * np.pi * phase))
    slow = {
        "triangle": triangle,
        "trapezoid": np.clip(2.0 * triangle, -1.0, 1.0),
        "zero to full": 0.5 - 0.5 * np.cos(2.0 * np.pi * phase),
        "one cycle": np.sin(2.0 * np.pi * phase),
    }[shape]
    scatter = 3e-4 * np.random.default_rng(2).standard_normal(time.size)
    record(tmp_path / "axial.csv", time, slow + sine(time, 0.4, 9.0) + scatter, 300.0 * slow + 20.0 * np.gradient(slow))
    facts = inspected(typed, "axial.csv")["facts"]
    assert facts["cycles"].startswith(f"{cycles:g},")
    assert facts["frequency"].startswith("0.02 Hz")


def test_a_fit_is_the_same_with_a_ripple(bushfit, work, own):
    time, motion, force = measured(own)
    record(own / "data/cmp_15961/loop_axial_1.csv", time, motion + sine(time, 0.5, 25.0), force)
    bushfit("fit", own / CAMPAIGN, "-o", own / "rippled", "--no-plots")
    clean, rippled = (load_result(folder / "model.json") for folder in (work / "model", own / "rippled"))
    assert rippled.quality.nrmse == pytest.approx(clean.quality.nrmse, rel=0.05)
    for name, value in clean.model.values.items():
        assert rippled.model.values[name] == pytest.approx(value, rel=0.02)


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
