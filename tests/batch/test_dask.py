"""On a Dask cluster of real processes on this machine: same results, and a lost worker loses nothing."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from trees import tree

pytest.importorskip("distributed", reason="the extra `dask` is not installed")

Processes = list["subprocess.Popen[bytes]"]


def dask(*arguments: str) -> subprocess.Popen[bytes]:
    code = "from distributed.cli import dask_{0}; dask_{0}.main()".format(arguments[0])
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen([sys.executable, "-c", code, *arguments[1:]], start_new_session=True, **quiet)


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, Processes]]:
    """A scheduler and two workers on 127.0.0.1: its address, and all three processes."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    here = ("--host", "127.0.0.1", "--no-dashboard")
    processes = [dask("scheduler", *here, "--port", str(port))]
    for _ in range(2):
        options = ("--nthreads", "1", "--no-nanny", "--memory-limit", "0", "--local-directory", str(tmp_path / "dask"))
        processes.append(dask("worker", address, *here, *options))
    yield address, processes
    for process in processes:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def kept(folder: Path) -> int:
    return sum(1 for _ in folder.glob("bushings/*/row.json"))


@pytest.mark.slow
def test_a_lost_worker_loses_nothing(typed: Callable[..., Any], shop: Path, cluster: tuple[str, Processes]) -> None:
    """One of two workers is killed in mid-run; what comes out is what the local pool makes, byte for byte."""
    address, (_, victim, other) = cluster
    (shop / "many.csv").write_text("campaign\n" + "".join(f"bushings/b{n % 5}/bushing.toml\n" for n in range(40)))
    assert typed("batch", "many.csv", "-o", "local", "-q").returncode == 0
    program = str(Path(sys.executable).with_name("bushfit"))
    arguments = [program, "batch", "many.csv", "-o", "cluster", "--scheduler", address, "--json", "-q"]
    running = subprocess.Popen(arguments, cwd=shop, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    while kept(shop / "cluster") < 5 and running.poll() is None:
        time.sleep(0.02)
    killed_at = kept(shop / "cluster")
    victim.send_signal(signal.SIGKILL)
    out, err = running.communicate(timeout=120)
    print(f"worker killed with {killed_at} of 40 rows kept")
    assert running.returncode == 0, err.decode()
    assert 5 <= killed_at < 40
    assert (json.loads(out)["done"], json.loads(out)["failed"]) == (40, [])
    assert other.poll() is None
    assert tree(shop / "cluster") == tree(shop / "local")


@pytest.mark.slow
def test_a_scheduler_that_is_lost_is_one_error_and_the_work_is_kept(shop: Path, cluster: tuple[str, Processes]) -> None:
    address, (scheduler, *_) = cluster
    (shop / "many.csv").write_text("campaign\n" + "".join(f"bushings/b{n % 5}/bushing.toml\n" for n in range(40)))
    program = str(Path(sys.executable).with_name("bushfit"))
    arguments = [program, "batch", "many.csv", "-o", "all", "--scheduler", address, "-q"]
    running = subprocess.Popen(arguments, cwd=shop, stderr=subprocess.PIPE)
    while kept(shop / "all") < 5 and running.poll() is None:
        time.sleep(0.02)
    scheduler.send_signal(signal.SIGKILL)
    _, err = running.communicate(timeout=120)
    print(err.decode())
    assert running.returncode == 2
    assert b"--resume" in err
    assert b"Traceback" not in err
    assert kept(shop / "all") >= 5


@pytest.mark.slow
def test_nobody_at_the_address(typed: Callable[..., Any], shop: Path) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        free = probe.getsockname()[1]
    done = typed("batch", "bushings/*/bushing.toml", "-o", "all", "--scheduler", f"tcp://127.0.0.1:{free}")
    assert done.returncode == 2
    assert "no cluster answers there" in done.stderr
    assert not (shop / "all").exists()
