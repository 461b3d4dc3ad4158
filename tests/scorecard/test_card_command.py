"""`python -m tests.scorecard` as typed, and its ledger: a card goes on where it was stopped, one card a folder."""

from __future__ import annotations

import json
import os
import signal
from dataclasses import replace
from pathlib import Path

import pytest
from cards.command import command
from cards.hidden import Sealed
from cards.ledger import LEDGER, ledger
from cards.outcome import Outcome, Task
from commandline import call

from bushfit.errors import OutputError

SEED = 5


@pytest.mark.slow
def test_a_small_score_card(tmp_path: Path) -> None:
    """Made, stopped in the middle of a line, made again, and refused to another card."""
    folder = tmp_path / "x"
    asked = ("--campaigns", "5", "--jobs", "1", "-o", folder, "--json")
    run = call(tmp_path, *asked, program=command)
    assert run.returncode == 0, run.stderr
    document = json.loads(run.stdout)
    assert document == json.loads((folder / "scorecard.json").read_text())
    assert (document["campaigns"], document["families"]) == (5, ["effects"])
    assert len(document["outcomes"]) >= 5
    assert {"card", "confusion", "seed"} <= document.keys()
    assert "score card:" in run.stderr
    assert "false alarm on clean" in run.stderr  # and the rest of the name where the table breaks it
    assert {file.name for file in folder.glob("[!.]*")} == {"outcomes.jsonl", "scorecard.json"}
    file = folder / "outcomes.jsonl"
    file.write_bytes(file.read_bytes()[:-30])
    again = json.loads(call(tmp_path, *asked, "-q", program=command).stdout)
    one, other = ([{**each, "seconds": 0} for each in made["outcomes"]] for made in (document, again))
    assert one == other
    refused = call(tmp_path, *asked, "--seed", "2", program=command)
    assert refused.returncode == 2
    assert "outcomes of another card stand there" in refused.stderr


@pytest.mark.parametrize(
    "options", [("--campaigns", "1"), ("--seed", "-1"), ("--jobs", "0"), ("--family", "fault"), ("extra",)]
)
def test_wrong_usage_of_the_score_card(tmp_path: Path, options: tuple[str, ...]) -> None:
    run = call(tmp_path, *options, program=command)
    assert (run.returncode, run.stdout) == (2, "")
    assert options[0] in run.stderr


def deadly(chosen: list[Task], kept: Path | None, hours: float | None) -> list[Outcome | str]:
    """Tasks, the first of which kills its process, as a system without memory does; nothing comes of the others."""
    if any(task.seed == SEED for task in chosen):
        os.kill(os.getpid(), signal.SIGKILL)
    return [Outcome(task, None, "none") for task in chosen]


def test_a_campaign_that_kills_its_worker_fails_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tasks = [Task("clean", seed, ()) for seed in (SEED, SEED + 1)]
    monkeypatch.setattr("cards.command.tasks", lambda *_: tasks)
    monkeypatch.setattr("cards.scorecard._in_worker", deadly)
    run = call(tmp_path, "--campaigns", "5", "--jobs", "2", "--json", program=command)
    failed = [one for one in json.loads(run.stdout)["outcomes"] if one["verdict"] == "failed"]
    assert [one["task"]["seed"] for one in failed] == [SEED]
    assert "its worker process died twice" in failed[0]["error"]


ASKED = {"families": ["awkward"], "campaigns": 5, "seed": 1}
SEALED = Sealed(("delay",), {"mu": 1.1e6}, 0.05, True, 1)
ONE = Outcome(Task("fault", 1, (), "preload"), SEALED, "named", (("delay", "viscous"),), heldout=1.01)
TWO = replace(ONE, task=replace(ONE.task, seed=2), error="FitError: no")


def written(folder: Path, *outcomes: Outcome) -> dict[Task, Outcome]:
    """What stands in the folder, before these are written to it."""
    with ledger(folder, ASKED, force=False) as (done, write):
        for outcome in outcomes:
            write(outcome)
    return done


@pytest.mark.parametrize(("cut", "left"), [(1, [ONE]), (40, [ONE]), (10_000, [])])
def test_what_stands_comes_back_whole_and_a_torn_line_is_made_again(
    tmp_path: Path, cut: int, left: list[Outcome]
) -> None:
    assert written(tmp_path, ONE, TWO) == {}
    assert written(tmp_path) == {ONE.task: ONE, TWO.task: TWO}
    file = tmp_path / LEDGER
    whole = file.read_bytes()
    file.write_bytes(whole[:-cut] or whole[:20])  # in the last line, or in the first
    assert written(tmp_path, TWO) == {each.task: each for each in left}
    assert written(tmp_path) == {each.task: each for each in (*left, TWO)}


def test_another_card_or_a_line_that_is_no_outcome_is_refused(tmp_path: Path) -> None:
    written(tmp_path, ONE)
    other = {**ASKED, "seed": 2}
    with pytest.raises(OutputError, match="outcomes of another card stand there"), ledger(tmp_path, other, force=False):
        pass
    file = tmp_path / LEDGER
    file.write_bytes(file.read_bytes() + b'{"task": 1}\n')
    with pytest.raises(OutputError, match="line 3"):
        written(tmp_path)
    with ledger(tmp_path, other, force=True) as (done, _):
        assert done == {}


def test_two_runs_do_not_share_a_folder(tmp_path: Path) -> None:
    with ledger(tmp_path, ASKED, force=False), pytest.raises(OutputError, match="another score card is made there"):
        written(tmp_path)
