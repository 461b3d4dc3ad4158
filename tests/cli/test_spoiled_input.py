"""Spoiled input of every kind, to every command: exit status 2, one error that says what and where, nothing written."""

from __future__ import annotations

import errno
import re
import subprocess
from pathlib import Path

import pytest
from commandline import Done, call
from spoiled import FILES, ROWS, Spoiled

from bushfit.cli import cli
from bushfit.report import folder as results

ERROR = re.compile(r"^(bushfit: error: |Error: )", re.MULTILINE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One folder for all, because most rows spoil one file of five."""
    return tmp_path_factory.mktemp("spoiled")


def lay_out(folder: Path, row: Spoiled) -> set[str]:
    for name, content in (FILES | row.files).items():
        if content is None:
            (folder / name).unlink(missing_ok=True)
        else:
            (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return {path.name for path in folder.iterdir()}


def assert_refused(row: Spoiled, done: Done | subprocess.CompletedProcess[str]) -> None:
    assert done.returncode == 2, done.stderr
    assert done.stdout == ""
    assert "Traceback" not in done.stderr
    assert "fault in bushfit" not in done.stderr
    assert len(ERROR.findall(done.stderr)) == 1, done.stderr
    for words in row.says:
        assert words in done.stderr, done.stderr


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_one_error_and_nothing_written(row: Spoiled, folder: Path) -> None:
    before = lay_out(folder, row)
    assert_refused(row, call(folder, *row.arguments))
    assert {path.name for path in folder.iterdir()} == before


@pytest.mark.parametrize("command", ["predict", "simulate"])
def test_a_disk_that_fills_up_after_the_work(command: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(files: list[int]) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(results, "flush", full)
    row = Spoiled(
        command, (command, "model.json", "--json", "-q"), ("x: the results cannot be written", "free some space")
    )
    before = lay_out(folder, row)
    assert_refused(row, call(folder, *row.arguments))
    assert {path.name for path in folder.iterdir()} == before


def test_every_command_is_among_them() -> None:
    commands = {row.command[0] for row in ROWS}
    assert set(cli.commands or cli.list_commands(None)) <= commands  # type: ignore[arg-type]
