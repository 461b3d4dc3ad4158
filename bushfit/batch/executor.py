"""Workers of a batch: processes of this machine or of a Dask cluster, both behind `concurrent.futures.Executor`.

A process that dies breaks the whole local pool. The rows in progress are then tried again, one at a time. A row that
fails repeatedly is given up, and the others continue.
"""

from __future__ import annotations

import asyncio
import logging
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, ProcessPoolExecutor, wait
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

from bushfit.errors import BatchError

Task = TypeVar("Task")
Outcome = TypeVar("Outcome")

#: Number of rows submitted per worker: one that is evaluated and the next one.
_ROWS_PER_WORKER = 2
#: Maximum number of attempts to evaluate a row: the first along with other rows, the next ones alone.
_ATTEMPTS = 3
#: Time between two counts of the workers [s], and maximum time that a cluster may have no worker [s].
_LOOK_SECONDS, NO_WORKER_SECONDS = 2.0, 30.0
#: Maximum time for an answer of a scheduler [s].
_ANSWER_SECONDS = 4.0
#: Environment of local workers. The first variable keeps the current folder off their import path. The other two make
#: glibc keep up to this number of bytes of freed memory for the next row, which saves a tenth of the time.
_ENVIRONMENT = {"PYTHONSAFEPATH": "1", "MALLOC_TRIM_THRESHOLD_": "134217728", "MALLOC_MMAP_THRESHOLD_": "33554432"}


@dataclass(frozen=True)
class Workers:
    """Worker processes of a batch, on this machine or on a cluster.

    Args:
        open: function that starts an executor; called again if the last executor is broken.
        count: function that returns the number of workers, at least 1; raises a BatchError if they are lost.
        close: function that is called at the end of the batch.
    """

    open: Callable[[], Executor]
    count: Callable[[], int]
    close: Callable[[], object] = lambda: None


def local_workers(processes: int) -> Workers:
    """Make workers of processes on this machine, and start the server that forks the processes.

    Args:
        processes: number of worker processes.

    Returns:
        Workers whose executor is a process pool.
    """
    os.environ.update(_ENVIRONMENT, PYTHONPATH=os.pathsep.join(sys.path))
    forks = "forkserver" in multiprocessing.get_all_start_methods()  # this process has threads, so it must not fork
    context = multiprocessing.get_context("forkserver" if forks else "spawn")
    if forks:
        from multiprocessing.forkserver import ensure_running

        context.set_forkserver_preload(["bushfit.batch.row", "bushfit.commands.respond", "bushfit.commands.run"])
        ensure_running()
    pool = partial(ProcessPoolExecutor, processes, context, initializer=_start_worker)
    return Workers(pool, lambda: processes)


def _start_worker() -> None:
    """Initialise a worker process: it ignores Ctrl-C, which the parent handles, and ends when the parent ends."""

    def follow(parent: Any) -> None:
        """End this process as soon as the parent process ends."""
        parent.join()
        os._exit(1)

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if parent := multiprocessing.parent_process():
        threading.Thread(target=follow, args=(parent,), daemon=True).start()


