"""Every command that writes tables or pictures writes them in the form asked for, by option or for all commands."""

from __future__ import annotations

import shlex
import shutil
from collections.abc import Collection
from functools import partial
from pathlib import Path
from typing import Any

import click
import pandas as pd
import pytest
from shell import typing

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


#: Commands that take a second or less: of the others a commit sees their files in their own tests.
QUICK = {"predict", "reduce", "export"}


def having(option: str, quick: Collection[str] = QUICK) -> list[Any]:
    commands = {name: cli.get_command(CONTEXT, name) for name in cli.list_commands(CONTEXT)}
    names = [name for name, found in commands.items() if found and option in {each.name for each in found.params}]
    return [name if name in quick else pytest.param(name, marks=pytest.mark.slow) for name in names]


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


@pytest.mark.parametrize("name", having("table_format"))
def test_tables_hold_the_same_in_every_form(place: Path, name: str) -> None:
    files = {form: written(place, name, "-o", f"{name}-{form}", "--no-plots", "--table-format", form) for form in READ}
    tables = [file for file in files["csv"] if file.suffix == ".csv"]
    assert tables
    assert files["decimal-comma"] == files["csv"]
    only_csv = name == "export"  # where --format says it
    end = ".csv" if only_csv else ".xlsx"
    assert files["xlsx"] == {file.with_suffix(end) if file in tables else file for file in files["csv"]}
    for table in tables:
        plain = pd.read_csv(place / f"{name}-csv" / table)
        for form in ("decimal-comma", "xlsx"):
            file = place / f"{name}-{form}" / table.with_suffix(end if form == "xlsx" else ".csv")
            found = READ["csv" if only_csv and form == "xlsx" else form](file)
            pd.testing.assert_frame_equal(found, plain, check_dtype=False, rtol=1e-6, atol=1e-300)


@pytest.mark.parametrize("name", having("plot_format", {"reduce"}))
def test_pictures_are_of_every_form_asked_for(place: Path, name: str) -> None:
    draws = ["--format", "fmu"] if name == "export" else []  # of its formats, the one that draws
    files = written(place, name, "-o", f"{name}-drawn", *draws, "--plot-format", "svg", "--plot-format", "pdf")
    drawn = {form: {file.with_suffix("") for file in files if file.suffix == form} for form in (".svg", ".pdf", ".png")}
    assert drawn[".svg"] == drawn[".pdf"] != set()
    assert drawn[".png"] == set()


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
