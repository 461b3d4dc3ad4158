"""Files that would fill the memory or take hours: refused, or read, within what the system is told to give."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from bombs import BOMBS
from commandline import Done
from spoiled import CAMPAIGN, FILES

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows bounds no process")

#: Address space [bytes] and processor time [s] of a command: a fit of the paper's campaign takes a third of each.
LIMITS = (1_500_000_000, 30)
FIRST, *REST = BOMBS


def bounded(folder: Path, *arguments: str, times: int = 1) -> Done:
    """A command in a process of its own that the system lets have so much, its time so many times, and no more; its
    processes as well."""
    code = (
        f"import resource, sys; memory, seconds = {LIMITS[0]}, {times * LIMITS[1]}\n"
        "resource.setrlimit(resource.RLIMIT_AS, (memory, memory))\n"
        "resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))\n"
        f"sys.argv = {['bushfit', *arguments]}\n"
        "from bushfit.__main__ import main; main()"
    )
    command = [sys.executable, "-W", "error", "-c", code]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, encoding="utf-8")
    return Done(done.returncode, done.stdout, done.stderr)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, content in FILES.items():
        (tmp_path / name).write_text(content)
    (tmp_path / "book.toml").write_text(CAMPAIGN.replace("loop.csv", "book.xlsx"))
    return tmp_path


def assert_refused(done: Done, *says: str) -> None:
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("bushfit: error: "), done.stderr
    assert "Traceback" not in done.stderr
    assert all(words in done.stderr for words in says), done.stderr


@pytest.mark.parametrize("bomb", [FIRST, *(pytest.param(bomb, marks=pytest.mark.slow) for bomb in REST)])
def test_workbooks_that_would_fill_the_machine(bomb: str, folder: Path) -> None:
    (folder / "book.xlsx").write_bytes(BOMBS[bomb])
    print(f"{len(BOMBS[bomb])} bytes")
    assert_refused(bounded(folder, "fit", "book.toml", "-o", "x"), "book.xlsx: the workbook is too large", "save the")


def test_300_mb_of_zeros_behind_a_table(folder: Path) -> None:
    with (folder / "loop.csv").open("r+b") as stream:
        stream.write(FILES["loop.csv"].encode() * 20)
        stream.truncate(300_000_000)
    assert_refused(bounded(folder, "fit", "campaign.toml", "-o", "x"), "this is not text", "found: byte 0x00")


@pytest.fixture
def long_runs(folder: Path) -> Path:
    """Two runs of 12,000 points: what grew with the square of them took 1.2 GB for each matrix."""
    rng = np.random.default_rng(1)
    frequency, level = np.tile(np.linspace(1.0, 200.0, 12_000), 2), np.repeat([0.1, 0.2], 12_000)
    reached = level * np.exp(0.001 * rng.standard_normal(level.size))
    stiffness = 500.0 + 0.6 * frequency + rng.standard_normal(level.size)
    columns = (frequency, reached, stiffness, 0.1 + 0.002 * rng.standard_normal(level.size))
    rows = [",".join(f"{value:.6g}" for value in row) for row in zip(*columns, strict=True)]
    (folder / "sweep.csv").write_text("\n".join([FILES["sweep.csv"].partition("\n")[0], *rows]))
    return folder


def test_a_fit_to_runs_of_12_000_points(long_runs: Path) -> None:
    done = bounded(long_runs, "fit-dynamic", "campaign.toml", "--static", "model.json", "-o", "x", "--no-plots")
    assert done.returncode == 0, done.stderr
    assert json.loads((long_runs / "x" / "dynamic.json").read_text())["fit"]["points"] == 2 * 12_000


@pytest.mark.slow
def test_a_diagnosis_of_runs_of_12_000_points(long_runs: Path) -> None:
    done = bounded(long_runs, "diagnose", "campaign.toml", "-o", "x", "--no-plots", times=2)
    assert done.returncode == 0, done.stderr
    assert "24000 points are diagnosed as 200 means over narrow bands" in done.stderr
