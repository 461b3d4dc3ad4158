"""Model families: that which made the tests is found from any start, wins where held out, and equals are alike."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from rigged import PLAN, in_closed_form
from tries import some

from bushfit.campaign.campaign import Campaign
from bushfit.diagnosis.families import FittedFamily, fit_families, known_families
from bushfit.effects import BASE
from bushfit.fitting.data import Data
from bushfit.fitting.data_sets import DataSet
from bushfit.model.model import Model
from bushfit.simulation.measured import measure
from bushfit.simulation.undisturbed import undisturbed

TRUTHS: dict[str, dict[str, float]] = {
    "kraus": {"delta": 6e5, "r": 0.15, "e_c": 8e-3, "n": 0.5},
    "sliders": {"sigma": 1.2e4, "e_s": 1.5e-2, "spread": 1.0},
    "fractional_zener": {"c": 0.3},
    "intrinsic_time": {"d": 3.0},
    "paper": {},
}
NAMES = ("kraus", "sliders", "fractional_zener", "intrinsic_time")


def begun(model: Model, campaign: Campaign) -> tuple[Model, list[DataSet]]:
    """The plain model as a fit begins, and the tests."""
    data = Data.of(campaign)
    tests = [*data.loops, *data.sweeps]
    return Model.started(model.bushing, BASE, data.start(tests, {})), tests


def families(model: Model, truth: str, values: Mapping[str, float]) -> dict[str, FittedFamily]:
    made = model if truth == "paper" else model.with_effect(truth, {f"{truth}.{k}": v for k, v in values.items()})
    harmonic = any(effect.harmonic_only for effect in made.records)
    clean = in_closed_form(made, PLAN) if harmonic else undisturbed(made, PLAN)
    fitted, _ = fit_families(*begun(model, measure(clean, PLAN).campaign()), NAMES, (), {})
    return {family.name: family for family in fitted}


@pytest.mark.parametrize("truth", some(TRUTHS, {"kraus", "intrinsic_time", "paper"}))
def test_the_family_that_made_the_tests_is_the_best_and_known_to_be(paper_model: Model, truth: str) -> None:
    found = families(paper_model, truth, TRUTHS[truth])
    assert list(found) == ["paper", *NAMES]
    assert found[truth].evidence.reduced == pytest.approx(1.0, abs=0.05)
    assert min(found, key=lambda name: found[name].evidence.bic) == truth
    assert sum(family.probability for family in found.values()) == pytest.approx(1.0)
    assert found[truth].probability > 0.5
    assert found[truth].held.after == pytest.approx(1.0, abs=0.05)
    if truth != "paper":
        assert found[truth].words.endswith("better by more than chance")
        values = found[truth].evidence.model.values
        for key, value in TRUTHS[truth].items():
            assert values[f"{truth}.{key}"] == pytest.approx(value, rel=0.1)
    else:
        assert "alike" in found["intrinsic_time"].words
        assert found["kraus"].words.endswith("worse by more than chance")


@pytest.mark.slow
def test_the_interval_of_the_gain_is_that_of_noise(paper_model: Model) -> None:
    """Two wrong families: redrawn noise moves the gain of one over the other as its interval says."""
    gains = []
    made = paper_model.with_effect("intrinsic_time", {"intrinsic_time.d": 1.0})
    clean = undisturbed(made, PLAN)
    for seed in range(12):
        made = begun(paper_model, measure(clean, replace(PLAN, seed=seed)).campaign())
        (_, other), _ = fit_families(*made, ["fractional_zener"], (), {})
        assert other.gain is not None
        gains.append(other.gain)
    value, low, high = np.array(gains).T
    said, real = float(np.mean(high - low)) / 3.92, float(value.std(ddof=1))
    print(f"standard error of the gain: said {said:.4f}, real {real:.4f}, gain {value.mean():.4f}")
    assert 0.4 < said / real < 2.5


def test_known_families_are_each_law_of_rate_with_each_of_amplitude(paper_model: Model, campaign: Campaign) -> None:
    tests = Data.of(campaign).sweeps
    found = known_families(paper_model, tests)
    assert len(found) == 4 * 5 - 1 - 1  # less the paper's own, and a second springpot on intrinsic time
    assert {"kraus", "maxwell", "fractional_zener+sliders", "second_springpot+coupled_breakdown"} < {*found}
    warm = [replace(sweep, sweep=replace(sweep.sweep, temperature=290.0 + 9.0 * i)) for i, sweep in enumerate(tests)]
    at_temperatures = known_families(paper_model, warm)
    assert at_temperatures == ("temperature", *(f"temperature+{name}" for name in found))
    kraus = paper_model.with_effect("kraus")
    assert not any("kraus" in name or "sliders" in name for name in known_families(kraus, tests))


@pytest.mark.slow
def test_the_likeliest_of_all_families_are_held_out(paper_model: Model) -> None:
    """Kraus' law with a spring in series with the springpot: it leads, or what leads has both in it."""
    made = paper_model.with_effect("kraus", {f"kraus.{key}": value for key, value in TRUTHS["kraus"].items()})
    made = made.with_effect("fractional_zener", {"fractional_zener.c": 0.5})
    found, left = fit_families(*begun(paper_model, measure(in_closed_form(made, PLAN), PLAN).campaign()), (), (), {})
    assert 2 <= len(found) <= 6
    assert found[0].name == "paper"
    assert sum(family.probability for family in found) + sum(left.values()) == pytest.approx(1.0)
    assert max(found, key=lambda family: family.probability).name == "fractional_zener+kraus"
