"""`python -m tests.scorecard` as typed: what it writes, goes on with, and refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from cards.command import command
from commandline import call


@pytest.mark.slow
def test_a_small_score_card(tmp_path: Path) -> None:
    run = call(tmp_path, "--campaigns", "5", "--jobs", "1", "-o", str(tmp_path / "x"), "--json", program=command)
    assert run.returncode == 0, run.stderr
    document = json.loads(run.stdout)
    assert document == json.loads((tmp_path / "x" / "scorecard.json").read_text())
    assert (document["campaigns"], document["families"]) == (5, ["effects"])
    assert len(document["outcomes"]) >= 5
    assert {"card", "confusion", "seed"} <= document.keys()
    assert "score card:" in run.stderr
    assert "false alarm on clean" in run.stderr  # and the rest of the name where the table breaks it
    assert {file.name for file in (tmp_path / "x").glob("[!.]*")} == {"outcomes.jsonl", "scorecard.json"}
    lines = (tmp_path / "x" / "outcomes.jsonl").read_bytes().splitlines(keepends=True)
    (tmp_path / "x" / "outcomes.jsonl").write_bytes(b"".join(lines[:-1]) + lines[-1][:30])
    again = call(
        tmp_path, "--campaigns", "5", "--jobs", "1", "-o", str(tmp_path / "x"), "--json", "-q", program=command
    )
    told = json.loads(again.stdout)
    assert [{**one, "seconds": 0} for one in told["outcomes"]] == [
        {**one, "seconds": 0} for one in document["outcomes"]
    ]
    other = call(tmp_path, "--campaigns", "5", "--seed", "2", "-o", str(tmp_path / "x"), program=command)
    assert other.returncode == 2
    assert "outcomes of another card stand there" in other.stderr


@pytest.mark.parametrize(
    "options",
    [
        ("--campaigns", "0"),
        ("--campaigns", "1"),
        ("--seed", "-1"),
        ("--jobs", "0"),
        ("--campaigns", "few"),
        ("--family", "fault"),
        ("extra",),
    ],
)
def test_wrong_usage_of_the_score_card(tmp_path: Path, options: tuple[str, ...]) -> None:
    run = call(tmp_path, *options, program=command)
    assert run.returncode == 2
    assert run.stdout == ""
    assert options[0] in run.stderr


def test_the_card_promises_no_folder(tmp_path: Path) -> None:
    words = " ".join(call(tmp_path, "--help", program=command).stdout.split())
    assert "[nothing is written]" in words
    assert "results/<campaign" not in words
