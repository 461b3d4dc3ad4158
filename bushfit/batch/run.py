"""The whole batch: rows to workers, records to disk, then the table, the verdicts and the picture."""

import math
import shutil
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import get_args

import numpy as np

from bushfit.batch import ledger, pool
from bushfit.batch.document import BatchFile, BatchSummary, Control, Counts, Record, Scatter
from bushfit.batch.junit import Report
from bushfit.batch.limits import Judge, Judgement, Limits
from bushfit.batch.manifest import Row
from bushfit.batch.pool import Pool
from bushfit.batch.quantities import LOSS_FACTOR, OF_FIT, STIFFNESS, Quantity, at_point, parameter_quantities
from bushfit.batch.spool import Spool
from bushfit.batch.table import Table
from bushfit.batch.work import Orders, given_up, work
from bushfit.effects.contract import Array
from bushfit.errors import OutputError
from bushfit.reading.tablefile import opened
from bushfit.reduction.scatter import scatter
from bushfit.report.contents import Contents, Formats, Kinds, Picture, pages_of
from bushfit.report.folder import check_free as check_writable
from bushfit.report.folder import to_json, write_files

#: All that is written of the whole batch: what is said of it, its table, picture and page.
KINDS = Kinds(("batch",), ("batch",), ("batch",), ("index",))
#: The files of these in whatever form, in the batch's folder.
FILES = ["index.html", *(f"batch.{ending}" for ending in ("json", "csv", "xlsx", *get_args(Picture)))]
#: Bushings that must have a quantity for it to be drawn: fewer show no scatter.
_LEAST_DRAWN = 3


@dataclass(frozen=True)
class Plan:
    """A batch: its title, rows, what all rows share, limits, a JUnit file on request, how the whole is written."""

    title: str
    rows: Sequence[Row]
    orders: Orders
    limits: Limits | None
    junit: Path | None
    formats: Formats


