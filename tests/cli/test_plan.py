"""bushfit plan: what it writes is what was planned, and the next command takes it."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commandline import Done, call

Run = Callable[..., Done]
CAMPAIGN = "configs/cmp_15961.toml"


@pytest.fixture(scope="module")
def planned(root: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict, str]:
    """The folder of a plan for a bushing that was not tested, its document, and what was said."""
    folder = tmp_path_factory.mktemp("planned")
    done = call(root, "plan", "configs/new_bushing.toml", "--hours", "1.5", "--check", "4", "-o", str(folder), "--json")
    assert done.returncode == 0, done.stderr
    return folder, json.loads(done.stdout), done.stderr


def test_sheet_document_and_screen_tell_the_same_plan(planned: tuple[Path, dict, str]) -> None:
    folder, document, said = planned
    sheet = pd.read_csv(folder / "plan.csv")
    assert {file.name for file in folder.glob("[!.]*")} == {"plan.json", "plan.csv", "plan.png", "campaign.toml"}
    assert json.loads((folder / "plan.json").read_text(encoding="utf-8")) == document
    assert sheet["direction"].tolist() == [run["place"] for run in document["tests"]]
    assert f"{len(sheet)} runs" in said
    assert sheet["minutes so far"].iloc[-1] == pytest.approx(60.0 * document["hours_planned"], abs=0.1)
    assert document["hours_planned"] <= document["hours"] == 1.5
    assert document["source"] in said.replace("\n", " ")
    for reached in (*document["parameters"].values(), *document["stiffness"].values()):
        assert 0.0 < reached["planned"] < reached["before"]
    check = document["check"]
    assert (check["campaigns"], check["failed"]) == (4, 0)
    for name, found in check["found"].items():
        low, high = check["ci95"][name]
        assert low < found < high
        assert check["predicted"][name] == pytest.approx(document["parameters"][name]["planned"], rel=0.05)


def test_simulate_takes_the_plan_and_fit_its_tests(root: Path, planned: tuple[Path, dict, str], tmp_path: Path) -> None:
    folder, document, _ = planned
    assert call(root, "simulate", str(folder / "campaign.toml"), "-o", str(tmp_path), "-q").returncode == 0
    both = ("--direction", "axial", "--direction", "radial", "--json", "-q", "--no-plots")
    done = call(root, "fit", str(tmp_path / "campaign.toml"), "-o", str(tmp_path / "fit"), *both)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)["parameters"]
    truth = json.loads((tmp_path / "truth.json").read_text(encoding="utf-8"))["parameters"]
    for name, reached in document["parameters"].items():
        off = np.log(found[name]["value"] / truth[name]["value"]) / reached["planned"]
        print(name, round(float(off), 2))
        assert abs(off) < 4.0


def test_a_plan_after_tests_counts_them(bushfit: Run, tmp_path: Path) -> None:
    """Errors before are those of the campaign with the class of its rig; further tests lower them."""
    options = ("--for", "parameters", "--hours", "1.2", "--direction", "axial", "--no-plots", "--json", "-q")
    found = json.loads(bushfit("plan", CAMPAIGN, *options, "-o", str(tmp_path)).stdout)
    assert "tests of CMP 15 961" in found["source"]
    assert {run["place"] for run in found["tests"]} == {"axial"}
    for reached in found["parameters"].values():
        assert reached["planned"] < reached["before"] < 0.05
    assert not (tmp_path / "plan.png").exists()
