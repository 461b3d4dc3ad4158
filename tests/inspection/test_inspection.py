"""Inspection of test files: contents, each fault with its figures, and no oddity in clean files."""

import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bushfit.campaign.simulated import SimulatedLoop, SimulatedSweep, SimulateSettings
from bushfit.geometry import Direction, Specimen
from bushfit.inspection.gathering import gather
from bushfit.inspection.opening import inspect_file
from bushfit.inspection.record import Inspection, campaign_tables
from bushfit.reading.measurement import Loop, Sweep
from bushfit.reading.tablefile import to_csv
from bushfit.simulation.exact import ExactTests, simulate_exact
from bushfit.simulation.files import raw_loop_table, raw_sweep_table
from bushfit.simulation.measured import measure, simulate

CHANNELS = ("time", "displacement", "force")
NOISE = {
    "good": {"noise": 1e-3, "force_noise": 5e-4, "displacement_noise": 1e-4},
    "bad": {"noise": 1e-2, "force_noise": 1e-2, "displacement_noise": 2e-3, "gain_error": 5e-3, "phase_error": 5e-3},
}
LOOPS = (
    SimulatedLoop(Direction.AXIAL, 1e-3, 0.1, cycles=3),
    SimulatedLoop(Direction.AXIAL, 3e-4, 0.2, cycles=2, waveform="triangle"),
)
SWEEP = SimulatedSweep(Direction.AXIAL, (1e-4, 2e-4, 5e-4), tuple(float(f) for f in range(5, 156, 10)))


def plan(**settings: float) -> SimulateSettings:
    return SimulateSettings(repeats=3, loops=LOOPS, sweeps=(SWEEP,), **settings)


def look(folder: Path, test: Loop | Sweep, name: str = "axial.csv", above: str = "") -> Inspection:
    """Inspect a test that is written to a file, below the lines `above`."""
    table = raw_sweep_table(test) if isinstance(test, Sweep) else raw_loop_table(test)
    (folder / name).write_bytes(above.encode() + to_csv(table))
    return inspect_file(folder / name, {})


@pytest.fixture(scope="module")
def clean(paper_model) -> ExactTests:
    return simulate_exact(paper_model, plan(), steps_per_cycle=256)


@pytest.fixture
def loop(clean) -> Loop:
    return measure(clean, plan(seed=1, force_noise=3e-3, displacement_noise=2e-4)).loops[0]


@pytest.fixture
def sweep(clean) -> Sweep:
    return measure(clean, plan(seed=1, noise=5e-3, gain_error=2e-3, phase_error=2e-3)).sweeps[0]


def test_a_triangle_in_torsion_about_a_mean_is_described(tmp_path, paper_model):
    """The references of exports contain the same facts on loops with a sine."""
    test = SimulatedLoop(Direction.TORSION, 0.02, 0.1, cycles=2, waveform="triangle")
    made = measure(simulate_exact(paper_model, SimulateSettings(loops=(test,))), SimulateSettings(force_noise=1e-3))
    (loop,) = made.loops
    seen = look(tmp_path, replace(loop, force=loop.force + 0.02 * loop.force.max()), "x.csv")
    assert (seen.direction.is_rotation, seen.facts["frequency"], seen.odd) == (True, "0.1 Hz, a triangle", ())
    assert seen.facts["amplitude"].endswith("deg zero-to-peak")
    assert float(seen.facts["mean moment"].split()[0]) == pytest.approx(0.02 * loop.force.max(), rel=0.05)


def less(loop: Loop, rows: slice) -> Loop:
    """Without some rows."""
    return replace(loop, **{key: np.delete(getattr(loop, key), rows) for key in CHANNELS})


def jumping(loop: Loop, *rows: int) -> Loop:
    """With a force that jumps in some rows."""
    return replace(loop, force=loop.force + np.where(np.isin(np.arange(loop.force.size), rows), 90.0, 0.0))


def stuck(loop: Loop) -> Loop:
    """With 30 rows that repeat one."""
    rows = np.r_[0:400, [400] * 30, 430 : loop.time.size]
    return replace(loop, displacement=loop.displacement[rows], force=loop.force[rows])


