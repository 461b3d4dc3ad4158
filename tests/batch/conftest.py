"""Campaigns to work through in batches, and the command as typed."""

from __future__ import annotations

import contextlib
import io
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

import pytest

from bushfit.cli import main


@dataclass(frozen=True)
class Done:
    returncode: int
    stdout: str
    stderr: str


Run = Callable[..., Done]


@pytest.fixture
def shop(root: Path, tmp_path: Path) -> Path:
    """Five bushings, each in a folder of its own under `bushings`."""
    for number in range(5):
        shutil.copytree(root / f"data/practice/case_{number:03}", tmp_path / f"bushings/b{number}")
    return tmp_path


@pytest.fixture
def bushfit(shop: Path) -> Run:
    """The entry point in this process, in the shop."""

    def call(*arguments: str) -> Done:
        out, err = io.StringIO(), io.StringIO()
        with (
            contextlib.chdir(shop),
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
            mock.patch.object(sys, "argv", ["bushfit", *arguments]),
            pytest.raises(SystemExit) as left,
        ):
            main()
        return Done(int(left.value.code or 0), out.getvalue(), err.getvalue())

    return call


def tree(folder: Path) -> dict[str, bytes]:
    """All files below a folder; records without the time they took."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != "row.json"
    }
