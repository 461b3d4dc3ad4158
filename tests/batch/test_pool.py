"""Workers that die: rows are tried again, a row that takes its worker along is given up, the rest goes on."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Sequence
from concurrent.futures import BrokenExecutor
from functools import partial
from pathlib import Path

import pytest

from bushfit.batch.manifest import Row, Settings
from bushfit.batch.pool import LocalPool, run
from bushfit.batch.work import Orders, failed, work
from bushfit.errors import BatchError
from bushfit.report.contents import Formats


def double(rows: Sequence[int], folder: Path, deadly: tuple[int, ...] = (), once: tuple[int, ...] = ()) -> list[str]:
    """Twice each row; deadly rows kill this process, some only the first time."""
    for row in rows:
        mark = folder / f"died at {row}"
        if row in deadly or (row in once and not mark.exists()):
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
    return [str(2 * row) for row in rows]


@pytest.mark.parametrize(
    ("count", "once", "deadly"), [(300, (), ()), (40, (100, 117), ()), (30, (), (103, 120))], ids=str
)
def test_a_worker_that_dies_costs_a_second_try_and_only_what_always_kills_is_given_up(
    tmp_path: Path, count: int, once: tuple[int, ...], deadly: tuple[int, ...]
) -> None:
    rows = list(range(100, 100 + count))
    task = partial(double, folder=tmp_path, once=once, deadly=deadly)
    found = list(run(rows, task, lambda why: why, LocalPool(2)))
    assert sorted(number for number, _ in found) == list(range(count)), "each row once"
    for number, result in found:
        if 100 + number in deadly:
            assert "its worker process died twice" in result
        else:
            assert result == str(2 * (100 + number))
    assert len(list(tmp_path.iterdir())) == len(once + deadly)


def test_workers_that_die_before_they_are_given_more_are_replaced(tmp_path: Path) -> None:
    pool = LocalPool(2)
    found = run(list(range(100, 140)), partial(double, folder=tmp_path), lambda why: why, pool)
    done = [next(found)]
    for worker in multiprocessing.active_children():
        worker.kill()  # once one is gone, the pool itself ends the others
        worker.join()
    with pytest.raises(BrokenExecutor):
        pool.executor().submit(double, [1], tmp_path).result()
    done += found
    assert dict(done) == {n: str(2 * (100 + n)) for n in range(40)}


def test_a_worker_of_another_version_or_none_that_lives_ends_the_batch(tmp_path: Path) -> None:
    row = Row("a", "a", "a.toml", "a.toml", Settings())
    orders = Orders(tmp_path, (), Formats(False, False), resume=False, version="0.0.0")
    with pytest.raises(BatchError, match=r"another bushfit[\s\S]*0\.0\.0"):
        list(run([row], partial(work, orders=orders), failed, LocalPool(1)))
    with pytest.raises(BatchError, match="no worker process starts"):
        list(run(list(range(100)), die, lambda why: why, LocalPool(2)))


def die(rows: Sequence[int]) -> list[str]:
    """Die, also over nothing."""
    os.kill(os.getpid(), signal.SIGKILL)
    return []
