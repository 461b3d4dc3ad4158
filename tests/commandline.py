"""A command line typed in this process: what it would do in its own, less the time to start."""

import contextlib
import hashlib
import io
import json
import os
import shutil
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from unittest import mock

import click
import pytest

from bushfit.cli import cli, main
from bushfit.effects import LIBRARY, ORIGINS

#: Width of the terminal, whatever that of the tests is.
WIDTH = "80"


@dataclass(frozen=True)
class Done:
    """What a command left behind."""

    returncode: int
    stdout: str
    stderr: str

    @property
    def text(self) -> str:
        """What is printed on both, the results first."""
        return self.stdout + self.stderr


#: Types a command, and gives what it left; an exit status other than `status=0` fails the test.
Run = Callable[..., Done]


def call(folder: Path, *arguments: object, program: click.Command = cli) -> Done:
    """`bushfit`, or another program of its kind, with these arguments, in a folder."""
    out, err = io.StringIO(), io.StringIO()
    with (
        contextlib.chdir(folder),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        mock.patch.dict(os.environ, {"COLUMNS": WIDTH}),
        mock.patch.dict(LIBRARY),  # effects of the user's own last as long as the command
        mock.patch.dict(ORIGINS),
        mock.patch.object(sys, "argv", ["bushfit", *map(str, arguments)]),
        pytest.raises(SystemExit) as left,
    ):
        main(program)
    return Done(int(left.value.code or 0), out.getvalue(), err.getvalue())


def typing(folder: Path) -> Run:
    """Type commands in a folder, each of which has to end with `status`, by default 0."""

    def run(*arguments: object, status: int = 0) -> Done:
        done = call(folder, *arguments)
        assert done.returncode == status, done.stderr
        return done

    return run


@dataclass(frozen=True)
class Shared:
    """Commands that several tests ask about: each runs once, in whichever worker comes to it, and all get its files.

    Args:
        store: a folder of the whole session.
    """

    store: Path

    def call(self, folder: Path, *arguments: str) -> Done:
        """As `call`, in a folder that has the same data as those of the other tests, and results of such commands."""
        read = [content for argument in arguments for content in contents(folder / argument)]
        place = self.store / hashlib.sha256(repr((arguments, read)).encode()).hexdigest()
        if place.exists():
            shutil.copytree(place / "files", folder, dirs_exist_ok=True)
            return Done(**json.loads((place / "done.json").read_text(encoding="utf-8")))
        before, made = state(folder), Path(tempfile.mkdtemp(dir=self.store))
        done = call(folder, *arguments)
        (made / "files").mkdir()
        for file in state(folder).items() - before.items():
            target = made / "files" / file[0].relative_to(folder)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(file[0], target)
        (made / "done.json").write_text(json.dumps(asdict(done)), encoding="utf-8")
        with contextlib.suppress(OSError):  # another worker was as quick
            made.rename(place)
        return done


def state(folder: Path) -> dict[Path, int]:
    """When each file in a folder was written [ns]."""
    return {file: file.stat().st_mtime_ns for file in folder.rglob("*") if file.is_file()}


def contents(path: Path) -> list[bytes]:
    """Of a file, or of all in a folder."""
    files = [path] if path.is_file() else sorted(file for file in path.rglob("*") if file.is_file())
    return [file.read_bytes() for file in files]
