"""Model files: what is written comes back, and whatever else a file holds is one clear error."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bushfit.effects import Level
from bushfit.errors import ModelError
from bushfit.model.file import SCHEMAS, from_document, load_result, model_document, to_document
from bushfit.model.model import FIVE, Model
from bushfit.model.result import Result


@pytest.fixture
def document(result: Result) -> dict[str, Any]:
    return json.loads(json.dumps(to_document(result), allow_nan=False))  # type: ignore[no-any-return]


def test_schema_of_the_interface(document: dict[str, Any]) -> None:
    assert list(document) == [
        "schema", "bushing", "effects", "parameters", "covariance", "fit", "warnings", "outliers",
        "provenance",
    ]  # fmt: skip
    assert document["schema"] == SCHEMAS[0] == "bushfit/model/1"
    assert document["bushing"] == {
        "name": "CMP 15 961", "inner_radius_m": 0.01, "outer_radius_m": 0.018, "length_m": 0.034,
    }  # fmt: skip
    assert document["effects"] == ["elastic", "springpot", "friction"]
    assert set(document["parameters"]) == set(FIVE) == set(document["covariance"]["names"])
    for entry in document["parameters"].values():
        assert set(entry) == {"value", "stderr", "ci95", "unit", "vary"}
        assert entry["ci95"][0] < entry["value"] < entry["ci95"][1]
        assert entry["vary"] is True
    assert document["parameters"]["m"]["unit"] == "Pa*s^alpha"
    assert np.shape(document["covariance"]["matrix"]) == (5, 5)
    assert np.shape(document["covariance"]["spread"])[1:] == (5, 5)
    assert {"nrmse", "reduced_chi_square", "points", "noise"} <= set(document["fit"])
    assert document["warnings"] == [] or all(isinstance(line, str) for line in document["warnings"])
    for source in document["provenance"]["inputs"]:
        assert len(source["sha256"]) == 64
    assert {"bushfit", "inputs", "packages"} == set(document["provenance"])


def test_there_and_back(result: Result, document: dict[str, Any]) -> None:
    back = from_document(document)
    assert back.model == result.model
    assert back.fitted == result.fitted
    assert back.quality == result.quality
    assert back.measured == result.measured
    assert back.warnings == result.warnings
    np.testing.assert_array_equal(back.covariance.matrix, result.covariance.matrix)
    np.testing.assert_array_equal(back.covariance.spread, result.covariance.spread)
    again = to_document(back)
    assert {**again, "provenance": None} == {**document, "provenance": None}


def test_what_is_unresolved_stays_so(result: Result) -> None:
    unresolved = replace(result, model=result.model.with_effect("clearance"), unresolved=("clearance",))
    document = json.loads(json.dumps(to_document(unresolved)))
    assert document["unresolved"] == ["clearance"]
    assert from_document(document).unresolved == ("clearance",)


def test_a_file_that_does_not_say_which_directions_were_fitted_is_read(
    result: Result, document: dict[str, Any]
) -> None:
    del document["fit"]["directions"]
    back = from_document(document)
    assert result.measured is not None
    assert back.measured == replace(result.measured, directions=())


def test_a_model_alone_is_a_result(paper_model: Model, tmp_path: Path) -> None:
    file = tmp_path / "m.json"
    file.write_text(json.dumps({"schema": SCHEMAS[0], **model_document(paper_model)}))
    result = load_result(file)
    assert result.model == paper_model
    assert result.quality is None
    assert result.interval("mu") is None


def test_the_radial_factor_of_older_files_is_read(document: dict[str, Any]) -> None:
    """An effect that was called radial_factor, with an excess over 1, is a stiffness factor of the radial direction."""
    entry = {"value": 0.05, "unit": "1", "vary": True, "profile95": [0.04, None]}
    document["effects"].append("radial_factor")
    document["parameters"]["radial_factor.excess"] = entry
    document["covariance"] = {"names": ["radial_factor.excess"], "matrix": [[1e-4]], "spread": []}
    result = from_document(document)
    assert result.model.values["stiffness_factor.radial"] == pytest.approx(1.05)
    assert result.covariance.stderr("stiffness_factor.radial") == pytest.approx(0.01)
    assert result.profile["stiffness_factor.radial"] == (pytest.approx(1.04), None)
    radial, axial = (
        abs(
            result.model.stiffness(direction, 50.0, 1e-4)
            / result.model.without(Level.COMPONENT).stiffness(direction, 50.0, 1e-4)
        )
        for direction in ("radial", "axial")
    )
    assert (radial, axial) == (pytest.approx(1.05), pytest.approx(1.0))


def test_an_older_file_with_a_misnamed_factor_is_one_clear_error(document: dict[str, Any]) -> None:
    document["effects"].append("radial_factor")
    document["parameters"]["radial_factor.factor"] = {"value": 0.05, "unit": "1", "vary": True}
    with pytest.raises(ModelError, match=r"stiffness_factor\.radial"):
        from_document(document)


@pytest.mark.parametrize("schema", ["bushfit/model/3", "bushfit/diagnosis/1", None, 3])
def test_an_unknown_schema_is_refused_by_name(document: dict[str, Any], tmp_path: Path, schema: object) -> None:
    document["schema"] = schema
    file = tmp_path / "model.json"
    file.write_text(json.dumps(document))
    with pytest.raises(ModelError) as caught:
        load_result(file)
    assert repr(schema) in str(caught.value)
    assert "bushfit/model/1" in str(caught.value)
    assert str(file) in str(caught.value)


Change = Callable[[dict[str, Any]], object]


DAMAGES: dict[str, Change] = {
    "no bushing": lambda d: d.pop("bushing"),
    "no parameters": lambda d: d.pop("parameters"),
    "text value": lambda d: d["parameters"]["mu"].update(value="stiff"),
    "null value": lambda d: d["parameters"]["mu"].update(value=None),
    "impossible value": lambda d: d["parameters"]["alpha"].update(value=7.0),
    "unknown effect": lambda d: d["effects"].append("magic"),
    "unknown parameter": lambda d: d["parameters"].update(nu={"value": 1.0}),
    "short covariance": lambda d: d["covariance"]["matrix"].pop(),
    "covariance of others": lambda d: d["covariance"].update(names=["a", "b", "c", "d", "e"]),
    "short spread": lambda d: d["covariance"]["spread"][0].pop(),
    "spread is a number": lambda d: d["covariance"].update(spread=3.0),
    "infinite covariance": lambda d: d["covariance"]["matrix"][0].__setitem__(0, float("inf")),
    "covariance is text": lambda d: d.update(covariance="none"),
    "fit is a list": lambda d: d.update(fit=[1, 2]),
    "fit lacks a number": lambda d: d["fit"].pop("nrmse"),
    "unknown direction": lambda d: d["fit"].update(directions=["sideways"]),
    "a range without frequencies": lambda d: d["fit"].pop("frequency_Hz"),
    "range of three": lambda d: d["fit"].update(strain=[1, 2, 3]),
    "at another bound": lambda d: d["parameters"]["mu"].update(at_bound="middle"),
    "profile of one end": lambda d: d["parameters"]["mu"].update(profile95=[1.0]),
    "profile of texts": lambda d: d["parameters"]["mu"].update(profile95=["1", "2"]),
    "outlier without row": lambda d: d.update(outliers=[{"test": "a", "file": None, "column": "force", "distance": 9}]),
    "outlier at half a row": lambda d: d.update(
        outliers=[{"test": "a", "file": None, "row": 1.5, "column": "force", "distance": 9}]
    ),
    "outliers is null": lambda d: d.update(outliers=None),
    "provenance is text": lambda d: d.update(provenance="here"),
    "warnings is a number": lambda d: d.update(warnings=3),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_content_is_one_clear_error(document: dict[str, Any], tmp_path: Path, damage: str) -> None:
    DAMAGES[damage](document)
    file = tmp_path / "model.json"
    file.write_text(json.dumps(document))
    with pytest.raises(ModelError) as caught:
        load_result(file)
    assert str(caught.value).startswith(str(file))


@pytest.mark.parametrize(
    "content", [b"", b"{", b"[1, 2]", b'"text"', b"\xff\xfe\x00", b"[" * 100_000, b'{"schema": "bushfit/model/1"}']
)
def test_files_that_are_no_model(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "model.json"
    file.write_bytes(content)
    with pytest.raises(ModelError, match=r"model\.json"):
        load_result(file)


def test_missing_files_and_folders(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="no such file"):
        load_result(tmp_path / "absent.json")
    with pytest.raises(ModelError, match="this is not a file"):
        load_result(tmp_path)
