"""Tables and plots as bytes by file name: what was asked for is there, and nothing else."""

from __future__ import annotations

import io
from pathlib import Path

import pandas as pd
import pytest

from bushfit.campaign.campaign import load_campaign
from bushfit.fitting.data import Data
from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.prediction import predict
from bushfit.report.artifacts import artifact_names, fit_files, prediction_files

PNG = b"\x89PNG"


@pytest.fixture(scope="module")
def data(root: Path) -> Data:
    return Data.of(load_campaign(root / "configs/cmp_15961.toml"))


@pytest.mark.parametrize("formats", [("csv",), ("png",), ("csv", "png"), ()])
def test_a_fit_has_the_files_of_the_formats_asked_for(data: Data, paper_model: Model, formats: tuple[str, ...]) -> None:
    files = fit_files(Result(paper_model), "mount", data.loops, data.sweeps, formats)
    assert sorted(files) == sorted(artifact_names(["loops", "sweeps"], formats))
    assert all(content.startswith(PNG) == name.endswith("png") for name, content in files.items())


def test_without_tests_there_are_no_files(paper_model: Model) -> None:
    formats = ("csv", "png")
    result = Result(paper_model)
    assert fit_files(result, "", [], [], formats) == {}


def test_a_prediction_has_a_table_and_a_plot_a_direction(data: Data, paper_model: Model) -> None:
    result = Result(paper_model)
    predictions = [predict(result, direction, [5.0, 15.0], [1e-4]) for direction in (Direction.AXIAL, Direction.RADIAL)]
    files = prediction_files(result, predictions, data.sweeps, ("csv", "png"))
    assert sorted(files) == sorted(artifact_names(["axial", "radial"], ("csv", "png")))
    assert len(pd.read_csv(io.BytesIO(files["radial.csv"]))) == 2
    assert list(prediction_files(result, predictions[:1], (), ("csv",))) == ["axial.csv"]
