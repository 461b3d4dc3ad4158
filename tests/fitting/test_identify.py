"""What tests leave open is said with its reason, what is known all the same, and what would help; and only then."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import Any

import pytest

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import FitSettings, ParameterSetting, SimulatedLoop, SimulatedSweep
from bushfit.effects import BASE
from bushfit.fitting.data import Data
from bushfit.fitting.procedures import fit_joint
from bushfit.geometry import Direction
from bushfit.model.model import Model

Rig = Callable[..., Campaign]
BAND = tuple(float(f) for f in range(5, 156, 10))


def loop(amplitude: float, rate: float) -> SimulatedLoop:
    return SimulatedLoop(Direction.AXIAL, amplitude, rate)


def sweep(*amplitudes: float, band: tuple[float, ...] = BAND) -> SimulatedSweep:
    return SimulatedSweep(Direction.AXIAL, amplitudes, band)


#: Noise that leaves several parameters open, and no loop.
ROUGH: dict[str, Any] = {"repeats": 1, "noise": 1e-2, "loops": ()}


def warnings(campaign: Campaign, **asked: Any) -> tuple[str, ...]:
    return fit_joint(Data.of(campaign), **asked).warnings


#: Tests that lack something: loops, sweeps, what must be said, what is known, the further test.
LACKING = {
    "small amplitudes": (
        (loop(3e-5, 0.1),), (sweep(1e-5, 3e-5),),
        "of eps_half: sigma_fmax and eps_half", "mu + sigma_fmax/eps_half", "times the largest amplitude",
    ),
    "one loop": ((loop(1e-3, 0.1),), (), "one loop rate, 0.1 Hz", "sin(pi alpha/2) at 0.1 Hz", "the rate"),
    "loops of one rate": (
        (loop(1e-3, 0.1), loop(3e-4, 0.1)), (), "mu, m and alpha cannot be told", "mu + m/2 omega^alpha", "the rate",
    ),
    "one frequency": (
        (loop(1e-3, 10.0),), (sweep(1e-4, 5e-4, band=(10.0,)),), "one frequency, 10 Hz", "at 10 Hz", "rate",
    ),
    "one amplitude": ((), (sweep(2e-4),), "one amplitude; there is no loop: ", "", "a loop at 0.1 Hz"),
}  # fmt: skip


@pytest.mark.parametrize("case", LACKING)
def test_what_is_lacking_is_said_with_what_is_known_and_what_would_help(rig: Rig, case: str) -> None:
    loops, sweeps, reason, known, further = LACKING[case]
    for seed in (1, 2):
        lines = warnings(rig(seed, loops=loops, sweeps=sweeps))
        (said,) = [line for line in lines if "standard errors:" in line]
        assert reason in said
        if known:
            assert any(line.startswith("what is known all the same") and known in line for line in lines)
        assert any(line.startswith("the further test that would help most") and further in line for line in lines)


@pytest.mark.parametrize(
    ("band", "amplitudes", "reason"),
    [
        ((40.0, 50.0, 60.0), (1e-4, 5e-4), "frequencies span only 40 to 60 Hz; there is no loop: "),
        (BAND, (4e-4, 6e-4), "amplitudes span only "),
        (BAND, (1e-4, 5e-4), "there is no loop: "),
    ],
)
def test_a_span_is_a_reason_only_where_it_is_narrow(
    rig: Rig, band: tuple[float, ...], amplitudes: tuple[float, ...], reason: str
) -> None:
    lines = warnings(rig(3, **ROUGH, sweeps=(sweep(*amplitudes, band=band),)))
    assert next(line for line in lines if "standard errors:" in line).startswith(reason)


def test_a_bound_of_the_user_is_named_as_the_user_s(rig: Rig) -> None:
    bounded = FitSettings(parameters={"mu": ParameterSetting(max=1e6)})
    lines = warnings(replace(rig(1), fit=bounded))
    assert "mu rests on the max given in [fit]" in lines
    assert not any("edge of what is possible" in line for line in lines)


def test_an_effect_that_is_not_there_is_said_to_be_no_different_from_zero(rig: Rig) -> None:
    lines = warnings(rig(1, **ROUGH, sweeps=(sweep(1e-4, 5e-4),)), effects=(*BASE, "viscous"))
    assert "viscous.eta is no different from zero: these tests do not show viscous" in lines
    assert not any("standard errors:" in line and "viscous" in line for line in lines)


def test_directions_that_share_no_parameter_have_sentences_of_their_own(rig: Rig) -> None:
    result = fit_joint(Data.of(rig(1, **ROUGH, sweeps=(sweep(1e-4, 5e-4),))))
    friction, springpot = [line for line in result.warnings if "standard errors:" in line]
    assert "sigma_fmax and eps_half are known only as a ratio" in friction
    assert "m and alpha cannot be told from one another" in springpot
    stderr, value = result.covariance.stderr("sigma_fmax"), result.model.values["sigma_fmax"]
    assert stderr is not None
    assert f"sigma_fmax {100 * stderr / value:.2g} %" in friction


def test_complete_tests_leave_nothing_open(rig: Rig, paper_model: Model, other_models: dict[str, Model]) -> None:
    for model, shared, seed in product((paper_model, *other_models.values()), (False, True), range(3)):
        assert warnings(rig(seed, model, shared=shared)) == ()
    assert warnings(rig(1, sweeps=(sweep(1e-4, 2e-4, 5e-4),))) == ()


@pytest.mark.parametrize(("largest", "proposed"), [(1e-4, True), (3e-3, False)])
def test_no_test_is_proposed_that_would_tear_the_rubber(
    rig: Rig, paper_model: Model, largest: float, proposed: bool
) -> None:
    """Friction that gives way at strains beyond all reach: what would help is more amplitude, as far as rubber goes."""
    model = paper_model.with_values({"sigma_fmax": 2e6, "eps_half": 2.0})
    lines = warnings(rig(1, model, loops=(loop(largest, 0.1),), sweeps=(sweep(0.3 * largest, largest),)))
    assert any("of eps_half: " in line for line in lines)
    assert any("times the largest amplitude" in line for line in lines) is proposed
