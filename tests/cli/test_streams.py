"""Output that nobody reads, its encoding, how far long work is, and what a Ctrl-C leaves: one line, one status."""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from shell import CAMPAIGN
from spoiled import FILES, MODEL

from bushfit.cli import common, main

PREDICT = ("predict", "model.json", "-o", "x", "--no-plots", "--json", "-q")
BATCH = ("batch", "campaign.toml", "more.toml", "-o", "x", "--jobs", "1", "--no-plots", "--json", "-q")
BUSHFIT = (sys.executable, "-m", "bushfit")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name, content in FILES.items():
        Path(name).write_text(content)
    return tmp_path


def assert_one_line(status: int, err: bytes) -> None:
    assert status == 2, err
    assert err.startswith(b"bushfit: "), err
    assert err.count(b"\n") == 1, err


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
@pytest.mark.parametrize(
    "arguments",
    [
        PREDICT, pytest.param(BATCH, marks=pytest.mark.slow), ("--help",), ("schema", "model", "-q"),
    ],
    ids=lambda it: it[0],
)  # fmt: skip
def test_a_full_device(arguments: tuple[str, ...], folder: Path) -> None:
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run([*BUSHFIT, *arguments], stdout=full, stderr=subprocess.PIPE, check=False)
    assert_one_line(done.returncode, done.stderr)
    assert b"standard output cannot be written: No space left on device" in done.stderr
    assert not list(folder.glob("x/*.*")), "the rows of a batch alone are kept, for --resume"


def test_a_pipe_that_nobody_reads(folder: Path) -> None:
    """Nothing is written where the result cannot be printed; what people are told besides is not needed."""
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run([*BUSHFIT, *PREDICT], stdout=write, stderr=subprocess.PIPE, check=False)
    assert_one_line(done.returncode, done.stderr)
    assert not (folder / "x").exists()
    done = subprocess.run([*BUSHFIT, *PREDICT[:-2]], stdout=subprocess.PIPE, stderr=write, check=False)
    assert done.returncode == 0
    assert (folder / "x" / "axial.csv").exists()
    missed = subprocess.run([*BUSHFIT, "predict", "lost.json"], stdout=subprocess.PIPE, stderr=write, check=False)
    os.close(write)
    assert missed.returncode == 2


def test_json_is_utf8_in_any_code_page_and_no_text_steers_the_terminal(folder: Path) -> None:
    """The name of the bushing is in no code page; a warning would clear the screen, and turn the line around."""
    said = "\x1b[2J\x9b2J\u202ecleared"
    model = MODEL | {"warnings": [said], "bushing": MODEL["bushing"] | {"name": "衬套"}}
    (folder / "model.json").write_text(json.dumps(model), encoding="utf-8")
    settings = {**os.environ, "PYTHONIOENCODING": "cp1252"}
    command = [*BUSHFIT, "simulate", "model.json", "-o", "x", "--json"]
    done = subprocess.run(command, capture_output=True, env=settings, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout.decode("utf-8"))["truth"]["bushing"]["name"] == "衬套"
    done = subprocess.run([*BUSHFIT, *PREDICT[:2], "-o", "y", "--no-plots"], capture_output=True, check=False)
    assert done.returncode == 0
    assert b"warning: \\x1b[2J\\x9b2J\\u202ecleared" in done.stderr
    assert not any(sign in done.stderr.decode() for sign in "\x1b\x9b\u202e")


@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no such signal")
@pytest.mark.parametrize("after", [0.1, 0.5])
def test_an_early_ctrl_c(after: float, folder: Path) -> None:
    """From the first line of bushfit on, which here says that it has begun."""
    code = (
        "import signal, sys; sys.argv = ['bushfit', 'run', 'campaign.toml']\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # what runs in the background ignores it
        "print(flush=True)\n"
        "from bushfit.__main__ import main; main()"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as run:
        assert run.stdout
        run.stdout.readline()
        time.sleep(after)
        run.send_signal(signal.SIGINT)
        err = run.communicate()[1]
    assert_one_line(run.returncode, err.lstrip(b"\n"))
    assert err.endswith(b"bushfit: aborted\n")
    assert not (folder / "results").exists()


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
