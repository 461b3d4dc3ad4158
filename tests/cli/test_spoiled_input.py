"""Spoiled input of every kind, to every command: exit status 2, one error that says what and where, nothing written."""

from __future__ import annotations

import contextlib
import errno
import io
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from unittest import mock

import pytest
from spoiled import FILES, ROWS, Spoiled

from bushfit.cli import cli, main
from bushfit.report import disk

ERROR = re.compile(r"^(bushfit: error: |Error: )", re.MULTILINE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """One folder for all, because most rows spoil one file of five."""
    place = tmp_path_factory.mktemp("spoiled")
    with contextlib.chdir(place):
        yield place


def lay_out(folder: Path, row: Spoiled) -> set[str]:
    for name, content in (FILES | row.files).items():
        if content is None:
            (folder / name).unlink(missing_ok=True)
        else:
            (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return {path.name for path in folder.iterdir()}


def assert_refused(row: Spoiled, status: int, out: str, err: str) -> None:
    assert status == 2, err
    assert out == ""
    assert "Traceback" not in err
    assert "fault in bushfit" not in err
    assert len(ERROR.findall(err)) == 1, err
    for words in row.says:
        assert words in err, err


def call(row: Spoiled) -> tuple[int, str, str]:
    out, err = io.StringIO(), io.StringIO()
    with (
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        mock.patch.object(sys, "argv", ["bushfit", *row.arguments]),
        pytest.raises(SystemExit) as left,
    ):
        main()
    return int(left.value.code or 0), out.getvalue(), err.getvalue()


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_one_error_and_nothing_written(row: Spoiled, folder: Path) -> None:
    before = lay_out(folder, row)
    assert_refused(row, *call(row))
    assert {path.name for path in folder.iterdir()} == before


@pytest.mark.parametrize("row", ROWS[:: len(ROWS) // 2], ids=lambda row: row.name)
def test_the_same_of_the_installed_command(row: Spoiled, folder: Path) -> None:
    before = lay_out(folder, row)
    command = [sys.executable, "-W", "error", str(Path(sys.executable).with_name("bushfit")), *row.arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False, encoding="utf-8")
    assert_refused(row, done.returncode, done.stdout, done.stderr)
    assert {path.name for path in folder.iterdir()} == before


@pytest.mark.parametrize("command", ["predict", "simulate"])
def test_a_disk_that_fills_up_after_the_work(command: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(files: list[int]) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(disk, "flush", full)
    row = Spoiled(
        command, (command, "model.json", "--json", "-q"), ("x: the results cannot be written", "free some space")
    )
    before = lay_out(folder, row)
    assert_refused(row, *call(row))
    assert {path.name for path in folder.iterdir()} == before


def test_every_command_is_among_them() -> None:
    commands = {row.command[0] for row in ROWS}
    print(f"{len(ROWS)} spoiled inputs to {len(commands)} commands")
    assert len(ROWS) >= 150
    assert set(cli.commands or cli.list_commands(None)) <= commands  # type: ignore[arg-type]
