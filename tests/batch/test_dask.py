"""On a Dask cluster of real processes on this machine: same results, and a lost worker loses nothing."""

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from trees import PATTERN, command, kept, list_many, tree, wait_for

pytest.importorskip("distributed", reason="the extra `dask` is not installed")
pytestmark = pytest.mark.slow

Processes = list["subprocess.Popen[bytes]"]


def dask(*arguments: str) -> subprocess.Popen[bytes]:
    code = "from distributed.cli import dask_{0}; dask_{0}.main()".format(arguments[0])
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen([sys.executable, "-c", code, *arguments[1:]], start_new_session=True, **quiet)


def free_address() -> str:
    """An address at which nobody listens."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp://127.0.0.1:{probe.getsockname()[1]}"


@pytest.fixture
def cluster(tmp_path) -> Iterator[tuple[str, Processes]]:
    """A scheduler and two workers on 127.0.0.1: its address, and all three processes."""
    address = free_address()
    here = ("--host", "127.0.0.1", "--no-dashboard")
    processes = [dask("scheduler", *here, "--port", address.rpartition(":")[2])]
    for _ in range(2):
        options = ("--nthreads", "1", "--no-nanny", "--memory-limit", "0", "--local-directory", str(tmp_path / "dask"))
        processes.append(dask("worker", address, *here, *options))
    yield address, processes
    for process in processes:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def interrupted(shop: Path, address: str, victim: subprocess.Popen[bytes]) -> tuple[int, bytes, bytes]:
    """Exit status and outputs of a batch of twenty, of whose cluster a process is killed in mid-run."""
    arguments = command("cluster", "--scheduler", address, "--json", "-q")
    running = subprocess.Popen(arguments, cwd=shop, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    wait_for(running, shop / "cluster", 5)
    print(f"killed with {kept(shop / 'cluster')} of 20 rows kept")
    assert 5 <= kept(shop / "cluster") < 20
    victim.send_signal(signal.SIGKILL)
    out, err = running.communicate(timeout=120)
    return running.returncode, out, err


def test_a_lost_worker_loses_nothing(typed, shop, cluster):
    """What comes out is what the local pool makes, byte for byte."""
    address, (_, victim, other) = cluster
    list_many(shop, 20)
    typed("batch", "many.csv", "-o", "local", "-q", "--no-plots")
    status, out, err = interrupted(shop, address, victim)
    assert status == 0, err.decode()
    assert (json.loads(out)["done"], json.loads(out)["failed"]) == (20, [])
    assert other.poll() is None
    assert tree(shop / "cluster") == tree(shop / "local")


def test_a_scheduler_that_is_lost_is_one_error_and_the_work_is_kept(shop, cluster):
    address, (scheduler, *_) = cluster
    list_many(shop, 20)
    status, _, err = interrupted(shop, address, scheduler)
    assert status == 2
    assert b"--resume" in err
    assert b"Traceback" not in err
    assert kept(shop / "cluster") >= 5


def test_no_scheduler_at_the_address(typed, shop):
    """Nobody, a service that says nothing, an unknown scheme, and no address."""
    with socket.create_server(("127.0.0.1", 0)) as silent:
        for address in (free_address(), f"tcp://127.0.0.1:{silent.getsockname()[1]}", "foo://x", ""):
            done = typed("batch", PATTERN, "-o", "all", "--scheduler", address, status=2)
            assert done.stderr.startswith("bushfit: error: --scheduler: no Dask scheduler answers there")
            assert "Traceback" not in done.stderr
    assert not (shop / "all").exists()
