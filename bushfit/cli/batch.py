"""`bushfit batch`: many campaigns at once."""

from __future__ import annotations

import os
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from bushfit.caveat import to_caveats
from bushfit.cli.options import command_called, direction_option, file_option, flag, option, option_group
from bushfit.cli.output import Output, with_output
from bushfit.errors import error_location
from bushfit.units import format_aligned, number, split_header

if TYPE_CHECKING:
    from bushfit.batch.summary import BatchResult

#: Maximum number of parts per verdict (failed, not judged, different) that the terminal lists; batch.csv has all.
_MOST_SHOWN = 10


@command_called("batch", '"data/practice/*/bushing.toml" --at "axial 25 Hz 0.1 mm"')
@click.argument("manifest", metavar="MANIFEST", nargs=-1, required=True)
@option_group(
    "Work on each bushing",
    option(
        "--command commands COMMAND",
        "Command to run for each bushing: fit, diagnose, predict, respond or run [fit].",
        type=click.Choice(["run", "fit", "diagnose", "predict", "respond"]),
        multiple=True,
    ),
    direction_option("fit", "as of `bushfit fit`"),
    option("--effect effects NAME", "Add this effect to each model.", multiple=True),
    option(
        "--at operating_points POINT",
        'Add table columns with stiffness and loss factor at this point, such as "axial 25 Hz 0.1 mm".',
        multiple=True,
    ),
)
@option_group(
    "Limits",
    file_option("--limits", "Judge each bushing by the limits in this TOML file."),
    file_option("--junit", "Write a JUnit report with one test case per bushing, for continuous integration (CI)."),
)
@option_group(
    "Execution",
    flag("--resume", "Evaluate only bushings without results, with an error, or with changed input."),
    option("--jobs N", "Number of worker processes [one per core].", type=click.IntRange(1)),
    option("--scheduler ADDRESS", "Run on the Dask cluster at this address, such as tcp://10.0.0.5:8786."),
)
@option_group(
    "Output",
    flag("--tables"),
    flag("--plots", "Also write the tables (or plots) of each bushing."),
    flag("--reports", "Also write report.html for each bushing that is diagnosed."),
)
@with_output("results/<manifest>", "tables", "pictures", "pages")
def command(
    manifest: tuple[str, ...], limits: Path | None, junit: Path | None, resume: bool, output: Output, **options: Any
) -> None:
    """Evaluate many campaigns and collect the results in one table.

    MANIFEST is a pattern in quotes, several campaigns, or a list: a CSV file with a column per key, or a TOML file:

    \b
        [[bushings]]
        campaign = "batch_7/*/campaign.toml"   # relative to the folder of the list

    The command names bushings that miss a limit, with value and limit, and bushings that differ from the others by more
    than chance. The exit status is 1 if a limit is missed, a bushing could not be evaluated, or its model fits too
    poorly to be judged. Writes batch.csv, batch.png, batch.json, index.html, and bushings/<name>/model.json.
    """
    from bushfit.batch.executor import dask_workers, local_workers

    # Workers import their modules while this process reads the manifest.
    jobs, scheduler = options["jobs"] or os.cpu_count() or 1, options["scheduler"]
    warn = partial(output.messages.print, "warning:", markup=False)
    workers = local_workers(jobs) if scheduler is None else dask_workers(scheduler, warn)
    from bushfit.batch.limits import read_limits
    from bushfit.batch.manifest import RowSettings, read_manifest
    from bushfit.batch.row import RowTask
    from bushfit.batch.run import check_output, run_batch
    from bushfit.batch.summary import BatchPlan
    from bushfit.effects import get_effect
    from bushfit.geometry.point import parse_point

    with error_location(place="--effect"):
        options["effects"] = tuple(get_effect(name).name for name in options["effects"])
    settings = RowSettings(**{key: options[key] or None for key in ("commands", "directions", "effects")})
    listed = read_manifest(manifest[0], settings, *manifest[1:])
    judged_by = read_limits(limits, listed.rows) if limits else None
    with error_location(place="--at"):
        points = [*listed.points, *map(parse_point, options["operating_points"])]
    if judged_by:
        points += [limit.at for _, limit in judged_by.at_points]
    pictures = options["plots"] and output.formats.pictures
    formats = replace(output.formats, tables=options["tables"], pictures=pictures, pages=options["reports"])
    folder = output.folder(listed.title)
    task = RowTask(folder.absolute(), tuple(dict.fromkeys(points)), formats, resume)
    plan = BatchPlan(listed.title, listed.rows, task, judged_by, junit, output.formats)
    check_output(plan, force=output.force)
    result = run_batch(plan, workers, lambda result: output.print_json(result.summary))
    _print_result(output, result, folder)
    if result.document.failed or result.document.missed or result.document.not_judged:
        click.get_current_context().exit(1)


def _print_result(output: Output, result: BatchResult, folder: Path) -> None:
    """Print the verdict, the parts that need attention, and the scatter and capability of each quantity."""
    from bushfit.batch.run import FILES

    document, table = result.document, output.formats.table("batch")
    output.print(f"{document.title}: {document.headline}")
    parts = document.parts
    sentences = {
        "fail": [f"{part.name} fails: {'; '.join(part.misses.values())}" for part in parts if part.misses],
        "are not judged": [
            f"{part.name} is not judged: {part.poor_fit or '; '.join(part.doubtful.values())}"
            for part in parts
            if part.result == "not judged"
        ],
        "could not be evaluated": [f"{part.name} could not be evaluated: {part.error}" for part in parts if part.error],
        "differ": [f"{part.name} differs from the others: {part.differs}" for part in parts if part.differs],
        "pass conditionally": [
            f"{part.name}: {'; '.join(part.doubtful.values())}" for part in parts if part.name in document.conditional
        ],
    }
    for attention, lines in sentences.items():
        for line in lines[:_MOST_SHOWN]:
            output.print(line)
        if len(lines) > _MOST_SHOWN:
            output.print(f"... and {len(lines) - _MOST_SHOWN} more that {attention}: see {table}")
    output.warn(to_caveats(document.warnings, document.warning_kinds))
    rows = []
    for header, quantity in document.quantities.items():
        name, unit = split_header(header)
        scatter = format_aligned([quantity.sigma], 2)[0] if quantity.parts > 1 and quantity.sigma else ""
        indices = ["" if index is None else number(index[0], 3) for index in (quantity.cp, quantity.cpk)]
        rows.append((name, format_aligned([quantity.median], 4)[0], scatter, unit or "-", *indices))
    columns = ("quantity", "median", "robust std dev", "unit", "Cp, with outliers", "Cpk, with outliers")
    column_count = len(columns) if any(row[-1] for row in rows) else 4
    if rows:
        counted = f"{document.title}: {document.done} bushing{'s' * (document.done > 1)}"
        counted += ", too few to show whether one differs" * (document.done > 1 and not document.detectable)
        output.print_table(counted, columns[:column_count], [row[:column_count] for row in rows])
    from_before = f", {result.kept_count} of them from an earlier run" if result.kept_count else ""
    errors = f"{len(document.failed)} with an error"
    output.print(f"{document.done} evaluated{from_before}, {errors}, in {result.seconds:.1f} s")
    if document.limits:
        counts = ", ".join(f"{count} {word}" for word, count in document.limits.items())
        explanation = " (conditional: the 95 % interval crosses the limit)" if "conditional" in counts else ""
        output.print(f"limits: {counts}{explanation}")
    written = [*(name for name in FILES if (folder / name).exists()), "bushings/"]
    output.print(f"wrote {', '.join(written)} to {folder}")
