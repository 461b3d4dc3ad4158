"""Tables and plots as bytes by file name: what was asked for is there, and nothing else."""

from __future__ import annotations

import io
from itertools import product
from pathlib import Path

import pandas as pd
import pytest

from bushfit.campaign.campaign import load_campaign
from bushfit.fitting.data import Data
from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.prediction import predict
from bushfit.report.artifacts import fit_contents, prediction_contents
from bushfit.report.contents import Formats, Kinds

PNG = b"\x89PNG"


@pytest.fixture(scope="module")
def data(root: Path) -> Data:
    return Data.of(load_campaign(root / "configs/cmp_15961.toml"))


@pytest.mark.parametrize("formats", [Formats(*both) for both in product((True, False), repeat=2)], ids=str)
def test_a_fit_has_the_files_of_the_formats_asked_for(data: Data, paper_model: Model, formats: Formats) -> None:
    files = formats.files(fit_contents(Result(paper_model), "mount", data.loops, data.sweeps))
    assert list(files) == formats.names(Kinds.shown(["loops", "sweeps"]))
    assert len(files) == 2 * (formats.tables + formats.pictures)
    assert all(content.startswith(PNG) == name.endswith("png") for name, content in files.items())


def test_without_tests_there_are_no_files(paper_model: Model) -> None:
    assert Formats().files(fit_contents(Result(paper_model), "", [], [])) == {}


def test_a_prediction_has_a_table_and_a_plot_a_direction(data: Data, paper_model: Model) -> None:
    result = Result(paper_model)
    predictions = [predict(result, direction, [5.0, 15.0], [1e-4]) for direction in (Direction.AXIAL, Direction.RADIAL)]
    files = Formats().files(prediction_contents(result, predictions, data.sweeps))
    assert list(files) == ["axial.csv", "axial.png", "radial.csv", "radial.png"]
    assert len(pd.read_csv(io.BytesIO(files["radial.csv"]))) == 2
    assert list(Formats(pictures=False).files(prediction_contents(result, predictions[:1], ()))) == ["axial.csv"]
