"""A small score card, as typed: no false alarm, no confident wrong name, the truth sealed, the same seed the same card.

And simulated campaigns that earlier searches named wrongly, or not at all, each with the step that it taught.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from cards.card import card
from cards.command import SCORECARD, command
from cards.families import DISTURBANCES, campaign_of, tasks
from cards.faults import FAULTS
from cards.hidden import FIRST
from cards.outcome import Outcome, Task
from cards.outside import OUTSIDE_LAWS
from cards.recipe import Recipe, cooked
from cards.scorecard import run, work
from commandline import call
from pydantic import TypeAdapter

from bushfit.effects import BASE, LIBRARY
from bushfit.simulation.measured import Simulated

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
    """A card as typed, without what the rig takes long to make; written, and never in place of another unasked."""
    folder = tmp_path_factory.mktemp("card")
    asked = ("--campaigns", COUNT, "--seed", SEED, "--jobs", "1", "--keep", "-o", folder / "x", "--json")
    assert not any("compliance" in name for task in tasks(COUNT, SEED) for name in task.hidden)
    run = call(folder, *asked, program=command)
    assert run.returncode == 0, run.stderr
    document = json.loads(run.stdout)
    assert document == json.loads((folder / "x" / SCORECARD).read_text())
    assert (document["campaigns"], document["families"], document["seed"]) == (COUNT, ["effects"], SEED)
    assert "false alarm on clean" in run.stderr  # and the rest of the name where the table breaks it
    assert call(folder, *asked, program=command).returncode == 2
    return folder / "x"


@pytest.fixture(scope="module")
def outcomes(folder: Path) -> list[Outcome]:
    made = json.loads((folder / SCORECARD).read_text())["outcomes"]
    return TypeAdapter(list[Outcome]).validate_python(made)


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
    # beside a smooth deviation of the compound one effect may take little off by itself, as a Maxwell arm here
    assert sum(each.gain > 100.0 for each in single) >= len(single) - 1
    assert sum(each.truth_in_sets for each in single) >= len(single) - 1


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


def named_both(outcome: Outcome) -> bool:
    both = outcome.verdict == "named" and set(outcome.sets) == {(name,) for name in outcome.task.hidden}
    return (both or outcome.verdict == "described") and not outcome.wrong_kept  # a gap without a name is no wrong one


def partly_right(outcome: Outcome) -> bool:
    """Some of what is hidden, and a remainder without a name."""
    names = {name for names in outcome.sets for name in names}
    return outcome.verdict == "partly" and names <= {*outcome.task.hidden, "unnamed"} and names != {"unnamed"}


#: Told as `unexplained` since a smooth deviation of the compound is part of every explanation: no wrong name, but none
#: where the tests show one.
WITHOUT_NAME = pytest.mark.xfail(
    reason="beside a smooth deviation of the compound the leader does not fit", strict=True
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("task", "right"),
    [
        # the model's springpot stood in for a dashpot, which then had no score of its own
        pytest.param(Task("two", 1248390658, ("clearance", "viscous")), named_both, marks=WITHOUT_NAME),
        # a third effect that was added on the way has to go again once the right two are there
        (
            Task("two", 967591611, ("high_pass", "second_friction")),
            lambda outcome: named_both(outcome) or partly_right(outcome),
        ),
        # a force channel that saturates explained the top level as well as an error of the rig does
        (Task("awkward", 1920798623, (), "level_errors_one"), lambda outcome: outcome.verdict == "consistent"),
        # errors of the levels explain loops that a gain sets apart from the sweeps nearly as well, but not as well
        (
            Task("single", 202619769, ("force_gain",)),
            lambda outcome: not outcome.wrong_kept and "force_gain" in outcome.sets[0],
        ),
        # without the factor the model bends its resonance, and from there a refit of the true effect hardly moved
        (
            Task("pair", 895678439, ("fixture_resonance", "stiffness_factor.radial")),
            lambda outcome: outcome.truth_in_sets and not outcome.wrong_kept,
        ),
        # what stands in place of a branch is asked for the form of its law too: sticking is not called sliders
        (Task("law", 979478117, (), "stick_slip"), lambda outcome: not outcome.wrong_kept),
        # a stiff friction lies at the end of a long valley; where its refit stopped short, a Maxwell arm made up
        pytest.param(
            Task("single", 949206328, ("second_friction",)),
            lambda outcome: ("second_friction",) in outcome.sets,
            marks=WITHOUT_NAME,
        ),
    ],
)
def test_what_was_once_wrong(task: Task, right: Callable[[Outcome], bool]) -> None:
    """A campaign of a card, whatever effects the library has gained since."""
    outcome = work(task)
    assert right(outcome), f"{outcome.verdict} {outcome.sets}"


OF_ALL = 4


@pytest.fixture(scope="module")
def plain() -> Simulated:
    return cooked(Recipe("as planned"), OF_ALL)[0]


def changes(one: Simulated, other: Simulated) -> list[float]:
    """Largest change of each sweep relative to |K|, and of each loop relative to half the range of its force."""
    swept = [
        np.max(np.abs(a.stiffness - b.stiffness) / np.abs(b.stiffness))
        for a, b in zip(one.sweeps, other.sweeps, strict=True)
    ]
    looped = [
        2.0 * np.max(np.abs(a.force - b.force)) / np.ptp(b.force) for a, b in zip(one.loops, other.loops, strict=True)
    ]
    return [float(change) for change in (*swept, *looped)]


@pytest.mark.parametrize(
    "task", [Task("law", OF_ALL, (), "rate_threshold"), Task("single", 3, ("inertia",)), Task("clean", 2, ())]
)
def test_the_same_seed_makes_the_same_campaign(task: Task) -> None:
    (one, sealed), (same, again) = campaign_of(task), campaign_of(task)
    assert sealed == again
    assert max(changes(one, same)) == 0.0
    assert one.campaign().simulate is None
    if task.kind == "clean":
        assert (sealed.hidden, sealed.visible, one.truth.effects) == ((), 0.0, BASE)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*FAULTS, *OUTSIDE_LAWS])
def test_what_is_wrong_shows_about_as_large_as_asked(name: str, plain: Simulated) -> None:
    made, sealed = cooked({**FAULTS, **OUTSIDE_LAWS}[name], OF_ALL)
    found = changes(made, plain)
    print(name, sealed.visible, found)
    if name == "loop_rate":
        assert max(found) == 0.0
        assert any(a.time[-1] != b.time[-1] for a, b in zip(made.loops, plain.loops, strict=True))
    elif name == "force_saturation":
        assert 0.002 < max(found[:2]) < 0.2
        assert max(found[2:]) == 0.0
    else:
        assert 0.3 * sealed.visible < max(found) < 4.0 * sealed.visible
    assert dict(made.truth.values) == dict(plain.truth.values) == dict(sealed.values)
