"""`bushfit batch`: many campaigns at once."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from bushfit.cli.options import command_called, effect_option, file_option, flag, option, place_option, under
from bushfit.cli.output import Output, with_output
from bushfit.errors import error_location
from bushfit.units import display_unit, format_aligned

if TYPE_CHECKING:
    from bushfit.batch.manifest import Command
    from bushfit.batch.outcome import Outcome
    from bushfit.batch.pool import Pool

#: Bushings of a kind (failed, out of limits, on the edge) that the terminal names; batch.csv has all.
_MOST_SHOWN = 10


@command_called("batch", '"data/practice/*/bushing.toml" --at "axial 25 Hz 0.1 mm"')
@click.argument("manifest", metavar="MANIFEST", nargs=-1, required=True)
@under(
    "What is done with each",
    option(
        "--command commands",
        "COMMAND",
        "fit, diagnose, predict or run; may be given again [fit].",
        type=click.Choice(["run", "fit", "diagnose", "predict"]),
        multiple=True,
    ),
    place_option("Tests to fit, as in bushfit fit."),
    effect_option("Add an effect, as in bushfit fit."),
    option("--at", "POINT", 'Stiffness and loss factor at "axial 25 Hz 0.1 mm"; may be given again.', multiple=True),
)
@under(
    "Limits",
    file_option("--limits", "Judge each bushing by the limits in this TOML file."),
    file_option("--junit", "Write a JUnit report for CI."),
)
@under(
    "How the work is done",
    flag("--resume", "Do what is missing, failed or changed, keep the rest."),
    option("--jobs", "N", "Worker processes [the cores there are].", type=click.IntRange(1)),
    option("--scheduler", "ADDRESS", "Work on this Dask cluster, such as tcp://10.0.0.5:8786."),
)
@under(
    "Output",
    flag("--tables"),
    flag("--plots", "Those of each bushing, too."),
    flag("--reports", "The page of each bushing that is diagnosed, too."),
)
@with_output("results/<manifest>", "tables", "pictures", "pages")
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
    output: Output,
) -> None:
    """Fit (diagnose, predict, run) many campaigns, with a row each in one table.

    MANIFEST is a list (TOML, or CSV with the same keys as columns), a pattern in quotes, or campaigns, be it one:

    \b
        [[bushings]]
        campaign = "batch_7/*/campaign.toml"   # from the list's folder

    Named are bushings that differ from the others by more than chance, what drifts, and with limits the capability.
    --force also removes results of bushings that are no longer listed. Exit status 1 where a row failed or a limit is
    missed. Writes batch.csv, batch.png, batch.json, index.html (control charts), and bushings/<name>/model.json.
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
    from bushfit.effects import get_effect

    names = tuple(get_effect(name).name for name in effects)
    of_all = Settings(commands=commands or None, directions=directions or None, effects=names or None)
    read = read_manifest(manifest[0], of_all, *manifest[1:])
    judged_by = read_limits(limits) if limits else None
    if limits and judged_by:
        check_judged(judged_by, limits, read.rows)
    with error_location(place="--at"):
        points = (*read.points, *map(parse_point, at), *(judged_by.points if judged_by else ()))
    formats = replace(output.formats, tables=tables, pictures=plots and output.formats.pictures, pages=reports)
    orders = Orders(output.folder(read.stem).absolute(), tuple(dict.fromkeys(points)), formats, resume)
    plan = Plan(read.stem, read.rows, orders, judged_by, junit, output.formats)
    check_free(plan, force=output.force)
    outcome = run(plan, workers, lambda outcome: output.print_json(outcome.summary))
    _tell(output, outcome, output.folder(read.stem))
    if outcome.status["failed"] or outcome.missed:
        click.get_current_context().exit(1)


def _tell(output: Output, outcome: Outcome, folder: Path) -> None:
    """Counts, the batch's own scatter, what failed, what misses limits and what passes on condition."""
    status, plan = outcome.status, outcome.plan
    if outcome.scatter:
        rows = []
        for quantity, (middle, spread) in outcome.scatter.items():
            unit, factor = display_unit(quantity.unit, 1.0, middle)
            scatter = format_aligned([spread * factor], 2)[0] if spread else ""  # one value tells of none
            rows.append((quantity.name, format_aligned([middle * factor], 4)[0], scatter, unit))
        columns = ("quantity", "median", "robust std dev", "unit")
        output.print_table(f"{plan.title}: {status['done']} bushing{'s' * (status['done'] > 1)}", columns, rows)
    rate = status.total() / max(outcome.seconds, 1e-9)
    kept = f", {outcome.kept} of them from before" if outcome.kept else ""
    output.print(
        f"{status['done']} done{kept}, {status['failed']} failed; {outcome.seconds:.1f} s, {rate:.1f} a second"
    )
    if plan.limits:
        output.print(
            "limits: " + (", ".join(f"{count} {word}" for word, count in outcome.limits.items()) or "none judged")
        )
    output.print_warnings(outcome.notes)
    for name, each in outcome.together.process.items():
        if each["capability"]:
            output.print(f"capability: {name}: {each['capability']}")
    for word, names in (
        ("failed", [f"{name}: {'; '.join(map(str.strip, error.splitlines()))}" for name, error in outcome.errors]),
        ("out of limits", [f"{name}: {words}" for name, words in outcome.missed]),
        ("conditional pass", [f"{name}: {words}" for name, words in outcome.edge]),
        ("differs", [f"{each['name']}: {each['words']}" for each in outcome.together.differ]),
    ):
        for name in names[:_MOST_SHOWN]:
            output.print(f"{word}: {name}")
        if len(names) > _MOST_SHOWN:
            output.print(f"... and {len(names) - _MOST_SHOWN} more {word}: see {output.formats.table('batch')}")
    names = [name for file in outcome.files for name in output.formats.names(file)]
    written = [*(name for name in names if (folder / name).exists()), "bushings/"]
    output.print(f"wrote {', '.join(written)} to {folder}")
