"""How far long work is: shown on a terminal alone, after two seconds, and never to programs or with --quiet."""

from __future__ import annotations

import contextlib
import io
import re
from pathlib import Path

import pytest
from shell import CAMPAIGN

from bushfit.cli import common, main

SIMULATE = ("simulate", "model/model.json")


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def said(work: Path, monkeypatch: pytest.MonkeyPatch, heard: io.StringIO, *words: object) -> str:
    monkeypatch.chdir(work)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setattr("sys.argv", ["bushfit", *map(str, words)])
    with (
        contextlib.redirect_stderr(heard),
        contextlib.redirect_stdout(io.StringIO()),
        pytest.raises(SystemExit) as left,
    ):
        main()
    assert left.value.code == 0, heard.getvalue()
    return heard.getvalue()


def test_a_terminal_is_shown_how_far_it_is(work: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(common, "_PATIENCE", 0.0)
    told = said(work, monkeypatch, Terminal(), *SIMULATE, "-o", tmp_path / "x")
    assert "sweeps simulated" in told
    assert "0 of 2" in told
    assert told.endswith(f"truth.json to {tmp_path / 'x'}\n"), "what was shown is gone, and the result stands"
    profiled = said(work, monkeypatch, Terminal(), "fit", CAMPAIGN, "--profile", "--no-plots", "-o", tmp_path / "fit")
    assert re.search(r"[0-5] of 5", profiled)


@pytest.mark.parametrize(
    ("heard", "patience", "more"),
    [(io.StringIO, 0.0, ()), (Terminal, 0.0, ("--quiet",)), (Terminal, 60.0, ())],
    ids=["no terminal", "quiet", "quick"],
)
def test_nobody_else_is(
    work: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, heard: type, patience: float, more: tuple[str, ...]
) -> None:
    monkeypatch.setattr(common, "_PATIENCE", patience)
    told = said(work, monkeypatch, heard(), *SIMULATE, *more, "-o", tmp_path / "x")
    assert "simulated " not in told
    assert "\x1b[?25" not in told, "the cursor is left alone"
