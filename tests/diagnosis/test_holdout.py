"""Held-out gaps are those of a real refit without the part, and a name that only memorises is taken back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rigged import SHARED, Fitted, Measured, cut

from bushfit.diagnosis.evidence import fit
from bushfit.diagnosis.holdout import HeldOut, HoldOut, hold_out
from bushfit.fitting.data_sets import SweepData

INERTIA = {"inertia": {"mass": 0.06}}


def test_parts_and_gaps(measured: Measured, fitted: Fitted) -> None:
    campaign = measured(INERTIA, SHARED)
    found = hold_out(fitted(campaign), fitted(campaign, "inertia"))
    for part in found.parts:
        print(f"{part.part:32} {part.before:5.2f} {part.after:5.2f}")
    assert [part.part for part in found.parts] == [
        *(f"amplitude level {n}" for n in (1, 2, 3)),
        "top third of the frequencies",
        "radial direction",
        *(f"loop loop_axial_{n}" for n in (1, 2)),
    ]
    assert found.passed
    assert found.after < 1.1 < 1.5 < found.before


@pytest.mark.parametrize("which", ["top third of the frequencies", "amplitude level 3"])
def test_the_gap_is_that_of_a_refit(measured: Measured, fitted: Fitted, which: str) -> None:
    """The right model is nearly linear over what noise moves it: a true refit gives the same."""
    campaign = measured(INERTIA, SHARED)
    after = fitted(campaign, "inertia")
    (part,) = [part for part in hold_out(after, after).parts if part.part == which]
    kept, gone = [], []
    for data_set in after.data_sets:
        out = np.zeros(data_set.frequency.size, dtype=bool)
        if isinstance(data_set, SweepData):
            out = data_set.frequency > 105.0 if "third" in which else data_set.amplitude == data_set.amplitude.max()
        if not out.any():
            kept.append(data_set)
            continue
        assert isinstance(data_set, SweepData)
        restored = out[np.argsort(data_set.order)]
        for chosen, place in ((~restored, kept), (restored, gone)):
            place.append(replace(data_set, sweep=cut(data_set.sweep, chosen)))
    refitted = fit(after.model, kept, (), {})
    expected = np.sqrt(np.mean(np.concatenate([data_set.residual(refitted.model) for data_set in gone]) ** 2))
    print(f"{which}: {part.after:.4f}, refitted {expected:.4f}")
    # the parts of a block that is cut in two share an error, which whitening then treats apart
    assert part.after == pytest.approx(expected, rel=0.05)


def test_a_model_that_misses_something_is_stepped_to_where_the_rest_would_have_it(
    measured: Measured, fitted: Fitted
) -> None:
    """The plain model has far to go without the top third: by hand, least squares on the other rows."""
    evidence = fitted(measured(INERTIA, SHARED))
    (part,) = [part for part in hold_out(evidence, evidence).parts if "third" in part.part]
    top = np.concatenate(
        [
            np.tile(data_set.frequency > 105.0, 2)
            if isinstance(data_set, SweepData)
            else np.zeros(data_set.size, dtype=bool)
            for data_set in evidence.data_sets
        ]
    )
    slopes, residual = evidence.solution.jacobian, evidence.residual
    step = np.linalg.lstsq(slopes[:, ~top].T, -residual[~top], rcond=None)[0]
    expected = np.sqrt(np.mean((residual[top] + step @ slopes[:, top]) ** 2))
    fit_gap = np.sqrt(np.mean(residual[top] ** 2))
    print(f"{part.before:.3f}, by hand {expected:.3f}; as fitted {fit_gap:.3f}")
    assert part.before == pytest.approx(expected, rel=1e-6)
    assert part.before > 1.1 * fit_gap


def test_what_cannot_be_predicted_is_not_held_out(measured: Measured, fitted: Fitted) -> None:
    """Without its own rows nothing is known of a gain that only loops show."""
    campaign = measured()
    evidence = fitted(replace(campaign, loops=campaign.loops[:1]), "force_gain")
    assert not any("axial direction" in part.part for part in hold_out(evidence, evidence).parts)


def test_nothing_to_hold_out_falls_back_on_the_fit(measured: Measured, fitted: Fitted) -> None:
    campaign = measured()
    evidence = fitted(replace(campaign, sweeps=(), loops=campaign.loops[:1]))
    found = hold_out(evidence, evidence)
    assert found.parts == ()
    assert found.before == found.after == pytest.approx(np.sqrt(np.mean(evidence.residual**2)))


@pytest.mark.parametrize(
    ("before", "after", "parts", "passed"),
    [
        (5.0, 1.1, [(5.0, 1.1)], True),
        (5.0, 2.4, [(5.0, 2.4)], True),
        (5.0, 2.6, [(5.0, 2.6)], False),
        (1.5, 1.15, [(1.2, 1.3), (2.0, 1.0)], True),
        (1.5, 1.15, [(1.2, 1.35), (2.0, 1.0)], False),
    ],
)
def test_the_rule(before: float, after: float, parts: list[tuple[float, float]], passed: bool) -> None:
    """To at most 1.2 of the floor or less than half; no part more than 10 % worse."""
    found = HoldOut(tuple(HeldOut("", *pair) for pair in parts), before, after)
    assert found.passed is passed
