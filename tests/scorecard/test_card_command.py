"""`python -m tests.scorecard` as typed: a card made and written, and one error for wrong usage."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from cards.command import SCORECARD, command
from commandline import call


@pytest.mark.slow
def test_a_small_score_card(tmp_path: Path) -> None:
    """Made, made again alike, and never in place of another unasked."""
    folder = tmp_path / "x"
    asked = ("--campaigns", "5", "--jobs", "1", "-o", folder, "--json")
    run = call(tmp_path, *asked, program=command)
    assert run.returncode == 0, run.stderr
    document = json.loads(run.stdout)
    assert document == json.loads((folder / SCORECARD).read_text())
    assert (document["campaigns"], document["families"]) == (5, ["effects"])
    assert len(document["outcomes"]) >= 5
    assert {"card", "confusion", "seed"} <= document.keys()
    assert "score card:" in run.stderr
    assert "false alarm on clean" in run.stderr  # and the rest of the name where the table breaks it
    assert call(tmp_path, *asked, program=command).returncode == 2
    again = json.loads(call(tmp_path, *asked, "-q", "--force", program=command).stdout)
    one, other = ([{**each, "seconds": 0} for each in made["outcomes"]] for made in (document, again))
    assert one == other


@pytest.mark.parametrize(
    "options", [("--campaigns", "1"), ("--seed", "-1"), ("--jobs", "0"), ("--family", "fault"), ("extra",)]
)
def test_wrong_usage_of_the_score_card(tmp_path: Path, options: tuple[str, ...]) -> None:
    run = call(tmp_path, *options, program=command)
    assert (run.returncode, run.stdout) == (2, "")
    assert options[0] in run.stderr
