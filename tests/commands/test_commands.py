"""Grids of commands, the model that is loaded, and the warnings of a comparison."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import PredictSettings
from bushfit.commands.compare import compare, compared_result
from bushfit.commands.predict import predict
from bushfit.geometry import Bushing, Direction
from bushfit.model.covariance import Covariance
from bushfit.model.model import Model
from bushfit.model.result import Range, Result
from bushfit.prediction.grid import common_grid, default_grid


def test_a_grid_that_is_given_goes_before_that_of_the_campaign(campaign: Campaign, paper_model: Model) -> None:
    stated = replace(campaign, predict=PredictSettings((10.0,), (1e-4,), None, (Direction.RADIAL,)))
    output = predict(Result(paper_model), stated, frequencies=(7.0, 9.0))
    (prediction,) = output.predictions
    assert prediction.direction is Direction.RADIAL
    assert prediction.frequency.tolist() == [7.0, 9.0]
    assert prediction.amplitude.tolist() == [1e-4, 1e-4]
    assert {file.name for file in output.files} == {"radial", "measured"}


def fitted(model: Model, frequency: tuple[float, float], displacement: tuple[float, float]) -> Result:
    low, high = (x * model.unit_strain(Direction.AXIAL) for x in displacement)
    covariance = Covariance(("mu",), np.array([[1e6]]))
    return Result(model, fitted=("mu",), covariance=covariance, measured=Range(frequency, (low, high), ("axial",)))


def test_the_grid_of_a_comparison_is_in_the_range_of_all_results(
    paper_model: Model, other_models: dict[str, Model]
) -> None:
    one = fitted(paper_model, (0.1, 155.0), (1e-4, 1e-3))
    two = fitted(next(iter(other_models.values())), (4.0, 60.0), (2e-4, 5e-3))
    frequency, amplitude = common_grid([one, two], [Direction.AXIAL] * 2)
    assert frequency.tolist() == [5.0, 15.0, 25.0, 35.0, 45.0, 55.0]
    assert amplitude.tolist() == [2e-4, 5e-4]
    assert common_grid([one, one], [Direction.AXIAL] * 2)[0][0] == 5.0
    apart = fitted(paper_model, (200.0, 300.0), (1e-4, 1e-3))
    assert (
        common_grid([one, apart], [Direction.AXIAL] * 2)[0].tolist() == default_grid(one, Direction.AXIAL)[0].tolist()
    )
    narrow = fitted(paper_model, (6.0, 9.0), (1.2e-4, 1.8e-4))
    frequency, amplitude = common_grid([one, narrow], [Direction.AXIAL] * 2)
    assert (frequency.min(), frequency.max(), amplitude.min(), amplitude.max()) == pytest.approx((6, 9, 1.2e-4, 1.8e-4))


def test_the_warning_names_the_result_that_is_extrapolated(paper_model: Model) -> None:
    inside, outside = (fitted(paper_model, ends, (1e-4, 1e-3)) for ends in ((5.0, 155.0), (200.0, 300.0)))
    output = compare(compared_result(inside, "one.json"), compared_result(outside, "two.json"))
    assert any(line.startswith("B: axial: predicted at frequencies of 5 to 155 Hz") for line in output.warnings)
    assert not any(line.startswith("A: axial: predicted") for line in output.warnings)


def test_another_shape_is_compared_at_the_same_displacement(paper_model: Model) -> None:
    """Twice the length, twice the stiffness, and the same material."""
    longer = replace(paper_model, bushing=Bushing("longer", 0.010, 0.018, 0.068))
    (pair,) = compare(*(fitted(model, (1.0, 155.0), (1e-4, 1e-3)) for model in (paper_model, longer))).comparisons
    np.testing.assert_allclose(np.expm1(pair.contrasts[0].stiffness.value), 1.0)
    assert [row.difference for row in pair.parameters if row.difference is not None] == [0.0]
