"""What counts as right and as wrong on a card, and what its rows count."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest
from cards.card import Row, card
from cards.hidden import Sealed
from cards.outcome import Outcome, Task

EVERYWHERE, EITHER = ("sleeve_compliance",), ("sleeve_compliance", "sleeve_compliance.radial")


def said(
    verdict: str, *sets: tuple[str, ...], truths: tuple[str, ...] = (), kind: str = "fault", **more: Any
) -> Outcome:
    """What was said of a campaign of a kind; in a fault the truths are not hidden effects."""
    hidden = () if kind == "fault" else truths
    sealed = Sealed(truths, {}, more.pop("visible", 0.05), False, 1)
    return Outcome(Task(kind, 1, hidden, without=hidden if kind == "lacking" else ()), sealed, verdict, sets, **more)


def rows_of(outcomes: Sequence[Outcome], family: Any) -> dict[str, Row]:
    return {row.measure.strip(): row for row in card(outcomes, family)}


@pytest.mark.parametrize(
    ("outcome", "kept", "wrong_set"),
    [
        (said("named", ("delay",), truths=("delay",)), (), False),
        (said("named", ("delay",)), ("delay",), False),
        (said("partly", ("delay",), ("inertia",), truths=("delay",)), ("inertia",), False),
        (said("unexplained", ("delay",)), (), False),
        (said("described", ("unnamed",)), (), False),
        (said("ambiguous", ("delay", "viscous"), truths=("viscous",)), (), False),
        (said("ambiguous", ("delay", "viscous"), truths=("inertia",)), (), True),
        (said("ambiguous", ("delay", "viscous"), ("inertia",), truths=("viscous",)), ("inertia",), False),
        (said("named", ("stiffness_factor.radial",), truths=("stiffness_factor",)), (), False),
        (said("named", ("interface_slip",), truths=("guide_friction",)), (), False),
        (said("named", ("viscous",), truths=("maxwell",)), (), False),
        (said("named", EVERYWHERE, truths=("rig_compliance.radial",)), EVERYWHERE, False),
        (
            said("named", ("sleeve_compliance.radial",), truths=("rig_compliance",)),
            ("sleeve_compliance.radial",),
            False,
        ),
        (said("ambiguous", EITHER, truths=("rig_compliance.radial",)), (), False),
    ],
)
def test_every_wrong_name_counts(outcome: Outcome, kept: tuple[str, ...], wrong_set: bool) -> None:
    assert (outcome.wrong_kept, outcome.wrong_set) == (kept, wrong_set)
    assert outcome.single_wrong == (outcome.verdict == "named" and bool(kept))


def test_a_level_that_stays_open_counts_as_told() -> None:
    for name, right in (("interface_slip", True), ("inertia", False)):
        assert said("named", (name,), truths=("guide_friction",), kind="alone").truth_in_sets is right


def test_what_a_session_settles() -> None:
    """Rightly with one true name of each set, wrongly with another, else it stays open; the card counts them."""
    was = said("ambiguous", ("delay", "viscous"), truths=("viscous",))
    then = [
        said("named", ("viscous",), truths=("viscous",)).settles,
        said("partly", ("delay",), truths=("viscous",)).settles,
        said("ambiguous", ("viscous", "delay"), truths=("viscous",)).settles,
        said("unexplained", truths=("viscous",)).settles,
    ]
    assert then == ["rightly", "wrongly", "open", "open"]
    twin = said("named", ("interface_slip",), truths=("guide_friction",))
    assert [each.left_open for each in (was, twin, said("named", ("delay",)))] == [True, True, False]
    outcomes = [replace(was, settled=settled) for settled in (*then, "elsewhere")]
    rows = rows_of([*outcomes, replace(twin, settled="elsewhere")], "faults")
    assert rows["ambiguous, settled rightly by a session"].figure.startswith("25.0 %")
    assert rows["settled wrongly"].over == 4
    assert rows["ambiguous, and no session would tell"].figure.startswith("20.0 %")
    assert rows["level unresolved: a test without the bushing decides"].figure == "1"
    assert not any("session" in row.measure for row in card([was], "faults"))


def test_a_target_is_met_where_the_whole_interval_is_within_it() -> None:
    clean = said("consistent", kind="awkward")
    for count, alarms, met in ((130, 0, None), (400, 0, True), (60, 3, False), (400, 4, None)):
        outcomes = [clean] * (count - alarms) + [said("unexplained", kind="awkward")] * alarms
        row = card(outcomes, "awkward")[0]
        assert (row.over, row.target, row.met) == (count, "<= 1 %", met)


@pytest.mark.parametrize(
    ("leader", "outcome", "right"),
    [
        ("delay", said("named", truths=("delay",), kind="alone"), True),
        ("viscous", said("named", truths=("delay",), kind="alone"), False),
        ("viscous", said("named", truths=("maxwell",), kind="alone"), True),  # its limit
        ("interface_slip", said("named", truths=("guide_friction",), kind="alone"), True),  # its twin
        ("delay", said("named", truths=("delay", "inertia"), kind="two"), False),
        ("inertia + delay", said("named", truths=("delay", "inertia"), kind="two"), True),
        ("delay + something without a name", said("partly", truths=("delay",), kind="alone"), False),
        ("delay", said("named", truths=("delay", "viscous")), True),
        ("fault: 50 Hz in axial", said("unexplained", truths=("delay",)), None),
        ("inertia + something without a name", said("partly", kind="law"), False),
        ("errors of levels beyond the class of the rig", said("unexplained", kind="awkward"), False),
    ],
)
def test_the_likeliest_is_right_if_all_of_it_is(leader: str, outcome: Outcome, right: bool | None) -> None:
    task = replace(outcome.task, outside="" if outcome.task.hidden else "recipe")
    assert replace(outcome, task=task, leader=leader, odds=0.9).leader_right is right


def test_told_odds_are_counted() -> None:
    """Of 100 told with 60 %, 62 are right; of 100 told with 90 %, half; three that were all but sure say nothing."""
    right, wrong = (said("named", truths=(name,), kind="alone", leader="delay") for name in ("delay", "inertia"))
    counts = ((0.6, 62, 38), (0.9, 50, 50), (1.0, 3, 0))
    outcomes = [
        replace(each, odds=odds)
        for odds, hits, others in counts
        for each, count in ((right, hits), (wrong, others))
        for _ in range(count)
    ]
    outcomes += [said("consistent", kind="alone", nothing=0.995, visible=0.004)] * 3
    outcomes += [said("consistent", kind="alone", nothing=0.995)]
    rows = rows_of(outcomes, "library")
    told = [rows[f"the likeliest, told {words}: right"] for words in ("0.5 to 0.8", "0.8 to 0.97", "0.97 to 1")]
    assert [(row.over, row.target, row.met) for row in told] == [
        (100, "60 %", True),
        (100, "90 %", False),
        (3, "100 %", None),
    ]
    risks = [row.figure[:6] for measure, row in rows.items() if measure.endswith(": wrong")]
    assert "told 0.8 and more, 51 % of answers: wrong" in rows
    assert risks[-3:] == ["43.3 %", "48.5 %", "0.0 % "]
    nothing = rows["nothing, told 0.99 and more: nothing to see"]
    assert (nothing.figure[:6], nothing.over, nothing.met) == ("75.0 %", 4, False)


def test_the_card_of_what_the_library_lacks() -> None:
    halved = said("described", ("unnamed",), kind="law", before=3.0, heldout=1.5)
    whole = said("unexplained", kind="law", before=3.0, heldout=3.0)
    silent = said("consistent", kind="law", before=1.02, heldout=1.02)
    wrong = said("partly", ("delay",), kind="three", before=2.0, heldout=1.1, truths=("inertia",))
    rows = rows_of([halved, whole, silent, wrong], "outside")
    assert rows["physics the library lacks: a wrong name or part kept"].figure.startswith("25.0 %")
    closed = rows["excess of the held-out gap at least halved, where it shows"]
    assert (closed.figure[:6], closed.over) == ("66.7 %", 3)


def test_the_card_counts() -> None:
    made = [
        said("named", ("inertia",), truths=("inertia",), kind="single", covered=(True,), gain=500.0),
        said("named", ("delay",), truths=("inertia",), kind="single", gain=500.0),
        said("ambiguous", ("delay", "inertia", "viscous"), truths=("inertia",), kind="single", gain=500.0),
        said("ambiguous", ("delay", "inertia", "viscous", "maxwell"), truths=("inertia",), kind="single", gain=20.0),
        said("consistent", kind="clean"),
        said("ambiguous", ("delay", "viscous"), kind="clean"),
        said("named", ("inertia",), truths=("inertia", "delay"), kind="pair", gain=500.0),
        said("named", ("delay",), truths=("inertia",), kind="lacking", gain=500.0),
    ]
    rows = rows_of(made, "effects")
    expected = {
        "false alarm on clean campaigns": "50.0 % (1.3 to 98.7)",  # one of two, after Clopper and Pearson
        "truth named alone or in a set of at most three": "50.0 %",
        "a single, confident, wrong name": "20.0 %",
        "single name where the effect is plain": "33.3 %",
        "two effects at once, both named": "0.0 %",
        "outside the list: no confident name": "0.0 %",
        "of these a disturbance of the rig": "no case",
        "95 % interval covers the truth, where named": "100.0 %",
    }
    assert [name for name, figure in expected.items() if not rows[name].figure.startswith(figure)] == []
    assert rows["false alarm on clean campaigns"].met is False
    assert rows["of these a disturbance of the rig"].met is None
    assert rows["processor time of one diagnosis, median / longest"].met is True


def test_another_mistake_counts_as_wrong() -> None:
    label = "inch:sweep_axial"
    right = said("named", (label,), truths=(label,), kind="mistake", matters=True)
    wrong = replace(right, sets=(("pound_per_inch:sweep_axial",),))
    assert right.mistake_alone
    assert wrong.single_wrong
    assert not any((wrong.mistake_told, wrong.mistake_alone))
    assert (
        rows_of([wrong, said("consistent", kind="clean")], "mistakes")["another mistake or an effect named"].met
        is False
    )
