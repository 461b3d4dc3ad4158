"""Operating points in words: directions, specimens by name, and amplitudes that are none of theirs."""

from __future__ import annotations

import pytest

from bushfit.batch.quantities import parse_point
from bushfit.batch.work import numbers_of
from bushfit.errors import BatchError, ModelError, UnitError
from bushfit.geometry import STRAINING, TRANSLATION, Specimen
from bushfit.model.model import Model
from bushfit.model.result import Result


@pytest.mark.parametrize(
    ("text", "place", "amplitude", "shown"),
    [
        ("axial 25 Hz 0.1 mm", "axial", 1e-4, "axial 25 Hz 0.1 mm"),
        ("DMA, 10 Hz, 1 %", "DMA", 0.01, "DMA 10 Hz 1 %"),
        ("mount: 1/2 0.025 kHz 100 um", "mount: 1/2", 1e-4, "mount: 1/2 25 Hz 0.1 mm"),
    ],
)
def test_points_in_words(text: str, place: str, amplitude: float, shown: str) -> None:
    point = parse_point(text)
    assert (point.place, str(point)) == (place, shown)
    assert point.amplitude == pytest.approx(amplitude)
    assert point.motion is (STRAINING if "%" in text else TRANSLATION)
    assert parse_point(shown) == point


@pytest.mark.parametrize(
    "text", ["axail 25 Hz 0.1 mm", "Axial 25 Hz 0.1 mm", "DMA 25 Hz", "DMA 25 Hz 1 kg", "axial 25 Hz 1 %"]
)
def test_what_is_no_point(text: str) -> None:
    with pytest.raises(UnitError):
        parse_point(text)


def test_a_point_at_a_specimen_is_that_of_the_model(paper_model: Model) -> None:
    result = Result(paper_model, specimens=(coupon := Specimen("DMA", "modulus"),))
    record = numbers_of(result, [parse_point("DMA 10 Hz 1 %")], ())
    modulus = abs(paper_model.stiffness(coupon, 10.0, 0.01))
    assert record["points"]["DMA 10 Hz 1 %"]["stiffness"][0] == pytest.approx(modulus)
    with pytest.raises(BatchError, match=r"this amplitude is none of the place[\s\S]*an amplitude in %"):
        numbers_of(result, [parse_point("DMA 10 Hz 1 mm")], ())
    with pytest.raises(ModelError, match="no such direction or specimen"):
        numbers_of(result, [parse_point("coupon 10 Hz 1 %")], ())
