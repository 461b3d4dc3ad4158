"""Simulated campaigns that earlier searches named wrongly, or not at all, each with the step that it taught."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from cards.families import tasks
from cards.outcome import Outcome
from cards.scorecard import work

pytestmark = pytest.mark.slow


def both_or_nothing(outcome: Outcome) -> bool:
    """The model's springpot stood in for a dashpot, which then had no score of its own; and a third effect that was
    added on the way has to go again once the right two are there."""
    both = outcome.verdict == "named" and set(outcome.sets) == {(name,) for name in outcome.task.hidden}
    return (both or outcome.verdict == "described") and not outcome.wrong_kept  # a gap without a name is no wrong one


def errors_of_levels_are_no_name(outcome: Outcome) -> bool:
    """A force channel that saturates explained the top level as well as an error of the rig does."""
    return outcome.verdict == "consistent"


def what_moves_all_levels_is_named(outcome: Outcome) -> bool:
    """Errors of the levels explain loops that a gain sets apart from the sweeps nearly as well, but not as well."""
    return outcome.verdict in ("named", "ambiguous") and "force_gain" in outcome.sets[0]


def a_rival_is_not_left_on_its_way(outcome: Outcome) -> bool:
    """Without the factor the model bends its resonance, and from there a refit of the true effect hardly moved."""
    return outcome.truth_in_sets and not outcome.wrong_kept


def sticking_is_not_called_sliders(outcome: Outcome) -> bool:
    """What stands in place of a branch is asked for the form of its law too."""
    return not outcome.wrong_kept


def the_best_refit_comes_to_its_end(outcome: Outcome) -> bool:
    """A stiff friction lies at the end of a long valley; where its refit stopped short, a Maxwell arm made up."""
    return ("second_friction",) in outcome.sets


@pytest.mark.parametrize(
    ("card", "which", "right"),
    [
        ((64, 78004, "library"), ("clearance", "viscous"), both_or_nothing),
        ((64, 78004, "library"), ("high_pass", "second_friction"), both_or_nothing),
        ((130, 78009, "awkward"), 1920798623, errors_of_levels_are_no_name),
        ((130, 78009, "awkward"), 1284136027, errors_of_levels_are_no_name),
        ((300, 78014), 202619769, what_moves_all_levels_is_named),
        ((300, 78014), 895678439, a_rival_is_not_left_on_its_way),
        ((110, 78010, "outside"), 979478117, sticking_is_not_called_sliders),
        ((110, 78010, "outside"), 1762680746, sticking_is_not_called_sliders),
        ((300, 11), 949206328, the_best_refit_comes_to_its_end),
    ],
)
def test_what_was_once_wrong(card: Any, which: object, right: Callable[[Outcome], bool]) -> None:
    """A campaign of a card, by its seed or by what is hidden in it."""
    (task,) = (task for task in tasks(*card) if which in (task.seed, task.hidden))
    outcome = work(task)
    assert right(outcome), f"{outcome.verdict} {outcome.sets}"
