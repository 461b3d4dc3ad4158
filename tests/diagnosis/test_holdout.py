"""Held-out gaps are those of a real refit without the part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from asking import INERTIA, TWO, one_loop
from rigged import SHARED, Effects, Fitted, Measured

from bushfit.diagnosis.evidence import fit
from bushfit.diagnosis.holdout import hold_out, parts
from bushfit.fitting.coordinates import residual

#: A mass that bends a plain model far.
HEAVY = {"inertia": {"mass": 0.2}}


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


@pytest.mark.parametrize(
    ("hidden", "effects", "which"),
    [
        *((INERTIA, ("inertia",), which) for which in ("top third of the frequencies", "amplitude level 3")),
        *((INERTIA, (), which) for which in ("top third of the frequencies", "loop loop_axial_1")),
        (HEAVY, ("viscous",), "radial direction"),
        (TWO, (), "loop loop_axial_1"),
    ],
    ids=["right", "right level", "lacking", "lacking loop", "far", "far loop"],
)
def test_the_gap_is_that_of_a_refit(
    measured: Measured, fitted: Fitted, hidden: Effects, effects: tuple[str, ...], which: str
) -> None:
    """Of the right model, and of one that has far to go without the part: one step would miss the last two by 60 and
    30 %."""
    evidence = fitted(measured(hidden, SHARED), *effects)
    (found,) = [part for part in hold_out(evidence, evidence, {}).parts if part.part == which]
    (part,) = [part for part in parts(evidence.data_sets) if part.name == which]
    refitted = fit(evidence.model, part.rest(evidence.data_sets), (), {}).model
    expected = np.sqrt(np.mean(residual(refitted, evidence.data_sets)[part.rows(evidence.data_sets)] ** 2))
    as_fitted = np.sqrt(np.mean(evidence.residual[part.rows(evidence.data_sets)] ** 2))
    print(f"{which}: {found.after:.4f}, refitted {expected:.4f}; as fitted {as_fitted:.4f}")
    # the parts of a block that is cut in two share an error, which whitening then treats apart
    assert found.after == pytest.approx(expected, rel=0.05)
    assert effects or "third" not in which or found.after > 1.05 * as_fitted


def test_the_prediction_s_own_error_is_that_of_a_sandwich_of_runs_and_loops(measured: Measured, fitted: Fitted) -> None:
    """In full, by parameters: A^-1 M A^-1, M of what each run and each loop of the rest pulls, and at least A."""
    evidence, which = fitted(measured(INERTIA, SHARED)), "amplitude level 3"
    (found,) = [part for part in hold_out(evidence, evidence, {}).parts if part.part == which]
    rows = next(part for part in parts(evidence.data_sets) if part.name == which).rows(evidence.data_sets)
    slopes, left = evidence.solution.jacobian, evidence.residual
    pairs = [(data, getattr(data, "held", np.zeros(data.size // data.parts))) for data in evidence.data_sets]
    lines = np.concatenate([np.tile(held, data.parts) for data, held in pairs])
    tests = np.repeat(np.arange(len(pairs)), [data.size for data, _ in pairs])
    root = np.linalg.inv(np.linalg.cholesky(slopes[:, ~rows] @ slopes[:, ~rows].T))
    left = left - slopes.T @ (root.T @ root @ slopes[:, ~rows] @ left[~rows])
    groups = {(test, line): (tests == test) & (lines == line) & ~rows for test, line in zip(tests, lines, strict=True)}
    pulls = np.array([root @ slopes[:, group] @ left[group] for group in groups.values()])
    size, vectors = np.linalg.eigh(pulls.T @ pulls)
    error = slopes[:, rows].T @ root.T @ vectors * np.sqrt(np.maximum(size, 1.0))
    whole = np.eye(int(rows.sum())) + error @ error.T
    expected = np.sqrt(left[rows] @ np.linalg.solve(whole, left[rows]) / len(whole))
    print(f"{which}: {found.after:.3f}, in units of its own error too {expected:.3f}")
    assert found.whitened == pytest.approx((expected, expected), rel=1e-6)


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
