"""Every warning of a result stands wherever its numbers do: terminal, JSON, pages, tables, solver files, batches."""

from __future__ import annotations

import json
import re
import zipfile
from html import unescape
from pathlib import Path

import pandas as pd
import pytest
from commandline import Done
from shell import Run, document, typing
from tries import some

#: What a fit may have said: longer than a comment of a deck, with signs that mean something to CSV, HTML and XML.
ODD = 'sweep_axial: "5 < 7 & 9", |K| of 3 points, ' + "far from the others, " * 5 + "left out of the fit"
PAPER = ("radial: not fitted; its band holds", "+4.9 % in stiffness and +36 % in strain against finite elements")
MOUNT = (
    "radial: fitted with the paper's formula, for this shape +4.3 % in stiffness and +26 % in strain against finite",
    "sleeve_compliance is taken as the bushing's, but these tests cannot tell it from rig_compliance",
    " % if sleeve_compliance is the rig's; low and high span both",
)


def warned(done: Done) -> list[str]:
    """What the terminal warns of."""
    return [line.removeprefix("warning: ") for line in done.stderr.splitlines() if line.startswith("warning: ")]


def text_of(file: Path) -> str:
    """What people read in a file: texts of cells and pages, comments without their line ends."""
    if file.suffix == ".fmu":
        return unescape(zipfile.ZipFile(file).read("modelDescription.xml").decode())
    if file.suffix == ".xlsx":
        return "\n".join(map(str, pd.read_excel(file, "provenance", engine="openpyxl").to_numpy().ravel()))
    if file.suffix == ".csv":
        return "\n".join(map(str, pd.read_csv(file, dtype=str).to_numpy().ravel()))
    text = file.read_text(encoding="utf-8")
    return unescape(text) if file.suffix == ".html" else re.sub(r"\n(\$|\*\*) \| ", " ", text)


@pytest.fixture(
    scope="module",
    params=some([("cmp_15961", PAPER), ("mystery_mount", MOUNT)], [("mystery_mount", MOUNT)]),
    ids=["paper", "mount"],
)
def ran(
    request: pytest.FixtureRequest, root: Path, tmp_path_factory: pytest.TempPathFactory, work: Path
) -> tuple[Path, Path, tuple[str, ...], list[str]]:
    """A campaign, the folder of its run, what must be warned of there, and what the terminal warned of."""
    name, words = request.param
    folder, campaign = tmp_path_factory.mktemp(name) / "run", root / f"configs/{name}.toml"
    return campaign, folder, words, warned(typing(work)("run", campaign, "-o", folder, "--no-plots"))


Ran = tuple[Path, Path, tuple[str, ...], list[str]]


@pytest.fixture
def model(ran: Ran, tmp_path: Path) -> Path:
    """The model of the run, whose fit warned of something, too."""
    found = document(ran[1] / "model.json")
    found["warnings"].insert(0, ODD)
    (tmp_path / "model.json").write_text(json.dumps(found), encoding="utf-8")
    return tmp_path / "model.json"


def test_pages_of_run_and_diagnose_say_what_the_terminal_says(ran: Ran, bushfit: Run, tmp_path: Path) -> None:
    campaign, folder, words, told = ran
    page = text_of(folder / "report.html")
    for each in words:
        assert any(each in line for line in told), told
    assert [line for line in told if line not in page] == []
    of_model = document(folder / "model.json")["warnings"]
    assert set(of_model) <= set(told)
    assert warned(bushfit("report", folder, "-o", tmp_path / "page")) == []
    assert text_of(tmp_path / "page/report.html") == page
    told = warned(bushfit("diagnose", campaign, "-o", tmp_path / "d", "--no-plots"))
    assert set(told) >= set(of_model)
    for name in ("report.html", "diagnosis.json"):
        page = text_of(tmp_path / "d" / name).replace('\\"', '"')
        assert [line for line in told if line not in page] == [], name
    joint = warned(bushfit("fit", campaign, "-o", tmp_path / "f", "--no-plots"))
    assert joint == document(tmp_path / "f/model.json")["warnings"]


def test_every_export_says_what_predict_says(ran: Ran, model: Path, bushfit: Run, tmp_path: Path) -> None:
    done = bushfit("predict", model, "-o", tmp_path / "p", "--no-plots", "--json")
    told = warned(done)
    assert told == json.loads(done.stdout)["warnings"]
    assert told[0] == ODD
    for each in ran[2]:
        assert any(each in line for line in told), told
    formats = ("nastran", "abaqus", "adams", "fmu", "xlsx", "csv")
    asked = [word for name in formats for word in ("--format", name)]
    assert warned(bushfit("export", model, *asked, "-o", tmp_path / "x", "--no-plots")) == told
    files = [file for kind in ("bdf", "inp", "bus", "fmu", "xlsx") for file in (tmp_path / "x").glob(f"*.{kind}")]
    assert len(files) == 6
    for file in (*files, tmp_path / "x/provenance.csv"):
        text = " ".join(text_of(file).split())
        assert [line for line in told if line not in text] == [], file.name


def test_a_comparison_says_of_whom_each_holds(ran: Ran, model: Path, bushfit: Run, tmp_path: Path) -> None:
    done = bushfit("compare", "model/model.json", model, "-o", tmp_path / "c", "--no-plots", "--json")
    told = warned(done)
    assert told == json.loads(done.stdout)["warnings"]
    assert f"B: {ODD}" in told
    for line in document(model)["warnings"]:
        assert any(re.match(r"(A, )?B: ", each) and each.endswith(line) for each in told), line
    page = text_of(tmp_path / "c/compare.html")
    assert [line for line in told if line not in page] == []


def test_a_batch_says_a_long_text_once(ran: Ran, model: Path, bushfit: Run, tmp_path: Path) -> None:
    row = (
        f'[[bushings]]\ncampaign = "{ran[0].as_posix()}"\nmodel = "model.json"\ncommands = ["predict"]\nname = "{{}}"\n'
    )
    at = 'at = ["axial 25 Hz 0.1 mm", "radial 25 Hz 0.1 mm"]\n'
    (tmp_path / "b.toml").write_text(at + row.format("one") + row.format("two"), encoding="utf-8")
    bushfit("batch", tmp_path / "b.toml", "-o", tmp_path / "b", "--jobs", "1", "--no-plots")
    table, page = pd.read_csv(tmp_path / "b/batch.csv"), text_of(tmp_path / "b/index.html")
    for cell in table["warnings"]:
        assert all(each in cell for each in (ODD, *ran[2]))
    told = document(tmp_path / "b/bushings/one/row.json")["warnings"]
    assert [page.count(line) for line in told] == [1] * len(told)
    assert page.count('<td class="remarks">warnings: 1, ') == 2
