"""The verdict: look-alikes are a set, a name that does not hold out is taken back, and what cannot be shown is said."""

from __future__ import annotations

from dataclasses import replace

import pytest
from asking import INERTIA, asked, no_loops, no_repeats, no_sweeps, one_direction, said
from rigged import SHARED, Measured

from bushfit.campaign.schema import Loss
from bushfit.diagnosis import verdict
from bushfit.diagnosis.holdout import HoldOut
from bushfit.diagnosis.next_test import MENU
from bushfit.effects import BASE
from bushfit.model.file import to_document


def test_look_alikes_are_a_set_and_none_is_added(measured: Measured) -> None:
    """A little viscosity in one direction: sets, and the test that would tell."""
    diagnosis = asked(one_direction(measured({"viscous": {"eta": 25.0}}, SHARED)))
    assert diagnosis.verdict == "ambiguous"
    (leader,) = diagnosis.effects
    assert "viscous" in (leader.name, *leader.alternatives)
    assert 1 <= len(leader.alternatives) <= 2
    assert diagnosis.after is diagnosis.before
    assert diagnosis.result.model.effects == BASE
    print(diagnosis.next_test)
    assert diagnosis.next_test in {entry.words for entry in MENU}
    assert all(name in diagnosis.summary for name in (leader.name, *leader.alternatives))
    (entry,) = diagnosis.to_document()["effects"]
    assert entry["parameters"]


def test_a_name_that_does_not_hold_out_is_taken_back(measured: Measured, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verdict, "hold_out", lambda *_: HoldOut((), 2.0, 1.9))
    diagnosis = asked(measured(INERTIA, SHARED))
    assert diagnosis.verdict == "unexplained"
    assert diagnosis.effects == ()
    assert diagnosis.after is diagnosis.before
    assert "inertia" in diagnosis.summary
    assert "taken back" in diagnosis.summary


def test_what_the_tests_cannot_show_is_said(measured: Measured) -> None:
    campaign = measured({}, SHARED)
    (note,) = asked(no_loops(campaign)).notes
    assert note.startswith("not identifiable from these tests: ")
    assert {"asymmetry", "force_offset", "force_gain"} <= set(note.partition(": ")[2].split(", "))
    (note,) = asked(no_sweeps(campaign)).notes
    assert {"viscous", "maxwell", "force_gain"} <= set(note.partition(": ")[2].split(", "))
    assert any("nothing was repeated" in note and "assumed" in note for note in asked(no_repeats(campaign)).notes)
    assert asked(campaign).notes == ()


@pytest.mark.parametrize("loss", ["linear", "soft_l1"])
def test_a_wild_point_is_listed_whatever_the_loss(measured: Measured, loss: Loss) -> None:
    campaign = measured({}, SHARED)
    stiffness = campaign.sweeps[0].stiffness.copy()
    stiffness[11] *= 1.1
    sweeps = (replace(campaign.sweeps[0], stiffness=stiffness), *campaign.sweeps[1:])
    diagnosis = asked(replace(campaign, sweeps=sweeps, fit=replace(campaign.fit, loss=loss)))
    assert [(entry.test, entry.row) for entry in diagnosis.result.outliers] == [(campaign.sweeps[0].name, 12)]
    (note,) = [note for note in diagnosis.notes if "row 12" in note]
    assert ("the fit follows them" if loss == "linear" else "left out of the fit") in note


def test_what_stays_open_of_the_final_model_goes_with_it(measured: Measured) -> None:
    campaign = measured({}, SHARED)
    result = asked(no_sweeps(campaign)).result
    print(*result.warnings, sep="\n")
    assert any("cannot be told from one another" in line for line in to_document(result)["warnings"])
    assert asked(campaign).result.warnings == ()


#: 3 % of give in the axial direction, 17 % in the radial, measured at a few frequencies.
SOFT_RIG = {"rig_compliance": {"compliance": 4e-8}}


FEW = replace(
    SHARED, sweeps=tuple(replace(sweep, frequencies=(5.0, 25.0, 55.0, 85.0, 115.0, 155.0)) for sweep in SHARED.sweeps)
)


def test_compliance_in_one_direction_alone_is_never_a_bold_name(measured: Measured) -> None:
    """A softer rig and a softer rubber look alike in one direction; two tell."""
    campaign = measured(SOFT_RIG, FEW)
    whole = asked(campaign)
    assert said(whole) == "named rig_compliance"
    low, high = whole.result.interval("rig_compliance.compliance") or (0.0, 0.0)
    print(f"compliance {low:.3g} to {high:.3g}, truth 4e-8")
    assert low <= 4e-8 <= high
    for alone in (
        replace(campaign, sweeps=campaign.sweeps[:1]),
        replace(campaign, sweeps=campaign.sweeps[1:], loops=()),
    ):
        assert asked(alone).verdict in ("consistent", "ambiguous")
