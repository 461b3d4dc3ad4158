"""What a perfect observer could know: how much likelier the tests are by the truth than by the model that was told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from bushfit.campaign.campaign import load_campaign
from bushfit.fitting.coordinates import residual
from bushfit.fitting.data import Data
from bushfit.fitting.data_sets import DataSet, LoopData, SweepData, with_gains
from bushfit.fitting.solve import solve
from bushfit.model.file import load_result


def against_truth(folder: Path, silent: Path, model: Path) -> float:
    """Logarithm of the likelihood of a campaign's tests by the truth over that by a model that was fitted to them.

    Args:
        folder, silent: of the campaign with the rig's errors, and of the same without any.
        model: the file of the model.

    Notes:
        Both by the noise that bushfit estimates, with the errors of its class. A model that
        is as good as the truth comes out at minus half the number of its parameters.
    """
    told = load_result(model).model
    tests, true = (Data.of(load_campaign(each / "bushing.toml")) for each in (folder, silent))
    data_sets = with_gains((*tests.loops, *tests.sweeps), weigh=True)
    told = solve(told, data_sets, tuple(told.values)).model
    off = residual(told, data_sets)
    as_true = [_with(one, other) for one, other in zip(data_sets, (*true.loops, *true.sweeps), strict=True)]
    noise = off - residual(told, as_true)  # residuals are linear in what was measured: here the model falls out
    return float(off @ off - noise @ noise) / 2.0


def _with(test: DataSet, true: DataSet) -> DataSet:
    """A test, its weights and its noise as they are, with what another one measured."""
    if isinstance(test, LoopData) and isinstance(true, LoopData):
        force = np.interp(test.drive.phase, true.drive.phase, true.drive.force)
        return replace(test, drive=replace(test.drive, force=force))
    assert isinstance(test, SweepData)
    assert isinstance(true, SweepData)
    return replace(test, sweep=replace(test.sweep, stiffness=true.sweep.stiffness))
