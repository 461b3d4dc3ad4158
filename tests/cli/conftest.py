"""The entry point called in this process: what it would do in its own, less the time to start."""

from __future__ import annotations

import contextlib
import io
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

import pytest

from bushfit.cli import main


@dataclass(frozen=True)
class Typed:
    """What a command left behind."""

    returncode: int
    stdout: str
    stderr: str


@pytest.fixture
def typed(tmp_path: Path) -> Callable[..., Typed]:
    """Run a command line in `tmp_path`."""

    def call(*arguments: object) -> Typed:
        out, err = io.StringIO(), io.StringIO()
        with (
            contextlib.chdir(tmp_path),
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
            mock.patch.object(sys, "argv", ["bushfit", *map(str, arguments)]),
            pytest.raises(SystemExit) as left,
        ):
            main()
        return Typed(int(left.value.code or 0), out.getvalue(), err.getvalue())

    return call
