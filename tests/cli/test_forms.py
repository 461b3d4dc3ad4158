"""Every command that writes tables or pictures writes them in the form asked for, by option or for all commands."""

from __future__ import annotations

import shlex
import shutil
from functools import partial
from itertools import cycle
from pathlib import Path

import click
import pandas as pd
import pytest
from shell import typing
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
    "reduce": ["data/cmp_15961_raw/stepped_sine_axial.csv"],
    "inspect": TESTS,
    "batch": shlex.split("data/practice/case_00[01]/bushing.toml --tables --plots --command fit --command predict"),
}


#: Commands that draw, each with a form of tables; a commit tries one, and sees the files of the others in their tests.
COMMANDS = some([*zip(ARGUMENTS, cycle(("xlsx", "decimal-comma")), strict=False)], [("reduce", "xlsx")])


@pytest.fixture(scope="module")
def place(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("forms")
    shutil.copytree(root / "data", folder / "data")
    shutil.copy(root / "data/arm_bushing/truth.json", folder / "model.json")
    return folder


def written(place: Path, name: str, *options: str) -> set[Path]:
    """The files of a command, by their paths in its folder."""
    typing(place)(name, *ARGUMENTS[name], *options)
    folder = place / options[1]
    return {file.relative_to(folder) for file in folder.rglob("[!.]*") if file.is_file()}


def test_every_command_that_writes_tables_or_draws_is_among_them() -> None:
    options = {"table_format", "plot_format"}
    found = [cli.get_command(CONTEXT, name) for name in cli.list_commands(CONTEXT)]
    assert {each.name for each in found if each and options & {one.name for one in each.params}} == set(ARGUMENTS)


@pytest.mark.parametrize("case", COMMANDS, ids=" ".join)
def test_tables_hold_the_same_in_every_form_and_pictures_are_of_every_form_asked_for(
    place: Path, case: tuple[str, str]
) -> None:
    name, form = case
    plain = written(place, name, "-o", f"{name}-csv", "--no-plots")
    draws = ("--format", "fmu") if name == "export" else ()  # of its formats, the one that draws
    options = ("--table-format", form, "--plot-format", "svg", "--plot-format", "pdf")
    files = written(place, name, "-o", f"{name}-other", *options, *draws)
    drawn = {end: {file.with_suffix("") for file in files if file.suffix == end} for end in (".svg", ".pdf", ".png")}
    assert drawn[".svg"] == drawn[".pdf"] != set()
    assert drawn[".png"] == set()
    form = "csv" if name == "export" else form  # where --format says it
    tables = {file: file.with_suffix(".xlsx" if form == "xlsx" else ".csv") for file in plain if file.suffix == ".csv"}
    assert tables
    assert {tables.get(file, file) for file in plain} <= files
    for table, other in tables.items():
        found, known = READ[form](place / f"{name}-other" / other), pd.read_csv(place / f"{name}-csv" / table)
        pd.testing.assert_frame_equal(found, known, check_dtype=False, rtol=1e-6, atol=1e-300)


def test_a_variable_of_the_environment_holds_for_all_commands(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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


@pytest.mark.parametrize("form", READ)
def test_a_wide_table_is_read_back(place: Path, form: str) -> None:
    options = ("--direction", "axial", "--amplitudes", "0.1, 0.25 mm", "--no-plots", "--table-format", form)
    typing(place)("predict", "model.json", "--wide", "-o", f"wide-{form}", *options)
    end = "xlsx" if form == "xlsx" else "csv"
    long, wide = (
        READ[form](place / f"wide-{form}/axial{end}.{'xlsx' if form == 'xlsx' else 'csv'}") for end in ("", "_wide")
    )
    for amplitude in (0.1, 0.25):
        of_level = long[long["amplitude [mm]"] == amplitude]
        assert wide["frequency [Hz]"].tolist() == of_level["frequency [Hz]"].tolist()
        assert wide[f"stiffness {amplitude} mm [N/mm]"].tolist() == of_level["stiffness [N/mm]"].tolist()
        assert wide[f"loss factor {amplitude} mm [-]"].tolist() == of_level["loss factor [-]"].tolist()
    seen = typing(place)("inspect", f"wide-{form}/axial_wide.{end}", "--no-plots")
    assert "amplitudes: 0.1, 0.25 mm" in seen.stderr
