"""The help of every command: it is short, names its files and roles, and its examples work."""

from __future__ import annotations

import re
import shlex
import shutil
from collections.abc import Callable
from pathlib import Path

import click
import pytest
from commandline import Done, call

from bushfit.cli import cli
from bushfit.reading.words import LOOP_COLUMNS, SWEEP_COLUMNS

Run = Callable[..., Done]
COMMANDS = cli.list_commands(click.Context(cli))
#: Lines of the longest help on a terminal of 80 columns.
LONGEST = 60
EXAMPLES = re.compile(r"^  Examples?:\n((?:    .*\n)+)\Z", re.MULTILINE)


def examples(text: str) -> list[list[str]]:
    """The command lines at the end of a help, without `bushfit`."""
    found = EXAMPLES.search(text)
    assert found, f"no example at the end of:\n{text}"
    lines = [shlex.split(line) for line in found[1].splitlines()]
    assert {line[0] for line in lines} == {"bushfit"}
    return [line[1:] for line in lines]


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_examples_of_the_help_work(typed: Run, root: Path, tmp_path: Path, command: str) -> None:
    for name in ("configs", "data"):
        shutil.copytree(root / name, tmp_path / name)
    for arguments in examples(typed(command, "-h").stdout):
        assert arguments[0] == command
        done = typed(*arguments)
        assert done.returncode == 0, done.stderr
        assert done.stderr, "something is told"


@pytest.mark.parametrize("command", COMMANDS)
def test_a_help_fits_on_a_screen_or_nearly(typed: Run, command: str) -> None:
    assert len(typed(command, "--help").stdout.splitlines()) <= LONGEST


@pytest.mark.parametrize(
    ("command", "roles"),
    [
        ("inspect", [*LOOP_COLUMNS, *SWEEP_COLUMNS]),
        ("init", [*LOOP_COLUMNS, *SWEEP_COLUMNS]),
        ("reduce", [*LOOP_COLUMNS]),
    ],
)
def test_roles_are_listed(root: Path, command: str, roles: list[str]) -> None:
    words = re.findall(r"\w+", call(root, command, "-h").stdout.partition("--column")[2].partition("--unit")[0])
    assert set(roles) <= set(words)


@pytest.mark.parametrize("command", ["fit", "predict", "compare", "plan", "export", "inspect", "init", "reduce"])
def test_directions_are_listed(root: Path, command: str) -> None:
    told = call(root, command, "-h").stdout.partition("--direction")[2].partition("\n  -")[0]
    assert {"axial", "radial", "torsion"} <= set(re.findall(r"\w+", told))
