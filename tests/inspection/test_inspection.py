"""Files looked at: what is recognised, that clean files raise nothing, and that each fault is told with its figures."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from looking import NOISE, SEEDS, look, plan, without

from bushfit.campaign.schema import SimulatedLoop, SimulateSettings
from bushfit.errors import BushfitError, FitError
from bushfit.geometry import Direction
from bushfit.inspection.draft import file_text
from bushfit.inspection.opening import inspect
from bushfit.model.model import Model
from bushfit.reading.csvfile import raw_loop_table, raw_sweep_table
from bushfit.reading.measurement import Loop, Sweep
from bushfit.simulation import Undisturbed, measure, undisturbed


@pytest.mark.parametrize("rig", NOISE)
def test_clean_tests_raise_nothing(clean: Undisturbed, tmp_path: Path, rig: str) -> None:
    raised = []
    for seed in range(SEEDS):
        made = measure(clean, plan(seed=seed, **NOISE[rig]))
        for test in (*made.loops, *made.sweeps):
            raised += [f"seed {seed}, {test.name}: {sentence}" for sentence in look(tmp_path, test).looked.odd]
    print(f"{rig} rig: {len(raised)} sentences over {SEEDS} clean campaigns")
    assert raised == []


@pytest.mark.parametrize("rig", NOISE)
def test_clean_loops_without_time_raise_nothing(clean: Undisturbed, tmp_path: Path, rig: str) -> None:
    """Time rebuilt from a noisy motion is uneven at its turning points; rows there are no outliers for it."""
    raised, file = [], tmp_path / "axial.csv"
    for seed in range(SEEDS):
        loops = measure(clean, plan(seed=seed, **NOISE[rig])).loops
        for loop, waveform, frequency in zip(loops, ("sine", "triangle"), ("0.1 Hz", "0.2 Hz"), strict=True):
            raw_loop_table(loop).iloc[:, 1:].to_csv(file, index=False)
            seen = inspect(file, {"frequency": frequency, "waveform": waveform})
            raised += [f"seed {seed}, {waveform}: {sentence}" for sentence in seen.looked.odd]
    print(f"{rig} rig: {len(raised)} sentences over {2 * SEEDS} clean loops without time")
    assert raised == []


def test_a_gap_in_a_loop_without_time_is_told_by_its_motion(loop: Loop, tmp_path: Path) -> None:
    table = raw_loop_table(loop).iloc[:, 1:].drop(index=range(500, 530))
    table.to_csv(tmp_path / "axial.csv", index=False)
    odd = inspect(tmp_path / "axial.csv", {"frequency": "0.1 Hz", "waveform": "sine"}).looked.odd
    assert any("1 gap in the motion, the first after data row 500: the displacement goes from " in line for line in odd)


def test_the_data_of_the_repository_raise_nothing(root: Path) -> None:
    files = [*root.glob("data/cmp_15961*/*.csv"), *root.glob("data/arm_bushing/*.csv")]
    assert len(files) == 8
    assert {file.name: inspect(file, {}).looked.odd for file in files} == {file.name: () for file in files}


def test_practice_campaigns_raise_only_what_is_there(root: Path) -> None:
    """Two of them lag so much that loss factors fall below zero; nothing else is odd in a single file."""
    files = [*root.glob("data/practice/*/*.csv"), *root.glob("data/mystery_mount/*.csv")]
    said = {file: odd for file in files if (odd := inspect(file, {}).looked.odd)}
    assert all("loss factor below zero" in sentence for odd in said.values() for sentence in odd)
    assert len(said) <= 2


def test_a_loop_is_described(loop: Loop, tmp_path: Path) -> None:
    seen = look(tmp_path, replace(loop, force=loop.force + 20.0), "loop_axial_1mm_0.1Hz.csv")
    assert (seen.kind, seen.direction) == ("loop", Direction.AXIAL)
    assert [(column.role, column.unit) for column in seen.columns] == [
        ("time", "s"), ("displacement", "mm"), ("force", "N"),
    ]  # fmt: skip
    assert seen.columns[1].high == pytest.approx(1.0, abs=2e-3)
    facts = seen.looked.facts
    assert facts["cycles"].startswith("3")
    assert facts["frequency"] == "0.1 Hz, a sine"
    assert facts["sampling"] == "even, every 0.01 s, 1000 rows a cycle"
    assert facts["amplitude"] == "1 mm zero-to-peak"
    assert facts["mean force"].startswith("20")
    assert facts["noise"].startswith("0.3 %")
    assert seen.looked.odd == ()


def test_a_triangle_and_torsion_are_recognised(paper_model: Model, tmp_path: Path) -> None:
    test = SimulatedLoop(Direction.TORSION, 0.02, 0.1, cycles=2, waveform="triangle")
    made = measure(undisturbed(paper_model, SimulateSettings(loops=(test,))), SimulateSettings(force_noise=1e-3))
    seen = look(tmp_path, made.loops[0], "x.csv")
    assert seen.direction.is_rotation
    assert seen.looked.facts["frequency"] == "0.1 Hz, a triangle"
    assert seen.looked.facts["amplitude"].endswith("deg zero-to-peak")
    assert seen.looked.odd == ()


def cut_off(values: np.ndarray, share: float) -> np.ndarray:
    return np.minimum(values, share * values.max())


LOOP_FAULTS: dict[str, tuple[Callable[[Loop], Loop], str]] = {
    "saturated force": (lambda x: replace(x, force=cut_off(x.force, 0.8)), "the force is cut off at its top"),
    "saturated displacement": (
        lambda x: replace(x, displacement=np.maximum(x.displacement, 0.9 * x.displacement.min())),
        "the displacement is cut off at its bottom",
    ),
    "drifting force": (
        lambda x: replace(x, force=x.force + 3.0 * x.time / x.time[-1]),
        "the force drifts: its mean goes from",
    ),
    "drifting displacement": (
        lambda x: replace(x, displacement=x.displacement + 2e-5 * x.time / x.time[-1]),
        "the displacement drifts",
    ),
    "still settling": (
        lambda x: replace(x, force=x.force * (1.0 + 0.1 * np.exp(-x.time / 20.0))),
        "the cycles are still settling: the force amplitude goes from",
    ),
    "outlier row": (
        lambda x: replace(x, force=x.force + np.where(np.arange(x.force.size) == 700, 90.0, 0.0)),
        "the force has an outlier at data row 701",
    ),
    "gap": (
        lambda x: replace(x, **{key: np.delete(getattr(x, key), slice(300, 330)) for key in CHANNELS}),
        "1 gap in time, the first after data row 300: 0.31 s without a row",
    ),
    "stuck": (
        lambda x: replace(
            x,
            displacement=np.where(STUCK(x), x.displacement[400], x.displacement),
            force=np.where(STUCK(x), x.force[400], x.force),
        ),
        "30 rows from data row 401 on repeat one displacement and force",
    ),
    "run-in": (
        lambda x: replace(x, displacement=x.displacement * np.where(x.time < 9.9, 0.6, 1.0)),
        "before its steady cycles are left out",
    ),
    "off zero": (
        lambda x: replace(x, displacement=x.displacement + 1e-4),
        "the motion is off zero by 0.1 mm, 10 % of its amplitude",
    ),
    "turned force": (lambda x: replace(x, force=-x.force), "the campaign needs force_sign = -1"),
}
CHANNELS = ("time", "displacement", "force")


def STUCK(x: Loop) -> np.ndarray:  # noqa: N802
    return (np.arange(x.time.size) >= 400) & (np.arange(x.time.size) < 430)


@pytest.mark.parametrize("fault", LOOP_FAULTS)
def test_each_fault_of_a_loop_is_told(loop: Loop, tmp_path: Path, fault: str) -> None:
    spoil, said = LOOP_FAULTS[fault]
    odd = look(tmp_path, spoil(loop)).looked.odd
    print("; ".join(odd))
    assert any(said in sentence for sentence in odd)
    assert len(odd) <= 2


def test_of_a_loop_with_a_whole_cycle_cut_out_the_longer_part_is_described(loop: Loop, tmp_path: Path) -> None:
    seen = look(tmp_path, replace(loop, **{key: np.delete(getattr(loop, key), slice(600, 1600)) for key in CHANNELS}))
    facts, odd = seen.looked.facts, seen.looked.odd
    print(facts["amplitude"], facts["mean displacement"], odd)
    assert float(facts["amplitude"].split()[0]) == pytest.approx(1.0, rel=0.01)
    assert abs(float(facts["mean displacement"].split()[0])) < 0.01
    assert any("1 gap in time" in sentence for sentence in odd)
    assert facts["frequency"] == "0.1 Hz, a sine"
    assert any("rows are missing; of 30 s only 16 to 30 s are used" in sentence for sentence in odd)


def test_a_loop_the_wrong_way_round_is_refused(loop: Loop, tmp_path: Path) -> None:
    with pytest.raises(FitError, match="gives energy"):
        look(tmp_path, replace(loop, force=np.roll(loop.force, 60)))


def spoiled(sweep: Sweep, rows: np.ndarray, factor: complex) -> Sweep:
    return replace(sweep, stiffness=np.where(rows, factor, 1.0) * sweep.stiffness)


def copied(sweep: Sweep) -> Sweep:
    """The second repeat of the smallest level is the first one once more."""
    first, second = ((sweep.amplitude == 1e-4) & (sweep.repeat == number) for number in (1, 2))
    stiffness = sweep.stiffness.copy()
    stiffness[second] = stiffness[first]
    return replace(sweep, stiffness=stiffness)


SWEEP_FAULTS: dict[str, tuple[Callable[[Sweep], Sweep], str]] = {
    "copied block": (copied, "16 rows repeat others digit by digit, the first of them at 5 Hz (data row 1)"),
    "missing frequencies": (
        lambda x: without(x, (x.amplitude == 2e-4) & np.isin(x.frequency, (45.0, 55.0))),
        "0.2 mm, repeat 1, lacks 45, 55 Hz, which most others have",
    ),
    "outlier point": (
        lambda x: spoiled(x, np.arange(x.repeat.size) == 20, 1.15),
        "data row 21 (45 Hz, 0.1 mm, repeat 2) is +1",
    ),
    "block off": (
        lambda x: spoiled(x, (x.amplitude == 5e-4) & (x.repeat == 3), 1.08),
        "0.5 mm, repeat 3 lies +",
    ),
    "drift over repeats": (
        lambda x: replace(x, stiffness=x.stiffness * (1.0 - 0.02 * x.repeat)),
        "|K| drifts by -4",
    ),
    "loss below zero": (
        lambda x: spoiled(x, x.frequency == 155.0, np.exp(-0.4j)),
        "9 points with a loss factor below zero, the first at 155 Hz, 0.1 mm",
    ),
}


@pytest.mark.parametrize("fault", SWEEP_FAULTS)
def test_each_fault_of_a_sweep_is_told(sweep: Sweep, tmp_path: Path, fault: str) -> None:
    spoil, said = SWEEP_FAULTS[fault]
    odd = look(tmp_path, spoil(sweep)).looked.odd
    print("; ".join(odd))
    assert any(said in sentence for sentence in odd)


def test_a_history_points_to_reduce(root: Path) -> None:
    seen = inspect(root / "data/cmp_15961_raw/stepped_sine_axial.csv", {})
    assert seen.kind == "history"
    assert "bushfit reduce" in file_text(seen, root)
    assert tomllib.loads(file_text(seen, root)) == {}
    assert seen.looked.facts["frequencies"] == "5, from 10 to 155 Hz"


@pytest.mark.parametrize(
    ("frequency", "amplitudes", "said"),
    [
        (1.0, (1.0,), None),
        (5.0, (1.0,), "a motion at 5 Hz is taken for a loop"),
        (0.1, (0.2, 0.6, 1.0), "a motion of several amplitudes is taken for a loop"),
    ],
)
def test_one_sine_is_a_loop_however_fast(
    tmp_path: Path, frequency: float, amplitudes: tuple[float, ...], said: str | None
) -> None:
    time = np.arange(0.0, 5.0 * len(amplitudes), 0.005) / frequency
    size = np.asarray(amplitudes)[np.minimum(time * frequency // 5, len(amplitudes) - 1).astype(int)]
    phase = 2.0 * np.pi * frequency * time
    noise = np.random.default_rng(3).standard_normal((2, time.size))
    motion = 1e-3 * (size * np.sin(phase) + 1e-4 * noise[0])
    force = 500.0 * (size * np.sin(phase + 0.1) + 1e-3 * noise[1])
    seen = look(tmp_path, Loop("x", Direction.AXIAL, time, motion, force))
    print(seen.kind, seen.looked.facts, seen.looked.odd)
    assert seen.kind == "loop"
    told = [sentence for sentence in seen.looked.odd if "taken for a loop" in sentence]
    assert [sentence.startswith(said or "") for sentence in told] == [True] * bool(said)
    assert all("bushfit reduce" in sentence for sentence in told)


def damaged(values: np.ndarray, kind: int, random: np.random.Generator) -> np.ndarray:
    """Rows of a file cut out, thinned, mixed up, or with a column that is constant, noisy, coarse or scaled."""
    column = random.integers(values.shape[1])
    match kind:
        case 0:
            return values[: random.integers(1, 60)]
        case 1:
            return values[:: random.integers(2, 400)]
        case 2:
            return values[random.integers(values.shape[0]) :]
        case 3:
            return values[np.sort(random.integers(0, values.shape[0], random.integers(1, 300)))]
        case 4:
            values[:, column] = random.choice([0.0, 1.0, -5.0, 1e30])
        case 5:
            values[:, column] += random.standard_normal(values.shape[0]) * 10.0 ** random.integers(-6, 4)
        case 6:
            values[:, column] *= np.where(random.random(values.shape[0]) < 0.01, 10.0 ** random.integers(-3, 13), 1.0)
        case 7:
            values[:, 1:] = values[:, 1:].round(random.integers(0, 3))
    return values


def test_damaged_files_are_told_or_refused(root: Path, tmp_path: Path) -> None:
    """Whatever a file holds: a look at it, or one of bushfit's errors; no warning of NumPy's, no other exception."""
    files = "cmp_15961/loop_axial_1.csv", "cmp_15961/sweep_axial.csv", "cmp_15961_raw/stepped_sine_axial.csv"
    told = refused = 0
    for seed in range(96):
        random = np.random.default_rng(seed)
        table = pd.read_csv(root / "data" / files[seed % 3])
        rows = damaged(table.to_numpy(dtype=float).copy(), seed // 3 % 8, random)
        pd.DataFrame(rows, columns=list(table)).to_csv(tmp_path / "axial.csv", index=False, float_format="%.9g")
        try:
            told += bool(file_text(inspect(tmp_path / "axial.csv", {})))
        except BushfitError:
            refused += 1
    print(f"{told} told, {refused} refused")
    assert told > 40
    assert refused > 25


def test_a_sweep_in_another_dialect(sweep: Sweep, tmp_path: Path) -> None:
    table = raw_sweep_table(sweep).set_axis(
        ["Frequenz [Hz]", "Amplitude [mm]", "Wiederholung", "Steifigkeit [N/mm]", "Verlustfaktor [-]"], axis=1
    )
    text = table.to_csv(index=False, sep=";", decimal=",", float_format="%.6f")
    (tmp_path / "Kennlinie_radial.csv").write_bytes(text.encode("cp1252"))
    seen = inspect(tmp_path / "Kennlinie_radial.csv", {})
    assert (seen.kind, seen.direction) == ("sweep", Direction.RADIAL)
    assert seen.written["columns parted by"] == "semicolon"
    assert seen.written["decimal mark"] == "comma"
    assert seen.columns[3].low == pytest.approx(pd.to_numeric(table["Steifigkeit [N/mm]"]).min(), rel=1e-5)


def test_rows_of_a_sine_do_not_pass_for_a_triangle(root: Path, tmp_path: Path) -> None:
    """A sine's file without time, of which a rate was stated."""
    from bushfit.geometry import Direction
    from bushfit.inspection.loops import look_at_loop
    from bushfit.reading.loops import read_loop

    lines = (root / "data/arm_bushing/loop_axial_1.csv").read_text(encoding="utf-8").splitlines()
    file = tmp_path / "loop.csv"
    file.write_text("\n".join(line.partition(",")[2] for line in lines), encoding="utf-8")
    wrong = look_at_loop(read_loop(file, Direction.AXIAL, rate=1.2e-4), file)
    right = look_at_loop(read_loop(file, Direction.AXIAL, frequency=0.1, waveform="sine"), file)
    assert any("as those of a sine" in line for line in wrong.odd)
    assert not any("as those of" in line for line in right.odd)
