"""Run a whole batch: workers evaluate the rows and save their records; then table, picture and page are written."""

from __future__ import annotations

import shutil
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import get_args

from bushfit.batch import store
from bushfit.batch.document import RowFile
from bushfit.batch.executor import Workers, run_rows
from bushfit.batch.junit import junit_report
from bushfit.batch.summary import BatchPlan, BatchResult
from bushfit.caveat import Caveat
from bushfit.errors import OutputError
from bushfit.progress import track
from bushfit.report import plots
from bushfit.report.batch_document import BatchFile
from bushfit.report.results import Picture, ResultFile, check_free, encode_all, unwritable_error, write_files
from bushfit.validation import to_json_data

#: Names of all possible files of the whole batch.
FILES = [*(f"batch.{ending}" for ending in ("json", "csv", "xlsx", *get_args(Picture))), "index.html"]


def check_output(plan: BatchPlan, *, force: bool) -> None:
    """Check before the computation that the results can be written and overwrite nothing without `force`.

    Args:
        plan: settings of the batch.
        force: True to allow overwriting.

    Raises:
        OutputError: the folder cannot be written or holds a batch, or the JUnit report cannot be written.
    """
    output, replaces = plan.task.output, force or plan.task.resume
    check_free(output, [], overwrite=True)
    existing = [name for name in (*FILES, store.ROWS_FOLDER) if (output / name).exists()]
    if existing and not replaces:
        hint = "--resume evaluates what is missing; --force evaluates all again; -o/--output names another folder"
        raise OutputError("there are results already", file=output, found=", ".join(existing), hint=hint)
    if plan.junit:
        report, folder = plan.junit.resolve(), output.resolve()
        try:
            if report in [folder / name for name in FILES] or folder / store.ROWS_FOLDER in (report, *report.parents):
                raise OutputError("the report cannot be in the results folder of a bushing or replace the table")
            check_free(plan.junit.parent, [plan.junit.name], overwrite=replaces)
        except OutputError as error:
            error.file, error.place = plan.junit, "--junit"
            error.hint = "name another file with --junit; --force replaces an existing report"
            raise


def run_batch(plan: BatchPlan, workers: Workers, before_writing: Callable[[BatchResult], None]) -> BatchResult:
    """Evaluate all rows, then write the files of the whole batch.

    Args:
        plan: settings of the batch.
        workers: workers of this machine or of a cluster.
        before_writing: function that is called with the result when all files are ready; if it raises, the rows are
            kept, and no file of the whole batch is written.

    Returns:
        Results of all rows.

    Raises:
        BatchError: the workers are lost; finished rows are kept.
        OutputError: the results cannot be written, or another batch is running in the folder.
    """
    from bushfit.report.page.index import index_page

    output, start = plan.task.output, time.perf_counter()
    try:
        with store.batch_folder(output):
            for name in FILES:  # they belong to the results that are about to be replaced
                (output / name).unlink(missing_ok=True)
            notes = remove_unlisted_parts(plan)
            records, counts = [RowFile(status="failed")] * len(plan.rows), Counter[str]()
            lost = lambda reason: (RowFile(status="failed", error=reason), False)  # noqa: E731
            finished = run_rows(plan.rows, plan.task, lost, workers)
            remark = lambda: f"{counts['failed']} failed" if counts["failed"] else ""  # noqa: E731
            for number, (record, was_kept) in track("bushings", finished, len(records), remark):
                records[number] = replace(record, inputs={}, files={})  # only a later run asks for these
                counts[record.status] += 1
                counts["kept"] += was_kept
            result = BatchResult(plan, records, counts["kept"], time.perf_counter() - start, notes)
            table = ResultFile("batch", "table", result.table)
            files = [ResultFile("batch", "json", to_json_data(result.document, BatchFile)), table]
            if plan.formats.pages:
                files.append(ResultFile("index", "page", partial(index_page, result.document, output)))
            if plan.formats.pictures and plots.batch.quantities_to_draw(result.document, table.content()):
                draw = lambda: plots.batch.batch_figure(result.document, table.content())  # noqa: E731
                files.append(ResultFile("batch", "figure", draw))
            encoded = encode_all(files, plan.formats)
            before_writing(result)
            if plan.junit:
                write_files(plan.junit.parent, {plan.junit.name: junit_report(result)})
            write_files(output, encoded)
            return result
    except OSError as error:
        raise unwritable_error(output, error) from error


def remove_unlisted_parts(plan: BatchPlan) -> list[Caveat]:
    """Remove results of an earlier batch for parts that are not in this batch; a batch that resumes keeps them.

    Returns:
        List with a warning on these results; empty if there are none.
    """
    current = {row.folder for row in plan.rows}
    records = (plan.task.output / store.ROWS_FOLDER).glob(f"*/{store.ROW_FILE}")
    folders = [record.parent for record in records if record.parent.name not in current]
    outcome = "are still in bushings/ (--force removes them)" if plan.task.resume else "were removed from bushings/"
    several = "bushings of an earlier batch that are" if len(folders) > 1 else "bushing of an earlier batch that is"
    for folder in () if plan.task.resume else folders:
        shutil.rmtree(folder)
    sentence = f"results of {len(folders)} {several} not in this batch {outcome}"
    return [Caveat("earlier_results", sentence)] if folders else []
