"""predict and compare as typed: warnings, and results side by side."""

import json

import pandas as pd
from shell import CAMPAIGN, names

FILES = {"compare.json", "parameters.csv", "differences.csv", "compare.png", "compare.html"}


def test_a_folder_a_model_and_a_campaign_of_the_same_tests_differ_in_nothing(bushfit, tmp_path):
    folder = tmp_path / "x"
    done = bushfit("compare", "model", "model/model.json", CAMPAIGN, "-o", folder, "--json")
    assert names(folder) == FILES
    found = json.loads(done.stdout)
    assert done.stdout == (folder / "compare.json").read_text(encoding="utf-8")
    assert [entry["label"] for entry in found["compared"]] == ["A", "B", "C"]
    assert all("no difference detected" in line for line in found["words"])
    assert [len(pair["shared_inputs"]) for pair in found["pairs"]] == [2, 2]
    assert any(line.startswith("A and B were fitted to the same ") for line in found["warnings"])
    assert all(row["holm"] == 1.0 for pair in found["pairs"] for row in pair["parameters"] if row["p"] is not None)
    parameters, differences = (pd.read_csv(folder / f"{name}.csv") for name in ("parameters", "differences"))
    assert set(parameters["other"]) == set(differences["other"]) == {"B", "C"}
    assert (differences["relative difference of stiffness [-], significant"] == "no").all()
    assert differences["frequency [Hz]"].min() == 5.0, "the lowest that was measured"
    for line in found["words"]:
        assert line in done.stderr


def test_without_names_each_law_is_a_family(bushfit, tmp_path, monkeypatch):
    monkeypatch.setattr("bushfit.diagnosis.families.known_families", lambda *_: ("sliders",))
    done = bushfit("compare", CAMPAIGN, "-o", tmp_path / "x", "--json", "--no-plots", "--families")
    assert [family["name"] for family in json.loads(done.stdout)["families"]] == ["paper", "sliders"]


def test_predict_says_each_warning_once_and_in_its_document(bushfit, root, tmp_path):
    truth = root / "data/mystery_mount/open_last/truth.json"
    shaken = ("--mass", "0.2 kg", "--base-acceleration", "0.1 m/s^2", "--direction", "axial")
    for said, model, *more in (
        ("belong to the rig and not to the bushing", truth),
        ("radial: not fitted", "model/model.json"),
        ("axial, resonance of 0.2 kg: predicted at strains", "model/model.json", *shaken),
        ("tests a bushing of another shape", "model/model.json", "--campaign", root / "configs/arm_bushing.toml"),
    ):
        done = bushfit("predict", model, *more, "-o", tmp_path / "x", "--no-plots", "--force", "--json", "-v")
        printed = [line for line in done.stderr.splitlines() if line.startswith("warning: ")]
        assert len(set(printed)) == len(printed) > 0
        warnings = json.loads(done.stdout)["warnings"]
        assert sorted(f"warning: {line}" for line in warnings) == sorted(printed)
        assert any(said in line for line in warnings)
