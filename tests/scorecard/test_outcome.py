"""What counts as right and as wrong on a card, and what its rows count."""

from __future__ import annotations

from collections.abc import Sequence
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


def test_a_target_is_met_where_the_whole_interval_is_within_it() -> None:
    clean = said("consistent", kind="awkward")
    for count, alarms, met in ((130, 0, None), (400, 0, True), (60, 3, False), (400, 4, None)):
        outcomes = [clean] * (count - alarms) + [said("unexplained", kind="awkward")] * alarms
        row = card(outcomes, "awkward")[0]
        assert (row.over, row.target, row.met) == (count, "<= 1 %", met)


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
