"""plan, predict and compare as typed: what is planned, grids, measurements laid over, results side by side."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commandline import typing
from shell import CAMPAIGN, document, names, values

FILES = {"compare.json", "parameters.csv", "differences.csv", "compare.png", "compare.html"}
ARM = "data/arm_bushing/truth.json"
NEW, OTHER = "configs/new_bushing.toml", "data/practice/case_003/bushing.toml"
TARGETS = (NEW, "--no-plots", "--json")


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


def test_another_bushing_differs_and_the_places_and_grid_are_those_asked_for(bushfit, root, tmp_path):
    truth = root / "data/arm_bushing/truth.json"
    grid = ("--frequencies", "10, 20 Hz", "--amplitudes", "0.1 mm", "--direction", "radial", "--direction", "axial")
    done = bushfit("compare", "model/model.json", truth, *grid, "-o", tmp_path / "x", "--no-plots")
    table = pd.read_csv(tmp_path / "x/differences.csv")
    assert table["direction"].tolist() == ["radial"] * 2 + ["axial"] * 2
    assert table["frequency [Hz]"].tolist() == [10.0, 20.0] * 2
    ratio = table["other stiffness [N/mm]"] / table["reference stiffness [N/mm]"] - 1.0
    assert abs(ratio - table["relative difference of stiffness [-]"]).max() < 1e-4
    assert (table["relative difference of stiffness [-], significant"] == "yes").all()
    assert "comparable only at equal alpha" in done.text
    assert "B against A, axial: stiffness 2" in done.text


def test_families_of_one_campaign_are_fitted_and_held_out(bushfit, tmp_path):
    folder = tmp_path / "x"
    done = bushfit("compare", CAMPAIGN, "-o", folder, "--json", "--families", "kraus, intrinsic_time")
    assert names(folder) == {*FILES, "families.csv"}
    families = json.loads(done.stdout)["families"]
    assert [family["name"] for family in families] == ["paper", "kraus", "intrinsic_time"]
    assert [family["parameters"] for family in families] == [5, 7, 6]
    table = pd.read_csv(folder / "families.csv")
    assert table["label"].tolist() == ["A", "B", "C"]
    assert table["held out [noise]"].notna().all()
    assert "\nthe first family meets these tests within their noise" in done.stderr
    assert table["held-out result"][2].endswith("equal within 1 %")


def test_without_names_each_law_is_a_family(bushfit, tmp_path, monkeypatch):
    monkeypatch.setattr("bushfit.diagnosis.families.known_families", lambda *_: ("sliders",))
    done = bushfit("compare", CAMPAIGN, "-o", tmp_path / "x", "--json", "--no-plots", "--families")
    assert [family["name"] for family in json.loads(done.stdout)["families"]] == ["paper", "sliders"]


def test_predict_lays_measurements_over_takes_grids_and_shows_at_most_eight_amplitudes(bushfit, tmp_path):
    grid = ("--frequencies", "10:30:10 Hz", "--amplitudes", "0.1, 0.3 mm")
    done = bushfit("predict", "model/model.json", "--campaign", CAMPAIGN, "-o", tmp_path / "x", *grid)
    assert names(tmp_path / "x") == {"axial.csv", "axial.png", "radial.csv", "radial.png", "measured.csv"}
    measured = pd.read_csv(tmp_path / "x" / "measured.csv")
    assert set(measured["sweep"]) == {"sweep_axial", "sweep_radial"}
    assert dict(zip(measured["direction"], measured["fitted"], strict=True)) == {"axial": "yes", "radial": "no"}
    assert measured["measured over model [-]"].between(0.95, 1.05).all()
    axial, radial = (line for line in done.text.splitlines() if ": expected error " in line)
    assert (axial.endswith("all fitted)"), radial.endswith("each predicted by a fit without it)")) == (True, True)
    assert 0.3 < float(axial.partition(": expected error ")[2].split()[0]) < 3.0, "in per cent"
    table = pd.read_csv(tmp_path / "x" / "axial.csv")
    assert table["frequency [Hz]"].tolist() == [10, 20, 30] * 2
    assert table["amplitude [mm]"].tolist() == [0.1] * 3 + [0.3] * 3
    amplitudes = ", ".join(f"{0.02 * n:.2f}" for n in range(1, 31)) + " mm"
    options = ("--direction", "axial", "--amplitudes", amplitudes, "--no-plots", "-o", tmp_path / "y")
    done = bushfit("predict", "model/model.json", *options)
    lines = [line.split() for line in done.text.splitlines() if line.split()[:1] == ["155"]]
    shown = [words[1] for words in lines]
    value, low, high = (float(lines[0][place].strip("()")) for place in (2, 3, 5))
    first = pd.read_csv(tmp_path / "y/axial.csv").query("`frequency [Hz]` == 155").iloc[0]
    wanted = [first[f"stiffness [N/mm]{end}"] for end in ("", ", low", ", high")]
    assert (value, low, high) == pytest.approx(wanted, abs=0.051)
    assert len(shown) == 8
    assert (shown[0], shown[-1]) == ("0.02", "0.6")
    assert len(pd.read_csv(tmp_path / "y/axial.csv")["amplitude [mm]"].unique()) == 30


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


def test_predict_writes_maxwell_arms_where_asked(bushfit, root, tmp_path):
    folder = tmp_path / "x"
    done = bushfit("predict", root / ARM, "--arms", "0.5 %", "-o", folder, "--json")
    (part,) = json.loads(done.stdout)["arms"]
    assert part["in_place_of"] == "springpot"
    assert part["largest_relative_error"] <= 0.005
    assert f"{len(part['relaxation_time_s'])} Maxwell arms represent the springpot: error at most" in done.stderr
    table = pd.read_csv(folder / "arms.csv")
    assert table["branch"].tolist() == ["elastic"] + ["springpot"] * len(part["relaxation_time_s"])
    assert table["relaxation time [s]"].tolist()[1:] == pytest.approx(part["relaxation_time_s"], rel=1e-6)
    ratio = table["radial stiffness [N/mm]"] / table["shear modulus [MPa]"]
    assert ratio.max() / ratio.min() - 1.0 < 1e-5
    done = bushfit("predict", root / ARM, "-o", tmp_path / "y", "--json", "--no-plots", "--arms")
    assert 0.001 < json.loads(done.stdout)["arms"][0]["largest_relative_error"] <= 0.01, "where no error is given"


@pytest.mark.parametrize("request_", [("--static",), ("--frequencies", "0 Hz")])
def test_predict_writes_the_static_curve_at_the_rate_of_the_slowest_loop(bushfit, work, tmp_path, request_):
    model = document(work / "model/model.json")
    (loop,) = (test for test in model["campaign"]["tests"] if test["kind"] == "loop")
    slow = 4.0 * loop["frequency_Hz"][0] * loop["amplitude"][1] * 60e3
    done = bushfit("predict", "model/model.json", *request_, "-o", tmp_path / "x", "--json")
    files = {f"{place}{end}" for place in ("axial", "radial") for end in (".csv", ".png", "_static.csv", "_static.png")}
    assert names(tmp_path / "x") == files
    table = pd.read_csv(tmp_path / "x/axial_static.csv")
    assert table["rate [mm/min]"].to_numpy() == pytest.approx(slow, rel=1e-6)
    assert table["displacement [mm]"].max() == pytest.approx(1e3 * loop["amplitude"][1])
    assert (table["loading force [N]"] >= table["force [N]"]).all()
    assert (table["force [N], low"] < table["force [N], high"])[table["displacement [mm]"] != 0.0].all()
    found = json.loads(done.stdout)
    assert found["axial_static"]["force [N]"] == pytest.approx(table["force [N]"].tolist(), rel=1e-5, abs=1e-6)
    secant = table["force [N]"].iloc[-1] / table["displacement [mm]"].iloc[-1]
    assert f"axial: static stiffness {secant:.4g} N/mm from -1 mm to 1 mm at {slow:.3g} mm/min (95 %: " in done.stderr
    options = ("--direction", "axial", "--amplitudes", "0.2 mm", "--static-rate", "5 mm/min", "--no-plots")
    bushfit("predict", "model/model.json", *options, "-o", tmp_path / "y")
    slower = pd.read_csv(tmp_path / "y/axial_static.csv")
    assert slower["rate [mm/min]"].unique() == pytest.approx([5.0])
    assert slower["displacement [mm]"].max() == pytest.approx(0.2)


def test_predict_on_a_large_motion_and_on_an_offset(bushfit, tmp_path):
    grid = ("--direction", "axial", "--frequencies", "10, 20 Hz", "--amplitudes", "0.1 mm")
    tables = {}
    for name, motion in (("slow", "0.5 Hz 1 mm"), ("offset", "-0.8 mm"), ("alone", None)):
        over = ("--over", motion) if motion else ()
        done = bushfit("predict", "model/model.json", *grid, *over, "-o", tmp_path / name, "--campaign", CAMPAIGN)
        tables[name] = pd.read_csv(tmp_path / name / "axial.csv")
        assert ("measured.csv" in names(tmp_path / name)) is (motion is None)
        assert (f"axial over {motion}: stiffness" in done.text) is (motion is not None)
        assert ("axial, with the large motion: predicted at strains of" in done.text) is (name == "slow")
    columns = ["large motion, frequency [Hz]", "large motion, displacement [mm]"]
    assert tables["slow"][columns].to_numpy() == pytest.approx(np.array([[0.5, 1.0]] * 2))
    assert tables["offset"][columns].to_numpy() == pytest.approx(np.array([[0.0, -0.8]] * 2))
    stiffness = {name: table["stiffness [N/mm]"].to_numpy() for name, table in tables.items()}
    assert stiffness["offset"] == pytest.approx(stiffness["alone"], rel=2e-3), "linear but for friction"
    assert (stiffness["slow"] < 0.99 * stiffness["alone"]).all()


@pytest.fixture(scope="module")
def planned(root, tmp_path_factory) -> tuple[Path, dict, str]:
    """The folder of a plan for a bushing that was not tested, its document, and what was said."""
    folder = tmp_path_factory.mktemp("planned")
    options = ("--hours", "1.5", "-o", folder, "--json")
    done = typing(root)("plan", "configs/new_bushing.toml", *options)
    return folder, json.loads(done.stdout), done.stderr


def test_sheet_document_and_screen_tell_the_same_plan(planned):
    folder, plan, said = planned
    sheet = pd.read_csv(folder / "plan.csv")
    assert names(folder) == {"plan.json", "plan.csv", "campaign.toml"}
    assert document(folder / "plan.json") == plan
    assert sheet["direction"].tolist() == [run["place"] for run in plan["tests"]]
    assert f"{len(sheet)} runs" in said
    assert sheet["minutes so far"].iloc[-1] == pytest.approx(60.0 * plan["hours_planned"], abs=0.1)
    assert plan["hours_planned"] <= plan["hours"] == 1.5
    assert plan["source"] in said.replace("\n", " ")
    for reached in (*plan["parameters"].values(), *plan["stiffness"].values()):
        assert 0.0 < reached["planned"] < reached["before"]


def test_simulate_takes_the_plan_and_fit_its_tests(root, planned, tmp_path):
    folder, plan, _ = planned
    typing(root)("simulate", folder / "campaign.toml", "-o", tmp_path)
    both = ("--direction", "axial", "--direction", "radial", "--json", "--no-plots")
    found = values(typing(root)("fit", tmp_path / "campaign.toml", "-o", tmp_path / "fit", *both))
    truth = document(tmp_path / "truth.json")["parameters"]
    for name, reached in plan["parameters"].items():
        assert abs(np.log(found[name] / truth[name]["value"])) < 4.0 * reached["planned"]


def test_a_plan_after_tests_counts_them(bushfit, tmp_path):
    """Errors before are those of the campaign with the class of its rig; further tests lower them."""
    options = ("--for", "parameters", "--hours", "1.2", "--direction", "axial", "--no-plots", "--json")
    found = json.loads(bushfit("plan", CAMPAIGN, *options, "-o", tmp_path).stdout)
    assert "tests of CMP 15 961" in found["source"]
    assert {run["place"] for run in found["tests"]} == {"axial"}
    for reached in found["parameters"].values():
        assert reached["planned"] < reached["before"] < 0.05


def test_a_plan_for_targets_stops_once_they_are_met(root, tmp_path):
    """In less than half of the hours, in every direction whose stiffness is asked for, and said; what is not asked for
    is not planned, and tighter targets take longer."""
    bushfit = typing(root)
    asked = ("--target", "stiffness=1 %", "--target", "alpha = 2 %")
    done = bushfit("plan", *TARGETS, *asked, "--hours", "6", "-o", tmp_path / "both")
    both = json.loads(done.stdout)
    assert set(both["targets"]) == {"stiffness.axial", "stiffness.radial", "alpha"}
    for name, target in both["targets"].items():
        assert target["met"]
        assert target["why"] is None
        assert target["planned"] <= target["asked"] == (0.02 if name == "alpha" else 0.01)
        assert target["planned"] < target["before"]
    assert both["targets"]["alpha"]["planned"] == pytest.approx(1.96 * both["parameters"]["alpha"]["planned"], rel=1e-3)
    assert {run["place"] for run in both["tests"]} == {"axial", "radial"}
    assert both["hours_planned"] < 3.0
    assert both["hours_left"] == pytest.approx(6.0 - both["hours_planned"])
    assert "all targets are met" in both["enough"]
    assert both["enough"] in done.stderr.replace("\n", " ")
    assert not both["warnings"]
    reasons = pd.read_csv(tmp_path / "both/plan.csv")["what for"]
    assert any(words.startswith(("stiffness.", "alpha: +/-2.")) for words in reasons), "what would miss a target"
    one = json.loads(bushfit("plan", *TARGETS, "--target", "alpha=4 %", "--hours", "6", "-o", tmp_path / "one").stdout)
    assert one["hours_planned"] < both["hours_planned"]
    assert {run["place"] for run in one["tests"]} == {"axial"}


@pytest.mark.parametrize(
    ("source", "options", "said"),
    [
        (NEW, ("stiffness=0.001 %",), "the class of the rig, 0.5 % of gain and 4.4 mrad of phase"),
        (NEW, ("mu=0.25 %", "--hours", "2"), "2 h are too few; about"),
        (
            NEW,
            ("stiffness.radial=5 %", "--direction", "axial"),
            "so far or on offer covers this target: radial: not fitted",
        ),
        (OTHER, ("stiffness.axial=1 %",), "+/-26 % at 145 Hz and 0.08 mm comes from the model error"),
    ],
)
def test_what_keeps_a_target_from_being_met_is_named(root, tmp_path, source, options, said):
    done = typing(root)("plan", source, "--target", *options, "--no-plots", "-o", tmp_path, status=1)
    name, found = next(iter(document(tmp_path / "plan.json")["targets"].items()))
    assert said in found["why"]
    assert not found["met"]
    assert found["why"] in done.text.replace("\n", " ")
    assert f"these targets are not met: {name}" in done.text.replace("\n", " ")


def test_where_nothing_was_tested_alike_the_compound_is_compared(bushfit, root, tmp_path):
    bushfit("fit", root / "configs/epdm_70.toml", "--direction", "DMA", "--no-plots", "-o", tmp_path / "dma")
    done = bushfit("compare", "model", tmp_path / "dma", "-o", tmp_path / "x", "--no-plots")
    table = pd.read_csv(tmp_path / "x/differences.csv")
    assert set(table["direction"]) == {"compound"}
    assert {"strain amplitude [%]", "other modulus [MPa]"} <= set(table)
    assert "compound: modulus " in done.text
