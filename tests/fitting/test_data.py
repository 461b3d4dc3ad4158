"""A campaign made ready to fit: which tests are taken, at which levels, and what the campaign holds or gives."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import FitSettings, ParameterSetting, RigSettings
from bushfit.errors import FitError
from bushfit.fitting.data import Data
from bushfit.fitting.data_sets import loop_data, sweep_data
from bushfit.fitting.procedures import fit_joint
from bushfit.geometry import Direction
from bushfit.model.model import FIVE
from bushfit.reading.measurement import Sweep


def test_repeats_of_a_loop_share_the_error_of_its_gain(campaign: Campaign) -> None:
    """So their mean is no surer of it than one of them: each counts as more unsure by the root of their number."""
    (loop,) = campaign.loops
    faster = replace(loop, name="faster", time=loop.time / 2.0)
    again = [replace(loop, name=f"again_{number}", displacement=1.01 * loop.displacement) for number in range(3)]
    found = Data.of(replace(campaign, loops=(loop, *again, faster), rig=RigSettings(gain_error=5e-3))).loops
    np.testing.assert_allclose([each.gain_error for each in found], [1e-2] * 4 + [5e-3])


def test_only_tests_of_the_same_points_contradict_one_another(measured: Data) -> None:
    """Dense sweeps that follow one another do not, nor do tests at other temperatures; the same ones 15 % apart do."""
    sweep, frequency = measured.sweeps[0].sweep, np.geomspace(20.0, 200.0, 4000)
    low, high = (
        Sweep(name, Direction.AXIAL, part, np.full(part.size, 1e-4), 1e6 * part**0.1 * (1.0 + 0.1j))
        for name, part in (("low", frequency[:2000]), ("high", frequency[2000:]))
    )
    other = replace(sweep, name="other", stiffness=1.15 * sweep.stiffness)
    warm, cold = replace(other, temperature=313.15), replace(sweep, temperature=296.15)
    loop = measured.loops[0].test
    hot = replace(loop, name="hot", force=1.15 * loop.force, temperature=313.15)
    for tests in ([low, high], [cold, warm]):
        assert [one.contradiction for one in sweep_data(tests)] == [None, None]
    assert [one.contradiction for one in loop_data([replace(loop, temperature=296.15), hot])] == [None, None]
    for _, one in (sweep_data([sweep, other]), loop_data([loop, replace(hot, temperature=None)])):
        assert one.contradiction is not None
        assert re.search(r"lies 1[5-7] % apart", one.contradiction)


def test_axial_tests_are_used_unless_told(measured: Data) -> None:
    assert {data_set.direction for data_set in measured.chosen(None)} == {Direction.AXIAL}
    every = fit_joint(measured, directions=list(Direction))
    assert every.quality.points > fit_joint(measured).quality.points  # type: ignore[union-attr]
    radial = Data.of(replace(measured.campaign, loops=(), sweeps=measured.campaign.sweeps[1:]))
    assert {data_set.direction for data_set in radial.chosen(None)} == {Direction.RADIAL}


def test_dynamic_amplitudes_choose_the_levels(measured: Data) -> None:
    assert set(measured.smallest_sweep.amplitude) == {1e-4}
    other = replace(measured.campaign, fit=FitSettings(dynamic_amplitudes=(2e-4, 5e-4)))
    assert set(Data.of(other).smallest_sweep.amplitude) == {2e-4, 5e-4}
    absent = Data.of(replace(measured.campaign, fit=FitSettings(dynamic_amplitudes=(3e-4,))))
    with pytest.raises(FitError, match="no sweep at these amplitudes"):
        _ = absent.smallest_sweep


def test_a_direction_without_tests_is_refused_with_those_there_are(measured: Data) -> None:
    with pytest.raises(FitError, match=r"no test in the directions[\s\S]*axial, radial[\s\S]*torsion"):
        measured.chosen([Direction.TORSION])
    with pytest.raises(FitError, match="there is nothing to fit"):
        Data.of(replace(measured.campaign, loops=(), sweeps=())).chosen(None)


def test_what_the_campaign_gives_and_holds(measured: Data) -> None:
    settings = {"mu": ParameterSetting(value=1e6, max=2e6), "alpha": ParameterSetting(value=0.3, vary=False)}
    data = Data.of(replace(measured.campaign, fit=FitSettings(parameters=settings)))
    assert data.given == {"mu": 1e6, "alpha": 0.3}
    assert data.free(FIVE) == tuple(name for name in FIVE if name != "alpha")
    assert data.bounds == {"mu": (None, 2e6), "alpha": (None, None)}
    assert measured.free(FIVE) == FIVE


def test_magnitudes_in_coarse_steps_are_told(campaign: Campaign) -> None:
    """In steps of 50 N/mm they are few, in steps of 0.05 N/mm they are as many as the points."""
    sweep = campaign.sweeps[0]
    size, turn = np.abs(sweep.stiffness), sweep.stiffness / np.abs(sweep.stiffness)
    for step, told in ((5e4, True), (50.0, False)):
        (data_set,) = sweep_data([replace(sweep, stiffness=np.round(size / step) * step * turn)])
        lines = [note for note in data_set.notes if "are rounded" in note]
        assert bool(lines) == told
