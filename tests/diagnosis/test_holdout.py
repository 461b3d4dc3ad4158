"""Held-out gaps are those of a real refit without the part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from asking import INERTIA, one_loop
from rigged import SHARED, Fitted, Measured

from bushfit.diagnosis.evidence import fit
from bushfit.diagnosis.holdout import hold_out, parts
from bushfit.fitting.coordinates import residual


def test_parts_and_gaps(measured: Measured, fitted: Fitted) -> None:
    campaign = measured(INERTIA, SHARED)
    found = hold_out(fitted(campaign), fitted(campaign, "inertia"), {})
    for part in found.parts:
        print(f"{part.part:32} {part.before:5.2f} {part.after:5.2f}")
    assert [part.part for part in found.parts] == [
        *(f"amplitude level {n}" for n in (1, 2, 3)),
        "top third of the frequencies",
        "radial direction",
        *(f"loop loop_axial_{n}" for n in (1, 2)),
    ]
    assert [skipped.part for skipped in found.skipped] == ["axial direction"]
    assert found.before is not None
    assert found.after is not None
    assert found.after < 1.1 < 1.5 < found.before


@pytest.mark.parametrize("which", ["top third of the frequencies", "amplitude level 3", "loop loop_axial_1"])
@pytest.mark.parametrize("effects", [("inertia",), ()], ids=["right", "lacking"])
def test_the_gap_is_that_of_a_refit(measured: Measured, fitted: Fitted, which: str, effects: tuple[str, ...]) -> None:
    """Of the right model, and of one that has far to go without the part."""
    evidence = fitted(measured(INERTIA, SHARED), *effects)
    (found,) = [part for part in hold_out(evidence, evidence, {}).parts if part.part == which]
    (part,) = [part for part in parts(evidence.data_sets) if part.name == which]
    refitted = fit(evidence.model, part.rest(evidence.data_sets), (), {}).model
    expected = np.sqrt(np.mean(residual(refitted, evidence.data_sets)[part.rows(evidence.data_sets)] ** 2))
    as_fitted = np.sqrt(np.mean(evidence.residual[part.rows(evidence.data_sets)] ** 2))
    print(f"{which}: {found.after:.4f}, refitted {expected:.4f}; as fitted {as_fitted:.4f}")
    # the parts of a block that is cut in two share an error, which whitening then treats apart
    assert found.after == pytest.approx(expected, rel=0.05)
    assert effects or "third" not in which or found.after > 1.05 * as_fitted


def test_what_cannot_be_predicted_is_told_with_the_reason(measured: Measured, fitted: Fitted) -> None:
    """Without its own rows nothing is known of a gain that only loops show."""
    campaign = measured()
    evidence = fitted(replace(campaign, loops=campaign.loops[:1]), "force_gain")
    found = hold_out(evidence, evidence, {})
    assert not any("axial direction" in part.part for part in found.parts)
    (skipped,) = [skipped for skipped in found.skipped if skipped.part == "axial direction"]
    print(skipped)
    assert "force_gain" in skipped.effects
    assert "force_gain.g" in skipped.reason


def test_nothing_to_hold_out_is_nothing_tested(measured: Measured, fitted: Fitted) -> None:
    evidence = fitted(one_loop(measured()))
    found = hold_out(evidence, evidence, {})
    assert found.parts == ()
    assert found.before is found.after is None
