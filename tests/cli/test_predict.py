"""predict and compare as typed: grids, measurements laid over, warnings, results side by side, and families."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest
from shell import CAMPAIGN, Run, names

FILES = {"compare.json", "parameters.csv", "differences.csv", "compare.png", "compare.html"}


def test_a_folder_a_model_and_a_campaign_of_the_same_tests_differ_in_nothing(bushfit: Run, tmp_path: Path) -> None:
    folder = tmp_path / "x"
    done = bushfit("compare", "model", "model/model.json", CAMPAIGN, "-o", folder, "--json")
    assert names(folder) == FILES
    found = json.loads(done.stdout)
    assert done.stdout == (folder / "compare.json").read_text(encoding="utf-8")
    assert [entry["label"] for entry in found["compared"]] == ["A", "B", "C"]
    assert all("no difference shown" in line for line in found["words"])
    assert [len(pair["shared_inputs"]) for pair in found["pairs"]] == [2, 2]
    assert any(line.startswith("A and B were fitted to the same ") for line in found["warnings"])
    assert all(row["holm"] == 1.0 for pair in found["pairs"] for row in pair["parameters"] if row["p"] is not None)
    parameters, differences = (pd.read_csv(folder / f"{name}.csv") for name in ("parameters", "differences"))
    assert set(parameters["other"]) == set(differences["other"]) == {"B", "C"}
    assert (differences["relative difference of stiffness [-], sure"] == "no").all()
    assert differences["frequency [Hz]"].min() == 1.0
    for line in found["words"]:
        assert line in done.stderr


def test_another_bushing_differs_and_the_places_and_grid_are_those_asked_for(
    bushfit: Run, root: Path, tmp_path: Path
) -> None:
    truth = root / "data/arm_bushing/truth.json"
    grid = ("--frequencies", "10, 20 Hz", "--amplitudes", "0.1 mm", "--direction", "radial", "--direction", "axial")
    done = bushfit("compare", "model/model.json", truth, *grid, "-o", tmp_path / "x", "--no-plots")
    table = pd.read_csv(tmp_path / "x/differences.csv")
    assert table["place"].tolist() == ["radial"] * 2 + ["axial"] * 2
    assert table["frequency [Hz]"].tolist() == [10.0, 20.0] * 2
    ratio = table["other stiffness [N/mm]"] / table["reference stiffness [N/mm]"] - 1.0
    assert abs(ratio - table["relative difference of stiffness [-]"]).max() < 1e-4
    assert (table["relative difference of stiffness [-], sure"] == "yes").all()
    assert "only at equal alpha" in done.stderr
    assert "B against A, axial: stiffness 2" in done.stderr


def test_where_nothing_was_tested_alike_the_compound_is_compared(bushfit: Run, root: Path, tmp_path: Path) -> None:
    bushfit("fit", root / "configs/epdm_70.toml", "--direction", "DMA", "--no-plots", "-o", tmp_path / "dma")
    done = bushfit("compare", "model", tmp_path / "dma", "-o", tmp_path / "x", "--no-plots")
    table = pd.read_csv(tmp_path / "x/differences.csv")
    assert set(table["place"]) == {"compound"}
    assert {"strain amplitude [%]", "other modulus [MPa]"} <= set(table)
    assert "compound: modulus " in done.stderr


def test_families_of_one_campaign_are_fitted_and_held_out(bushfit: Run, tmp_path: Path) -> None:
    folder = tmp_path / "x"
    done = bushfit("compare", CAMPAIGN, "-o", folder, "--json", "--families", "kraus, intrinsic_time")
    assert names(folder) == {*FILES, "families.csv"}
    families = json.loads(done.stdout)["families"]
    assert [family["name"] for family in families] == ["paper", "kraus", "intrinsic_time"]
    assert [family["parameters"] for family in families] == [5, 7, 6]
    table = pd.read_csv(folder / "families.csv")
    assert table["label"].tolist() == ["A", "B", "C"]
    assert table["held out [noise]"].notna().all()
    assert "the first family meets these tests within their noise" in done.stderr
    assert table["words"][2].endswith("alike within 1 %")


ARM = "data/arm_bushing/truth.json"


def test_predict_lays_measurements_over_takes_grids_and_shows_at_most_eight_amplitudes(
    bushfit: Run, tmp_path: Path
) -> None:
    grid = ("--frequencies", "10:30:10 Hz", "--amplitudes", "0.1, 0.3 mm")
    done = bushfit("predict", "model/model.json", "--campaign", CAMPAIGN, "-o", tmp_path / "x", *grid)
    assert names(tmp_path / "x") == {"axial.csv", "axial.png", "radial.csv", "radial.png", "measured.csv"}
    measured = pd.read_csv(tmp_path / "x" / "measured.csv")
    assert set(measured["sweep"]) == {"sweep_axial", "sweep_radial"}
    assert dict(zip(measured["direction"], measured["fitted"], strict=True)) == {"axial": "yes", "radial": "no"}
    assert measured["model over measured [-]"].between(0.95, 1.05).all()
    assert "radial: usable within" in done.stderr
    table = pd.read_csv(tmp_path / "x" / "axial.csv")
    assert table["frequency [Hz]"].tolist() == [10, 20, 30] * 2
    assert table["amplitude [mm]"].tolist() == [0.1] * 3 + [0.3] * 3
    amplitudes = ", ".join(f"{0.02 * n:.2f}" for n in range(1, 31)) + " mm"
    options = ("--direction", "axial", "--amplitudes", amplitudes, "--no-plots", "-o", tmp_path / "x")
    done = bushfit("predict", "model/model.json", *options)
    shown = [line.split()[1] for line in done.stderr.splitlines() if line.split()[:1] == ["155"]]
    assert len(shown) == 8
    assert (shown[0], shown[-1]) == ("0.02", "0.6")
    assert len(pd.read_csv(tmp_path / "x/axial.csv")["amplitude [mm]"].unique()) == 30


def test_predict_says_each_warning_once_and_in_its_document(bushfit: Run, root: Path, tmp_path: Path) -> None:
    truth = root / "data/mystery_mount/open_last/truth.json"
    for model, said in ((truth, "left out of the prediction"), ("model/model.json", "radial: not fitted")):
        done = bushfit("predict", model, "-o", tmp_path / "x", "--no-plots", "--force", "--json")
        told = [line for line in done.stderr.splitlines() if line.startswith("warning: ")]
        assert len(set(told)) == len(told) > 0
        warnings = json.loads(done.stdout)["warnings"]
        assert [f"warning: {line}" for line in warnings] == told
        assert any(line.startswith(said) for line in warnings)


def test_predict_writes_maxwell_arms_where_asked(bushfit: Run, root: Path, tmp_path: Path) -> None:
    folder = tmp_path / "x"
    done = bushfit("predict", root / ARM, "--arms", "0.5 %", "-o", folder, "--json")
    (part,) = json.loads(done.stdout)["arms"]
    assert part["in_place_of"] == "springpot"
    assert part["largest_relative_error"] <= 0.005
    assert f"{len(part['relaxation_time_s'])} Maxwell arms in place of the springpot: off by at most" in done.stderr
    table = pd.read_csv(folder / "arms.csv")
    assert table["in place of"].tolist() == ["elastic"] + ["springpot"] * len(part["relaxation_time_s"])
    assert table["relaxation time [s]"].tolist()[1:] == pytest.approx(part["relaxation_time_s"], rel=1e-6)
    ratio = table["radial stiffness [N/mm]"] / table["shear modulus [MPa]"]
    assert ratio.max() / ratio.min() - 1.0 < 1e-5
    assert (folder / "arms.png").read_bytes().startswith(b"\x89PNG")
    done = bushfit("predict", root / ARM, "-o", tmp_path / "y", "--json", "--no-plots", "--arms")
    assert 0.001 < json.loads(done.stdout)["arms"][0]["largest_relative_error"] <= 0.01, "where no error is given"
