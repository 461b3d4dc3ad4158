"""`diagnose` as typed: files, streams, exit statuses, one error for what is wrong."""

from __future__ import annotations

import html
import json
import re
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commandline import Done, call

from bushfit.effects import BASE, at_places
from bushfit.effects.mistakes import MISTAKES

Run = Callable[..., Done]
#: An inertia is hidden here.
CAMPAIGN = "case_001/bushing.toml"
CLEAN = "case_000/bushing.toml"
TABLES = {"diagnosis.json", "model.json", "gap.csv", "candidates.csv", "report.html"}


@pytest.fixture(scope="module")
def work(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("work")
    for case in ("case_000", "case_001"):
        shutil.copytree(root / "data/practice" / case, folder / case)
    return folder


@pytest.fixture(scope="module")
def bushfit(work: Path) -> Run:
    return partial(call, work)


@pytest.fixture(scope="module")
def done(bushfit: Run) -> Done:
    """One diagnosis, its files under `found`."""
    return bushfit("diagnose", CAMPAIGN, "-o", "found", "--json", "--no-plots")


@pytest.fixture(scope="module")
def found(work: Path, done: Done) -> Path:
    assert done.returncode == 0, done.stderr
    return work / "found"


def test_files_and_streams(done: Done, found: Path) -> None:
    assert {file.name for file in found.glob("[!.]*")} == TABLES
    assert done.stdout == (found / "diagnosis.json").read_text(encoding="utf-8")
    for words in ("case 001: named", "inertia", "95 %", "data fitted", "held out", "where", "next test:", "wrote "):
        assert words in done.stderr
    assert "all but sure: moving mass between bushing and load cell (inertia)\n" in done.stderr


def test_the_document_is_that_of_the_interface(found: Path) -> None:
    document = json.loads((found / "diagnosis.json").read_text())
    assert document["schema"] == "bushfit/diagnosis/3"
    assert {"verdict", "effects", "description", "where", "gap", "usable", "next_test"} <= document.keys()
    assert document["verdict"] == "named"
    (odds,) = document["odds"]
    assert 0.0 <= document["nothing"] < 0.01 < 0.97 < odds["probability"] <= 1.0
    assert (odds["words"], odds["chances"]) == ("moving mass between bushing and load cell (inertia)", "all but sure")
    (effect,) = document["effects"]
    assert {"name", "level", "twins", "alternatives", "replaces", "parameters", "evidence"} <= effect.keys()
    assert (effect["name"], effect["level"], effect["alternatives"]) == ("inertia", "instrument", [])
    mass = effect["parameters"]["inertia.mass"]
    assert mass["unit"] == "kg"
    assert mass["ci95"][0] < mass["value"] < mass["ci95"][1]
    for where in document["where"]:
        keys = {"direction", "kind", "frequency_Hz", "amplitude_mm", "component", "excess", "reading"}
        assert keys == where.keys()
        assert len(where["frequency_Hz"]) == len(where["amplitude_mm"]) == 2
    for pair in (document["gap"]["calibration"], document["gap"]["heldout"]):
        assert pair["after"] < 1.1 < pair["before"]
    assert "mass" in document["next_test"]
    assert document["description"] is None
    assert {"part", "before", "after", "whitened"} == document["gap"]["parts"][0].keys()
    assert {"axial direction"} >= {each["part"] for each in document["gap"]["skipped"]}  # which alone tells mu so well
    usable = document["usable"]
    assert 0.0 < usable["stiffness"] == max(place["stiffness"] for place in usable["places"]) < 0.02
    assert usable["held_out"] is True


def test_every_residual_is_in_the_table(found: Path) -> None:
    """Their mean squares are the gaps that the document states, but for what a loop's rows tell of the next."""
    table = pd.read_csv(found / "gap.csv")
    gap = json.loads((found / "diagnosis.json").read_text())["gap"]["calibration"]
    assert {"test", "kind", "direction", "frequency [Hz]", "amplitude [mm]", "repeat", "time [s]"} <= set(table.columns)
    for when in ("before", "after"):
        columns = [name for name in table.columns if name.endswith(f"{when} [noise]")]
        assert len(columns) == 3
        values = table[columns].to_numpy().ravel()
        values = values[~np.isnan(values)]
        print(f"{when}: {np.sqrt(np.mean(values**2)):.4f} over {values.size} residuals")
        assert np.sqrt(np.mean(values**2)) == pytest.approx(gap[when], rel=0.02)  # a loop's rows share its gain
    assert table[table.kind == "sweep"].groupby("test").size().to_dict() == {"sweep_axial": 144, "sweep_radial": 144}
    assert set(table[table.kind == "loop"].test) == {"loop_axial_1", "loop_axial_2"}


def test_every_candidate_is_in_the_table(found: Path) -> None:
    table = pd.read_csv(found / "candidates.csv")
    asked = {name for name, effect in at_places(("axial", "radial")).items() if effect.after in (None, *BASE)}
    mistakes = table.effect.str.partition(":")[0].isin(MISTAKES)
    assert set(table.effect[~mistakes]) == asked - set(BASE)
    assert table.probability[mistakes].max() < 1e-6
    levels = table.set_index("effect").level
    assert (levels["sleeve_compliance"], levels["inertia"]) == ("unresolved", "instrument")
    assert table.why.notna().all()
    assert table.set_index("effect").why["inertia"] == "part of the likeliest explanation"
    assert table.score.is_monotonic_decreasing
    assert table.probability.between(0.0, 1.0).all()
    assert table.effect[table.probability.idxmax()] == "inertia"
    refitted = table[table["chi-square gain"].notna() & ~mistakes]
    assert refitted.parameters.str.contains("=").all()


def test_its_own_model_is_consistent_and_predicts_without_the_rig(bushfit: Run, found: Path, tmp_path: Path) -> None:
    model = str(found / "model.json")
    again = bushfit("diagnose", CAMPAIGN, "--model", model, "-o", str(tmp_path / "again"), "--json", "-q", "--no-plots")
    assert again.returncode == 0
    assert again.stderr == ""
    assert json.loads(again.stdout)["verdict"] == "consistent"
    with_added = json.loads((tmp_path / "again" / "model.json").read_text())
    assert with_added["effects"] == [*BASE, "inertia"]
    predicted = bushfit("predict", model, "-o", str(tmp_path / "predicted"), "--no-plots")
    assert predicted.returncode == 0, predicted.stderr
    assert "inertia" in predicted.stderr


def test_options_reach_the_workflow(bushfit: Run, tmp_path: Path) -> None:
    def document(*options: str) -> dict[str, object]:
        run = bushfit(
            "diagnose", CAMPAIGN, *options, "-o", str(tmp_path / "x"), "--force", "--json", "-q", "--no-plots"
        )
        assert run.returncode == 0, run.stderr
        return json.loads(run.stdout)

    assert document("--tolerance", "50 %")["verdict"] == "consistent"
    assert document("--adopt", "inertia")["verdict"] == "consistent"
    assert json.loads((tmp_path / "x" / "model.json").read_text())["effects"] == [*BASE, "inertia"]


@pytest.mark.slow
def test_an_effect_that_is_left_out_is_not_named(bushfit: Run, tmp_path: Path) -> None:
    done = bushfit("diagnose", CAMPAIGN, "--without", "inertia", "-o", str(tmp_path / "x"), "--json", "--no-plots")
    assert done.returncode == 0, done.stderr
    assert all(effect["name"] != "inertia" for effect in json.loads(done.stdout)["effects"])


def test_a_clean_campaign(bushfit: Run, tmp_path: Path) -> None:
    run = bushfit("diagnose", CLEAN, "-o", str(tmp_path / "x"), "--no-plots")
    assert run.returncode == 0, run.stderr
    assert run.stdout == ""
    assert "consistent" in run.stderr
    assert ": nothing is missing\n" in run.stderr
    document = json.loads((tmp_path / "x" / "diagnosis.json").read_text())
    assert (document["effects"], document["odds"]) == ([], [])
    assert document["nothing"] > 0.15


def test_look_alikes_are_told_with_their_odds(root: Path, work: Path, bushfit: Run) -> None:
    """And the page says what the terminal says."""
    shutil.copytree(root / "data/practice/case_003", work / "case_003")
    run = bushfit("diagnose", "case_003/bushing.toml", "-o", "alike", "--no-plots")
    assert run.returncode == 0, run.stderr
    document = json.loads((work / "alike/diagnosis.json").read_text())
    assert document["verdict"] == "ambiguous"
    shares = [each["probability"] for each in document["odds"]]
    assert shares == sorted(shares, reverse=True)
    assert 0.97 <= sum(shares) <= 1.0
    page = html.unescape((work / "alike/report.html").read_text(encoding="utf-8"))
    for each in document["odds"]:
        line = f"{each['chances']}: {each['words']}"
        assert re.search(r"\d in 10", line)
        assert f"  {line}\n" in run.stderr
        assert f"<li>{line}</li>" in page
    assert f"<b>Next test:</b> {document['next_test']}." in page


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--adopt", "inertai"), ("inertai", "inertia")),
        (("--without", "inertai"), ("inertai", "inertia")),
        (("--tolerance", "abc"), ("abc",)),
        (("--tolerance", "1 mm"), ("mm", "ratio")),
        (("--tolerance", "-1 %"), ("--tolerance", "-1 %")),
        (("--tolerance", "120 %"), ("--tolerance", "120 %")),
        (("--tolerance", "nan %"), ("--tolerance", "nan")),
        (("--max-effects", "-1"), ("--max-effects",)),
        (("--max-effects", "many"), ("many",)),
        (("--model", "absent.json"), ("absent.json",)),
        (("--model", CAMPAIGN), ("bushing.toml",)),
        (("--max-nrmse", "0"), ("--max-nrmse",)),
    ],
    ids=lambda value: " ".join(value) if value and value[0].startswith("--") else "",
)
def test_wrong_usage(bushfit: Run, tmp_path: Path, options: tuple[str, ...], words: tuple[str, ...]) -> None:
    run = bushfit("diagnose", CAMPAIGN, *options, "-o", str(tmp_path / "x"), "--no-plots")
    print(run.stderr)
    assert run.returncode == 2
    assert run.stdout == ""
    assert "Traceback" not in run.stderr
    assert "fault in bushfit" not in run.stderr
    assert run.stderr.count("error: ") + run.stderr.count("Error: ") == 1
    for word in words:
        assert word in run.stderr
    assert not (tmp_path / "x").exists()


def test_statuses(bushfit: Run, tmp_path: Path) -> None:
    missed = bushfit("diagnose", CAMPAIGN, "-o", str(tmp_path / "x"), "--no-plots", "--max-nrmse", "1e-4")
    assert missed.returncode == 1
    assert "is above --max-nrmse" in missed.stderr
    assert {file.name for file in (tmp_path / "x").glob("[!.]*")} == TABLES
    refused = bushfit("diagnose", CAMPAIGN, "-o", str(tmp_path / "x"), "--no-plots")
    assert refused.returncode == 2
    assert "--force" in refused.stderr


@pytest.mark.slow
def test_the_gap_in_a_picture(bushfit: Run, tmp_path: Path) -> None:
    run = bushfit("diagnose", CAMPAIGN, "-o", str(tmp_path / "x"))
    assert run.returncode == 0, run.stderr
    assert {file.name for file in (tmp_path / "x").glob("[!.]*")} == TABLES | {"gap.png"}
    picture = (tmp_path / "x" / "gap.png").read_bytes()
    assert picture.startswith(b"\x89PNG")
    assert len(picture) > 20_000
