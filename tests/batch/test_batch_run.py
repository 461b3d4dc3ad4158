"""`bushfit batch` as typed: rows equal single commands to the last digit, and nothing that is done is done again."""

import json
import os
import signal
from functools import partial

import pytest
from junitparser import JUnitXml
from trees import PATTERN, rows, tree

from bushfit.batch import run
from bushfit.batch.document import RowFile
from bushfit.batch.manifest import Row
from bushfit.batch.row import RowTask


def test_a_row_is_the_single_command_to_the_last_digit(typed, shop):
    (shop / "m.toml").write_text(
        '[[bushings]]\ncampaign = "bushings/b0/bushing.toml"\n'
        '[[bushings]]\ncampaign = "bushings/b1/bushing.toml"\neffects = ["inertia"]\ndirections = ["axial", "radial"]\n'
        'name = "two ways"\n'
        '[[bushings]]\ncampaign = "bushings/b2/bushing.toml"\nname = "c"\ncommands = ["fit", "diagnose", "predict"]\n'
    )
    assert typed("batch", "m.toml", "-o", "all", "--tables", "-q", "--no-plots").stderr == ""
    b0, b1, b2 = (f"bushings/b{n}/bushing.toml" for n in range(3))
    typed("fit", b0, "-o", "one/0", "--no-plots")
    typed(
        "fit", b1, "-o", "one/1", "--no-plots", "--effect", "inertia", "--direction", "axial", "--direction", "radial"
    )
    assert tree(shop / "all/bushings/b0") == tree(shop / "one/0")
    assert tree(shop / "all/bushings/two ways") == tree(shop / "one/1")
    typed("fit", b2, "-o", "one/joint", "--no-plots")
    typed("diagnose", b2, "-o", "one/2", "--no-plots", "--no-report")
    typed("predict", "one/2/model.json", "--campaign", b2, "-o", "one/2", "--no-plots", "--force")
    single, joint = tree(shop / "one/2"), tree(shop / "one/joint")
    single["joint.json"] = joint.pop("model.json")
    assert tree(shop / "all/bushings/c") == single | joint


def test_a_bad_row_costs_that_row(typed, shop):
    """A test that is none, a missing file, a campaign of gigabytes, a model that is a pipe, a device or missing: one
    clear error a row, at once."""
    (shop / "bushings/b1/sweep_axial.csv").write_text("nonsense\n1\n")
    os.mkfifo(shop / "pipe.json")
    with (shop / "huge.toml").open("wb") as stream:
        stream.truncate(6 << 30)
    lines = {
        "bushings/b1/bushing.toml,,,": "sweep_axial.csv",
        "absent.toml,x,,": "there is no such file",
        "huge.toml,,fit,": "the file is too large",
        f"{'a' * 300}.toml,,fit,": "File name too long",
        "bushings/b0/bushing.toml,,predict,pipe.json": "this is not a file",
        "bushings/b0/bushing.toml,,predict,/dev/zero": "this is not a file",
        "bushings/b0/bushing.toml,,predict,absent.json": "there is no such file",
    }
    head = ["campaign,name,commands,model", "bushings/b0/bushing.toml,=cmd|' /C calc'!A0,,"]
    (shop / "m.csv").write_text("\n".join([*head, *lines]))
    done = typed("batch", "m.csv", "-o", "all", "--junit", "all/report.xml", status=1)
    assert "7 with an error" in done.text
    assert "x could not be evaluated: " in done.text
    assert "internal error of bushfit" not in done.text
    good, *bad = rows(shop / "all")
    assert good["name"].startswith("'="), "a spreadsheet must not run a name"
    assert [row["status"] for row in (good, *bad)] == ["done", *["failed"] * 7]
    assert [word in row["error"] for word, row in zip(lines.values(), bad, strict=True)] == [True] * 7
    assert bad[0]["mu [MPa]"] == ""
    (suite,) = JUnitXml.fromfile(str(shop / "all/report.xml"))
    assert (suite.tests, suite.errors, suite.failures) == (8, 7, 0)
    assert "sweep_axial.csv" in list(suite)[1].result[0].text
    typed("batch", "m.csv", "-o", "two", "--scheduler", "", status=2)


