"""`diagnose` as typed: its files and streams, options, look-alikes, and a mistake in the record of a test."""

import html
import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commandline import Done, Run, typing
from shell import document, names

from bushfit.effects import BASE, effects_for_places
from bushfit.effects.mistakes import MISTAKES

#: An inertia is hidden here.
CAMPAIGN = "case_001/bushing.toml"
CLEAN = "case_000/bushing.toml"
#: The clean campaign, but for a file that counts amplitudes otherwise than it says, and the mistake by its name.
DOUBLED = "doubled/bushing.toml"
LABEL = "peak_to_peak:sweep_axial"
TABLES = {"diagnosis.json", "model.json", "gap.csv", "candidates.csv", "report.html"}


@pytest.fixture(scope="module")
def work(root, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("work")
    for case, copy in (("000", "case_000"), ("001", "case_001"), ("003", "case_003"), ("000", "doubled")):
        shutil.copytree(root / f"data/practice/case_{case}", folder / copy)
    table = pd.read_csv(folder / "doubled/sweep_axial.csv", comment="#")
    table.loc[:, [name for name in table.columns if name.startswith("amplitude")]] *= 2.0
    table.to_csv(folder / "doubled/sweep_axial.csv", index=False)
    return folder


@pytest.fixture(scope="module")
def bushfit(work) -> Run:
    return typing(work)


@pytest.fixture(scope="module")
def done(bushfit) -> Done:
    """One diagnosis, its files under `found`."""
    return bushfit("diagnose", CAMPAIGN, "-o", "found", "--json", "--no-plots")


@pytest.fixture(scope="module")
def found(work, done) -> Path:
    return work / "found"


def test_the_document_names_the_effect_with_its_size_and_the_gap_before_and_after(done, found):
    assert names(found) == TABLES
    assert done.stdout == (found / "diagnosis.json").read_text(encoding="utf-8")
    for words in ("case 001: named", "inertia", "95 %", "data fitted", "held out", "where", "next test:", "wrote "):
        assert words in done.stderr
    assert "probability above 99.5 %: moving mass between bushing and load cell (inertia)\n" in done.stderr
    written = document(found / "diagnosis.json")
    assert written["schema"] == "bushfit/diagnosis/3"
    assert written["verdict"] == "named"
    (odds,) = written["odds"]
    assert 0.0 <= written["nothing"] < 0.01 < 0.97 < odds["probability"] <= 1.0
    assert odds["words"] == "moving mass between bushing and load cell (inertia)"
    (effect,) = written["effects"]
    assert (effect["name"], effect["level"], effect["alternatives"]) == ("inertia", "instrument", [])
    mass = effect["parameters"]["inertia.mass"]
    assert mass["unit"] == "kg"
    assert mass["ci95"][0] < mass["value"] < mass["ci95"][1]
    for where in written["where"]:
        assert len(where["frequency_Hz"]) == len(where["amplitude_mm"]) == 2
    for pair in (written["gap"]["calibration"], written["gap"]["heldout"]):
        assert pair["after"] < 1.1 < pair["before"]
    assert "mass" in written["next_test"]
    assert written["description"] is None
    assert {"axial direction"} >= {each["part"] for each in written["gap"]["skipped"]}  # which alone tells mu so well
    usable = written["usable"]
    assert 0.0 < usable["stiffness"] == max(place["stiffness"] for place in usable["places"]) < 0.02
    assert usable["held_out"] is True
    assert f"expected error {100.0 * usable['stiffness']:.2g} % in stiffness" in done.stderr


def test_every_residual_and_every_candidate_is_in_a_table(found):
    """Their mean squares are the gaps that the document states, but for what a loop's rows tell of the next."""
    table = pd.read_csv(found / "gap.csv")
    gap = document(found / "diagnosis.json")["gap"]["calibration"]
    assert {"test", "kind", "direction", "frequency [Hz]", "amplitude [mm]", "repeat", "time [s]"} <= set(table.columns)
    for when in ("before", "after"):
        columns = [name for name in table.columns if name.endswith(f"{when} [noise]")]
        assert len(columns) == 3
        values = np.sqrt(np.nanmean(np.square(table[columns].to_numpy())))
        assert values == pytest.approx(gap[when], rel=0.02)  # a loop's rows share its gain
    assert table[table.kind == "sweep"].groupby("test").size().to_dict() == {"sweep_axial": 144, "sweep_radial": 144}
    assert set(table[table.kind == "loop"].test) == {"loop_axial_1", "loop_axial_2"}
    table = pd.read_csv(found / "candidates.csv")
    asked = {name for name, effect in effects_for_places(("axial", "radial")).items() if effect.after in (None, *BASE)}
    mistakes = table.effect.str.partition(":")[0].isin(MISTAKES)
    assert set(table.effect[~mistakes]) == asked - set(BASE)
    assert table.probability[mistakes].max() < 1e-6
    levels = table.set_index("effect").level
    assert (levels["sleeve_compliance"], levels["inertia"]) == ("unresolved", "instrument")
    assert table.why.notna().all()
    assert table.set_index("effect").why["inertia"] == "part of the most probable explanation"
    assert table["expected chi-square gain"].is_monotonic_decreasing
    assert table.effect[table.probability.idxmax()] == "inertia"
    assert table[table["chi-square gain"].notna() & ~mistakes].parameters.str.contains("=").all()


def test_its_own_model_is_consistent_and_predicts_without_the_rig(bushfit, found, tmp_path):
    model = found / "model.json"
    again = bushfit("diagnose", CAMPAIGN, "--model", model, "-o", tmp_path / "again", "--json", "--no-plots")
    assert json.loads(again.stdout)["verdict"] == "consistent"
    assert document(tmp_path / "again/model.json")["effects"] == [*BASE, "inertia"]
    assert "inertia" in bushfit("predict", model, "-o", tmp_path / "predicted", "--no-plots").stderr


def test_options_reach_the_workflow(bushfit, work, tmp_path):
    for options in (("--tolerance", "50 %"), ("--adopt", "inertia")):
        run = bushfit("diagnose", CAMPAIGN, *options, "-o", tmp_path / "x", "--force", "--json", "--no-plots")
        assert json.loads(run.stdout)["verdict"] == "consistent"
    assert document(tmp_path / "x" / "model.json")["effects"] == [*BASE, "inertia"]
    stated = '\n[fit."inertia.mass"]\nvalue = "70 g"\nvary = false\n'  # as weighed
    (work / "case_001/weighed.toml").write_text((work / CAMPAIGN).read_text() + stated)
    bushfit("diagnose", "case_001/weighed.toml", "--adopt", "inertia", "-o", tmp_path / "weighed", "--no-plots")
    assert document(tmp_path / "weighed/model.json")["parameters"]["inertia.mass"]["value"] == pytest.approx(0.07)


def test_a_clean_campaign(bushfit, tmp_path):
    run = bushfit("diagnose", CLEAN, "-o", tmp_path / "x", "--no-plots")
    assert "consistent" in run.stdout
    assert "Probability that nothing is missing: above 99.5 %.\n" in run.stdout
    written = document(tmp_path / "x" / "diagnosis.json")
    assert (written["effects"], written["odds"]) == ([], [])
    assert written["nothing"] > 0.15


def test_look_alikes_are_told_with_their_odds(work, bushfit):
    """And with what closes the gap meanwhile; the page says what the terminal says."""
    run = bushfit("diagnose", "case_003/bushing.toml", "--without", "force_offset", "-o", "alike", "--no-plots")
    assert "bushfit diagnose case_003/bushing.toml --without force_offset --adopt sleeve_compliance" in run.text
    written = document(work / "alike/diagnosis.json")
    assert written["verdict"] == "ambiguous"
    assert written["summary"].startswith("these tests cannot distinguish between ")
    assert "; a smooth correction closes the gap: up to " in written["summary"]
    assert document(work / "alike/model.json")["effects"] == [*BASE, "unnamed"]
    assert all(
        gap["after"] < 0.5 * gap["before"] for gap in (written["gap"][key] for key in ("calibration", "heldout"))
    )
    (size,) = written["effects"][0]["parameters"].values()
    assert (size["unit"], 1e-8 < size["value"] < 4e-8) == ("m/N", True), "of an effect that the model lacks"
    shares = [each["probability"] for each in written["odds"]]
    assert shares == sorted(shares, reverse=True)
    assert 0.97 <= sum(shares) <= 1.0
    page = html.unescape((work / "alike/report.html").read_text(encoding="utf-8"))
    assert "bushfit diagnose looks for" not in run.text + (work / "alike/model.json").read_text(encoding="utf-8")
    lines = [f"probability {100 * entry['probability']:.0f} %: {entry['words']}" for entry in written["odds"]]
    assert len(lines) > 1
    for line in lines:
        assert f"  {line}\n" in run.text
    assert "".join(f"<li>{line}</li>" for line in lines) in page
    assert f"<b>Next test:</b> {written['next_test']}." in page


def test_it_is_told_with_its_line_and_nothing_is_mended(bushfit, work):
    done = bushfit("diagnose", DOUBLED, "-o", "doubled_told")
    adopt = f"bushfit diagnose {DOUBLED} --adopt {LABEL}"
    for words in ("these tests agree if the", "sweep_axial.csv are peak-to-peak", 'amplitude = "peak-to-peak"', adopt):
        assert words in " ".join(done.text.split())
    written, model = (document(work / f"doubled_told/{name}.json") for name in ("diagnosis", "model"))
    (effect,) = written["effects"]
    assert (written["verdict"], effect["name"], effect["level"]) == ("named", "peak_to_peak", "record")
    assert (effect["test"], effect["parameters"]) == ("sweep_axial", {})
    assert any("fitted to the tests as they are" in warning for warning in model["warnings"])
    table = pd.read_csv(work / "doubled_told/gap.csv")
    for when in ("before", "after"):
        columns = [name for name in table.columns if name.endswith(f"{when} [noise]")]
        gap = np.sqrt(np.nanmean(np.square(table[columns].to_numpy())))
        assert gap > 0.99 * written["gap"]["calibration"][when]  # rows of a loop share its gain, and tell of the next
    candidates = pd.read_csv(work / "doubled_told/candidates.csv").set_index("effect")
    assert candidates.loc[LABEL, ["level", "why"]].tolist() == ["record", "closes the gap"]


def test_a_line_in_the_campaign_or_adopted_aloud_puts_it_right(bushfit, work):
    done = bushfit("diagnose", DOUBLED, "--adopt", LABEL, "-o", "adopted", "--no-plots")
    assert f"corrected by --adopt {LABEL}" in " ".join(done.stderr.split())
    assert any("corrected by" in line for line in document(work / "adopted/model.json")["warnings"])
    line = 'file = "sweep_axial.csv"'
    text = (work / DOUBLED).read_text().replace(line, f'{line}\namplitude = "peak-to-peak"')
    (work / "doubled/mended.toml").write_text(text)
    bushfit("diagnose", "doubled/mended.toml", "--no-plots", "-o", "mended")
    for folder in ("adopted", "mended"):
        assert document(work / folder / "diagnosis.json")["verdict"] == "consistent"