LOOP_FAULTS: dict[str, Callable[[Loop], Loop]] = {
    "the force is cut off at its top": lambda x: replace(x, force=np.minimum(x.force, 0.8 * x.force.max())),
    "the displacement is cut off at its bottom": lambda x: replace(
        x, displacement=np.maximum(x.displacement, 0.9 * x.displacement.min())
    ),
    "one cycle takes 170 min, which is unusual; possible causes: axial.csv ran 60 times faster than stated": (
        lambda x: replace(x, time=1000.0 * x.time)
    ),
    "the force drifts: its mean goes from": lambda x: replace(x, force=x.force + 3.0 * x.time / x.time[-1]),
    "the displacement drifts": lambda x: replace(x, displacement=x.displacement - 2e-5 * x.time / x.time[-1]),
    "goes from 489.2 N in the first cycle to 466.4 in the last (-4.7 %)": lambda x: replace(
        x, force=x.force * (1.0 + 0.1 * np.exp(-x.time / 20.0))
    ),
    "the force has an outlier at data row 701": lambda x: jumping(x, 700),
    " and 1 more": lambda x: jumping(x, 100, 700, 1300, 1900),
    "1 gap in time, the first after data row 300: 0.31 s without a row": lambda x: less(x, slice(300, 330)),
    "30 rows from data row 401 on repeat the same displacement and force": stuck,
    "before the steady cycles are left out": lambda x: replace(
        x, displacement=x.displacement * np.where(x.time < 9.9, 0.6, 1.0)
    ),
    "the mean displacement is 0.03 mm, 3 % of its amplitude": lambda x: replace(x, displacement=x.displacement + 3e-5),
    "recorded about a mean displacement of 0.1 mm, but no preload is stated": lambda x: replace(
        x, displacement=x.displacement + 1e-4
    ),
    "a mean displacement of 152 mm without a mean force is taken for the position of the actuator": lambda x: replace(
        x, displacement=x.displacement + 0.152
    ),
    "recorded about a mean force of 820 N, but no preload is stated": lambda x: replace(x, force=x.force + 820.0),
    "the force has the opposite sign and is turned": lambda x: replace(x, force=-x.force),
}


@pytest.mark.parametrize("said", LOOP_FAULTS)
def test_each_fault_of_a_loop_is_told(loop, tmp_path, said):
    odd = [*map(str, look(tmp_path, LOOP_FAULTS[said](loop)).odd)]
    assert any(said in sentence for sentence in odd), odd
    assert len(odd) <= 2


def test_gaps_and_an_uneven_clock_are_described(loop, tmp_path):
    uneven = less(loop, slice(5, None, 10))
    assert look(tmp_path, uneven).facts["sampling"].startswith("uneven, every 0.01 to 0.02 s, mostly 0.01 s")
    seen = look(tmp_path, less(loop, slice(600, 1600)))
    facts, odd = seen.facts, [*map(str, seen.odd)]
    assert float(facts["amplitude"].split()[0]) == pytest.approx(1.0, rel=0.01)
    assert abs(float(facts["mean displacement"].split()[0])) < 0.01
    assert any("1 gap in time" in sentence for sentence in odd)
    assert facts["frequency"] == "0.1 Hz, a sine"
    assert any("rows are missing; of 30 s only 16 to 30 s are used" in sentence for sentence in odd)


def spoiled(sweep: Sweep, rows: np.ndarray, factor: complex) -> Sweep:
    return replace(sweep, stiffness=np.where(rows, factor, 1.0) * sweep.stiffness)


def lacking(sweep: Sweep, rows: np.ndarray) -> Sweep:
    names = ("frequency", "amplitude", "stiffness", "repeat")
    return replace(sweep, **{name: getattr(sweep, name)[~rows] for name in names})


