"""export as typed: the files of each format, what is told of each, and grids that are those of predict."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import openpyxl
import pandas as pd
from commandline import Done

from bushfit.cli.export import command
from bushfit.jobs.export import FORMATS

Run = Callable[..., Done]
CAMPAIGN = "configs/cmp_15961.toml"
#: Every format that is written without a compiler, as options.
ALL = [word for name in ("nastran", "abaqus", "adams", "csv", "xlsx") for word in ("--format", name)]


def test_every_format_at_once_and_what_it_leaves_out(bushfit: Run, tmp_path: Path) -> None:
    done = bushfit("export", "model/model.json", *ALL, "-o", str(tmp_path / "x"), "--json")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    named = [file for each in document["formats"].values() for file in each["files"]]
    assert {file.name for file in (tmp_path / "x").glob("[!.]*")} == set(named)
    for name, each in document["formats"].items():
        for line in each["left_out"]:
            assert f"{name} leaves out: {line}" in done.stderr
    for words in (
        "axial: amplitude, one a property: taken at 0.2 mm, |K| is ",
        "axial: the 95 % band, up to ",
        "no law in time",
        "no stiffness in torsion, rotations about x and y",
    ):
        assert any(words in line for line in document["formats"]["nastran"]["left_out"]), words
    told = [line.removeprefix("warning: ") for line in done.stderr.splitlines() if line.startswith("warning: ")]
    assert told == document["warnings"]
    assert any(line.startswith("radial: not fitted") for line in told)


def test_the_arms_of_an_fmu_stand_beside_it_as_table_and_picture(bushfit: Run, tmp_path: Path) -> None:
    done = bushfit("export", "model/model.json", "--format", "fmu", "-o", str(tmp_path), "--json")
    assert done.returncode == 0, done.stderr
    (fmu,) = json.loads(done.stdout)["formats"]["fmu"]["files"]
    assert {file.name for file in tmp_path.glob("[!.]*")} == {fmu, "arms.csv", "arms.png"}
    arms = pd.read_csv(tmp_path / "arms.csv")["relaxation time [s]"]
    assert f"{arms.notna().sum()} Maxwell arms in place of the springpot" in done.stderr


def test_the_tables_are_those_of_predict(bushfit: Run, tmp_path: Path) -> None:
    grid = (
        "--campaign",
        CAMPAIGN,
        "--direction",
        "axial",
        "--amplitudes",
        "0.1, 0.3 mm",
        "--frequencies",
        "10:30:10 Hz",
    )
    assert bushfit("export", "model/model.json", *grid, "--format", "csv", "-o", str(tmp_path / "x")).returncode == 0
    assert bushfit("predict", "model/model.json", *grid, "--no-plots", "-o", str(tmp_path / "y")).returncode == 0
    assert (tmp_path / "x/axial.csv").read_bytes() == (tmp_path / "y/axial.csv").read_bytes()
    wide = pd.read_csv(tmp_path / "x/axial_wide.csv")
    assert wide["frequency [Hz]"].tolist() == [10, 20, 30]
    assert len(wide.columns) == 5


def test_directions_share_frequencies_and_the_dialect_has_its_own_file(bushfit: Run, tmp_path: Path) -> None:
    """Tests of other frequencies axially and radially: decks have one list, of all of them."""
    text = (
        '[bushing]\nname = "two grids"\ninner_radius = "10 mm"\nouter_radius = "18 mm"\nlength = "34 mm"\n'
        '[[sweeps]]\nfile = "a.csv"\ndirection = "axial"\n[[sweeps]]\nfile = "r.csv"\ndirection = "radial"\n'
    )
    (tmp_path / "two.toml").write_text(text)
    for name, frequencies in (("a.csv", (5, 20, 50)), ("r.csv", (5, 20, 70))):
        rows = "\n".join(f"{f},0.1,600,0.1" for f in frequencies)
        (tmp_path / name).write_text(f"frequency [Hz],amplitude [mm],stiffness [N/mm],loss factor [-]\n{rows}\n")
    options = ("--campaign", str(tmp_path / "two.toml"), "--dialect", "optistruct", "-o", str(tmp_path / "x"))
    done = bushfit("export", "model/model.json", "--format", "nastran", "--format", "csv", *options)
    assert done.returncode == 0, done.stderr
    assert "KMAG" in (tmp_path / "x/bushing.fem").read_text()
    for place in ("axial", "radial"):
        assert pd.read_csv(tmp_path / f"x/{place}.csv")["frequency [Hz]"].tolist() == [5, 20, 50, 70]


def test_the_formats_of_the_option_are_those_of_the_job() -> None:
    (formats,) = (each.type for each in command.params if each.name == "formats")
    assert list(FORMATS) == list(formats.choices)


def test_results_that_stand_are_kept(bushfit: Run, tmp_path: Path) -> None:
    (tmp_path / "bushing.bdf").write_text("mine")
    command = ("export", "model/model.json", "--format", "nastran", "-o", str(tmp_path))
    refused = bushfit(*command)
    assert refused.returncode == 2
    assert "--force" in refused.stderr
    assert (tmp_path / "bushing.bdf").read_text() == "mine"
    assert bushfit(*command, "--force").returncode == 0
    assert "PBUSHT" in (tmp_path / "bushing.bdf").read_text()


def test_effects_of_the_rig_are_left_out_and_the_other_reading_is_told(
    bushfit: Run, root: Path, tmp_path: Path
) -> None:
    truth = json.loads((root / "data/mystery_mount/open_last/truth.json").read_text())
    (tmp_path / "m.json").write_text(json.dumps(truth))
    done = bushfit(
        "export", str(tmp_path / "m.json"), "--format", "xlsx", "--format", "nastran", "-o", str(tmp_path / "x")
    )
    assert done.returncode == 0, done.stderr
    assert "left out of the prediction, because they belong to the rig" in done.stderr
    book = openpyxl.load_workbook(io.BytesIO((tmp_path / "x/bushing.xlsx").read_bytes()))
    said = " ".join(str(cell.value) for cell in book["provenance"]["B"])
    assert "Mystery" in said


def test_an_unresolved_effect_is_a_loss_of_every_deck(bushfit: Run, root: Path, tmp_path: Path) -> None:
    document = json.loads((root / "data/arm_bushing/truth.json").read_text())
    document["effects"].append("sleeve_compliance")
    value = {"value": 1.4e-8, "unit": "m/N", "stderr": None, "ci95": None, "vary": False}
    document["parameters"]["sleeve_compliance.compliance"] = value
    document["unresolved"] = ["sleeve_compliance"]
    (tmp_path / "m.json").write_text(json.dumps(document))
    formats = [word for name in ("nastran", "abaqus", "adams") for word in ("--format", name)]
    done = bushfit("export", str(tmp_path / "m.json"), *formats, "-o", str(tmp_path / "x"), "--json")
    assert done.returncode == 0, done.stderr
    for each in json.loads(done.stdout)["formats"].values():
        (line,) = (line for line in each["left_out"] if line.startswith("radial: the other reading"))
        low = float(line.split("|K| is ")[1].split()[0])
        # radially 20 to 40 kN/mm with 0.014 mm/kN in series: 1/(1 - K c) is far above 1
        assert low > 20.0, line
    assert np.isfinite(low)
