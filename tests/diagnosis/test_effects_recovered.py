"""Each effect of the library, known to be there, is found by the fit at the size the time-domain rig was given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from cards.hidden import hidden_campaign, hideable
from rigged import BOTH, PLAN, Diagnosed, Measured, changed, in_closed_form
from tries import some

from bushfit.campaign.schema import FitSettings, ParameterSetting
from bushfit.effects import BASE, LIBRARY, qualified, with_base
from bushfit.fitting.data import Data
from bushfit.fitting.procedures import fit_joint
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.simulation.measured import measure

#: The rig steps a compliant mount in time with many more steps than any other.
SLOW = {name for name in hideable() if "compliance" in name}
#: Of these a fit has several minima, and the campaign has to say where about they are; a diagnosis probes them.
NEAR = ("force_saturation.level", "force_saturation.share")


@pytest.mark.parametrize("name", some(hideable(), set(hideable()[::3]) - SLOW))
def test_known_effects_are_recovered(name: str) -> None:
    simulated, sealed = hidden_campaign(1, [name])
    near = {key: ParameterSetting(0.95 * sealed.values[key]) for key in NEAR if key in sealed.values}
    campaign = replace(simulated.campaign(), fit=FitSettings(parameters=near))
    result = fit_joint(Data.of(campaign), effects=with_base([name]), directions=BOTH)
    print(f"{name}: {100 * sealed.visible:.1f} % visible")
    reduced = agrees(result, sealed.values)
    # softening from cycle to cycle passes for scatter from cycle to cycle, and so for noise
    assert (0.5 if name == "mullins_softening" else 0.9) < reduced < 1.1


@pytest.mark.parametrize("name", [name for name, effect in LIBRARY.items() if effect.harmonic_only])
def test_effects_without_a_law_in_time_are_recovered_from_their_first_harmonic(name: str, paper_model: Model) -> None:
    """The rig refuses them: the data are the closed form of the steady state with noise, for loops too."""
    effect = LIBRARY[name]
    truth = paper_model.with_effect(name, {qualified(effect, effect.amount): effect.amount.sized(1.0)})
    campaign = measure(in_closed_form(truth, PLAN), PLAN).campaign()
    result = fit_joint(Data.of(campaign), effects=(*BASE, name), directions=BOTH)
    assert 0.85 < agrees(result, truth.values) < 1.15


@pytest.mark.slow
def test_a_second_relaxation_is_no_other_effect(diagnosed: Diagnosed) -> None:
    """Two are named, or described where the two cannot be told from one of another shape; one is one."""
    one = {"maxwell": {"mu1": 3e5, "tau": 2e-2}}
    two = {**one, "second_maxwell": {"mu1": 6e5, "tau": 8e-4}}
    found = [[effect.name for effect in diagnosed(effects, seed=3).effects] for effects in (two, one)]
    print(found)
    assert found[0] in (["maxwell", "second_maxwell"], ["unnamed"])
    assert found[1] == ["maxwell"]


def agrees(result: Result, truths: Mapping[str, float]) -> float:
    """Reduced chi-square of a fit whose values have to be the true ones."""
    assert result.quality is not None
    reduced = result.quality.reduced_chi_square
    print(f"reduced chi-square {reduced:.3f}")
    for parameter, truth in truths.items():
        value, stderr = result.model.values[parameter], result.covariance.stderr(parameter)
        assert stderr is not None, parameter
        z = (value - truth) / stderr
        print(f"  {parameter} = {value:.5g} +- {stderr:.2g}, truth {truth:.5g}, z {z:+.2f}")
        assert abs(z) < 4.0 or abs(value / truth - 1.0) < 0.03
    return reduced


SMALL = {"interface_slip.force": 5.0, "self_heating.beta": 1e-3, "viscous.eta": 80.0, "delay.tau": 4e-5}


@pytest.mark.parametrize("name", SMALL)
def test_a_small_effect_is_not_taken_for_one_at_rest_on_its_bound(measured: Measured, name: str) -> None:
    """However wide the bounds: it has an error of its own, and the others carry their share of it."""
    effect, _, key = name.partition(".")
    campaign = measured({effect: {key: SMALL[name]}}, seed=1)
    result = fit_joint(Data.of(campaign), effects=(*BASE, effect), directions=BOTH)
    interval = result.interval(name)
    print(f"{name} = {result.model.values[name]:.3g}, 95 % {interval}")
    assert not any("edge" in line for line in result.warnings)
    assert interval is not None
    assert interval[0] <= SMALL[name] <= interval[1]


def test_what_the_data_push_below_zero_rests_on_its_bound(measured: Measured) -> None:
    """Loss that shrinks in proportion to frequency, as of a late force, is no dashpot."""
    campaign = measured()
    for number, sweep in enumerate(campaign.sweeps):
        campaign = changed(campaign, number, np.exp(-2j * np.pi * sweep.frequency * 1e-4))
    result = fit_joint(Data.of(campaign), effects=(*BASE, "viscous"), directions=BOTH)
    assert result.model.values["viscous.eta"] == pytest.approx(0.0, abs=1e-6)
    assert any("viscous.eta ended at the edge" in line for line in result.warnings)