def copied(sweep: Sweep) -> Sweep:
    """The second repeat of the smallest level is the first one once more."""
    first, second = ((sweep.amplitude == 1e-4) & (sweep.repeat == number) for number in (1, 2))
    stiffness = sweep.stiffness.copy()
    stiffness[second] = stiffness[first]
    return replace(sweep, stiffness=stiffness)


SWEEP_FAULTS: dict[str, Callable[[Sweep], Sweep]] = {
    "16 rows equal other rows in all digits, the first at 5 Hz (data row 1)": copied,
    "0.2 mm, repeat 1, lacks 45, 55 Hz, which most other levels contain": lambda x: lacking(
        x, (x.amplitude == 2e-4) & np.isin(x.frequency, (45.0, 55.0))
    ),
    "data row 21 (45 Hz, 0.1 mm, repeat 2) deviates by +1": lambda x: spoiled(x, np.arange(x.repeat.size) == 20, 1.15),
    "0.5 mm, repeat 3 differs by +": lambda x: spoiled(x, (x.amplitude == 5e-4) & (x.repeat == 3), 1.08),
    "|K| drifts by -4": lambda x: replace(x, stiffness=x.stiffness * (1.0 - 0.02 * x.repeat)),
    "9 points with a loss factor below zero, the first at 155 Hz, 0.1 mm: is the force channel late?": (
        lambda x: spoiled(x, x.frequency == 155.0, np.exp(-0.4j))
    ),
    "possible causes: the phases of axial.csv are radians, not degrees (then, in the campaign: [[sweeps]] of axial": (
        lambda x: replace(x, stiffness=np.abs(x.stiffness) * np.exp(1j * np.radians(np.angle(x.stiffness))))
    ),
    "causes: the phases of axial.csv are 90 deg minus the loss angle (then, in the campaign: [[sweeps]] of axial": (
        lambda x: replace(x, stiffness=1j * np.conj(x.stiffness * np.exp(0.2j)))
    ),
}


@pytest.mark.parametrize("said", SWEEP_FAULTS)
def test_each_fault_of_a_sweep_is_told(sweep, tmp_path, said):
    odd = [*map(str, look(tmp_path, SWEEP_FAULTS[said](sweep)).odd)]
    assert any(said in sentence for sentence in odd), odd


@pytest.mark.parametrize(
    ("name", "above", "said"),
    [
        ("loop_axial_1mm_0.1Hz.csv", "Amplitude: 1 mm\nUnits: s, mm, N\n", ()),
        ("axial_18mm_bushing_1,0 mm 10mm_min.csv", "", ()),
        ("axial.csv", "Frequency: 0.2 Hz\n", ("the text above the table states 0.2 Hz, the frequency",)),
        ("axial.csv", "Units: s, mm, kN\n", ('line 1 states "Units: s, mm, kN", the unit of "force [N]" is N',)),
        ("axial.csv", "Sampling rate: 512 Hz\n", ("the text above the table states 512 rows",)),
        ("loop_axial_2mm.csv", "", ("the name states 2 mm, the amplitude is 1 mm zero-to-peak: the name may be p",)),
        (
            "loop_axial_0p5mm_0.2Hz.csv",
            "",
            ("the name states 0.5 mm, the amplitude", "the name states 0.2 Hz, the frequency"),
        ),
    ],
)
def test_labels_are_held_against_the_content(loop, tmp_path, name, above, said):
    odd = [*map(str, look(tmp_path, loop, name, above).odd)]
    assert len(odd) == len(said)
    assert all(sentence.startswith(start) for sentence, start in zip(odd, said, strict=True))


