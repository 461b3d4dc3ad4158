"""`bushfit scorecard`: the workflow judged on hidden campaigns."""

from __future__ import annotations

import os
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import click

from bushfit.cli.common import Options, example, shared_options
from bushfit.cli.show import new_table

if TYPE_CHECKING:
    from bushfit.scorecard.scorecard import Family


@click.command("scorecard", epilog=example("bushfit scorecard --campaigns 5 --seed 3"))
@click.option("--campaigns", type=click.IntRange(min=5), default=300, show_default=True, help="Hidden campaigns.")
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True, help="Of everything random.")
@click.option("--jobs", type=click.IntRange(min=1), default=os.cpu_count() or 1, show_default=True, help="Cores.")
@click.option(
    "--family",
    type=click.Choice(["effects", "mistakes", "amplitude_sweeps"]),
    default="effects",
    show_default=True,
    help="What is hidden: effects, mistakes in the record, or nothing, in amplitude sweeps.",
)
@partial(shared_options, where="nothing is written")
def command(campaigns: int, seed: int, jobs: int, family: Family, options: Options) -> None:
    """Judge `diagnose` on hidden campaigns of random bushings, and print how often it is right.

    The time-domain rig makes the data: every effect alone, pairs, none, disturbances outside the list, and effects
    that the library is made to lack; or a mistake in what a file says, and none; or clean amplitude sweeps. The truth
    is sealed in files that the workflow does not read, and opened afterwards. With -o the campaigns, the sealed truths
    and scorecard.json stay there.
    """
    from dataclasses import asdict

    from rich.progress import Progress

    from bushfit.report.folder import to_json
    from bushfit.scorecard.scorecard import card, confusion, run, tasks

    folder = options.output
    if folder:
        options.require_free(folder, ["scorecard.json"])
    console = options.console
    chosen = tasks(campaigns, seed, family)
    with (
        TemporaryDirectory() if folder is None else nullcontext(str(folder)) as place,
        Progress(console=console, transient=True, disable=options.quiet) as progress,
    ):
        bar = progress.add_task("hidden campaigns", total=len(chosen))
        outcomes = run(chosen, Path(place), jobs, lambda: progress.advance(bar))
    rows = card(outcomes)
    table = new_table(
        f"score card: {len(chosen)} hidden campaigns ({family}), seed {seed}", "measure", "figure", "over", "target", ""
    )
    for row in rows:
        met = "" if row.met is None else ("met" if row.met else "missed")
        table.add_row(row.measure, row.figure, str(row.over), row.target, met)
    console.print(table)
    for truth, said in confusion(outcomes).items():
        answers = "; ".join(f"{count} x {words}" for words, count in said.most_common())
        options.say(f"{truth}: {answers}")
    for outcome in outcomes:
        if outcome.error:
            options.say(f"failed: {outcome.task}: {outcome.error}")
    document = {
        "campaigns": len(chosen),
        "seed": seed,
        "family": family,
        "card": [asdict(row) for row in rows],
        "confusion": {truth: dict(said) for truth, said in confusion(outcomes).items()},
        "outcomes": [asdict(outcome) for outcome in outcomes],
    }
    if folder:
        options.write(folder, {"scorecard.json": to_json(document)})
    options.tell(document)
