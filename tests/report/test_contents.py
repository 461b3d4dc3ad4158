"""Tables and pictures as files: named before they are made, in the form asked for, with the right numbers and texts."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any, get_args
from xml.etree import ElementTree

import numpy as np
import openpyxl
import pandas as pd
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from bushfit.campaign.campaign import load_campaign
from bushfit.errors import CONTROL
from bushfit.fitting.data import Data
from bushfit.jobs.compare import Compare
from bushfit.jobs.fits import Fit
from bushfit.jobs.predict import Predict
from bushfit.model.model import Model
from bushfit.reading.tablefile import Form
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


def test_loops_row_by_row_and_sweeps_by_amplitude_repeat_and_frequency(data: Data, paper_model: Model) -> None:
    table, loop = loops_table(paper_model, data.loops), data.loops[0].test
    assert len(table) == loop.time.size
    np.testing.assert_allclose(table["force [N]"], loop.force, rtol=1e-12)
    np.testing.assert_allclose(table["displacement [mm]"], 1e3 * loop.displacement, atol=2e-3)
    off = (table["model force [N]"] - table["force [N]"]) / data.loops[0].drive.noise
    np.testing.assert_allclose(table["residual [noise]"], off, rtol=1e-9, atol=1e-9)
    assert np.std(table["residual [noise]"]) == pytest.approx(1.0, abs=0.1)
    table = sweeps_table(paper_model, data.sweeps)
    assert len(table) == sum(data_set.sweep.frequency.size for data_set in data.sweeps)
    assert list(dict.fromkeys(table["direction"])) == ["axial", "radial"]
    axial = table[table["direction"] == "axial"].reset_index(drop=True)
    frequency, amplitude = axial[["frequency [Hz]", "amplitude [mm]"]].to_numpy().T
    assert axial.equals(axial.sort_values(["amplitude [mm]", "repeat", "frequency [Hz]"], ignore_index=True))
    stiffness = paper_model.stiffness("axial", frequency, amplitude / 1e3)
    np.testing.assert_allclose(axial["model stiffness [N/mm]"], np.abs(stiffness) / 1e3, rtol=1e-12)
    np.testing.assert_allclose(axial["model loss factor [-]"], stiffness.imag / stiffness.real, rtol=1e-9)


#: A formula, mathematics that is none, and in names of files what clears the screen and turns a line around.
NAME = r"=cmd|' /C calc'!A0 $\foo{x}$ _a_ <b>"
FILE = "=1+1 $\\foo$ \x1b[2J\u202ecsv.exe"


@pytest.fixture(scope="module")
def found(root: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Contents]:
    """All that commands make of a campaign of such names."""
    folder = tmp_path_factory.mktemp("foreign")
    text = (root / "configs/cmp_15961.toml").read_text().replace('"CMP 15 961"', f"'''{NAME}'''", 1)
    for number, file in enumerate(sorted((root / "data/cmp_15961").glob("*.csv"))):
        name = f"{FILE}{number}.csv"
        (folder / name).write_bytes(file.read_bytes())
        quoted = name.replace("\\", "\\\\").replace("\x1b", "\\u001b")
        text = text.replace(f'"../data/cmp_15961/{file.name}"', f'"{quoted}"')
    assert "../data" not in text
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    campaign = load_campaign(folder / "campaign.toml")
    fitted = Fit().run(Data.of(campaign))
    job = Compare()
    compared = job.run([job.entry(fitted.result, FILE), job.entry(fitted.result, NAME)])
    return {
        "fit": fitted.contents,
        "predict": Predict().run(fitted.result, campaign).contents_beside,
        "compare": compared.contents,
    }


@pytest.mark.parametrize("command", ["fit", "predict", "compare"])
def test_pictures_and_sheets(command: str, found: dict[str, Contents]) -> None:
    contents, texts, cells = found[command], list[str](), list[Any]()
    for make in contents.pictures.values():
        figure = make()
        to_image(figure)
        drawn = figure.findobj(Text)
        assert not [text.get_text() for text in drawn if text._preprocess_math(text.get_text())[1]], "mathematics"
        texts += [text.get_text() for text in drawn]
    for name, content in Formats(pictures=False, table_form="xlsx").files(contents).items():
        if name.endswith("xlsx"):
            book = openpyxl.load_workbook(io.BytesIO(content))
            cells += [cell for sheet in book for row in sheet.iter_rows() for cell in row]
        else:
            texts += content.decode().split("\n")
    assert not [cell.value for cell in cells if cell.data_type == "f" or cell.hyperlink]
    texts += [str(cell.value) for cell in cells]
    assert not [text for text in texts if CONTROL.search(text.replace("\n", ""))]
    seen = [text for text in texts if "foo" in text]
    print(f"{len(texts)} texts, {len(seen)} with a foreign name")
    assert seen
