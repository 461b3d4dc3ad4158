"""The search weighs sets of explanations: what is there is the likeliest, alone, beside others, and in every order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from asking import INERTIA, SLIP, TWO, asked, names, said
from rigged import LEVELS, SHARED, Diagnosed, Effects, Measured, Tamper, changed, loop_too_strong, off

from bushfit.campaign.schema import Loss
from bushfit.effects import BASE

#: The axial level of 0.2 mm.
level_too_stiff = off(0, 1.05, amplitude=LEVELS[1])


@pytest.mark.parametrize(
    "truth", [TWO, *(pytest.param(one, marks=pytest.mark.slow) for one in (INERTIA, SLIP))], ids="+".join
)
def test_what_is_there_is_all_but_sure(diagnosed: Diagnosed, truth: Effects) -> None:
    """A mass is no fixture resonance far above, which fits as well and says more; slip is no fault of one level."""
    diagnosis = diagnosed(truth, SHARED)
    assert diagnosis.verdict == "named"
    assert names(diagnosis) == set(truth)
    assert diagnosis.odds.nothing < 1e-6
    assert set(diagnosis.odds.labels[0].split(" + ")) == set(truth)
    assert diagnosis.odds.told[0][1] > 0.97
    assert diagnosis.result.model.effects[:3] == BASE
    assert diagnosis.calibration[1] < 1.1 < 1.2 < diagnosis.calibration[0]


@pytest.mark.parametrize(
    ("tamper", "place"),
    [
        (level_too_stiff, "the axial level 0.2 mm"),
        pytest.param(
            off(1, 1.0 + 0.05j, frequency=75.0), "75 Hz in radial, at every amplitude", marks=pytest.mark.slow
        ),
        pytest.param(
            off(0, 1.1, amplitude=LEVELS[1], repeat=2), "repeat 2 of the axial level 0.2 mm", marks=pytest.mark.slow
        ),
        (loop_too_strong, "the loop loop_axial_2"),
    ],
    ids=["level", "frequency", "repeat", "loop"],
)
def test_what_one_place_alone_shows_is_to_be_measured_again(measured: Measured, tamper: Tamper, place: str) -> None:
    """However far the levels' own errors could stretch."""
    diagnosis = asked(tamper(measured(plan=SHARED)))
    assert said(diagnosis) == "unexplained "
    assert diagnosis.after is diagnosis.before
    assert place in diagnosis.summary
    assert place in diagnosis.where[0].reading
    assert diagnosis.next_test == f"measure again: {place}"
    assert diagnosis.odds.labels[0] == f"fault: {place}"


@pytest.mark.slow
def test_a_fault_beside_an_effect_hides_neither(measured: Measured) -> None:
    diagnosis = asked(level_too_stiff(measured(INERTIA, SHARED)))
    assert "the axial level 0.2 mm" in diagnosis.summary
    assert "inertia + fault: the axial level 0.2 mm" in diagnosis.odds.labels
    assert diagnosis.odds.nothing < 1e-6


def test_errors_of_every_level_within_the_class_are_nothing(measured: Measured) -> None:
    campaign, random = measured(plan=SHARED), np.random.default_rng(3)
    for number, sweep in enumerate(campaign.sweeps):
        levels, place = np.unique(sweep.amplitude, return_inverse=True)
        campaign = changed(campaign, number, (1.0 + 0.005 * random.standard_normal(levels.size))[place])
    assert asked(campaign).verdict == "consistent"


@pytest.mark.parametrize(
    ("effects", "factor", "loss"),
    [
        ({}, 1.04, "linear"),
        ({}, 1.04, "soft_l1"),
        pytest.param({}, 1.15, "linear", marks=pytest.mark.slow),
        pytest.param(SLIP, 1.15, "linear", marks=pytest.mark.slow),
    ],
)
def test_a_wild_row_is_a_warning(measured: Measured, effects: Effects, factor: float, loss: Loss) -> None:
    """One row of 288 is left out and named by its number; it neither makes a gap nor hides one."""
    campaign = measured(effects, SHARED)
    campaign = replace(campaign, fit=replace(campaign.fit, loss=loss))
    sweep = campaign.sweeps[0]
    where = {"amplitude": LEVELS[1], "repeat": 2, "frequency": 65.0}
    row = int(np.flatnonzero(np.all([getattr(sweep, name) == value for name, value in where.items()], axis=0))[0]) + 1
    diagnosis = asked(off(0, factor, **where)(campaign))
    assert names(diagnosis) == set(effects)
    assert [entry.row for entry in diagnosis.result.outliers if entry.test == "sweep_axial"] == [row]
    (note,) = [note for note in diagnosis.notes if f"row {row}" in note]
    assert "left out of the fit" in note


@pytest.mark.slow
def test_limits_of_what_is_added_and_of_what_counts(measured: Measured) -> None:
    none = asked(measured(INERTIA, SHARED), max_effects=0)
    assert (none.verdict, none.effects, none.after is none.before) == ("unexplained", (), True)
    assert none.where
    within = asked(measured(INERTIA, SHARED), tolerance=0.5)
    assert (within.verdict, within.effects) == ("consistent", ())
    one = asked(measured(TWO, SHARED), max_effects=1)
    assert one.verdict in ("partly", "unexplained", "described")
    assert len(one.result.model.effects) <= 4


def test_chance_alone_names_nothing_however_small_a_gap_counts(measured: Measured) -> None:
    """Something always fits noise a little."""
    diagnosis = asked(measured({}, SHARED), tolerance=0.0)
    assert max(judged.score for judged in diagnosis.candidates) > 1.0
    assert said(diagnosis) == "consistent "
