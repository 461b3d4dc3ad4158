"""`bushfit batch`: many campaigns at once."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from bushfit.cli.common import CAMPAIGN_FOLDER, Options, with_options
from bushfit.cli.options import FILE, NO_REPORT, PLOT_FORMAT, TABLE_FORMAT, command_called, place_option
from bushfit.cli.show import new_table
from bushfit.errors import naming
from bushfit.units import alike, for_people

if TYPE_CHECKING:
    from bushfit.batch.manifest import Command
    from bushfit.batch.outcome import Outcome
    from bushfit.batch.pool import Pool

#: Bushings of a kind (failed, out of limits, on the edge) that the terminal names; batch.csv has all.
_MOST_SHOWN = 10
#: Seconds between two lines on progress where standard error is no terminal.
_SECONDS_A_LINE = 10.0


@command_called("batch", '"data/practice/*/bushing.toml" --at "axial 25 Hz 0.1 mm"')
@click.argument("manifest", metavar="MANIFEST", nargs=-1, required=True)
@click.option(
    "--command",
    "commands",
    type=click.Choice(["run", "fit", "diagnose", "predict"]),
    multiple=True,
    metavar="COMMAND",
    help="What to do with each campaign: fit, diagnose, predict, may be given again; or run, the whole chain [fit].",
)
@place_option("Tests to fit, as in bushfit fit.")
@click.option("--effect", "effects", multiple=True, metavar="NAME", help="Add an effect, as in bushfit fit.")
@click.option(
    "--at",
    multiple=True,
    metavar="POINT",
    help='Stiffness and loss factor there, such as "axial 25 Hz 0.1 mm" (zero-to-peak); may be given again.',
)
@click.option("--limits", type=FILE, metavar="FILE", help="Judge each bushing by this TOML file (above).")
@click.option("--junit", type=FILE, metavar="FILE", help="Write a JUnit report for CI.")
@click.option("--jobs", type=click.IntRange(1), help="Worker processes [the cores there are].")
@click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="Work on this Dask cluster, such as tcp://10.0.0.5:8786, whose workers see the same files and paths.",
)
@click.option(
    "--resume",
    is_flag=True,
    help="Go on with the results that stand: do what is missing, failed, or has changed (a test, a setting, bushfit).",
)
@click.option("--tables", is_flag=True, help="Write loops.csv, sweeps.csv and the like of each too.")
@click.option("--plots", is_flag=True, help="Write each bushing's plots too.")
@click.option("--reports", is_flag=True, help="Write report.html of each that is diagnosed too.")
@with_options(CAMPAIGN_FOLDER, TABLE_FORMAT, PLOT_FORMAT, NO_REPORT)
def command(
    manifest: tuple[str, ...],
    commands: tuple[Command, ...],
    directions: tuple[str, ...],
    effects: tuple[str, ...],
    at: tuple[str, ...],
    limits: Path | None,
    junit: Path | None,
    jobs: int | None,
    scheduler: str | None,
    resume: bool,
    tables: bool,
    plots: bool,
    reports: bool,
    options: Options,
) -> None:
    """Fit (diagnose, predict, run) every campaign of MANIFEST: a TOML or CSV list, a pattern in quotes, or campaigns.

    A TOML list has a [[bushings]] table a row: campaign (a file or a pattern, counted from the list's folder), and on
    request name, subgroup, commands, directions, effects, adopt, without, max_effects, tolerance, model. The same keys
    from commands on, and at, may stand at its top for all rows; the options here win over these, a row's own keys over
    both. A CSV list has the keys as columns.

    LIMITS are TOML: nrmse, reduced_chi_square, verdicts; tables [parameters.mu], and [[stiffness]] and [[loss_factor]]
    with at = "axial 25 Hz 0.1 mm", each with min, max, nominal and tolerance, or sigma (standard deviations of the
    batch, where it has at_least bushings). guard = true counts as missed what is only within by its value.

    Work is kept as it finishes: after an interruption the same command with --resume does what is missing. A row that
    fails costs that row; its error stands in the table. --force also removes results of bushings that are no longer
    listed. Exit status 1 where a row failed or a limit is missed.

    Named are bushings that differ from the others by more than chance, what drifts, and with limits the capability.

    Writes batch.csv (a row a bushing), batch.png, batch.json, index.html (control charts, a table to sort), and
    bushings/<name>/ with model.json of each, or all that `bushfit run` writes.
    """
    from bushfit.batch.pool import DaskPool, LocalPool

    # Workers import what they need while this process does.
    workers: Pool = DaskPool(scheduler) if scheduler else LocalPool(jobs or os.cpu_count() or 1)
    from bushfit.batch.limits import check_judged, read_limits
    from bushfit.batch.manifest import Settings, read_manifest
    from bushfit.batch.outcome import Plan
    from bushfit.batch.quantities import parse_point
    from bushfit.batch.run import check_free, run
    from bushfit.batch.work import Orders
    from bushfit.effects import effect_named

    names = tuple(effect_named(name).name for name in effects)
    of_all = Settings(commands=commands or None, directions=directions or None, effects=names or None)
    read = read_manifest(manifest[0], of_all, *manifest[1:])
    judged_by = read_limits(limits) if limits else None
    if limits and judged_by:
        check_judged(judged_by, limits, read.rows)
    with naming(place="--at"):
        points = (*read.points, *map(parse_point, at), *(judged_by.points if judged_by else ()))
    formats = replace(options.formats, tables=tables, pictures=plots and options.formats.pictures, pages=reports)
    output = options.folder(read.stem).absolute()
    orders = Orders(output, tuple(dict.fromkeys(points)), formats, resume)
    plan = Plan(read.stem, read.rows, orders, judged_by, junit, options.formats)
    check_free(plan, force=options.force)
    with _progress(options, len(plan.rows)) as advance:
        outcome = run(plan, workers, advance, lambda outcome: options.print_json(outcome.summary))
    _tell(options, outcome, options.folder(read.stem))
    if outcome.status["failed"] or outcome.missed:
        click.get_current_context().exit(1)


@contextmanager
def _progress(options: Options, total: int) -> Iterator[Callable[[str], None]]:
    """Rate and time left: a bar on a terminal, now and then a line elsewhere."""
    console = options.console
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[failures]}", style="red"),
    )
    begin = said = time.monotonic()
    tenth, count = 0, Counter[str]()
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("bushings", total=total, rate="", failures="")

        def advance(status: str) -> None:
            nonlocal said, tenth
            count[status] += 1
            done, now = count.total(), time.monotonic()
            rate = done / max(now - begin, 1e-9)
            failures = f"{count['failed']} failed" if count["failed"] else ""
            bar.update(task, completed=done, rate=f"{rate:.1f}/s", failures=failures)
            if done == total:
                bar.stop()  # it takes what is printed for its own as long as it stands
            due = now - begin >= _SECONDS_A_LINE and 10 * done // total != tenth
            if not console.is_terminal and (due or now - said >= _SECONDS_A_LINE):
                said, tenth = now, 10 * done // total
                text = f"{done} of {total}, {rate:.1f}/s, {(total - done) / rate:.0f} s left"
                options.say(", ".join(filter(None, (text, failures))))

        yield advance


def _tell(options: Options, outcome: Outcome, folder: Path) -> None:
    """Counts, the batch's own scatter, what failed, what misses limits and what passes on condition."""
    from bushfit.batch.run import KINDS

    console, status, plan = options.console, outcome.status, outcome.plan
    if outcome.scatter:
        table = new_table(f"{plan.title}: {status['done']} bushings", "quantity", "median", "robust std dev", "unit")
        for quantity, (middle, spread) in outcome.scatter.items():
            unit, factor = for_people(quantity.unit, 1.0, middle)
            table.add_row(quantity.name, alike([middle * factor], 4)[0], alike([spread * factor], 2)[0], unit)
        console.print(table)
    rate = status.total() / max(outcome.seconds, 1e-9)
    kept = f", {outcome.kept} of them from before" if outcome.kept else ""
    options.say(f"{status['done']} done{kept}, {status['failed']} failed; {outcome.seconds:.1f} s, {rate:.1f} a second")
    if plan.limits:
        options.say("limits: " + ", ".join(f"{count} {word}" for word, count in outcome.limits.items()))
    options.warn(outcome.notes)
    for name, each in outcome.together.process.items():
        if each["capability"]:
            options.say(f"capability: {name}: {each['capability']}")
    for word, names in (
        ("failed", [f"{name}: {' '.join(error.split())}" for name, error in outcome.errors]),
        ("out of limits", [f"{name}: {words}" for name, words in outcome.missed]),
        ("conditional pass", [f"{name}: {words}" for name, words in outcome.edge]),
        ("differs", [f"{each['name']}: {each['words']}" for each in outcome.together.differ]),
    ):
        for name in names[:_MOST_SHOWN]:
            options.say(f"{word}: {name}")
        if len(names) > _MOST_SHOWN:
            options.say(f"... and {len(names) - _MOST_SHOWN} more {word}: see {options.formats.table('batch')}")
    written = [*(name for name in options.formats.names(KINDS) if (folder / name).exists()), "bushings/"]
    options.say(f"wrote {', '.join(written)} to {folder}")
