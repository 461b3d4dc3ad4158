"""A small score card: no false alarm, no confident wrong name, the truth sealed, the same seed the same card."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from cards.card import card
from cards.families import DISTURBANCES, RECIPES, tasks
from cards.hidden import FIRST, hideable
from cards.outcome import Outcome, Task
from cards.scorecard import run

from bushfit.effects import BASE, LIBRARY

COUNT, SEED = 12, 5


def test_a_card_has_every_kind_and_the_same_seed_the_same() -> None:
    large = tasks(300, 1)
    kinds = {kind: sum(task.kind == kind for task in large) for kind in {task.kind for task in large}}
    assert kinds == {"single": 150, "clean": 60, "pair": 30, "outside": 30, "lacking": 30}
    assert {task.hidden[0] for task in large if task.kind == "single"} == set(FIRST) <= set(LIBRARY) - set(BASE)
    assert {task.outside for task in large if task.kind == "outside"} == set(DISTURBANCES)
    assert all(task.without == task.hidden for task in large if task.kind == "lacking")
    assert len({(task.kind, task.seed) for task in large}) == len(large)
    assert large == tasks(300, 1) != tasks(300, 2)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("card")


@pytest.fixture(scope="module")
def outcomes(folder: Path) -> list[Outcome]:
    """Of a card without what the rig takes long to make."""
    done: list[Outcome] = []
    quick = [task for task in tasks(COUNT, SEED) if not any("compliance" in name for name in task.hidden)]
    found = run(quick, folder, 1, done.append)
    assert {outcome.task for outcome in done} == {outcome.task for outcome in found}
    return found


@pytest.mark.slow
def test_no_false_alarm_and_no_confident_wrong_name(outcomes: list[Outcome]) -> None:
    for outcome in outcomes:
        truth = " + ".join(outcome.task.hidden) or outcome.task.outside or "none"
        print(f"{outcome.task.kind:8} {truth:42} {outcome.verdict:12} {outcome.sets} {outcome.seconds:5.1f} s")
    assert len(outcomes) >= 10
    assert [each.error for each in outcomes if each.error] == []
    assert [each.task for each in outcomes if each.task.kind == "clean" and each.verdict != "consistent"] == []
    assert [each.task for each in outcomes if each.single_wrong and each.task.kind != "lacking"] == []
    single = [each for each in outcomes if each.task.kind == "single"]
    assert all(each.gain > 100.0 for each in single)
    assert sum(each.truth_in_sets for each in single) >= len(single) - 1


@pytest.mark.slow
def test_truths_are_sealed_apart_from_the_campaigns(outcomes: list[Outcome], folder: Path) -> None:
    for outcome in outcomes:
        task, stem = outcome.task, f"{outcome.task.kind}_{outcome.task.seed}"
        sealed = json.loads((folder / "sealed" / f"{stem}.json").read_text())
        assert tuple(sealed["hidden"]) == (RECIPES[task.kind][task.outside].truths if task.outside else task.hidden)
        names = {file.name for file in (folder / stem).iterdir()}
        assert {"campaign.toml", "loop_axial_1.csv", "sweep_axial.csv"} <= names
        assert not any("truth" in name or name.endswith(".json") for name in names)
        text = (folder / stem / "campaign.toml").read_text()
        assert not any(name in text for name in hideable())
        assert "[simulate" not in text


@pytest.mark.slow
def test_mistakes_are_told_and_none_is_made_up(tmp_path: Path) -> None:
    """The most frequent of them, a clean campaign, and one that the reader refuses."""
    large = tasks(500, 7, "mistakes")
    chosen = [next(task for task in large if task.hidden == hidden) for hidden in (("peak_to_peak",), ("inch",), ())]
    found = run([*chosen, Task("mistake", 6, ("complement",))], tmp_path, 1, lambda _: None)
    for outcome in found:
        print(outcome.task.hidden, outcome.verdict, outcome.named, f"matters: {outcome.matters}")
    peaks, inches, clean, refused = found
    assert peaks.mistake_alone
    assert inches.mistake_alone
    assert not any(outcome.single_wrong for outcome in found)
    assert (clean.verdict, clean.named, refused.verdict) == ("consistent", (), "refused")
    rows = {row.measure: row for row in card(found, "mistakes")}
    few = ("another mistake or an effect named", "anything named on clean campaigns")
    for measure, figure in {"mistake told where it matters": "100.0", **dict.fromkeys(few, "0.0")}.items():
        assert rows[measure].figure.startswith(f"{figure} %")
        assert rows[measure].met is None  # so few do not say that a target is met
