"""export as typed: the files of each format, what is told of each, and grids that are those of predict."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path

import pandas as pd
import pytest
from shell import BUSHING, CAMPAIGN, Run, document, names, refused, typing

from bushfit.effects.contract import Circumstances
from bushfit.model.file import load_result
from bushfit.units import CELSIUS

#: Options of every format that is written without a compiler.
ALL = [f"--format={name}" for name in ("nastran", "abaqus", "adams", "csv", "xlsx")]


def test_every_format_at_once_and_what_it_leaves_out(bushfit: Run, tmp_path: Path) -> None:
    done = bushfit("export", "model/model.json", *ALL, "-o", tmp_path / "x", "--json")
    found = json.loads(done.stdout)
    assert names(tmp_path / "x") == {file for each in found["formats"].values() for file in each["files"]}
    for name, each in found["formats"].items():
        for line in each["left_out"]:
            assert f"{name} leaves out: {line}" in done.stderr
    for words in (
        "axial: amplitude, one a property: taken at 0.2 mm, |K| is ",
        "axial: the 95 % band, up to ",
        "no law in time",
        "no stiffness in torsion, rotations about x and y",
    ):
        assert any(words in line for line in found["formats"]["nastran"]["left_out"]), words
    told = [line.removeprefix("warning: ") for line in done.stderr.splitlines() if line.startswith("warning: ")]
    assert told == found["warnings"]
    assert any(line.startswith("radial: not fitted") for line in told)


def test_the_arms_of_an_fmu_stand_beside_it_as_table_and_picture(bushfit: Run, tmp_path: Path) -> None:
    done = bushfit("export", "model/model.json", "--format", "fmu", "-o", tmp_path, "--json")
    (fmu,) = json.loads(done.stdout)["formats"]["fmu"]["files"]
    assert names(tmp_path) == {fmu, "arms.csv", "arms.png"}
    arms = pd.read_csv(tmp_path / "arms.csv")["relaxation time [s]"]
    assert f"{arms.notna().sum()} Maxwell arms in place of the springpot" in done.stderr


def test_the_tables_are_those_of_predict(bushfit: Run, tmp_path: Path) -> None:
    grid = ("--direction", "axial", "--amplitudes", "0.1, 0.3 mm", "--frequencies", "10:30:10 Hz")
    of_campaign = ("model/model.json", "--campaign", CAMPAIGN, *grid)
    bushfit("export", *of_campaign, "--format", "csv", "-o", tmp_path / "x")
    bushfit("predict", *of_campaign, "--no-plots", "-o", tmp_path / "y")
    assert (tmp_path / "x/axial.csv").read_bytes() == (tmp_path / "y/axial.csv").read_bytes()
    wide = pd.read_csv(tmp_path / "x/axial_wide.csv")
    assert wide["frequency [Hz]"].tolist() == [10, 20, 30]
    assert len(wide.columns) == 5


def test_directions_share_frequencies_and_the_dialect_has_its_own_file(bushfit: Run, tmp_path: Path) -> None:
    """Tests of other frequencies axially and radially: decks have one list, of all of them."""
    text = BUSHING
    for direction, frequencies in (("axial", (5, 20, 50)), ("radial", (5, 20, 70))):
        text += f'[[sweeps]]\nfile = "{direction}.csv"\ndirection = "{direction}"\n'
        rows = "\n".join(f"{f},0.1,600,0.1" for f in frequencies)
        header = "frequency [Hz],amplitude [mm],stiffness [N/mm],loss factor [-]"
        (tmp_path / f"{direction}.csv").write_text(f"{header}\n{rows}\n")
    (tmp_path / "two.toml").write_text(text)
    formats = ("--format", "nastran", "--format", "csv", "--dialect", "optistruct")
    bushfit("export", "model/model.json", *formats, "--campaign", tmp_path / "two.toml", "-o", tmp_path / "x")
    assert "KMAG" in (tmp_path / "x/bushing.fem").read_text()
    for place in ("axial", "radial"):
        assert pd.read_csv(tmp_path / f"x/{place}.csv")["frequency [Hz]"].tolist() == [5, 20, 50, 70]


def test_an_unresolved_effect_is_a_loss_of_every_deck(bushfit: Run, root: Path, tmp_path: Path) -> None:
    model = document(root / "data/arm_bushing/truth.json")
    model["effects"].append("sleeve_compliance")
    value = {"value": 1.4e-8, "unit": "m/N", "stderr": None, "ci95": None, "vary": False}
    model["parameters"]["sleeve_compliance.compliance"] = value
    model["unresolved"] = ["sleeve_compliance"]
    (tmp_path / "m.json").write_text(json.dumps(model))
    done = bushfit("export", tmp_path / "m.json", *ALL[:3], "-o", tmp_path / "x", "--json")
    for each in json.loads(done.stdout)["formats"].values():
        (line,) = (line for line in each["left_out"] if line.startswith("radial: the other reading"))
        low = float(line.split("|K| is ")[1].split()[0])
        # radially 20 to 40 kN/mm with 0.014 mm/kN in series: 1/(1 - K c) is far above 1
        assert low > 20.0, line


def test_without_a_grid_it_is_the_measured_one_and_files_say_where_they_hold(root: Path, tmp_path: Path) -> None:
    """By the model file alone, at levels that no other grid has."""
    typing(root)("fit", "data/practice/case_000/bushing.toml", "-o", tmp_path / "fit", "--no-plots")
    typing(root)("export", tmp_path / "fit/model.json", *ALL[:4], "-o", tmp_path / "x")
    for place, levels in (("axial", [0.2, 0.4, 1.0]), ("radial", [0.05, 0.1, 0.2])):
        table = pd.read_csv(tmp_path / f"x/{place}.csv")
        measured = pd.read_csv(root / f"data/practice/case_000/sweep_{place}.csv")
        assert table["amplitude [mm]"].unique() == pytest.approx(levels)
        assert table["frequency [Hz]"].unique() == pytest.approx(measured.iloc[:, 0].unique())
    said = (
        *("campaign: case 000, bushing.toml", "tests: 4, no date stated"),
        "valid: axial, 0.1 to 155 Hz, 0.2 to 2 mm, temperature not stated, fitted there",
        "valid: radial, 0.1 to 155 Hz, 0.0483 to 0.483 mm, temperature not stated, not fitted there",
    )
    today = f" on {datetime.now(UTC).date().isoformat()}"
    for deck in ("bushing.bdf", "bushing.inp", "bushing_car.bus"):
        text = " ".join((tmp_path / "x" / deck).read_text().replace("** |", "$ |").replace("\n$ |", "").split())
        for words in (*said, today):
            assert words in text, (deck, words)
    provenance = pd.read_csv(tmp_path / "x/provenance.csv")
    assert (provenance["what"] == "valid").sum() == 2


def test_a_deck_is_of_the_temperature_asked_for(bushfit: Run, root: Path, tmp_path: Path) -> None:
    model = document(root / "data/arm_bushing/truth.json")
    model["effects"].append("temperature")
    for name, value in (("softening", 4e-3), ("shift", 0.08)):
        model["parameters"][f"temperature.{name}"] = {"value": value, "unit": "1/K", "vary": False}
    (tmp_path / "m.json").write_text(json.dumps(model))
    grid = ("--direction", "axial", "--frequencies", "10, 50 Hz", "--amplitudes", "0.2 mm", "--temperature", "60 degC")
    bushfit("export", tmp_path / "m.json", "--format", "nastran", "--format", "csv", *grid, "-o", tmp_path / "x")
    table, warm = pd.read_csv(tmp_path / "x/axial.csv"), Circumstances(60.0 + CELSIUS)
    exact = load_result(tmp_path / "m.json").model.stiffness("axial", table["frequency [Hz]"], 2e-4, under=warm)
    assert table["storage stiffness [N/mm]"].to_numpy() == pytest.approx(exact.real / 1e3, rel=1e-6)
    deck = (tmp_path / "x/bushing.bdf").read_text()
    assert "$ temperature: 60 degC" in deck
    assert f"{exact[1].real / 1e3:.4E}" in deck
    cold = ("export", root / "data/arm_bushing/truth.json", "--format", "nastran", "--temperature", "60 degC")
    refused(bushfit(*cold, "-o", tmp_path / "y", status=2), tmp_path / "y", "the model knows no temperature")
