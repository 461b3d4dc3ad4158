"""Workers: processes of this machine or of a Dask cluster, through one `concurrent.futures.Executor`.

Rows go out in chunks, few at a time. A worker that dies takes the others of its pool along, so the rows that were out
are tried again, each alone; a row whose worker dies twice then is given up, and the rest goes on.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent import futures
from concurrent.futures import CancelledError, Executor, Future
from itertools import islice
from typing import TYPE_CHECKING, Any, TypeVar

from bushfit.errors import BatchError

if TYPE_CHECKING:
    from distributed import Client

T = TypeVar("T")
R = TypeVar("R")

#: Time that a chunk should take [s]: far more than handing it over, far less than one would like to lose; and its rows
#: at most (chosen: at 7 ms a row it takes that time).
_CHUNK_SECONDS, _LARGEST_CHUNK = 0.5, 64
#: Chunks handed out per worker: one to do and one to go on with.
_CHUNKS_PER_WORKER = 2
#: Environment of the workers. Python puts the current folder before its own on the path of what it starts, unless told
#: not to. Below so many bytes glibc keeps freed memory for the next row: handing it back takes a tenth of the time.
_ENVIRONMENT = {"PYTHONSAFEPATH": "1", "MALLOC_TRIM_THRESHOLD_": "134217728", "MALLOC_MMAP_THRESHOLD_": "33554432"}


class LocalPool:
    """Worker processes of this machine, which begin to get ready at once."""

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs
        self._executor: Executor | None = None
        # No fork of this process: it has threads. A server forks instead, with all imported already, which takes it a
        # second or two from now on. It imports what this process does, from where it does.
        os.environ.update(_ENVIRONMENT, PYTHONPATH=os.pathsep.join(sys.path))
        forks = "forkserver" in multiprocessing.get_all_start_methods()
        self._context = multiprocessing.get_context("forkserver" if forks else "spawn")
        if forks:
            from multiprocessing.forkserver import ensure_running

            self._context.set_forkserver_preload(["bushfit.batch.work", "bushfit.commands.fit", "pandas"])
            ensure_running()

    def executor(self) -> Executor:
        """One that works: a new one where the last is broken."""
        if self._executor is None:
            self._executor = futures.ProcessPoolExecutor(self._jobs, self._context, initializer=_begin_worker)
        return self._executor

    def workers(self) -> int:
        """How many chunks are worked on at once."""
        return self._jobs

    def mend(self, _: BaseException) -> None:
        """A future failed, of that cause. Raises BatchError where it is of no use to try again."""
        self.close()

    def close(self) -> None:
        """Let go of what is not finished."""
        if self._executor is not None:
            self._executor.shutdown(wait=False, cancel_futures=True)
            self._executor = None


def _begin_worker() -> None:
    """Ctrl-C is for the parent to answer; and where the parent is gone, so is its worker."""

    def follow(parent: Any) -> None:
        parent.join()
        os._exit(1)

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if parent := multiprocessing.parent_process():
        threading.Thread(target=follow, args=(parent,), daemon=True).start()


class DaskPool:
    """The workers of a Dask cluster, which see the same files.

    Raises:
        BatchError: the extra is not installed, or nobody answers at the address.
    """

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise BatchError("Dask is not installed", place="--scheduler", hint='pip install "bushfit[dask]"') from None
        for name in ("distributed", "distributed.client", "distributed.core", "tornado.application", "asyncio"):
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)  # what goes wrong is told once, in our words
        try:
            self._client: Client = Client(address, timeout=5.0, set_as_default=False)  # in the same house, at once
            self._client.wait_for_workers(1, timeout=60.0)  # a queue may have to start them
        except (OSError, TimeoutError, ValueError) as error:
            raise BatchError(
                "no cluster answers there",
                place="--scheduler",
                found=address,
                expected="the address of a Dask scheduler with workers, such as tcp://10.0.0.5:8786",
                hint=str(error) or "start one with: dask scheduler; dask worker ADDRESS",
            ) from None
        self._executor: Executor = self._client.get_executor(pure=False)
        self._counted, self._count = 0.0, 1

    def executor(self) -> Executor:
        return self._executor

    def workers(self) -> int:
        if time.monotonic() > self._counted:
            self._count = max(1, sum(self._client.nthreads().values()))
            self._counted = time.monotonic() + 5.0  # they come and go, but asking costs a message
        return self._count

    def mend(self, cause: BaseException) -> None:
        if isinstance(cause, CancelledError) or self._client.status != "running":
            raise BatchError(
                "the Dask scheduler is gone", found=str(cause), hint="the same command with --resume goes on from here"
            )

    def close(self) -> None:
        self._executor.shutdown(wait=False)
        self._client.close()


#: Where chunks are sent.
Pool = LocalPool | DaskPool


def run(
    rows: Sequence[T], work: Callable[[Sequence[T]], Sequence[R]], give_up: Callable[[str], R], pool: Pool
) -> Iterator[tuple[int, R]]:
    """Do work(chunk) for all rows in some order, and yield each row's number and result as it comes.

    Args:
        rows, pool: what to do, and where.
        work: results of a chunk of rows, in their order; it must bear being asked again.
        give_up: the result of a row that took its worker down twice, from a sentence on that.

    Raises:
        BatchError: no worker starts, or they are gone for good.
    """
    left, size = iter(enumerate(rows)), 1
    out: dict[Future[Sequence[R]], list[tuple[int, T]]] = {}
    started: dict[Future[Sequence[R]], float] = {}
    suspects: deque[tuple[int, T]] = deque()
    try:
        while True:
            while not suspects and len(out) < _CHUNKS_PER_WORKER * pool.workers():
                if not (chunk := list(islice(left, size))):
                    break
                future = _submit(pool, work, [row for _, row in chunk])
                out[future], started[future] = chunk, time.monotonic()
            if not out:
                if not suspects:
                    return
                number, row = suspects.popleft()
                yield number, _alone(row, work, give_up, pool)
                continue
            done, _ = futures.wait(out, return_when=futures.FIRST_COMPLETED)
            for future in done:
                chunk, seconds = out.pop(future), time.monotonic() - started.pop(future)
                try:
                    results = future.result()
                except BatchError:
                    raise
                except (Exception, CancelledError) as error:
                    pool.mend(error)
                    suspects.extend(chunk)
                else:
                    # towards the time a chunk should take, at most twice as many rows as before
                    per_row = max(seconds / (_CHUNKS_PER_WORKER * len(chunk)), 1e-9)
                    size = max(1, min(2 * size, _LARGEST_CHUNK, int(_CHUNK_SECONDS / per_row)))
                    yield from ((number, result) for (number, _), result in zip(chunk, results, strict=True))
    finally:
        pool.close()


def _submit(pool: Pool, work: Callable[[Sequence[T]], Sequence[R]], rows: Sequence[T]) -> Future[Sequence[R]]:
    """Hand rows to a worker, of a new pool where the old one has lost a worker, or loses it just now."""
    for _ in range(3):  # the first pool may have lost a worker just now
        try:
            return pool.executor().submit(work, rows)
        except (futures.BrokenExecutor, OSError, EOFError) as error:
            pool.mend(error)
            cause = error
    raise _no_worker(cause) from cause


def _alone(row: T, work: Callable[[Sequence[T]], Sequence[R]], give_up: Callable[[str], R], pool: Pool) -> R:
    """The result of a row that was with a worker when it died: nothing else is out while it tries again."""
    for _ in range(2):  # the worker may have died by chance
        try:
            return _submit(pool, work, [row]).result()[0]
        except BatchError:
            raise
        except (Exception, CancelledError) as error:
            pool.mend(error)
            cause = error
    try:
        _submit(pool, work, []).result()  # a worker that dies over nothing was not brought down by the row
    except (futures.BrokenExecutor, OSError, EOFError) as error:
        raise _no_worker(error) from error
    return give_up(f"its worker process died twice over it alone; out of memory, most likely ({cause})")


def _no_worker(cause: BaseException) -> BatchError:
    return BatchError(
        "no worker process starts",
        found=str(cause) or type(cause).__name__,
        expected="processes that import what this one does",
        hint="what they say of it stands above; install bushfit and its packages anew",
    )
