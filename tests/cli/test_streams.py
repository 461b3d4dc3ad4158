"""Output that nobody reads, its encoding, and what a Ctrl-C leaves: one line, and the right status."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from spoiled import FILES, MODEL

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
        PREDICT,
        pytest.param(BATCH, marks=pytest.mark.slow),
        ("--help",),
        ("schema", "model", "-q"),
    ],
    ids=lambda it: it[0],
)
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