def dask_workers(address: str, warn: Callable[[str], object]) -> Workers:
    """Connect to the workers of a Dask cluster, which must see the same files; workers may join and leave.

    Args:
        address: address of the Dask scheduler, such as tcp://10.0.0.5:8786.
        warn: function that is called with a sentence when the cluster has no worker.

    Returns:
        Workers whose executor sends tasks to the cluster.

    Raises:
        BatchError: Dask is not installed, or no scheduler answers at the address.
    """
    try:
        from distributed import Client
    except ImportError:
        raise BatchError("Dask is not installed", place="--scheduler", hint='pip install "bushfit[dask]"') from None
    for name in ("distributed", "distributed.client", "distributed.core", "tornado.application", "asyncio"):
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)  # errors are reported once, in our words
    try:  # a client waits for ever where something else listens, so a short call comes first
        if (kind := asyncio.run(asyncio.wait_for(_ask_kind(address), _ANSWER_SECONDS))) != "Scheduler":
            raise ValueError(f"a Dask {kind.lower()} answers there")
        client: Any = Client(address, timeout=_ANSWER_SECONDS, set_as_default=False)
    except Exception as error:  # whatever a foreign service answers
        problem, found = "no Dask scheduler answers there", address or "an empty address"
        expected = "the address of a Dask scheduler, such as tcp://10.0.0.5:8786"
        hint = str(error) or "start one with: dask scheduler; dask worker ADDRESS"
        raise BatchError(problem, place="--scheduler", found=found, expected=expected, hint=hint) from None

    def count() -> int:
        """Count the worker threads of the cluster, after a wait for the first one.

        Returns:
            Number of threads.

        Raises:
            BatchError: no worker comes, or the connection is lost.
        """
        hint = "the same command with --resume continues from here"
        with suppress(OSError, RuntimeError):
            if client.status == "running" and not client.nthreads():
                warn(f"no worker at {address}: waiting {NO_WORKER_SECONDS:.0f} s for one")
                try:
                    client.wait_for_workers(1, NO_WORKER_SECONDS)
                except TimeoutError:
                    hint = f"dask worker {address}; then {hint}"
                    raise BatchError("no Dask worker is left", place="--scheduler", found=address, hint=hint) from None
            if client.status == "running":
                return sum(client.nthreads().values())
        raise BatchError("the connection to the Dask scheduler is lost", found=address, hint=hint)

    return Workers(partial(client.get_executor, pure=False), count, partial(client.close, _ANSWER_SECONDS))


async def _ask_kind(address: str) -> str:
    """Kind of the Dask server at an address, such as "Scheduler"."""
    from distributed import rpc

    async with rpc(address) as server:
        return str((await server.identity())["type"])


def run_rows(
    rows: Sequence[Task], work: Callable[[Task], Outcome], give_up: Callable[[str], Outcome], workers: Workers
) -> Iterator[tuple[int, Outcome]]:
    """Evaluate all rows of a batch (one row for each part) on the workers, in any order.

    Args:
        rows: rows of the batch.
        work: function that evaluates a row; it may be called several times with the same row.
        give_up: function that makes the outcome of a row whose worker dies repeatedly, from a sentence with the reason.
        workers: workers of this machine or of a cluster.

    Returns:
        Iterator over index and outcome of each row, in the order in which the rows finish.

    Raises:
        BatchError: no worker starts, or the cluster is lost.
    """
    queue, out, failures = deque(range(len(rows))), dict[Future[Outcome], int](), Counter[int]()
    executor, width, looked = workers.open(), 1, 0.0
    try:
        while queue or out:
            if time.monotonic() > looked + _LOOK_SECONDS:
                width, looked = _ROWS_PER_WORKER * workers.count(), time.monotonic()
            while queue and len(out) < (1 if failures else width):  # a row that failed runs alone
                number = queue.popleft()
                try:
                    future = executor.submit(work, rows[number])
                except (OSError, RuntimeError) as error:  # the pool has just broken
                    future = Future[Outcome]()
                    future.set_exception(error)
                out[future] = number
            for future in wait(out, timeout=_LOOK_SECONDS, return_when=FIRST_COMPLETED).done:
                number = out.pop(future)
                try:
                    outcome = future.result()
                except BatchError:
                    raise
                except (Exception, CancelledError) as error:
                    workers.count()
                    if not out:  # all of the broken pool have come back
                        executor.shutdown(wait=False)
                        executor = workers.open()
                    failures[number] += 1
                    if failures[number] < _ATTEMPTS:
                        queue.appendleft(number)
                        continue
                    _check_alive(executor)
                    outcome = give_up(f"its worker process ended, probably for lack of memory ({error})")
                failures.pop(number, None)
                yield number, outcome
    finally:
        for future in out:
            future.cancel()
        executor.shutdown(wait=False)
        workers.close()


def _check_alive(executor: Executor) -> None:
    """Raise a BatchError if the workers fail even on a trivial task."""
    try:
        executor.submit(os.getpid).result(NO_WORKER_SECONDS)
    except (OSError, RuntimeError, CancelledError) as error:
        raise BatchError(
            "no worker process starts",
            found=str(error) or type(error).__name__,
            expected="worker processes that import the same packages as this process",
            hint="read the messages above, and install bushfit and its packages again",
        ) from error
