"""Exports, tables and pictures in the form asked for, and every warning of a result wherever its numbers stand."""

import json
import re
import shlex
import shutil
import zipfile
from functools import partial
from html import unescape
from itertools import cycle
from pathlib import Path

import click
import pandas as pd
import pytest
from commandline import Done, typing
from shell import document
from tries import some

from bushfit.cli import cli

CONTEXT = click.Context(cli)
READ = {
    "csv": pd.read_csv,
    "decimal-comma": partial(pd.read_csv, sep=";", decimal=","),
    "xlsx": partial(pd.read_excel, engine="openpyxl"),
}
CASE = "data/practice/case_000/bushing.toml"
TESTS = ["data/cmp_15961/loop_axial_1.csv", "data/cmp_15961/sweep_axial.csv"]
#: What is typed after the command.
ARGUMENTS = {
    **{name: [CASE] for name in ("run", "fit-static", "fit-dynamic", "fit", "diagnose")},
    "simulate": ["model.json"],
    "predict": ["model.json", "--wide"],
    "plan": ["model.json", "--hours", "1.5"],
    "compare": ["model.json", CASE],
    "export": ["model.json", "--format", "csv"],
    "example": [],
    "respond": ["model.json", "data/road/axial_radial.csv"],
    "reduce": ["data/cmp_15961_raw/stepped_sine_axial.csv"],
    "inspect": TESTS,
    "batch": shlex.split("data/practice/case_00[01]/bushing.toml --tables --plots --command fit --command predict"),
}


#: Commands without pictures.
UNDRAWN = ("simulate", "example", "plan", "export")
#: Commands that draw, each with a form of tables; a commit tries one, and sees the files of the others in their tests.
COMMANDS = some([*zip(ARGUMENTS, cycle(("xlsx", "decimal-comma")), strict=False)], [("reduce", "xlsx")])
#: What a fit may have said: longer than a comment of a deck, with signs that mean something to CSV, HTML and XML.
ODD = 'sweep_axial: "5 < 7 & 9", |K| of 3 points, ' + "far from the others, " * 5 + "left out of the fit"


