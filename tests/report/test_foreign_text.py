"""Text of others passes one door: none steers a terminal, is a formula of a sheet, or is taken for mathematics."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import openpyxl
import pytest
from matplotlib.text import Text

from bushfit.campaign.campaign import load_campaign
from bushfit.errors import CONTROL
from bushfit.fitting.data import Data
from bushfit.jobs.compare import Compare
from bushfit.jobs.fits import Fit
from bushfit.jobs.predict import Predict
from bushfit.report.contents import Contents, Formats
from bushfit.report.plots.style import to_image

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
