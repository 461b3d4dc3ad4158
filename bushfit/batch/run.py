"""The whole batch: rows to workers, records to disk, then the table, the verdicts and the picture."""

import shutil
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import cast, get_args

import numpy as np

from bushfit.batch import ledger, pool
from bushfit.batch.document import Record
from bushfit.batch.outcome import Outcome, Plan
from bushfit.batch.pool import Pool
from bushfit.batch.quantities import PARTS, figures
from bushfit.batch.work import failed, work
from bushfit.effects.contract import Array
from bushfit.errors import OutputError
from bushfit.progress import track
from bushfit.report.results import Picture, encode_all, unwritable, write_files
from bushfit.report.results import check_free as check_writable

#: The files of these in whatever form, in the batch's folder.
FILES = ["index.html", *(f"batch.{ending}" for ending in ("json", "csv", "xlsx", *get_args(Picture)))]
#: Keys of a record that are not held in memory: the figures have its numbers, and a later run asks for the files.
_NOT_HELD = {"parameters", "points", "inputs", "files"}


def check_free(plan: Plan, *, force: bool) -> None:
    """Refuse to replace results that stand, unless asked to go on or to replace.

    Raises:
        OutputError: the folder cannot be written or holds a batch, or the report cannot be written.
    """
    output, over = plan.orders.output, force or plan.orders.resume
    check_writable(output, [], overwrite=True)
    found = [name for name in (*FILES, ledger.ROWS) if (output / name).exists()]
    if found and not over:
        raise OutputError(
            "results stand there already",
            file=output,
            found=", ".join(found),
            hint="--resume does what is missing; --force does all again; -o/--output names another folder",
        )
    if plan.junit:
        with _blamed_on(plan.junit):
            place, own = plan.junit.resolve(), output.resolve()
            if place in [own / name for name in FILES] or own / ledger.ROWS in (place, *place.parents):
                problem = "the report cannot stand among the results of the rows, nor in place of the table"
                raise OutputError(problem, file=plan.junit)
            check_writable(plan.junit.parent, [plan.junit.name], overwrite=over)


@contextmanager
def _blamed_on(junit: Path) -> Iterator[None]:
    """Errors of the report's own folder name the option that chose it."""
    try:
        yield
    except OutputError as error:
        if error.file:
            error.file, error.place = junit, "--junit"
            error.hint = "name another file with --junit; --force replaces a report that stands"
        raise


def run(plan: Plan, workers: Pool, tell: Callable[[Outcome], None]) -> Outcome:
    """Do every row, then write the table, the picture, the summary, the page and the JUnit report.

    Args:
        plan, workers: the batch, and where its rows are done.
        tell: called with what came of it when all is on the disk and only stands elsewhere; if it raises, the rows are
            kept, and nothing is written of the whole.

    Raises:
        BatchError: the workers are gone for good; what was done is kept.
        OutputError: the results cannot be written, or another batch is at work in the folder.
    """
    output = plan.orders.output
    try:
        with ledger.held(output):
            for name in FILES:  # from here on they tell of results that are replaced
                (output / name).unlink(missing_ok=True)
            outcome = _worked(plan, workers)
            ready = output / ledger.STAGE / "whole"
            ready.mkdir()
            for name, content in encode_all(outcome.files, plan.formats).items():
                (ready / name).write_bytes(content)
            if plan.junit:
                with _blamed_on(plan.junit):
                    tell(outcome)
                    write_files(plan.junit.parent, {plan.junit.name: outcome.junit()})
            else:
                tell(outcome)
            for file in sorted(ready.iterdir()):
                file.replace(output / file.name)
            return outcome
    except OSError as error:
        raise unwritable(output, error) from error


def _worked(plan: Plan, workers: Pool) -> Outcome:
    """Do every row, and take over its record and its numbers."""
    begin, count = time.perf_counter(), len(plan.rows)
    earlier = list[str]()
    if folders := ledger.left_over(plan.orders.output, plan.rows):  # they are removed unless it goes on
        fate = "are still in bushings/ (--force removes them)"
        if not plan.orders.resume:
            fate = "were removed from bushings/"
            for folder in folders:
                shutil.rmtree(folder)
        earlier = [f"results of {len(folders)} bushings of an earlier batch, no rows of this one, {fate}"]
    records: list[Record] = [failed("") for _ in plan.rows]
    numbers = defaultdict[str, Array](lambda: np.full((len(PARTS), count), np.nan))
    count_of = Counter[str]()
    come = pool.run(plan.rows, partial(work, orders=plan.orders), failed, workers)
    for number, record in track(
        "bushings", come, count, lambda: f"{count_of['failed']} failed" if count_of["failed"] else ""
    ):
        for name, known in figures(record):
            if known[0] is not None:
                numbers[name][:, number] = np.array(known, dtype=float)
        records[number] = cast("Record", {key: entry for key, entry in record.items() if key not in _NOT_HELD})
        count_of[record["status"]] += 1
    return Outcome(plan, records, dict(numbers), time.perf_counter() - begin, earlier)
