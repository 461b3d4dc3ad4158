"""Each effect of the library, known to be there, is found by the fit at the size the time-domain rig was given; of
model families that which made the tests is found from any start, and wins where held out."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from fits import joint_fit
from hidden import hidden_campaign, hideable
from rigged import BOTH, PLAN, in_closed_form
from tries import some

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import FitSettings, ParameterSetting
from bushfit.diagnosis.families import FittedFamily, fit_families, known_families
from bushfit.effects import BASE, LIBRARY, qualified_name, twins_of, with_base
from bushfit.fitting.preparation import MeasuredTest
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.simulation.exact import simulate_exact
from bushfit.simulation.measured import measure

#: The rig steps a compliant mount in time with many more steps than any other.
SLOW = {name for name in hideable() if "compliance" in name}
#: Of these a fit has several minima, and the campaign has to say where about they are; a diagnosis probes them.
NEAR = ("force_saturation.level", "force_saturation.share")
#: Of twins, which answer alike to the last bit (see tests/effects/test_family.py), one.
SINGLE = [name for name in hideable() if twins_of(name)[0] == name]
SMALL = {"interface_slip.force": 5.0, "self_heating.beta": 1e-3, "viscous.eta": 80.0, "delay.tau": 4e-5}
NAMES = ("kraus", "sliders", "distributed_sliders", "fractional_zener", "intrinsic_time")


@pytest.mark.parametrize("name", some(SINGLE, set(SINGLE[::3]) - SLOW))
def test_known_effects_are_recovered(name):
    simulated = hidden_campaign(1, [name])
    near = {key: ParameterSetting(0.95 * simulated.truth.values[key]) for key in NEAR if key in simulated.truth.values}
    campaign = replace(simulated.campaign(), fit=FitSettings(parameters=near))
    result = joint_fit(campaign, effects=with_base([name]), directions=BOTH)
    reduced = agrees(result, simulated.truth.values)
    # softening from cycle to cycle passes for scatter from cycle to cycle, and so for noise
    assert (0.5 if name == "mullins_softening" else 0.9) < reduced < 1.1


@pytest.mark.parametrize("name", [name for name, effect in LIBRARY.items() if effect.harmonic_only])
def test_effects_without_a_law_in_time_are_recovered_from_their_first_harmonic(name, paper_model):
    """The rig refuses them: the data are the closed form of the steady state with noise, for loops too."""
    effect = LIBRARY[name]
    truth = paper_model.with_effect(name, {qualified_name(effect, effect.amount): effect.amount.value_at_share(1.0)})
    campaign = measure(in_closed_form(truth, PLAN), PLAN).campaign()
    result = joint_fit(campaign, effects=(*BASE, name), directions=BOTH)
    assert 0.85 < agrees(result, truth.values) < 1.15


def agrees(result: Result, truths: Mapping[str, float]) -> float:
    """Reduced chi-square of a fit whose values have to be the true ones."""
    reduced = result.quality.reduced_chi_square
    for parameter, truth in truths.items():
        value, stderr = result.model.values[parameter], result.covariance.stderr(parameter)
        assert stderr is not None, parameter
        z = (value - truth) / stderr
        assert abs(z) < 4.0 or abs(value / truth - 1.0) < 0.03
    return reduced


@pytest.mark.parametrize("name", SMALL)
def test_a_small_effect_is_not_taken_for_one_at_rest_on_its_bound(measured, name):
    """However wide the bounds: it has an error of its own, and the others carry their share of it."""
    effect, _, key = name.partition(".")
    campaign = measured({effect: {key: SMALL[name]}}, seed=1)
    result = joint_fit(campaign, effects=(*BASE, effect), directions=BOTH)
    interval = result.interval(name)
    assert not any("edge" in line for line in map(str, result.warnings))
    assert interval[0] <= SMALL[name] <= interval[1]


TRUTHS: dict[str, dict[str, float]] = {
    "kraus": {"delta": 6e5, "r": 0.15, "e_c": 8e-3, "n": 0.5},
    "sliders": {"sigma": 1.2e4, "e_s": 1.5e-2, "spread": 1.0},
    "distributed_sliders": {"delta": 5e5, "e_s": 8e-3, "spread": 1.2},
    "fractional_zener": {"c": 0.3},
    "intrinsic_time": {"d": 3.0},
    "paper": {},
}


def begun(model: Model, campaign: Campaign) -> tuple[Model, list[MeasuredTest]]:
    """The plain model as a fit begins, and the tests."""
    data = PreparedCampaign.from_campaign(campaign)
    tests = [*data.loops, *data.sweeps]
    return Model.with_defaults(model.bushing, BASE, data.start_values(tests)), tests


def families(model: Model, truth: str, values: Mapping[str, float]) -> dict[str, FittedFamily]:
    made = model if truth == "paper" else model.with_effect(truth, {f"{truth}.{k}": v for k, v in values.items()})
    harmonic = any(effect.harmonic_only for effect in made.records)
    clean = in_closed_form(made, PLAN) if harmonic else simulate_exact(made, PLAN)
    fitted, _ = fit_families(*begun(model, measure(clean, PLAN).campaign()), NAMES, (), {})
    return {family.name: family for family in fitted}


@pytest.mark.parametrize("truth", some(TRUTHS, {"kraus", "intrinsic_time", "paper"}))
def test_the_family_that_made_the_tests_is_the_best_and_known_to_be(paper_model, truth):
    found = families(paper_model, truth, TRUTHS[truth])
    assert list(found) == ["paper", *NAMES]
    assert found[truth].fit.reduced_chi_square == pytest.approx(1.0, abs=0.05)
    assert min(found, key=lambda name: found[name].bic) == truth
    assert sum(family.probability for family in found.values()) == pytest.approx(1.0)
    assert found[truth].probability > 0.5
    assert found[truth].holdout.after == pytest.approx(1.0, abs=0.05)
    if truth != "paper":
        assert found[truth].sentence.endswith("better by more than chance")
        values = found[truth].fit.model.values
        for key, value in TRUTHS[truth].items():
            assert values[f"{truth}.{key}"] == pytest.approx(value, rel=0.1)
    else:
        assert "equal" in found["intrinsic_time"].sentence
        assert found["kraus"].sentence.endswith("worse by more than chance")


def test_the_interval_of_the_gain_grows_with_the_misfit(paper_model):
    """Noise that is stated as half makes residuals of twice the size, and four times the gain and its interval."""
    made = paper_model.with_effect("intrinsic_time", {"intrinsic_time.d": 3.0})
    campaign = replace(measure(simulate_exact(made, PLAN), PLAN).campaign(), loops=())
    gains = []
    for noise in (2e-3, 1e-3):
        stated = replace(campaign, sweeps=tuple(replace(sweep, noise=noise) for sweep in campaign.sweeps))
        (_, family), _ = fit_families(*begun(paper_model, stated), ["fractional_zener"], (), {})
        assert family.gain is not None
        value, low, high = family.gain
        gains.append(np.array([value, value - low, high - value]))
    assert min(gains[0]) > 0.0
    assert gains[1] == pytest.approx(4.0 * gains[0], rel=0.05)


def test_known_families_are_each_law_of_rate_with_each_of_amplitude(paper_model, campaign):
    tests = PreparedCampaign.from_campaign(campaign).sweeps
    found = known_families(paper_model, tests)
    assert len(found) == 4 * 6 - 1 - 1  # less the paper's own, and a second springpot on intrinsic time
    assert {"kraus", "maxwell", "fractional_zener+sliders", "second_springpot+coupled_breakdown"} < {*found}
    warm = [replace(sweep, test=replace(sweep.test, temperature=290.0 + 9.0 * i)) for i, sweep in enumerate(tests)]
    at_temperatures = known_families(paper_model, warm)
    assert at_temperatures == ("temperature", *(f"temperature+{name}" for name in found))
    kraus = paper_model.with_effect("kraus")
    assert not any("kraus" in name or "sliders" in name for name in known_families(kraus, tests))
