"""What a prediction says that it cannot: extrapolation, formulas that were not fitted, models given by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bushfit.geometry import Bushing, Direction, Shape
from bushfit.model.model import Model
from bushfit.model.result import Range, Result
from bushfit.prediction.caveats import caveats
from bushfit.prediction.stiffness import predict, predict_resonance


def test_extrapolation_is_said(result: Result) -> None:
    inside = predict(result, Direction.AXIAL, [5.0, 155.0], [1e-4, 5e-4])
    assert inside.warnings == ()
    high = predict(result, Direction.AXIAL, [5.0, 400.0], [1e-4])
    assert high.warnings == (
        "axial: predicted at frequencies of 5 to 400 Hz, but fitted at 0.1 to 155 Hz only: extrapolated beyond",
    )
    far = predict(result, Direction.AXIAL, [5.0], [5e-3])
    assert len(far.warnings) == 1
    assert "predicted at strains of 31 %, but fitted at " in far.warnings[0]
    assert len(predict(result, Direction.AXIAL, [0.01], [1e-6]).warnings) == 2


def test_a_resonance_says_what_its_peak_extrapolates(result: Result) -> None:
    """Frequencies and strains near the peak count, not those far from it; so does a place that was not fitted."""
    inside = predict_resonance(result, Direction.AXIAL, 3.0, 20.0, None)
    assert inside.frequency[-1] > 155.0, "beyond what was fitted, but far from the peak"
    assert inside.peak[0] == pytest.approx(75.0, rel=0.2)
    assert inside.warnings == ()
    fast, low = predict_resonance(result, Direction.AXIAL, 0.2, 0.1, None).warnings
    assert fast.startswith("axial, resonance of 0.2 kg: predicted at frequencies of ")
    assert low.startswith("axial, resonance of 0.2 kg: predicted at strains of ")
    fitted, *_ = predict_resonance(result, Direction.RADIAL, 3.0, 20.0, None).warnings
    assert fitted.startswith("radial: not fitted")


def test_a_model_given_by_hand_has_no_bands_and_says_so(paper_model: Model) -> None:
    prediction = predict(Result(paper_model), Direction.RADIAL, [5.0, 55.0], [1e-4])
    assert np.array_equal(prediction.stiffness.low, prediction.stiffness.high)
    assert prediction.warnings == ()
    (said,) = caveats(Result(paper_model))
    assert "no uncertainty" in said


RADIAL_FORMULA = (
    "not the error of the radial formula, for this shape +4.9 % in stiffness and +36 % in strain against finite "
    'elements, by which shape = "calibrated" goes'
)
BAND = "its band holds the scatter of the"
TORSION_FORMULA = "not the error of the torsion formula, which was not compared with finite elements"


@pytest.mark.parametrize(
    ("direction", "fitted", "said"),
    [
        ("radial", "axial", f"radial: not fitted; {BAND} axial tests, {RADIAL_FORMULA}"),
        ("axial", "radial", f"axial: not fitted; {BAND} radial tests, {RADIAL_FORMULA}"),
        ("torsion", "axial radial", f"torsion: not fitted; {BAND} axial and radial tests, {TORSION_FORMULA}"),
        (
            "radial",
            "axial radial",
            "radial: fitted with the paper's formula, for this shape +4.9 % in stiffness and +36 % in strain against "
            'finite elements, by which shape = "calibrated" goes; the parameters carry that error',
        ),
        ("axial", "axial", None),
        ("radial", "", None),
    ],
)
def test_a_band_that_lacks_the_error_of_a_formula_says_so(
    result: Result, direction: str, fitted: str, said: str | None
) -> None:
    """And keeps silent where another was fitted by its exact formula, or where an older file does not say."""
    reach = Range((0.1, 155.0), (1e-6, 1.0), tuple(Direction(name) for name in fitted.split()))
    found = predict(replace(result, measured=reach), Direction(direction), [5.0], [1e-4])
    assert found.warnings == ((said,) if said else ())


@pytest.mark.parametrize(
    ("inner", "shape", "said"),
    [
        (0.010, "calibrated", ["the radial formula, up to 1 % in stiffness and 3 % in strain against finite elements"]),
        (
            0.016,
            "paper",
            ["+7.3 % in stiffness and +47 % in strain", "a bulk modulus of 2 GPa would lower the radial stiffness of"],
        ),
        (0.017, "paper", ["the radial formula, which no finite elements back for this shape"]),
    ],
)
def test_the_error_of_the_radial_formula_is_that_of_the_very_shape(
    result: Result, bushing: Bushing, inner: float, shape: Shape, said: list[str]
) -> None:
    bushing = replace(bushing, inner_radius=inner, shape=shape)
    reach = Range((0.1, 155.0), (1e-6, 1.0), (Direction.AXIAL,))
    other = replace(result, model=replace(result.model, bushing=bushing), measured=reach)
    found = predict(other, Direction.RADIAL, [5.0], [1e-6]).warnings
    assert len(found) == len(said)
    assert all(part in line for part, line in zip(said, found, strict=True)), found


def test_a_radial_factor_stands_for_the_error_of_the_radial_formula(result: Result) -> None:
    model = result.model.with_effect("stiffness_factor.radial", {"stiffness_factor.radial": 1.05})
    for direction, said in ((Direction.RADIAL, False), (Direction.TORSION, True)):
        warnings = predict(replace(result, model=model), direction, [5.0], [2e-5]).warnings
        assert any("not fitted" in line for line in warnings) is said
