"""Jobs: the files that one names before the work are those that its outcome holds; grids, and who is warned of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import PredictSettings
from bushfit.geometry import Bushing, Direction
from bushfit.jobs.compare import Compare, Entry
from bushfit.jobs.fits import kinds_of_test
from bushfit.jobs.grid import common_grid, default_grid
from bushfit.jobs.predict import Predict
from bushfit.model.covariance import Covariance
from bushfit.model.model import Model
from bushfit.model.result import Range, Result
from bushfit.report.contents import Kinds


def test_a_campaign_has_the_kinds_of_test_that_it_lists(campaign: Campaign) -> None:
    assert kinds_of_test(replace(campaign, loops=()), ("temperature",)) == ("sweeps",)
    warm = replace(campaign, sweeps=tuple(replace(sweep, temperature=300.0) for sweep in campaign.sweeps))
    assert kinds_of_test(warm, ("temperature",)) == ("loops", "sweeps", "master_curve", "shift_factors")


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


def fitted(model: Model, frequency: tuple[float, float], displacement: tuple[float, float]) -> Result:
    low, high = (x * model.unit_strain(Direction.AXIAL) for x in displacement)
    covariance = Covariance(("mu",), np.array([[1e6]]))
    return Result(model, fitted=("mu",), covariance=covariance, measured=Range(frequency, (low, high), ("axial",)))


def test_the_grid_lies_within_what_all_were_fitted_at(paper_model: Model, other_models: dict[str, Model]) -> None:
    one = fitted(paper_model, (0.1, 155.0), (1e-4, 1e-3))
    two = fitted(next(iter(other_models.values())), (4.0, 60.0), (2e-4, 5e-3))
    frequency, amplitude = common_grid([one, two], [Direction.AXIAL] * 2)
    assert frequency.tolist() == [5.0, 15.0, 25.0, 35.0, 45.0, 55.0]
    assert amplitude.tolist() == [2e-4, 5e-4]
    assert common_grid([one, one], [Direction.AXIAL] * 2)[0][0] == 1.0
    apart = fitted(paper_model, (200.0, 300.0), (1e-4, 1e-3))
    assert (
        common_grid([one, apart], [Direction.AXIAL] * 2)[0].tolist() == default_grid(one, Direction.AXIAL)[0].tolist()
    )
    narrow = fitted(paper_model, (6.0, 9.0), (1.2e-4, 1.8e-4))
    frequency, amplitude = common_grid([one, narrow], [Direction.AXIAL] * 2)
    assert (frequency.min(), frequency.max(), amplitude.min(), amplitude.max()) == pytest.approx((6, 9, 1.2e-4, 1.8e-4))


def test_what_lies_beyond_one_is_warned_of_and_another_shape_is_compared_at_the_same_displacement(
    paper_model: Model,
) -> None:
    entries = [
        Entry("one", "one.json", fitted(paper_model, (5.0, 155.0), (1e-4, 1e-3))),
        Entry("two", "two.json", fitted(paper_model, (200.0, 300.0), (1e-4, 1e-3))),
    ]
    found = Compare().run(entries)
    assert any(line.startswith("B: axial: predicted at frequencies of 5 to 155 Hz") for line in found.warnings)
    assert not any(line.startswith("A: axial: predicted") for line in found.warnings)
    longer = replace(paper_model, bushing=Bushing("longer", 0.010, 0.018, 0.068))
    entries = [Entry(m.name, m.name, fitted(m, (1.0, 155.0), (1e-4, 1e-3))) for m in (paper_model, longer)]
    (pair,) = Compare().run(entries).comparisons
    np.testing.assert_allclose(np.expm1(pair.contrasts[0].stiffness.value), 1.0)
    assert [row.difference for row in pair.parameters if row.difference is not None] == [0.0]
