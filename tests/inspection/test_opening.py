"""Files opened and gathered: which hold tests, what is said of the others, and that clean files raise nothing."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from looking import NOISE, SEEDS, look, plan

from bushfit.campaign.schema import SimulatedLoop, SimulateSettings
from bushfit.errors import BushfitError
from bushfit.geometry import Direction, Specimen
from bushfit.inspection.draft import file_text
from bushfit.inspection.gathering import gather
from bushfit.inspection.opening import inspect
from bushfit.model.model import Model
from bushfit.reading.measurement import Loop, Sweep
from bushfit.reading.rawtable import raw_loop_table, raw_sweep_table
from bushfit.simulation.measured import measure, simulate
from bushfit.simulation.undisturbed import Undisturbed


def held(sweep: Sweep, file: Path, level: float = 1e-4, drop: str = "amplitude [mm]") -> Path:
    table = raw_sweep_table(sweep)[sweep.amplitude == level].drop(columns=drop)
    table.to_csv(file, index=False)
    return file


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
    sweep: Sweep, tmp_path: Path, name: str, stated: dict[str, str], entry: dict[str, str], amplitude: float
) -> None:
    seen = inspect(held(sweep, tmp_path / f"{name}.csv"), stated)
    assert seen.entry == entry
    assert seen.measured.amplitude[0] == pytest.approx(amplitude)
    assert ("from its name" in seen.facts) == ("at_amplitude" not in stated)
    assert (seen.assumed is not None) == (name == "axial_A0,1mm")
    overruled = name == "axial_0.2mm" and "at_amplitude" in stated
    assert bool(seen.odd) == overruled


@pytest.mark.parametrize(
    ("header", "cells", "name", "strain"),
    [
        ("G' [MPa],G'' [MPa]", "{0},0.2", "shear_0.1%", "engineering"),
        ("E' [MPa],E'' [MPa]", "{0},0.2", "bar_0.1%", "tension"),
        ("Strain [%],Storage Modulus E' [MPa],tan delta [-]", "0.1,{0},0.1", "x", "tension"),
        ("Strain [%],E' [MPa],Phase angle [deg]", "0.1,{0},5.7", "x", "tension"),
        ("E* 0.1 % [MPa],E* 1 % [MPa],tan delta 0.1 %,tan delta 1 %", "{0},0.8,0.1,0.2", "x", "tension"),
        ("|G*| 0.1% [MPa],|G*| 1% [MPa],tan delta 0.1 %,tan delta 1 %", "{0},0.8,0.1,0.2", "x", "engineering"),
    ],
)
def test_moduli_are_those_of_a_specimen(header: str, cells: str, name: str, strain: str, tmp_path: Path) -> None:
    rows = "\n".join(f"{f},{cells.format(1.2 + f / 1e3)}" for f in range(5, 60, 5))
    (tmp_path / f"{name}.csv").write_text(f"frequency [Hz],{header}\n{rows}\n", encoding="utf-8")
    seen = inspect(tmp_path / f"{name}.csv", {"specimen": "DMA"})
    assert seen.direction == Specimen("DMA", "modulus", strain=strain)
    assert seen.entry == {"specimen": "DMA"} | ({"at_amplitude": "0.1 %"} if "%" in name else {})
    assert "its strain is taken as" in seen.assumed
    assert inspect(tmp_path / f"{name}.csv", {}).direction.name == ("bar" if strain == "tension" else "coupon")


@pytest.mark.parametrize("text", ["0 mm", "-0.1 mm", "0.1", "0.1 N", "wide"])
def test_an_amplitude_that_is_none_is_refused(sweep: Sweep, tmp_path: Path, text: str) -> None:
    with pytest.raises(BushfitError, match=r"axial\.csv, at_amplitude: "):
        inspect(held(sweep, tmp_path / "axial.csv"), {"at_amplitude": text})


def test_a_temperature_is_stated_for_files_with_several(tmp_path: Path) -> None:
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
    with pytest.raises(BushfitError, match=r"several temperatures(.|\n)*temperature = "):
        inspect(tmp_path / "axial_several.csv", {})
    (tmp_path / "axial_several.csv").unlink()
    assert entries() == {"axial_one": {}, "radial_none": {"temperature": "25 degC"}}


@pytest.mark.parametrize("rig", NOISE)
@pytest.mark.parametrize("seeds", SEEDS)
def test_clean_tests_raise_nothing(clean: Undisturbed, tmp_path: Path, rig: str, seeds: int) -> None:
    """Nor do loops without time: rebuilt from a noisy motion it is uneven where the motion turns."""
    raised, file = [], tmp_path / "untimed_axial.csv"
    for seed in range(seeds):
        made = measure(clean, plan(seed=seed, **NOISE[rig]))
        seen = [look(tmp_path, test) for test in (*made.loops, *made.sweeps)]
        for loop, waveform, frequency in zip(made.loops, ("sine", "triangle"), ("0.1 Hz", "0.2 Hz"), strict=True):
            raw_loop_table(loop).iloc[:, 1:].to_csv(file, index=False)
            seen.append(inspect(file, {"frequency": frequency, "waveform": waveform}))
        raised += [f"seed {seed}, {one.file.name}: {sentence}" for one in seen for sentence in one.odd]
    assert raised == []


def test_a_gap_in_a_loop_without_time_is_told_by_its_motion(loop: Loop, tmp_path: Path) -> None:
    table = raw_loop_table(loop).iloc[:, 1:].drop(index=range(500, 530))
    table.to_csv(tmp_path / "axial.csv", index=False)
    odd = inspect(tmp_path / "axial.csv", {"frequency": "0.1 Hz", "waveform": "sine"}).odd
    assert any("1 gap in the motion, the first after data row 500: the displacement goes from " in line for line in odd)


def test_the_data_of_the_repository_raise_only_what_is_there(root: Path) -> None:
    """Two practice campaigns lag so much that loss factors fall below zero; nothing else is odd in a single file."""
    sound = [*root.glob("data/cmp_15961*/*.csv"), *root.glob("data/arm_bushing/*.csv")]
    practice = [*root.glob("data/practice/*/*.csv"), *root.glob("data/mystery_mount/*.csv")]
    odd = {file: found for file in (*sound, *practice) if (found := inspect(file, {}).odd)}
    assert len(sound) == 8
    assert len(odd) <= 2
    assert not set(odd) & set(sound)
    assert all("loss factor below zero" in sentence for found in odd.values() for sentence in found)


@pytest.mark.parametrize(
    ("frequency", "amplitudes", "said"),
    [
        (1.0, (1.0,), None),
        (5.0, (1.0,), "a motion at 5 Hz is taken for a loop"),
        (0.1, (0.2, 0.6, 1.0), None),
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
    assert seen.kind == "loop"
    told = [sentence for sentence in seen.odd if "taken for a loop" in sentence]
    assert [sentence.startswith(said or "") for sentence in told] == [True] * bool(said)
    assert all("bushfit reduce" in sentence for sentence in told)


@pytest.mark.parametrize("timed", [True, False])
def test_a_programme_of_loops_is_described(paper_model: Model, tmp_path: Path, *, timed: bool) -> None:
    planned = SimulatedLoop(Direction.AXIAL, cycles=5, amplitudes=(2e-4, 5e-4, 1e-3), frequency=0.1, pause=12.0)
    (record,) = simulate(paper_model, SimulateSettings(seed=1, force_noise=3e-3, loops=(planned,))).loops
    table = raw_loop_table(record)
    (table if timed else table.iloc[:, 1:]).to_csv(tmp_path / "axial.csv", index=False)
    seen = inspect(tmp_path / "axial.csv", {} if timed else {"frequency": "0.1 Hz", "waveform": "sine"})
    said = "3 loops in one record: 0.2, 0.5, 1 mm at 0.1 Hz, 4 to 5 cycles used of each; 25 % of the rows left out"
    assert seen.kind == "loop"
    assert seen.facts["programme"] == said
    assert seen.facts["loop 2"].startswith("0.5 mm at 0.1 Hz, a sine; ")
    assert seen.facts["loop 2"].endswith("before its steady cycles are left out; 4 cycles are used")
    assert tomllib.loads(file_text(seen, tmp_path))["loops"][0]["file"] == "axial.csv"


def test_slow_loops_at_several_rates_are_no_stepped_sine(paper_model: Model, tmp_path: Path) -> None:
    planned = SimulatedLoop(Direction.AXIAL, 5e-4, cycles=4, frequencies=(0.1, 0.3))
    (record,) = simulate(paper_model, SimulateSettings(loops=(planned,))).loops
    seen = look(tmp_path, record)
    assert seen.kind == "loop"
    assert seen.facts["programme"].startswith("2 loops in one record: 0.5 mm at 0.1, 0.3 Hz")
