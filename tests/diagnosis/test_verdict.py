"""The verdict: look-alikes are a set, twins leave the level open, and what cannot be shown is said."""

from __future__ import annotations

from dataclasses import replace

import pytest
from asking import asked, no_loops, no_repeats, no_sweeps, said
from rigged import SHARED, Measured

from bushfit.campaign.schema import RigSettings
from bushfit.effects import BASE
from bushfit.fitting.data import Data
from bushfit.geometry import Direction
from bushfit.model.file import to_document


def test_what_the_tests_cannot_show_is_said_and_goes_with_the_model(measured: Measured) -> None:
    campaign = measured({}, SHARED)
    for part, unseen in (
        (no_loops, {"asymmetry", "force_offset", "force_gain"}),
        (no_sweeps, {"viscous", "maxwell", "force_gain"}),
    ):
        diagnosis = asked(part(campaign))
        assert said(diagnosis) == "consistent "
        (note,) = diagnosis.notes
        assert note.startswith("not identifiable from these tests: ")
        assert unseen <= set(note.partition(": ")[2].split(", "))
    assert any("cannot be told from one another" in line for line in to_document(diagnosis.result)["warnings"])
    whole = asked(campaign)
    assert whole.notes == whole.result.warnings == ()


def test_the_class_of_a_rig_that_is_assumed_is_said(measured: Measured) -> None:
    campaign = no_repeats(measured({}, SHARED))
    for rig, words in (
        (RigSettings(), "0.5 % gain and 0.25 deg phase, gain and phase assumed"),
        (RigSettings(gain_error=4e-3), "0.4 % gain and 0.25 deg phase, phase assumed"),
        (RigSettings(gain_error=4e-3, phase_error=3.5e-3), ""),
    ):
        assumed = Data.of(replace(campaign, rig=rig)).assumed
        assert [note.partition(" class, ")[2] for note in assumed] == [words] * bool(words)


#: 3 % of give in the axial direction, 17 % in the radial, measured at a few frequencies.
SOFT_RIG = {"rig_compliance": {"compliance": 4e-8}}
FEW = tuple(replace(sweep, frequencies=(5.0, 25.0, 55.0, 85.0, 115.0, 155.0)) for sweep in SHARED.sweeps)
#: With torsion, in which nothing gives way along a line: it tells the rubber by itself.
TURNED = replace(SHARED, sweeps=(*FEW, replace(FEW[0], direction=Direction.TORSION, amplitudes=(0.01, 0.03))))


@pytest.mark.slow
def test_compliance_in_one_direction_alone_is_never_a_bold_name(measured: Measured) -> None:
    """A softer rig and a softer rubber look alike in one direction; two leave open which gives way, torsion tells."""
    campaign = measured(SOFT_RIG, TURNED)
    whole = asked(campaign)
    assert said(whole) == "named sleeve_compliance"
    assert said(asked(replace(campaign, sweeps=campaign.sweeps[:2]))) == (
        "ambiguous sleeve_compliance|sleeve_compliance.radial"
    )
    assert whole.result.unresolved == ("sleeve_compliance",)
    (entry,) = whole.to_document()["effects"]
    assert (entry["level"], entry["twins"]) == ("unresolved", ["rig_compliance"])
    low, high = whole.result.interval("sleeve_compliance.compliance") or (0.0, 0.0)
    assert low <= 4e-8 <= high
    for alone in (
        replace(campaign, sweeps=campaign.sweeps[:1]),
        replace(campaign, sweeps=campaign.sweeps[1:2], loops=()),
    ):
        assert asked(alone).verdict in ("consistent", "ambiguous")
    again = asked(campaign, whole.result.model, unresolved=whole.result.unresolved)
    assert (again.verdict, again.result.unresolved) == ("consistent", ("sleeve_compliance",))
    settled = asked(campaign, whole.result.model, unresolved=whole.result.unresolved, adopt=("rig_compliance",))
    assert (settled.verdict, settled.result.unresolved) == ("consistent", ())
    assert settled.result.model.effects == (*BASE, "rig_compliance")
    assert settled.result.model.values["rig_compliance.compliance"] == pytest.approx(
        whole.result.model.values["sleeve_compliance.compliance"], rel=1e-3
    )
    proposed = {judged.name for judged in settled.candidates}
    assert not proposed & {"sleeve_compliance", "rig_compliance"}
