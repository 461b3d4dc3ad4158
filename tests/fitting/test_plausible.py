"""What a fit says of the tests it left out, and of tests that no rubber could have given."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import SimulatedLoop, SimulatedSweep
from bushfit.diagnosis.workflow import diagnose
from bushfit.fitting.data import Data
from bushfit.fitting.procedures import fit_joint, fit_two_step
from bushfit.geometry import Direction
from bushfit.reading.measurement import Sweep
from bushfit.units import CELSIUS

BAND = (5.0, 15.0, 45.0, 100.0, 155.0)


@pytest.fixture
def campaign(rig: Callable[..., Campaign]) -> Campaign:
    """An axial loop, an axial and a radial sweep."""
    sweeps = tuple(SimulatedSweep(direction, (1e-4, 5e-4), BAND) for direction in (Direction.AXIAL, Direction.RADIAL))
    return rig(1, loops=(SimulatedLoop(Direction.AXIAL, 1e-3, 0.1),), sweeps=sweeps)


def stiffer(test: Sweep, factor: float) -> Sweep:
    return replace(test, stiffness=factor * test.stiffness)


def without(campaign: Campaign, direction: Direction) -> tuple[Sweep, ...]:
    return tuple(sweep for sweep in campaign.sweeps if sweep.direction is not direction)


@pytest.mark.parametrize("factor", [1.0, 1.05])
def test_a_test_that_was_left_out_is_told_where_the_model_misses_it(campaign: Campaign, factor: float) -> None:
    radial = [stiffer(sweep, factor) for sweep in without(campaign, Direction.AXIAL)]
    data = Data.of(replace(campaign, sweeps=(*without(campaign, Direction.RADIAL), *radial)))
    told = [line for line in fit_joint(data).warnings if "was not fitted" in line]
    assert len(told) == (factor != 1.0)
    if told:
        assert f"{radial[0].name}, radial, was not fitted, and the model misses it by 4." in told[0]
        assert "bushfit diagnose" in told[0]
    both = fit_joint(data, directions=(Direction.AXIAL, Direction.RADIAL))
    assert not any("was not fitted" in line for line in both.warnings)


def test_kilonewtons_taken_for_newtons_are_told(campaign: Campaign) -> None:
    axial = without(campaign, Direction.RADIAL)
    slip = replace(campaign, sweeps=tuple(stiffer(sweep, 1e-3) for sweep in axial))
    (told,) = [line for line in fit_joint(Data.of(slip)).warnings if "units" in line]
    assert told.startswith(f"{campaign.loops[0].name} shows ")
    assert f"times the modulus of {axial[0].name}, which no rubber does: check the units" in told


@pytest.mark.parametrize(("warm", "told"), [(25.9, 0), (60.0, 1)])
def test_tests_at_other_temperatures_are_told_by_fit_and_diagnose(campaign: Campaign, warm: float, told: int) -> None:
    (loop,), (sweep,) = campaign.loops, without(campaign, Direction.RADIAL)
    at_23, hot = replace(loop, temperature=23.0 + CELSIUS), replace(sweep, temperature=warm + CELSIUS)
    data = Data.of(replace(campaign, loops=(at_23,), sweeps=(hot,)))
    for result in (fit_joint(data), fit_two_step(data).result, diagnose(data).result):
        lines = [line for line in result.warnings if "degC" in line]
        assert len(lines) == told
        if told:
            assert lines[0].startswith(
                f"{sweep.name} was tested at 60 degC and {loop.name} at 23 degC, 37 degC apart: "
            )


def test_a_modulus_of_no_rubber_is_told(campaign: Campaign) -> None:
    loops = tuple(replace(loop, force=1e-3 * loop.force) for loop in campaign.loops)
    axial = tuple(stiffer(sweep, 1e-3) for sweep in without(campaign, Direction.RADIAL))
    (told,) = [
        line for line in fit_joint(Data.of(replace(campaign, loops=loops, sweeps=axial))).warnings if "units" in line
    ]
    assert "kPa is that of no rubber" in told