def test_a_parameter_on_a_bound_of_its_fit_passes_on_condition_and_is_named(typed, shop):
    campaign = shop / "bushings/b1/bushing.toml"
    campaign.write_text(campaign.read_text() + '\n[fit.mu]\nmax = "0.2 MPa"\n')
    (shop / "limits.toml").write_text('[parameters.mu]\nmax = "1 GPa"\n')
    done = typed(
        "batch", "bushings/b[013]/bushing.toml", "-o", "all", "--no-plots", "--limits", "limits.toml", "--json"
    )
    assert json.loads(done.stdout)["conditional"] == ["b1"]
    assert json.loads((shop / "all/bushings/b1/model.json").read_text())["parameters"]["mu"]["at_bound"] == "max"
    good, held, other = rows(shop / "all")
    assert (good["limits"], held["limits"], other["limits"]) == ("pass", "conditional pass", "pass")
    assert good["at bound"] == ""
    assert "mu (max)" in held["at bound"]
    assert "mu is at the max given in [fit]" in held["warnings"]
    assert "the maximum that the fit allows" in held["undecided limits"]
    assert ": the fit ends at a bound" in done.stderr
    assert "mu of b1" in done.stderr
    assert "b1: mu 0.2 MPa" in done.stderr
    typed("batch", "bushings/b[013]/bushing.toml", "-o", "none", "--no-plots", "--effect", "inertia", "--json")
    assert json.loads((shop / "none/bushings/b1/model.json").read_text())["parameters"]["mu"]["at_bound"] == "max"
    assert not any("inertia" in row["at bound"] for row in rows(shop / "none")), "no mass is an answer"


def deadly(task: RowTask, part: Row) -> tuple[RowFile, bool]:
    """The work, but the bushing b2 kills its process, as a system without memory does."""
    if part.name == "b2":
        os.kill(os.getpid(), signal.SIGKILL)
    return RowTask.__call__(task, part)


def test_a_campaign_that_kills_its_worker_is_told_once_and_the_others_go_on(typed, shop, monkeypatch):
    done_by = run.run_rows
    monkeypatch.setattr(run, "run_rows", lambda rows, task, *others: done_by(rows, partial(deadly, task), *others))
    done = typed("batch", PATTERN, "-o", "all", "--no-plots", "--no-report", "--jobs", "2", status=1)
    assert "4 evaluated, 1 with an error" in done.text
    assert not (shop / "all/index.html").exists()
    assert not {"Traceback", "\x1b"} & set(done.text.split()), "plain lines where there is no terminal"
    assert [row["status"] for row in rows(shop / "all")] == ["done", "done", "failed", "done", "done"]
    (told,) = [line for line in done.text.splitlines() if line.startswith("b2 ")]
    assert told.startswith("b2 could not be evaluated: its worker process ended, probably for lack of memory")
    assert not (shop / "all/bushings/b2").exists()


@pytest.mark.parametrize(
    ("report", "words"),
    [
        ("old.xml", "that bushfit did not write"), ("old.xml/r.xml", "not a folder"),
        ("bushings", "a folder has the name of a result file"), ("all/bushings/b0/r.xml", "in the results folder"),
        ("all/bushings/../batch.csv", "replace the table"), ("all/batch.png", "replace the table"),
    ],
)  # fmt: skip
def test_a_report_that_cannot_be_written_is_refused_before_the_work(typed, shop, report, words):
    (shop / "old.xml").write_text("old")
    done = typed("batch", PATTERN, "-o", "all", "--junit", report, status=2)
    assert all(part in done.stderr for part in (f"{report}, --junit: ", words, "another file with --junit"))
    assert "--output" not in done.stderr
    assert not (shop / "all").exists()
    assert (shop / "old.xml").read_text() == "old"