@pytest.mark.parametrize(
    ("name", "stated", "entry", "amplitude"),
    [
        ("axial_A0,1mm", {}, {"at_amplitude": "0.1 mm"}, 1e-4),
        ("axial_0.2mmpp_23C", {}, {"at_amplitude": "0.1 mm", "temperature": "23 degC"}, 1e-4),
        ("axial_0.2mm", {"amplitude": "peak-to-peak"}, {"at_amplitude": "0.1 mm"}, 1e-4),
        ("axial_0.2mmpp", {"amplitude": "zero-to-peak"}, {"at_amplitude": "0.2 mm"}, 2e-4),
        ("axial_0.2mm", {"at_amplitude": "0.1 mm"}, {"at_amplitude": "0.1 mm"}, 1e-4),
    ],
)
def test_an_amplitude_without_a_column_is_read_from_the_name_unless_stated(
    sweep, tmp_path, name, stated, entry, amplitude
):
    file = tmp_path / f"{name}.csv"
    raw_sweep_table(sweep)[sweep.amplitude == 1e-4].drop(columns="amplitude [mm]").to_csv(file, index=False)
    seen = inspect_file(file, stated)
    assert seen.entry == entry
    assert seen.measured.amplitude[0] == pytest.approx(amplitude)
    assert ("from the name" in seen.facts) == ("at_amplitude" not in stated)
    assert (seen.assumed is not None) == (name == "axial_A0,1mm")
    assert bool(seen.odd) == (name == "axial_0.2mm" and "at_amplitude" in stated)
    (tmp_path / "axial.csv").write_text("Sweep of part 7, 0.2 mm peak-to-peak\n" + file.read_text(encoding="utf-8"))
    assert inspect_file(tmp_path / "axial.csv", {}).entry == {"at_amplitude": "0.1 mm"}


@pytest.mark.parametrize(
    ("header", "cells", "name", "strain"),
    [
        ("G' [MPa],G'' [MPa]", "{0},0.2", "shear_0.1%", "engineering"),
        ("E' [MPa],E'' [MPa]", "{0},0.2", "bar_0.1%", "tension"),
        ("Strain [%],Storage Modulus E' [MPa],tan delta [-]", "0.1,{0},0.1", "x", "tension"),
        ("|G*| 0.1% [MPa],|G*| 1% [MPa],tan delta 0.1 %,tan delta 1 %", "{0},0.8,0.1,0.2", "x", "engineering"),
    ],
)
def test_moduli_are_those_of_a_specimen(header, cells, name, strain, tmp_path):
    rows = "\n".join(f"{f},{cells.format(1.2 + f / 1e3)}" for f in range(5, 60, 5))
    (tmp_path / f"{name}.csv").write_text(f"frequency [Hz],{header}\n{rows}\n", encoding="utf-8")
    seen = inspect_file(tmp_path / f"{name}.csv", {"specimen": "DMA"})
    assert seen.direction == Specimen("DMA", "modulus", strain=strain)
    assert seen.entry == {"specimen": "DMA"} | ({"at_amplitude": "0.1 %"} if "%" in name else {})
    assert "the strain is read as" in seen.assumed
    assert inspect_file(tmp_path / f"{name}.csv", {}).direction.name == ("bar" if strain == "tension" else "coupon")


def test_a_temperature_is_stated_for_files_with_several(tmp_path):
    """Of files with one temperature in a column, with several, and without such a column."""
    rows = pd.DataFrame(
        [(f, 0.1, 600 + f, 0.1, t) for t in (10, 25) for f in range(5, 60, 5)],
        columns=["f [Hz]", "amplitude [mm]", "K* [N/mm]", "tan delta", "temperature [degC]"],
    )
    files = {"axial_several": rows, "axial_one": rows[:11], "radial_none": rows[:11].drop(columns="temperature [degC]")}
    for name, table in files.items():
        table.to_csv(tmp_path / f"{name}.csv", index=False)

    def entries() -> dict[str, object]:
        sources, _ = gather([tmp_path], {"temperature": "25 degC"})
        return {source.file.stem: source.inspect().entry for source in sources}

    # it chooses rows of another file, and tells nothing of the one without
    assert entries() == {"axial_several": {"temperature": "25 degC"}, "axial_one": {}, "radial_none": {}}
    (tmp_path / "axial_several.csv").unlink()
    assert entries() == {"axial_one": {}, "radial_none": {"temperature": "25 degC"}}


