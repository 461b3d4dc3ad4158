"""What tests leave open is said with its reason, what is known all the same, and what would help; and only then."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import FitSettings, ParameterSetting, SimulatedLoop, SimulatedSweep, SimulateSettings
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
def test_what_is_lacking_is_said_with_what_is_known_and_what_would_help(
    rig: Rig, paper_noise: SimulateSettings, paper_model: Model, case: str
) -> None:
    loops, sweeps, reason, known, further = LACKING[case]
    plan = replace(paper_noise, loops=loops, sweeps=sweeps)
    for seed in (1, 2):
        lines = fit_joint(Data.of(rig(paper_model, plan, seed))).warnings
        print(case, *lines, sep="\n  ")
        said = [line for line in lines if "standard errors:" in line]
        assert len(said) == 1
        assert reason in said[0]
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
    rig: Rig, paper_noise: SimulateSettings, paper_model: Model, band: tuple[float, ...], amplitudes: tuple[float, ...],
    reason: str,
) -> None:  # fmt: skip
    plan = replace(paper_noise, repeats=1, noise=1e-2, loops=(), sweeps=(sweep(*amplitudes, band=band),))
    lines = fit_joint(Data.of(rig(paper_model, plan, 3))).warnings  # noise that leaves several open
    print(*lines, sep="\n")
    said = [line for line in lines if "standard errors:" in line]
    assert said
    assert said[0].startswith(reason)


def test_a_bound_of_the_user_is_named_as_the_user_s(
    rig: Rig, paper_noise: SimulateSettings, paper_model: Model
) -> None:
    bounded = FitSettings(parameters={"mu": ParameterSetting(max=1e6)})
    campaign = replace(rig(paper_model, paper_noise, 1), fit=bounded)
    lines = fit_joint(Data.of(campaign)).warnings
    print(*lines, sep="\n")
    assert "mu rests on the max given in [fit]" in lines
    assert not any("edge of what is possible" in line for line in lines)


def test_an_effect_that_is_not_there_is_said_to_be_no_different_from_zero(
    rig: Rig, paper_noise: SimulateSettings, paper_model: Model
) -> None:
    plan = replace(paper_noise, repeats=1, noise=1e-2, loops=(), sweeps=(sweep(1e-4, 5e-4),))
    lines = fit_joint(Data.of(rig(paper_model, plan, 1)), effects=(*BASE, "viscous")).warnings
    print(*lines, sep="\n")
    assert "viscous.eta is no different from zero: these tests do not show viscous" in lines
    assert not any("standard errors:" in line and "viscous" in line for line in lines)


def test_directions_that_share_no_parameter_have_sentences_of_their_own(
    rig: Rig, paper_noise: SimulateSettings, paper_model: Model
) -> None:
    plan = replace(paper_noise, repeats=1, noise=1e-2, loops=(), sweeps=(sweep(1e-4, 5e-4),))
    result = fit_joint(Data.of(rig(paper_model, plan, 1)))
    said = [line for line in result.warnings if "standard errors:" in line]
    print(*result.warnings, sep="\n")
    assert len(said) == 2
    assert "sigma_fmax and eps_half are known only as a ratio" in said[0]
    assert "m and alpha cannot be told from one another" in said[1]
    stderr, value = result.covariance.stderr("sigma_fmax"), result.model.values["sigma_fmax"]
    assert stderr is not None
    assert f"sigma_fmax {100 * stderr / value:.2g} %" in said[0]


def test_complete_tests_leave_nothing_open(
    rig: Rig,
    paper_noise: SimulateSettings,
    shared_noise: SimulateSettings,
    paper_model: Model,
    other_models: dict[str, Model],
) -> None:
    count = 0
    for model in (paper_model, *other_models.values()):
        for noise in (paper_noise, shared_noise):
            for seed in range(5):
                assert fit_joint(Data.of(rig(model, noise, seed))).warnings == ()
                count += 1
    sweeps_only = replace(paper_noise, sweeps=(sweep(1e-4, 2e-4, 5e-4),))
    assert fit_joint(Data.of(rig(paper_model, sweeps_only, 1))).warnings == ()
    print(f"{count + 1} campaigns that lack nothing: none warned of")


@pytest.mark.parametrize(("largest", "proposed"), [(1e-4, True), (3e-3, False)])
def test_no_test_is_proposed_that_would_tear_the_rubber(
    rig: Rig, paper_noise: SimulateSettings, paper_model: Model, largest: float, proposed: bool
) -> None:
    """Friction that gives way at strains beyond all reach: what would help is more amplitude, as far as rubber goes."""
    model = paper_model.with_values({"sigma_fmax": 2e6, "eps_half": 2.0})
    plan = replace(paper_noise, loops=(loop(largest, 0.1),), sweeps=(sweep(0.3 * largest, largest),))
    lines = fit_joint(Data.of(rig(model, plan, 1))).warnings
    print(*lines, sep="\n")
    assert any("of eps_half: " in line for line in lines)
    assert any("times the largest amplitude" in line for line in lines) is proposed