@dataclass
class Summary:
    """What came of it: what is counted and named row by row, then what is said of the whole batch.

    Args:
        status: rows by done, failed.
        kept: rows taken over from an earlier run.
        bounded, bounds: bushings with a parameter at rest on a bound, and how many by the parameter.
        limits: bushings by verdict.
        missed: name of each bushing that misses a limit, and what it misses, in words.
        missing: numbers of the rows that miss a limit of a quantity, by its name.
        edge: name of each bushing that passes on condition, and why.
        scatter: median and robust standard deviation of each quantity, in its unit.
        notes: limits that could not be judged, bushings with warnings, results of earlier batches beside these.
    """

    seconds: float
    status: Counter[str] = field(default_factory=Counter)
    kept: int = 0
    warned: int = 0
    bounded: int = 0
    bounds: Counter[str] = field(default_factory=Counter)
    limits: Counter[str] = field(default_factory=Counter)
    missed: list[tuple[str, str]] = field(default_factory=list)
    missing: defaultdict[str, set[int]] = field(default_factory=lambda: defaultdict(set))
    edge: list[tuple[str, str]] = field(default_factory=list)
    errors: list[tuple[str, str]] = field(default_factory=list)
    scatter: dict[Quantity, tuple[float, float]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def add(self, number: int, row: Row, record: Record, judged: Judgement | None) -> None:
        """Count one row."""
        self.status[record["status"]] += 1
        self.kept += bool(record.get("kept"))
        self.warned += bool(record.get("warnings"))
        self.bounded += bool(record.get("at_bound"))
        self.bounds.update(list(record.get("at_bound", ())))
        if record["status"] != "done":
            self.errors.append((row.name, record["error"]))
        if judged:
            self.limits[str(judged.verdict)] += 1
            for name in judged.missed:
                self.missing[name].add(number)
            if judged.missed:
                self.missed.append((row.name, "; ".join(judged.missed.values())))
            elif judged.edge:
                self.edge.append((row.name, "; ".join(judged.edge.values())))

    @property
    def counts(self) -> Counts:
        """JSON-ready data, whatever of it was done in this run."""
        return {
            "schema": "bushfit/batch/1",
            "rows": self.status.total(),
            "done": self.status["done"],
            "failed": [{"name": name, "error": error} for name, error in self.errors],
            "limits": dict(self.limits),
            "missed": [name for name, _ in self.missed],
            "conditional": [name for name, _ in self.edge],
            "warnings": self.notes,
        }

    def to_document(self) -> BatchSummary:
        """The same with what this run took, and the scatter of each quantity in its unit."""
        scatter: dict[str, Scatter] = {
            quantity.name: {"median": middle, "sigma": spread, "unit": quantity.unit}
            for quantity, (middle, spread) in self.scatter.items()
        }
        return {**self.counts, "kept": self.kept, "scatter": scatter, "seconds": self.seconds}

    def to_file(self, title: str, judge: Judge | None) -> BatchFile:
        """The same as a file: with its title, and of each quantity its column, its limits and its scatter there."""
        quantities: dict[str, Control] = {}
        for quantity, (middle, spread) in self.scatter.items():
            allowed, tabled = judge.allowed.get(quantity.name, ()) if judge else (), quantity.tabled
            ends = [end * tabled.factor if math.isfinite(end) else None for end in allowed]
            scale = tabled.factor / quantity.factor
            sizes: Control = {"median": middle * scale, "sigma": spread * scale, "allowed": ends or [None, None]}
            quantities[tabled.header] = sizes
        return {**self.counts, "title": title, "quantities": quantities}


def check_free(plan: Plan, *, force: bool) -> None:
    """Refuse to replace results that stand, unless asked to go on or to replace.

    Raises:
        OutputError: the folder cannot be written or holds a batch, or the report cannot be written.
    """
    output, over = plan.orders.output, force or plan.orders.resume
    check_writable(output, FILES, force=True)
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
            check_writable(plan.junit.parent, [plan.junit.name], force=over)


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


def run(plan: Plan, workers: Pool, progress: Callable[[str], None], tell: Callable[[Summary], None]) -> Summary:
    """Do every row, then write the table, the picture, the summary, the page and the JUnit report.

    Args:
        plan, workers: the batch, and where its rows are done.
        progress: called with the status of each row as it comes.
        tell: called with what came of it when all is on the disk and only stands elsewhere; if it raises, the rows are
            kept, and nothing is written of the whole.

    Raises:
        BatchError: the workers are gone for good; what was done is kept.
        OutputError: the results cannot be written, or another batch is at work in the folder.
    """
    begin, output = time.perf_counter(), plan.orders.output
    try:
        with ledger.held(output), closing(Spool(output / ledger.ASIDE / "records", len(plan.rows))) as spool:
            for name in FILES:  # from here on they tell of results that are replaced
                (output / name).unlink(missing_ok=True)
            strays = ledger.strays(output, plan.rows)
            fate = "are still in bushings/ (--force removes them)"
            if not plan.orders.resume:
                fate = "were removed from bushings/"
                for folder in strays:
                    shutil.rmtree(folder)
            task = partial(work, orders=plan.orders)
            for number, (status, line) in pool.run(plan.rows, task, given_up, workers):
                spool.put(number, line)
                progress(status)
            summary, ready = Summary(time.perf_counter() - begin), output / ledger.ASIDE / "whole"
            ready.mkdir()
            report = _report(plan, spool, summary, ready)
            if strays:
                summary.notes.append(
                    f"results of {len(strays)} bushings of an earlier batch, no rows of this one, {fate}"
                )
            if plan.junit:
                with _blamed_on(plan.junit):
                    files = {plan.junit.name: report.to_xml()}
                    write_files(plan.junit.parent, files, force=True, before=lambda: tell(summary))
            else:
                tell(summary)
            for file in sorted(ready.iterdir()):
                file.replace(output / file.name)
            return summary
    except OSError as error:
        raise OutputError(
            "the results cannot be written", file=output, found=error.strerror or str(error), hint="free some space"
        ) from error


def _report(plan: Plan, spool: Spool, summary: Summary, ready: Path) -> Report:
    """Hold every record against the limits, fill the summary, and write what people read into the folder `ready`."""
    columns, intervals = spool.columns()
    parameters = parameter_quantities(columns)
    points = [at_point(point, what) for point in plan.orders.points for what in (STIFFNESS, LOSS_FACTOR)]
    quantities = {quantity.name: quantity for quantity in (*parameters, *OF_FIT.values(), *points)}
    judge = Judge(plan.limits, columns, quantities) if plan.limits else None
    report, name = Report(plan.title), plan.formats.table("batch")
    diagnosed = any(row.settings.diagnosed for row in plan.rows)
    table = Table(parameters, points, verdicts=diagnosed, limits=judge is not None)
    with opened(ready / name, plan.formats.table_form, table.headers) as write:
        for number, (row, record) in enumerate(zip(plan.rows, spool, strict=True)):
            judged = judge(record) if judge and record["status"] == "done" else None
            write(table.row(row, record, judged))
            summary.add(number, row, record, judged)
            if plan.junit:
                report.add(row, record, judged)
    values = {quantity: columns[name] for name, quantity in quantities.items() if name in columns}
    scattered = {quantity: scatter(sizes[np.isfinite(sizes)]) for quantity, sizes in values.items()}
    summary.scatter = {q: (middle * q.factor, spread * q.factor) for q, (middle, spread) in scattered.items()}
    summary.notes += [*(judge.notes if judge else ()), *_notes(summary, name)]
    (ready / "batch.json").write_bytes(to_json(summary.to_file(plan.title, judge)))
    files = _drawn(plan, columns, intervals, quantities, judge, summary.missing) if plan.formats.pictures else {}
    if plan.formats.pages:
        from bushfit.report.page.index import read_batch

        files |= pages_of(read_batch(ready, rows=plan.orders.output))
    for file, content in files.items():
        (ready / file).write_bytes(content)
    return report


def _notes(summary: Summary, table: str) -> Iterator[str]:
    """What a user must know of bushings whose numbers are not to be trusted blindly; a file has the table."""
    names = ", ".join(f"{name} of {times}" for name, times in summary.bounds.most_common())
    unsettled = (
        f"a parameter at rest on a bound of its fit, which the tests do not settle: {names}; see the column on a"
    )
    said = {f"{unsettled} bound": summary.bounded, "warnings of their own: see the column warnings": summary.warned}
    for words, count in said.items():
        if count:
            yield f"{count} bushing{'s' * (count > 1)} with {words} of {table}"


def _drawn(
    plan: Plan,
    columns: dict[str, Array],
    intervals: dict[str, Array],
    quantities: dict[str, Quantity],
    judge: Judge | None,
    missing: Mapping[str, Collection[int]],
) -> dict[str, bytes]:
    """The files of the picture; none where there is nothing to draw."""
    from bushfit.report.plots.batch import Panel, batch_figure

    panels = []
    for name, quantity in quantities.items():
        allowed = judge.allowed.get(name, ()) if judge else ()
        known = np.isfinite(columns.get(name, np.empty(0)))
        if known.sum() >= (1 if allowed else _LEAST_DRAWN):
            shown = quantity.for_people(float(np.median(columns[name][known])))
            values, limits = columns[name] * shown.factor, tuple(limit * shown.factor for limit in allowed)
            out = {number for number in missing.get(name, ()) if known[number]}
            ends = intervals[name] * shown.factor if name in intervals else None
            panels.append(Panel(shown.header, values, limits, out, ends))
    names = [row.name for row in plan.rows]
    drawn = {"batch": lambda: batch_figure(panels, plan.title, names)} if panels else {}
    return plan.formats.files(Contents(pictures=drawn))
