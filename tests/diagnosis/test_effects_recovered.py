"""Each effect of the library, known to be there, is found by the fit at the size the time-domain rig was given."""

from __future__ import annotations

import numpy as np
import pytest
from rigged import BOTH, Measured, changed

from bushfit.effects import BASE
from bushfit.fitting.data import Data
from bushfit.fitting.procedures import fit_joint
from bushfit.scorecard.hidden import hidden_campaign, hideable

#: The rig steps a compliant mount in time with many more steps than any other.
SLOW = {"rig_compliance"}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if name in SLOW else []) for name in hideable()]
)
def test_known_effects_are_recovered(name: str) -> None:
    simulated, sealed = hidden_campaign(1, [name])
    result = fit_joint(Data.of(simulated.campaign()), effects=(*BASE, name), directions=BOTH)
    assert result.quality is not None
    reduced = result.quality.reduced_chi_square
    print(f"{name}: {100 * sealed.visible:.1f} % visible, reduced chi-square {reduced:.3f}")
    for parameter, truth in sealed.values.items():
        value, stderr = result.model.values[parameter], result.covariance.stderr(parameter)
        assert stderr is not None, parameter
        z = (value - truth) / stderr
        print(f"  {parameter} = {value:.5g} +- {stderr:.2g}, truth {truth:.5g}, z {z:+.2f}")
        assert abs(z) < 4.0 or abs(value / truth - 1.0) < 0.03
    # softening from cycle to cycle passes for scatter from cycle to cycle, and so for noise
    assert (0.5 if name == "mullins_softening" else 0.9) < reduced < 1.1


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
    """A force channel that leads is no delay."""
    campaign = measured()
    ahead = [np.exp(2j * np.pi * sweep.frequency * 1e-4) for sweep in campaign.sweeps]
    for number, factor in enumerate(ahead):
        campaign = changed(campaign, number, factor)
    result = fit_joint(Data.of(campaign), effects=(*BASE, "delay"), directions=BOTH)
    assert result.model.values["delay.tau"] == pytest.approx(0.0, abs=1e-8)
    assert any("delay.tau ended at the edge" in line for line in result.warnings)
