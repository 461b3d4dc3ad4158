"""Errors of the rig: what a run, a level or a loop shares does what it says to the residuals, and nothing is lost."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from rigged import LEVELS, SHARED

from bushfit.campaign.schema import RigSettings
from bushfit.diagnosis.rig_errors import error_blocks
from bushfit.diagnosis.workflow import diagnose
from bushfit.effects.contract import Array
from bushfit.fitting.preparation import MeasuredSweep, split_by_kind
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.problem import FitResult

RIG = RigSettings(gain_error=4e-3, phase_error=3.5e-3)
RUN, LEVEL = 0, 1


def off(evidence: FitResult, sweep: MeasuredSweep, change: Callable[[MeasuredSweep], Array]) -> Array:
    """What a small relative change of the measured stiffness does to the residuals, per unit of it."""
    step = 1e-6
    changed = replace(sweep, test=replace(sweep.test, stiffness=sweep.test.stiffness * (1.0 - step * change(sweep))))
    row = np.zeros(evidence.residual.size)
    row[evidence.residual_rows[sweep]] = (changed.residual(evidence.model) - sweep.residual(evidence.model)) / step
    return row


@pytest.mark.parametrize("unit", [1.0, 1.0j], ids=["gain", "phase"])
@pytest.mark.parametrize(("kind", "repeats"), [(RUN, (2,)), (LEVEL, (1, 2, 3))])
def test_what_shares_an_error_moves_together(bare, unit, kind, repeats):
    """A column is what an error of the class makes of a run, or of all runs of a level, in gain or in phase."""
    sweep = split_by_kind(bare.data_sets)[1][1]
    there = (sweep.test.amplitude == LEVELS[1]) & np.isin(sweep.test.repeat, repeats)
    wanted = off(bare, sweep, lambda _: unit * there) * (RIG.gain_error if unit == 1.0 else RIG.phase_error)
    every = [
        (block, column)
        for block in error_blocks(bare, RIG)
        for column, own in zip(block.columns, block.kinds, strict=True)
        if own == kind
    ]
    embedded = np.zeros((len(every), bare.residual.size))
    for row, (block, column) in zip(embedded, every, strict=True):
        row[block.rows] = column
    best = min(embedded, key=lambda row: float(np.abs(row - wanted).max()))
    assert np.abs(best - wanted).max() < 0.02 * np.abs(wanted).max()


def test_a_zero_error_of_the_load_cell_hides_no_effect(measured):
    """An offset of the class, many standard errors large, is neither a faulty loop nor something without a name."""
    campaign = measured({"inertia": {"mass": 0.2}}, plan=SHARED)
    first, second = campaign.loops
    shifted = replace(first, force=first.force + RIG.gain_error * np.ptp(first.force) / 2.0)
    diagnosis = diagnose(PreparedCampaign.from_campaign(replace(campaign, loops=(shifted, second))))
    assert (diagnosis.verdict, [effect.name for effect in diagnosis.effects]) == ("named", ["inertia"])
