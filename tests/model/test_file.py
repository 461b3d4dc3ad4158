"""Model files: what is written comes back; what else a file may hold is one clear error, see cli/spoiled_rows.py."""

from __future__ import annotations

import json
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


def test_the_keys_of_the_interface(document: dict[str, Any]) -> None:
    keys = "schema bushing effects parameters covariance fit warnings outliers provenance"
    assert list(document) == keys.split()
    assert document["schema"] == SCHEMAS[0] == "bushfit/model/1"
    sizes = {"inner_radius_m": 0.01, "outer_radius_m": 0.018, "length_m": 0.034}
    assert document["bushing"] == {"name": "CMP 15 961", **sizes}
    assert document["effects"] == ["elastic", "springpot", "friction"]
    assert set(document["parameters"]) == set(FIVE) == set(document["covariance"]["names"])
    for entry in document["parameters"].values():
        assert set(entry) == {"value", "stderr", "ci95", "unit", "vary"}
        assert entry["ci95"][0] < entry["value"] < entry["ci95"][1]
        assert entry["vary"] is True
    assert document["parameters"]["m"]["unit"] == "Pa*s^alpha"
    assert np.shape(document["covariance"]["matrix"]) == np.shape(document["covariance"]["spread"])[1:] == (5, 5)
    assert {"nrmse", "reduced_chi_square", "points", "noise"} <= set(document["fit"])
    assert {len(source["sha256"]) for source in document["provenance"]["inputs"]} == {64}
    assert {"bushfit", "inputs", "packages"} == set(document["provenance"])


def test_there_and_back(result: Result, document: dict[str, Any]) -> None:
    back = from_document(document)
    for key in ("model", "fitted", "quality", "measured", "warnings"):
        assert getattr(back, key) == getattr(result, key)
    np.testing.assert_array_equal(back.covariance.matrix, result.covariance.matrix)
    np.testing.assert_array_equal(back.covariance.spread, result.covariance.spread)
    assert {**to_document(back), "provenance": None} == {**document, "provenance": None}


def test_what_is_left_out_where_it_is_not_so(result: Result, document: dict[str, Any]) -> None:
    """Effects that may be the rig's, a shape that is not the paper's; directions are not in older files."""
    bushing = replace(result.model.bushing, shape="calibrated")  # type: ignore[type-var]
    model = replace(result.model.with_effect("clearance"), bushing=bushing)
    more = json.loads(json.dumps(to_document(replace(result, model=model, unresolved=("clearance",)))))
    assert (more["unresolved"], more["bushing"]["shape"]) == (["clearance"], "calibrated")
    assert (from_document(more).unresolved, from_document(more).model.bushing) == (("clearance",), bushing)
    del document["fit"]["directions"]
    assert result.measured is not None
    assert from_document(document).measured == replace(result.measured, directions=())


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
    plain = result.model.without(Level.COMPONENT)
    for direction, factor in (("radial", 1.05), ("axial", 1.0)):
        ratio = result.model.stiffness(direction, 50.0, 1e-4) / plain.stiffness(direction, 50.0, 1e-4)
        assert abs(ratio) == pytest.approx(factor)
    document["parameters"]["radial_factor.factor"] = document["parameters"].pop("radial_factor.excess")
    with pytest.raises(ModelError, match=r"stiffness_factor\.radial"):
        from_document(document)
