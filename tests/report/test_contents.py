"""Tables and pictures as files: named before they are made, in the form asked for, with the right numbers."""

from __future__ import annotations

import io
from pathlib import Path
from typing import get_args
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from bushfit.campaign.campaign import load_campaign
from bushfit.fitting.data import Data
from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.prediction.stiffness import predict
from bushfit.reading.tablefile import Form
from bushfit.report.artifacts import fit_contents, prediction_contents
from bushfit.report.contents import Contents, Formats, Picture
from bushfit.report.plots.style import to_image
from bushfit.report.tables import loops_table, sweeps_table

BEGINS = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}
#: A text with markup, the end of a comment, what mathematics would be, and letters that the font lacks.
NASTY = "<script>alert(1)</script> --> & $x_1$ 衬套"


@pytest.fixture(scope="module")
def data(root: Path) -> Data:
    return Data.of(load_campaign(root / "configs/cmp_15961.toml"))


def drawn() -> Figure:
    figure = Figure()
    figure.subplots().fill_between([1.0, 2.0], [1.0, 2.0], [2.0, 3.0], hatch="//")
    figure.suptitle(NASTY, parse_math=False)
    return figure


@pytest.mark.parametrize(("form", "end"), [("csv", "csv"), ("decimal-comma", "csv"), ("xlsx", "xlsx")])
@pytest.mark.parametrize("pictures", [("png",), ("svg", "pdf"), ()])
def test_files_have_the_names_told_before(form: Form, end: str, pictures: tuple[Picture, ...]) -> None:
    made = list[Figure]()

    def picture() -> Figure:
        made.append(drawn())
        return made[0]

    formats = Formats(pictures=bool(pictures), table_form=form, picture_forms=pictures)
    table = pd.DataFrame({"x [mm]": np.ones(2)})
    contents = Contents({"model": {}}, {"a": lambda: table, "b": lambda: table}, {"b": picture})
    files = formats.files(contents)
    assert list(files) == formats.names(contents.kinds)
    assert list(files) == ["model.json", f"a.{end}", f"b.{end}", *(f"b.{each}" for each in pictures)]
    assert len(made) == bool(pictures), "drawn once for all forms"
    for each in pictures:
        assert files[f"b.{each}"].startswith(BEGINS[each])


@pytest.mark.parametrize("form", get_args(Picture))
def test_a_picture_is_the_same_bytes_each_time_without_date_or_version(form: Picture) -> None:
    first, second = (to_image(drawn(), form) for _ in range(2))
    assert first == second
    assert not [word for word in (b"Matplotlib v", b"CreationDate", b"dc:date", b"Software") if word in first]
    if form == "svg":  # texts are outlines
        names = {element.tag.partition("}")[2] for element in ElementTree.fromstring(first).iter()}
        assert {"path", "use"} <= names
        assert not {"script", "text", "image"} & names


def test_a_fit_and_a_prediction_have_a_table_and_a_picture_of_each(data: Data, paper_model: Model) -> None:
    result = Result(paper_model)
    assert Formats().files(fit_contents(result, "", [], [])) == {}
    assert list(Formats(tables=False).files(fit_contents(result, "", data.loops, data.sweeps))) == [
        "loops.png",
        "sweeps.png",
    ]
    predictions = [predict(result, direction, [5.0, 15.0], [1e-4]) for direction in (Direction.AXIAL, Direction.RADIAL)]
    files = Formats().files(prediction_contents(result, predictions, data.sweeps))
    assert list(files) == ["axial.csv", "axial.png", "radial.csv", "radial.png"]
    assert len(pd.read_csv(io.BytesIO(files["radial.csv"]))) == 2


def test_loops_row_by_row(data: Data, paper_model: Model) -> None:
    table, loop = loops_table(paper_model, data.loops), data.loops[0].test
    assert len(table) == loop.time.size
    np.testing.assert_allclose(table["force [N]"], loop.force, rtol=1e-12)
    np.testing.assert_allclose(table["displacement [mm]"], 1e3 * loop.displacement, atol=2e-3)
    off = (table["model force [N]"] - table["force [N]"]) / data.loops[0].drive.noise
    np.testing.assert_allclose(table["residual [noise]"], off, rtol=1e-9, atol=1e-9)
    assert np.std(table["residual [noise]"]) == pytest.approx(1.0, abs=0.1)


def test_sweeps_sorted_by_amplitude_repeat_and_frequency(data: Data, paper_model: Model) -> None:
    table = sweeps_table(paper_model, data.sweeps)
    assert len(table) == sum(data_set.sweep.frequency.size for data_set in data.sweeps)
    assert list(dict.fromkeys(table["direction"])) == ["axial", "radial"]
    axial = table[table["direction"] == "axial"].reset_index(drop=True)
    frequency, amplitude = axial[["frequency [Hz]", "amplitude [mm]"]].to_numpy().T
    assert axial.equals(axial.sort_values(["amplitude [mm]", "repeat", "frequency [Hz]"], ignore_index=True))
    stiffness = paper_model.stiffness("axial", frequency, amplitude / 1e3)
    np.testing.assert_allclose(axial["model stiffness [N/mm]"], np.abs(stiffness) / 1e3, rtol=1e-12)
    np.testing.assert_allclose(axial["model loss factor [-]"], stiffness.imag / stiffness.real, rtol=1e-9)