@pytest.fixture(scope="module")
def place(root, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("forms")
    shutil.copytree(root / "data", folder / "data")
    shutil.copy(root / "data/arm_bushing/truth.json", folder / "model.json")
    return folder


def written(place: Path, name: str, *options: str) -> set[Path]:
    """The files of a command, by their paths in its folder."""
    typing(place)(name, *ARGUMENTS[name], *options)
    folder = place / options[1]
    return {file.relative_to(folder) for file in folder.rglob("[!.]*") if file.is_file()}


def test_every_command_that_writes_tables_or_draws_is_among_them():
    options = {"table_format", "plot_format"}
    found = [cli.get_command(CONTEXT, name) for name in cli.list_commands(CONTEXT)]
    assert {each.name for each in found if each and options & {one.name for one in each.params}} == set(ARGUMENTS)


@pytest.mark.parametrize("case", COMMANDS, ids=" ".join)
def test_tables_hold_the_same_in_every_form_and_pictures_are_of_every_form_asked_for(place, case):
    name, form = case
    plain = written(place, name, "-o", f"{name}-csv", "--no-plots")
    options = ["--table-format", form] if name != "inspect" else []
    options += ["--plot-format", "svg", "--plot-format", "pdf"] if name not in UNDRAWN else []
    files = written(place, name, "-o", f"{name}-other", *options)
    drawn = {end: {file.with_suffix("") for file in files if file.suffix == end} for end in (".svg", ".pdf", ".png")}
    assert drawn[".svg"] == drawn[".pdf"]
    assert bool(drawn[".svg"]) is (name not in UNDRAWN)
    assert drawn[".png"] == set()
    tables = {file: file.with_suffix(".xlsx" if form == "xlsx" else ".csv") for file in plain if file.suffix == ".csv"}
    assert bool(tables) is (name != "inspect")
    assert {tables.get(file, file) for file in plain} <= files
    for table, other in tables.items():
        found, known = READ[form](place / f"{name}-other" / other), pd.read_csv(place / f"{name}-csv" / table)
        pd.testing.assert_frame_equal(found, known, check_dtype=False, rtol=1e-6, atol=1e-300)


def test_a_variable_of_the_environment_holds_for_all_commands(place, monkeypatch):
    monkeypatch.setenv("BUSHFIT_TABLE_FORMAT", "xlsx")
    monkeypatch.setenv("BUSHFIT_PLOT_FORMAT", "svg png")
    assert set(map(str, written(place, "reduce", "-o", "of-all"))) == {"sweep.xlsx", "reduce.png", "reduce.svg"}
    over = written(place, "reduce", "-o", "over", "--table-format", "csv", "--plot-format", "pdf")
    assert set(map(str, over)) == {"sweep.csv", "reduce.pdf"}
    monkeypatch.setenv("BUSHFIT_TABLE_FORMAT", "")
    assert Path("sweep.csv") in written(place, "reduce", "-o", "empty", "--no-plots")
    monkeypatch.setenv("BUSHFIT_TABLE_FORMAT", "german")
    done = typing(place)("reduce", *ARGUMENTS["reduce"], "-o", "none", status=2)
    assert "BUSHFIT_TABLE_FORMAT" in done.stderr
    assert not (place / "none").exists()


PAPER = (
    "radial: not fitted, predicted from the",
    "+4.9 % in stiffness and +36 % in strain compared with finite elements",
)
MOUNT = (
    "radial: fitted with the paper's formula, for this shape +4.3 % in stiffness and +26 % in strain compared",
    "sleeve_compliance is assigned to the bushing, but these tests cannot distinguish it from rig_compliance",
    " % with sleeve_compliance in the rig; the band, low to high, includes both",
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
def ran(request, root, campaign_run) -> tuple[Path, Path, tuple[str, ...], list[str]]:
    """A campaign, the folder of its run, what must be warned of there, and all its warnings."""
    name, words = request.param
    folder, done = campaign_run(name)
    return root / f"configs/{name}.toml", folder, words, json.loads(done.stdout)["warnings"]


@pytest.fixture
def model(ran, tmp_path) -> Path:
    """The model of the run, whose fit warned of something, too."""
    found = document(ran[1] / "model.json")
    found["warnings"].insert(0, ODD)
    (tmp_path / "model.json").write_text(json.dumps(found), encoding="utf-8")
    return tmp_path / "model.json"


def test_pages_of_run_and_diagnose_say_what_the_terminal_says(ran, bushfit, tmp_path):
    campaign, folder, words, told = ran
    page = text_of(folder / "report.html")
    for each in words:
        assert any(each in line for line in told), told
    assert [line for line in told if line not in page] == []
    of_model = document(folder / "model.json")["warnings"]
    assert set(of_model) <= set(told)
    assert warned(bushfit("report", folder, "-o", tmp_path / "page")) == []
    assert text_of(tmp_path / "page/report.html") == page
    told = warned(bushfit("diagnose", campaign, "-o", tmp_path / "d", "--no-plots", "-v"))
    assert set(told) >= set(of_model)
    for name in ("report.html", "diagnosis.json"):
        page = text_of(tmp_path / "d" / name).replace('\\"', '"')
        assert [line for line in told if line not in page] == [], name
    joint = warned(bushfit("fit", campaign, "-o", tmp_path / "f", "--no-plots", "-v"))
    assert sorted(joint) == sorted(document(tmp_path / "f/model.json")["warnings"])


def test_every_export_says_what_predict_says(ran, model, bushfit, tmp_path):
    done = bushfit("predict", model, "-o", tmp_path / "p", "--no-plots", "--json", "-v")
    told = warned(done)
    assert sorted(told) == sorted(json.loads(done.stdout)["warnings"])
    assert ODD in told
    for each in ran[2]:
        assert any(each in line for line in told), told
    formats = ("nastran", "abaqus", "adams", "fmu", "xlsx", "csv")
    asked = [word for name in formats for word in ("--format", name)]
    assert warned(bushfit("export", model, *asked, "-o", tmp_path / "x", "--no-plots", "-v")) == told
    files = [file for kind in ("bdf", "inp", "bus", "fmu", "xlsx") for file in (tmp_path / "x").glob(f"*.{kind}")]
    assert len(files) == 6
    for file in (*files, tmp_path / "x/provenance.csv"):
        text = " ".join(text_of(file).split())
        assert [line for line in told if line not in text] == [], file.name
