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

from bushfit.batch.pool import LocalPool, run
from bushfit.errors import BatchError


def double(rows: Sequence[int], folder: Path, deadly: tuple[int, ...] = (), once: tuple[int, ...] = ()) -> list[str]:
    """Twice each row; deadly rows kill this process, some only the first time."""
    for row in rows:
        mark = folder / f"died at {row}"
        if row in deadly or (row in once and not mark.exists()):
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
    return [str(2 * row) for row in rows]


def results(count: int, folder: Path, **deaths: tuple[int, ...]) -> dict[int, str]:
    rows = list(range(100, 100 + count))
    found = list(run(rows, partial(double, folder=folder, **deaths), lambda why: why, LocalPool(2)))
    assert sorted(number for number, _ in found) == list(range(count)), "each row once"
    return dict(found)


def test_every_row_once(tmp_path: Path) -> None:
    assert results(300, tmp_path) == {n: str(2 * (100 + n)) for n in range(300)}


def test_a_worker_that_dies_costs_a_second_try(tmp_path: Path) -> None:
    assert results(40, tmp_path, once=(100, 117)) == {n: str(2 * (100 + n)) for n in range(40)}
    assert len(list(tmp_path.iterdir())) == 2


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


def test_rows_that_always_kill_are_given_up_and_no_others(tmp_path: Path) -> None:
    found = results(30, tmp_path, deadly=(103, 120))
    for number, result in found.items():
        if number in (3, 20):
            assert "its worker process died twice" in result
        else:
            assert result == str(2 * (100 + number))


def refuse(rows: Sequence[int]) -> list[str]:
    raise BatchError("another version")


def test_what_no_retry_can_mend_ends_the_batch() -> None:
    with pytest.raises(BatchError, match="another version"):
        list(run([1, 2, 3], refuse, lambda why: why, LocalPool(1)))


def die(rows: Sequence[int]) -> list[str]:
    """Die, also over nothing."""
    os.kill(os.getpid(), signal.SIGKILL)
    return []


def test_where_no_worker_lives_the_batch_ends_at_once() -> None:
    with pytest.raises(BatchError, match="no worker process starts"):
        list(run(list(range(100)), die, lambda why: why, LocalPool(2)))
