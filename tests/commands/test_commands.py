"""Results compared: the one that is extrapolated, and bushings of another shape."""

from dataclasses import replace

import numpy as np

from bushfit.commands.compare import compare, compared_result
from bushfit.geometry import Bushing, Direction
from bushfit.model.covariance import Covariance
from bushfit.model.model import Model
from bushfit.model.result import Range, Result


def fitted(model: Model, frequency: tuple[float, float], displacement: tuple[float, float]) -> Result:
    low, high = (x * model.unit_strain(Direction.AXIAL) for x in displacement)
    covariance = Covariance(("mu",), np.array([[1e6]]))
    return Result(model, fitted=("mu",), covariance=covariance, measured=Range(frequency, (low, high), ("axial",)))


def test_the_warning_names_the_result_that_is_extrapolated(paper_model):
    inside, outside = (fitted(paper_model, ends, (1e-4, 1e-3)) for ends in ((5.0, 155.0), (200.0, 300.0)))
    output = compare(compared_result(inside, "one.json"), compared_result(outside, "two.json"))
    assert any(line.startswith("B: axial: predicted at frequencies of 5 to 155 Hz") for line in output.warnings)
    assert not any(line.startswith("A: axial: predicted") for line in output.warnings)


def test_another_shape_is_compared_at_the_same_displacement(paper_model):
    """Twice the length, twice the stiffness, and the same material."""
    longer = replace(paper_model, bushing=Bushing("longer", 0.010, 0.018, 0.068))
    (pair,) = compare(*(fitted(model, (1.0, 155.0), (1e-4, 1e-3)) for model in (paper_model, longer))).comparisons
    np.testing.assert_allclose(np.expm1(pair.contrasts[0].stiffness.value), 1.0)
    assert [row.difference for row in pair.parameters if row.difference is not None] == [0.0]
