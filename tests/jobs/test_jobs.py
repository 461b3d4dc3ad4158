"""Jobs: the files that one names before the work are those that its outcome holds."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bushfit.campaign.campaign import Campaign, load_campaign
from bushfit.campaign.schema import PredictSettings
from bushfit.errors import FitError
from bushfit.fitting.data import Data
from bushfit.geometry import Direction
from bushfit.jobs import fits
from bushfit.jobs.diagnose import Diagnose
from bushfit.jobs.fits import Fit, FitDynamic, FitStatic
from bushfit.jobs.predict import Predict
from bushfit.model.model import FIVE, Model
from bushfit.model.result import Result
from bushfit.report.contents import Formats, Kinds


@pytest.fixture(scope="module")
def campaign(root: Path) -> Campaign:
    return load_campaign(root / "configs/cmp_15961.toml")


@pytest.mark.parametrize("formats", [Formats(pictures=False), Formats()], ids=str)
@pytest.mark.parametrize("job", [FitStatic(), FitDynamic(), Fit(), Diagnose()], ids=lambda job: type(job).__name__)
def test_an_outcome_holds_the_files_that_were_named(campaign: Campaign, job: Any, formats: Formats) -> None:
    outcome = job.run(Data.of(campaign))
    files = formats.files(outcome.contents)
    assert list(files) == formats.names(job.kinds(campaign))
    documents = [json.loads(content) for name, content in files.items() if name.endswith(".json")]
    assert json.loads(json.dumps(outcome.document)) in documents


def test_a_fit_moves_what_it_is_for(campaign: Campaign) -> None:
    data = Data.of(campaign)
    assert set(FitStatic().run(data).result.fitted) == {"mu", "sigma_fmax", "eps_half"}
    assert set(FitDynamic().run(data).result.fitted) == {"m", "alpha"}
    added = Fit(directions=(Direction.RADIAL,), effects=("inertia",)).run(data).result
    assert set(added.fitted) == {*FIVE, "inertia.mass"}
    assert added.measured is not None
    assert added.measured.directions == (Direction.RADIAL,)


def test_a_dynamic_fit_makes_its_own_static_one_or_says_what_it_needs(campaign: Campaign) -> None:
    titles = [title for title, _ in FitDynamic().run(Data.of(campaign)).reports]
    assert len(titles) == 2
    assert "no --static was given" in titles[0]
    with pytest.raises(FitError, match="nothing says at which mu, sigma_fmax and eps_half"):
        FitDynamic().run(Data.of(replace(campaign, loops=())))


def test_warnings_of_a_resonance_are_those_of_the_prediction(campaign: Campaign) -> None:
    result = Fit().run(Data.of(campaign)).result
    warnings = Predict(mass=0.2, base_acceleration=0.1).run(result, campaign).document["warnings"]
    assert any(line.startswith("axial, resonance of 0.2 kg: predicted at strains") for line in warnings)
    assert len(set(warnings)) == len(warnings)


def test_a_campaign_has_the_kinds_of_test_that_it_lists(campaign: Campaign) -> None:
    assert fits.tests_of(campaign, ()) == ("loops", "sweeps")
    assert fits.tests_of(replace(campaign, loops=()), ("temperature",)) == ("sweeps",)
    warm = replace(campaign, sweeps=tuple(replace(sweep, temperature=300.0) for sweep in campaign.sweeps))
    assert fits.tests_of(warm, ("temperature",)) == ("loops", "sweeps", "master_curve", "shift_factors")


def test_a_prediction_is_over_what_was_asked_for_before_what_the_campaign_says(
    campaign: Campaign, paper_model: Model
) -> None:
    said = replace(campaign, predict=PredictSettings((10.0,), (1e-4,), None, (Direction.RADIAL,)))
    found = Predict(PredictSettings(frequencies=(7.0, 9.0))).run(Result(paper_model), said)
    (prediction,) = found.predictions
    assert prediction.direction is Direction.RADIAL
    assert prediction.frequency.tolist() == [7.0, 9.0]
    assert prediction.amplitude.tolist() == [1e-4, 1e-4]
    assert Predict().kinds(None, said) == found.contents.kinds == Kinds.shown(["radial"])


def test_a_prediction_without_a_campaign_is_axial_and_radial(paper_model: Model) -> None:
    found = Predict().run(Result(paper_model), None)
    assert [prediction.direction for prediction in found.predictions] == [Direction.AXIAL, Direction.RADIAL]
    table = found.document["axial"]
    np.testing.assert_allclose(
        table["stiffness [N/mm]"],
        1e-3
        * np.abs(
            paper_model.stiffness(
                Direction.AXIAL, np.array(table["frequency [Hz]"]), np.array(table["amplitude [mm]"]) / 1e3
            )
        ),
    )
    assert found.document["warnings"] == found.warnings
