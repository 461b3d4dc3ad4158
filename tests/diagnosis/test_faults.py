"""What one place alone shows is no physics: the rows to measure again are named, and no effect."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from rigged import LEVELS, SHARED, Measured, changed, with_sweep

from bushfit.campaign.campaign import Campaign
from bushfit.diagnosis.faults import faults
from bushfit.diagnosis.workflow import diagnose
from bushfit.fitting.data import Data

Tamper = Callable[[Campaign], Campaign]


def at_75_hz(campaign: Campaign, number: int) -> Campaign:
    return changed(campaign, number, np.where(campaign.sweeps[number].frequency == 75.0, 1.0 + 0.05j, 1.0))


def level_too_stiff(campaign: Campaign) -> Campaign:
    return changed(campaign, 0, np.where(campaign.sweeps[0].amplitude == LEVELS[1], 1.05, 1.0))


def mislabelled(campaign: Campaign) -> Campaign:
    """The 0.2 mm of the label were 0.2 mm; it says 0.32."""
    sweep = campaign.sweeps[1]
    amplitude = np.where(sweep.amplitude == LEVELS[1], 3.2e-4, sweep.amplitude)
    return with_sweep(campaign, 1, replace(sweep, amplitude=amplitude))


def repeat_off(campaign: Campaign, factor: float) -> Campaign:
    sweep = campaign.sweeps[0]
    return changed(campaign, 0, np.where((sweep.amplitude == LEVELS[1]) & (sweep.repeat == 2), factor, 1.0))


def loop_too_strong(campaign: Campaign) -> Campaign:
    first, second = campaign.loops
    return replace(campaign, loops=(first, replace(second, force=1.06 * second.force)))


@pytest.mark.parametrize(
    ("tamper", "words"),
    [
        (lambda c: at_75_hz(c, 1), "75 Hz in radial"),
        (lambda c: at_75_hz(at_75_hz(c, 0), 1), "75 Hz in all directions"),
        (level_too_stiff, "the axial level 0.2 mm"),
        (mislabelled, "the radial level 0.32 mm"),
        (loop_too_strong, "the loop loop_axial_2"),
    ],
    ids=["spot, one direction", "spot, all directions", "level", "label", "loop"],
)
def test_the_place_is_named_and_no_effect(measured: Measured, tamper: Tamper, words: str) -> None:
    diagnosis = diagnose(Data.of(tamper(measured(plan=SHARED))))
    print(diagnosis.summary)
    assert diagnosis.verdict == "unexplained"
    assert diagnosis.effects == ()
    assert diagnosis.after is diagnosis.before
    assert words in diagnosis.summary
    assert diagnosis.next_test.startswith("measure again: ")
    assert words in diagnosis.next_test
    assert words in diagnosis.where[0].reading


@pytest.mark.parametrize("factor", [1.1, 1.2])
def test_one_repeat(measured: Measured, factor: float) -> None:
    diagnosis = diagnose(Data.of(repeat_off(measured(plan=SHARED), factor)))
    assert diagnosis.verdict == "unexplained"
    assert "repeat 2 of the axial level 0.2 mm" in diagnosis.summary


def test_one_row(measured: Measured) -> None:
    campaign = measured(plan=SHARED)
    sweep = campaign.sweeps[0]
    row = (sweep.amplitude == LEVELS[1]) & (sweep.repeat == 2) & (sweep.frequency == 65.0)
    diagnosis = diagnose(Data.of(changed(campaign, 0, np.where(row, 1.15, 1.0))))
    assert diagnosis.verdict == "unexplained"


def test_sizes_and_gains_of_a_fault(measured: Measured, fitted: Callable[..., object]) -> None:
    """A level 5 % too stiff is found 5 % too stiff, but for what the fit follows; no other level is."""
    clean, found = (fitted(campaign) for campaign in (measured(plan=SHARED), level_too_stiff(measured(plan=SHARED))))
    quiet, chance = faults(clean, 0.998)  # type: ignore[arg-type]
    loud, _ = faults(found, 0.998)  # type: ignore[arg-type]
    best = max(loud, key=lambda fault: fault.worth)
    print(
        f"{best.suspect.words}: {100 * best.size:.1f} %, gain {best.gain:.0f}; clean {max(f.gain for f in quiet):.1f}"
    )
    assert max(fault.gain for fault in quiet) < chance < best.gain
    assert best.suspect.kind == "level"
    assert best.size == pytest.approx(0.05, abs=0.015)


def test_physics_is_not_taken_for_a_fault(measured: Measured) -> None:
    """Slip shows most at one level of one direction, and is slip."""
    diagnosis = diagnose(Data.of(measured({"interface_slip": {"force": 6.0}}, SHARED)))
    assert [effect.name for effect in diagnosis.effects] == ["interface_slip"]
    assert diagnosis.verdict == "named"
