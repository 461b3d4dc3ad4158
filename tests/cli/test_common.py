"""What all commands hold to: files, exit statuses, what goes to which stream, help that is short and works."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
import sys
from io import StringIO
from pathlib import Path

import click
import pytest
from rich.console import Console
from shell import CAMPAIGN, GEOMETRY, Run, names

from bushfit.cli import cli
from bushfit.cli.common import Options
from bushfit.cli.show import new_table, tell_tests
from bushfit.model.result import Misfit
from bushfit.report.contents import Formats

COMMANDS = cli.list_commands(click.Context(cli))
#: Lines of the longest help on a terminal of 80 columns.
LONGEST = 47
EXAMPLES = re.compile(r"^  Examples?:\n((?:    .*\n)+)\Z", re.MULTILINE)


@pytest.mark.parametrize(
    "arguments",
    [
        ("fit-static", CAMPAIGN),
        ("fit-dynamic", CAMPAIGN),
        ("fit", CAMPAIGN),
        ("run", CAMPAIGN),
        ("predict", "model/model.json"),
        ("compare", "model", "model/model.json"),
        ("simulate", "model/model.json"),
        ("plan", "model/model.json", "--hours", "1.5"),
        ("export", "model/model.json", "--format", "abaqus"),
    ],
    ids=lambda arguments: arguments[0],
)
def test_json_alone_on_standard_output_and_quiet_is_quiet(
    bushfit: Run, tmp_path: Path, arguments: tuple[str, ...]
) -> None:
    done = bushfit(*arguments, "-o", tmp_path / "x", "--json", "-q", "--no-plots")
    assert isinstance(json.loads(done.stdout), dict)
    assert done.stderr == ""
    assert not list((tmp_path / "x").glob("*.png"))
    loud = bushfit(*arguments, "-o", tmp_path / "y", "-v", "--no-plots")
    assert loud.stdout == ""
    assert "wrote " in loud.stderr


@pytest.mark.parametrize(
    ("arguments", "file"),
    [
        (("fit-static", CAMPAIGN), "static.json"),
        (("compare", CAMPAIGN, "model"), "differences.csv"),
        (("export", "model/model.json", "--format", "nastran"), "bushing.bdf"),
        (("inspect", "data/cmp_15961/sweep_axial.csv"), "inspect.png"),
        (("init", "data/cmp_15961/sweep_axial.csv", *GEOMETRY), "campaign.toml"),
    ],
    ids=lambda value: value[0] if isinstance(value, tuple) else "",
)
def test_results_are_not_replaced_unasked(bushfit: Run, tmp_path: Path, arguments: tuple[str, ...], file: str) -> None:
    (tmp_path / file).write_text("mine")
    refused = bushfit(*arguments, "-o", tmp_path, status=2)
    assert f"{file}" in refused.stderr
    assert "--force" in refused.stderr
    assert names(tmp_path) == {file}
    assert (tmp_path / file).read_text() == "mine"
    bushfit(*arguments, "-o", tmp_path, "--force")
    assert (tmp_path / file).read_bytes() != b"mine"


def test_a_missed_limit_is_status_1_with_the_results_written(bushfit: Run, tmp_path: Path) -> None:
    missed = bushfit("fit", CAMPAIGN, "-o", tmp_path / "x", "--no-plots", "--max-nrmse", "1e-4", status=1)
    assert "is above --max-nrmse 0.0001" in missed.stderr
    assert "model.json" in names(tmp_path / "x")
    bushfit("fit", CAMPAIGN, "-o", tmp_path / "y", "--no-plots", "--max-nrmse", "5 %")


def test_results_go_to_a_folder_of_the_campaign_by_default(work: Path, typed: Run, tmp_path: Path) -> None:
    typed("fit-static", work / CAMPAIGN, "--no-plots")
    assert (tmp_path / "results" / "CMP 15 961" / "static.json").exists()


def test_the_installed_command(work: Path, tmp_path: Path) -> None:
    """In a process of its own, with warnings as errors; JSON is the file."""
    command = [sys.executable, "-W", "error", str(Path(sys.executable).with_name("bushfit"))]
    folder = tmp_path / "x"
    done = subprocess.run(
        [*command, "fit", CAMPAIGN, "-o", str(folder), "--json", "--no-plots"],
        cwd=work, capture_output=True, text=True, check=False, encoding="utf-8",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout == (folder / "model.json").read_text(encoding="utf-8")
    assert "CMP 15 961: joint fit" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "slow"),
    [
        (["--help"], {"numpy", "pandas", "scipy", "matplotlib", "lmfit", "pint", "pydantic", "rich"}),
        (["fit", CAMPAIGN, "--no-plots", "-q", "-o", "quick"], {"pint", "matplotlib.pyplot", "distributed"}),
    ],
    ids=["help", "fit"],
)
def test_slow_packages_are_imported_where_they_are_needed(work: Path, arguments: list[str], slow: set[str]) -> None:
    code = (
        f"import sys\nfrom bushfit.cli import main\nsys.argv = {['bushfit', *arguments]!r}\n"
        f"try:\n    main()\nfinally:\n    assert not {slow!r} & set(sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=work, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("command", COMMANDS)
def test_a_help_is_short_and_says_what_is_written(typed: Run, command: str) -> None:
    told = typed(command, "-h").stdout
    assert len(told.splitlines()) <= LONGEST
    assert re.search("[Ww]rites", told)
    for option in ("-o, --output", "-v, --verbose", "-q, --quiet", "--json", "--force"):
        assert option in told
    assert ("--no-plots" in told) == ("--plot-format" in told)
    placeholders = re.findall(r"^  (?:-\w, )?--[\w-]+ ([A-Z[-].*?)(?:  |, -|$)", told, re.MULTILINE)
    assert [each for each in placeholders if re.search(r"\s|TEXT|RANGE|INTEGER|FLOAT", each)] == []
    if "--direction" in told and command != "batch":  # which is as of fit
        of_direction = told.partition("--direction")[2].partition("\n  -")[0]
        assert {"axial", "radial", "torsion"} <= set(re.findall(r"\w+", of_direction))
    assert f"  {command} " in typed("--help").stdout


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_examples_of_the_help_work(typed: Run, root: Path, tmp_path: Path, command: str) -> None:
    for name in ("configs", "data"):
        shutil.copytree(root / name, tmp_path / name)
    found = EXAMPLES.search(typed(command, "-h").stdout)
    assert found, "an example at the end"
    for line in found[1].splitlines():
        program, *arguments = shlex.split(line)
        assert (program, arguments[0]) == ("bushfit", command)
        assert typed(*arguments).stderr, "something is told"


def test_long_names_in_a_table_wrap_and_lose_no_letter() -> None:
    table = new_table("t", "test", "place", "points", "NRMSE", names=2)
    table.add_row("tf_015p 18.4 degC", "DMA, second specimen", "14", "7.7")
    told = StringIO()
    Console(file=told, width=40).print(table)
    assert "…" not in told.getvalue()
    for word in ("tf_015p", "degC", "second", "specimen", "points", "NRMSE", "7.7"):
        assert word in told.getvalue()


@pytest.mark.parametrize(("count", "said"), [(9, "and 1 more test, which is"), (10, "and 2 more tests, which are")])
def test_tests_left_out_are_counted(count: int, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    tests = [Misfit(f"t{n}", "axial", True, None, None, None, 5, 0.01, 1.0, 0.0) for n in range(count)]
    tell_tests(Options(None, False, False, False, Formats(), False), tests, [])
    assert said in capsys.readouterr().err