@pytest.mark.parametrize("rig", NOISE)
@pytest.mark.parametrize("seeds", [4, pytest.param(12, marks=pytest.mark.slow)])
def test_clean_tests_raise_nothing(clean, tmp_path, rig, seeds):
    """Nor do loops without time: rebuilt from a noisy motion it is uneven where the motion turns."""
    raised, file = [], tmp_path / "untimed_axial.csv"
    for seed in range(seeds):
        made = measure(clean, plan(seed=seed, **NOISE[rig]))
        seen = [look(tmp_path, test) for test in (*made.loops, *made.sweeps)]
        for loop, waveform, frequency in zip(made.loops, ("sine", "triangle"), ("0.1 Hz", "0.2 Hz"), strict=True):
            raw_loop_table(loop).iloc[:, 1:].to_csv(file, index=False)
            seen.append(inspect_file(file, {"frequency": frequency, "waveform": waveform}))
        raised += [f"seed {seed}, {one.file.name}: {sentence}" for one in seen for sentence in one.odd]
    assert raised == []


def test_the_data_of_the_repository_raise_only_what_is_there(root):
    """Two practice campaigns lag so much that loss factors fall below zero; nothing else is odd in a single file."""
    sound = [*root.glob("data/cmp_15961*/*.csv"), *root.glob("data/arm_bushing/*.csv")]
    practice = [*root.glob("data/practice/*/*.csv"), *root.glob("data/mystery_mount/*.csv")]
    odd = {file: found for file in (*sound, *practice) if (found := inspect_file(file, {}).odd)}
    assert len(sound) == 8
    assert len(odd) <= 2
    assert not set(odd) & set(sound)
    assert all("loss factor below zero" in sentence for found in odd.values() for sentence in map(str, found))


@pytest.mark.parametrize("frequency", [1.0, 5.0])
def test_one_sine_is_a_loop_however_fast(tmp_path, frequency):
    phase = 2.0 * np.pi * np.arange(0.0, 5.0, 0.005)
    noise = np.random.default_rng(3).standard_normal((2, phase.size))
    motion, force = 1e-3 * np.sin(phase) + 1e-7 * noise[0], 500.0 * np.sin(phase + 0.1) + 0.5 * noise[1]
    seen = look(tmp_path, Loop("x", Direction.AXIAL, phase / (2.0 * np.pi * frequency), motion, force))
    assert seen.kind == "loop"
    odd = [sentence for sentence in map(str, seen.odd) if "if it is a stepped sine, run bushfit reduce" in sentence]
    assert odd == ["a motion at 5 Hz is read as a loop; if it is a stepped sine, run bushfit reduce"] * (
        frequency > 1.0
    )


@pytest.mark.parametrize("timed", [True, False])
def test_a_programme_of_loops_is_described(paper_model, tmp_path, *, timed):
    planned = SimulatedLoop(Direction.AXIAL, cycles=5, amplitudes=(2e-4, 5e-4, 1e-3), frequency=0.1, pause=12.0)
    (record,) = simulate(paper_model, SimulateSettings(seed=1, force_noise=3e-3, loops=(planned,))).loops
    table = raw_loop_table(record)
    (table if timed else table.iloc[:, 1:]).to_csv(tmp_path / "axial.csv", index=False)
    seen = inspect_file(tmp_path / "axial.csv", {} if timed else {"frequency": "0.1 Hz", "waveform": "sine"})
    said = "3 loops in one record: 0.2, 0.5, 1 mm at 0.1 Hz, 4 to 5 cycles used of each; 25 % of the rows left out"
    assert seen.kind == "loop"
    assert seen.facts["programme"] == said
    assert seen.facts["loop 2"].startswith("0.5 mm at 0.1 Hz, a sine; ")
    assert seen.facts["loop 2"].endswith("before the steady cycles are left out; 4 cycles are used")
    seen = look(tmp_path, replace(record, displacement=1e3 * record.displacement))
    assert any(sentence.startswith("amplitude of 200 to 1000 m") for sentence in map(str, seen.odd))
    assert tomllib.loads("\n".join(campaign_tables([seen], tmp_path)))["loops"][0]["file"] == "axial.csv"
