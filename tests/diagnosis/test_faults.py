"""What one place alone shows is no physics: the rows to measure again are named, and no effect."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from rigged import LEVELS, SHARED, Effects, Fitted, Measured, changed, with_sweep
from tries import some

from bushfit.campaign.campaign import Campaign
from bushfit.diagnosis.faults import faults
from bushfit.diagnosis.record import Settings
from bushfit.diagnosis.search import CHANCE_LEVEL, SAME, Search
from bushfit.diagnosis.verdict import worst_fault
from bushfit.diagnosis.workflow import diagnose
from bushfit.fitting.data import Data
from bushfit.fitting.data_sets import parted, with_level_errors

Tamper = Callable[[Campaign], Campaign]


def at_75_hz(campaign: Campaign, number: int) -> Campaign:
    return changed(campaign, number, np.where(campaign.sweeps[number].frequency == 75.0, 1.0 + 0.05j, 1.0))


def level_too_stiff(campaign: Campaign) -> Campaign:
    return changed(campaign, 0, np.where(campaign.sweeps[0].amplitude == LEVELS[1], 1.05, 1.0))


def mislabelled(campaign: Campaign) -> Campaign:
    """The 0.2 mm were 0.2 mm; the label says 0.45, which is more than an error of a level could be."""
    sweep = campaign.sweeps[1]
    amplitude = np.where(sweep.amplitude == LEVELS[1], 4.5e-4, sweep.amplitude)
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
        (mislabelled, "the radial level 0.45 mm"),
        pytest.param(loop_too_strong, "the loop loop_axial_2", marks=pytest.mark.slow),
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


@pytest.mark.parametrize(("off", "verdict"), [(1.05, "consistent"), (1.075, "unexplained")])
def test_a_level_that_no_rig_makes_is_a_fault_however_few_levels_tell_of_errors(
    measured: Measured, off: float, verdict: str
) -> None:
    """Two degrees of freedom would let an error of 0.9 % be any size by chance; 6 % are what a rig may have at most."""
    campaign = measured(plan=SHARED)
    wrong = changed(campaign, 1, np.where(campaign.sweeps[1].amplitude == LEVELS[0], off, 1.0))
    diagnosis = diagnose(Data.of(wrong).with_level_errors((0.009, 0.004), 2))
    print(diagnosis.verdict, diagnosis.summary)
    assert diagnosis.verdict == verdict
    assert ("the radial level 0.1 mm stands out" in diagnosis.summary) == (verdict == "unexplained")


@pytest.mark.parametrize(("off", "beyond_chance"), [(1.013, False), (1.02, True)])
def test_a_level_of_no_rig_still_has_to_be_more_than_chance(
    measured: Measured, fitted: Fitted, off: float, beyond_chance: bool
) -> None:
    """A rig that states no error at all makes none, and still a level is off by chance."""
    campaign = measured(plan=SHARED)
    plain = fitted(changed(campaign, 1, np.where(campaign.sweeps[1].amplitude == LEVELS[0], off, 1.0)))
    loops, sweeps = parted(plain.data_sets)
    evidence = replace(plain, data_sets=(*loops, *with_level_errors(sweeps, (1e-3, 1e-3), 2)))
    told = faults(evidence, CHANCE_LEVEL)
    worst = max(told.places, key=lambda place: place.worth)
    print(f"{worst.suspect.words}: {worst.gain:.1f}, by chance {told.chance_of_known:.1f} to {told.chance:.0f}")
    assert worst.worth >= SAME
    search = Search.begin(evidence, Settings(), plain.model.values, (), {})
    assert worst_fault(search, evidence) is None
    found = worst_fault(replace(search, most_of_level=0.0), evidence)
    assert (found is not None) == beyond_chance


@pytest.mark.parametrize("factor", some((1.1, 1.2), {1.1}))
def test_one_repeat(measured: Measured, factor: float) -> None:
    diagnosis = diagnose(Data.of(repeat_off(measured(plan=SHARED), factor)))
    assert diagnosis.verdict == "unexplained"
    assert "repeat 2 of the axial level 0.2 mm" in diagnosis.summary


@pytest.mark.parametrize("off", some((1.04, 1.15), {1.15}))
@pytest.mark.parametrize("effects", [{}, {"interface_slip": {"force": 6.0}}], ids=["clean", "slip"])
def test_a_wild_row_is_a_warning(measured: Measured, effects: Effects, off: float) -> None:
    """One row of 288 is left out and named by its number; it neither makes a gap nor hides one."""
    campaign = measured(effects, SHARED)
    sweep = campaign.sweeps[0]
    row = (sweep.amplitude == LEVELS[1]) & (sweep.repeat == 2) & (sweep.frequency == 65.0)
    diagnosis = diagnose(Data.of(changed(campaign, 0, np.where(row, off, 1.0))))
    said = f"sweep_axial, stiffness row {int(np.flatnonzero(row)[0]) + 1}"
    print(diagnosis.verdict, diagnosis.result.warnings)
    assert [effect.name for effect in diagnosis.effects] == list(effects)
    assert diagnosis.verdict == ("named" if effects else "consistent")
    assert any(said in note for note in diagnosis.notes)
    assert any(said in warning for warning in diagnosis.result.warnings)


@pytest.mark.parametrize("repeats", [3, 1])
def test_errors_of_every_level_are_noise_and_no_finding(measured: Measured, repeats: int) -> None:
    """Levels that are off by 1 % each, all repeats alike, are within the class of a rig: nothing is missing."""
    campaign, random = measured(plan=replace(SHARED, repeats=repeats)), np.random.default_rng(3)
    for number, sweep in enumerate(campaign.sweeps):
        levels, place = np.unique(sweep.amplitude, return_inverse=True)
        campaign = changed(campaign, number, (1.0 + 0.01 * random.standard_normal(levels.size))[place])
    diagnosis = diagnose(Data.of(campaign))
    print(diagnosis.verdict, diagnosis.notes)
    assert diagnosis.verdict == "consistent"
    assert any("explains what is left" in note for note in diagnosis.notes) or repeats == 1
    assert any("0.5 % gain and 0.25 deg phase, gain and phase assumed" in note for note in diagnosis.notes)


def test_sizes_and_gains_of_a_fault(measured: Measured, fitted: Callable[..., object]) -> None:
    """A level 5 % too stiff is found 5 % too stiff, but for what the fit follows; no other level is."""
    clean, found = (fitted(campaign) for campaign in (measured(plan=SHARED), level_too_stiff(measured(plan=SHARED))))
    quiet, chance, _ = faults(clean, 0.998)  # type: ignore[arg-type]
    loud, *_ = faults(found, 0.998)  # type: ignore[arg-type]
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
