"""`reduce` as typed: the files, the streams, and a fit of what it wrote."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.reading.sweeps import read_sweep

RECORD = "data/cmp_15961_raw/stepped_sine_axial.csv"
CAMPAIGN = """[bushing]
name = "CMP 15 961"
inner_radius = "10 mm"
outer_radius = "18 mm"
length = "34 mm"

[[loops]]
file = "loop_axial_1.csv"
direction = "axial"

"""


def test_a_raw_record_becomes_a_sweep_that_fits(
    typed: Callable, root: Path, tmp_path: Path, paper_model: Model, table_1: dict[str, float]
) -> None:
    done = typed("reduce", root / RECORD, "-o", "x")
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert {file.name for file in (tmp_path / "x").glob("[!.]*")} == {"sweep.csv", "reduce.png"}
    assert "15 points found" in done.stderr

    sweep = read_sweep(tmp_path / "x/sweep.csv", Direction.AXIAL)
    off = sweep.stiffness / paper_model.stiffness(Direction.AXIAL, sweep.frequency, sweep.amplitude_reached) - 1.0
    print(f"raw record with noise: |K| and phase of 15 points within {abs(off).max():.1e}")
    assert abs(off).max() < 3e-3
    assert len(set(sweep.amplitude)) == 3

    shutil.copy(root / "data/cmp_15961/loop_axial_1.csv", tmp_path / "x")
    snippet = done.stderr.partition("the way there):")[2]
    (tmp_path / "x/campaign.toml").write_text(CAMPAIGN + snippet, encoding="utf-8")
    fitted = typed("fit", "x/campaign.toml", "-o", "fit", "--no-plots", "--json", "-q")
    assert fitted.returncode == 0, fitted.stderr
    for name, entry in json.loads(fitted.stdout)["parameters"].items():
        off = entry["value"] / table_1[name] - 1.0
        print(f"{name}: {100 * off:+.2f} %, {off * table_1[name] / entry['stderr']:+.1f} standard errors")
        assert abs(off) < 0.03
        assert abs(off) * table_1[name] < 3.0 * entry["stderr"]


def test_json_and_further_columns(typed: Callable, root: Path, tmp_path: Path) -> None:
    done = typed("reduce", root / RECORD, "-o", "x", "--no-plots", "--json", "-q", "--cycles", "4")
    assert done.returncode == 0
    assert done.stderr == ""
    document = json.loads(done.stdout)
    assert document["direction"] == "axial"
    table = pd.read_csv(tmp_path / "x/sweep.csv")
    assert list(table) == list(document["points"])
    assert list(table)[:3] == ["frequency [Hz]", "amplitude [mm]", "amplitude reached [mm]"]
    assert (table["force distortion [-]"] > 0.005).all()
    assert (table["cycles used"] >= 4).all()


def halves(root: Path, folder: Path, *names: str) -> list[Path]:
    lines = (root / RECORD).read_text(encoding="utf-8").splitlines(keepends=True)
    middle = len(lines) // 2
    for name, part in zip(names, (lines[1:middle], lines[middle:]), strict=True):
        (folder / name).write_text("".join([lines[0], *part]), encoding="utf-8")
    return [folder / name for name in names]


def test_several_files_make_one_sweep(typed: Callable, root: Path, tmp_path: Path) -> None:
    files = halves(root, tmp_path, "axial_1.csv", "axial_2.csv")
    done = typed("reduce", *files, "-o", "x")
    assert done.returncode == 0, done.stderr
    table = pd.read_csv(tmp_path / "x/sweep.csv")
    assert set(table["history"]) == {"axial_1", "axial_2"}
    assert 14 <= len(table) <= 15  # one step may be cut in two


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (("first.csv", "second.csv"), "state it: --direction axial"),
        (("axial.csv", "radial.csv"), "reduce each direction by itself"),
    ],
)
def test_a_direction_is_never_guessed(
    typed: Callable, root: Path, tmp_path: Path, names: tuple[str, ...], said: str
) -> None:
    files = halves(root, tmp_path, *names)
    done = typed("reduce", *files, "-o", "x")
    assert done.returncode == 2
    assert said in done.stderr
    assert not (tmp_path / "x").exists()


def test_a_direction_can_be_stated(typed: Callable, root: Path, tmp_path: Path) -> None:
    files = halves(root, tmp_path, "first.csv", "second.csv")
    assert typed("reduce", *files, "-o", "x", "--direction", "axial", "--no-plots").returncode == 0


def test_a_sweep_needs_no_reduction(typed: Callable, root: Path, tmp_path: Path) -> None:
    done = typed("reduce", root / "data/cmp_15961/sweep_axial.csv", "-o", "x")
    assert done.returncode == 2
    assert "this is a sweep already" in done.stderr


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--column", "force"), 'such as "force=Kraft"'),
        (("--unit", "kraft=N"), "roles: time, displacement, force"),
        (("--column", "force=Kraft"), 'there is no column "Kraft"'),
        (("--unit", "force=kN"), "two units for the force"),
        (("--force-sign", "-1"), "the force falls where the displacement rises"),
        (("--levels", "0.1 deg"), "--levels"),
        (("--cycles", "40"), "no steady sine was found"),
    ],
)
def test_options_that_do_not_fit(typed: Callable, root: Path, tmp_path: Path, options: tuple, said: str) -> None:
    done = typed("reduce", root / RECORD, "-o", "x", *options)
    assert done.returncode == 2
    assert said in done.stderr
    assert done.stderr.count("error:") == 1
    assert not (tmp_path / "x").exists()


def test_numbers_of_a_line_end_alike_and_frequencies_are_plain(typed: Callable, root: Path) -> None:
    done = typed("reduce", root / RECORD, "-o", "x", "--no-plots")
    assert "10-155" in done.stderr
    lines = [line.split() for line in done.stderr.splitlines() if re.match(r"\s+0\.\d+ ", line)]
    assert len(lines) == 3
    for line in lines:
        for cell in line[4:6]:
            low, high = cell.split("-")
            assert len(low.partition(".")[2]) == len(high.partition(".")[2])
