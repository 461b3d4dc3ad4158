"""`python -m tests.scorecard`: the workflow judged on hidden campaigns."""

from __future__ import annotations

import os
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import click
from rich.progress import Progress
from typing_extensions import TypedDict

from bushfit import __version__
from bushfit.cli.output import Output
from bushfit.report.results import ResultFile, check_free, to_json
from bushfit.validation import to_json_data
from cards.card import Row, card
from cards.families import CARD_SEEDS, FAMILIES, Family, tasks
from cards.outcome import Outcome
from cards.scorecard import run

#: What a score card writes.
SCORECARD = "scorecard.json"


class Scorecard(TypedDict):
    """How often diagnose is right on hidden campaigns, key by key.

    Args:
        schema: of this file.
        version: of bushfit that made it.
        families: of hidden campaigns.
        campaigns: how many of each family.
        seed: of everything random.
        session: hours of the session that is planned, and simulated, where effects are left open; null for none.
        card: the measures of each family, with their targets.
        outcomes: every campaign.
    """

    schema: Literal["bushfit/scorecard/3"]
    version: str
    families: list[str]
    campaigns: int
    seed: int
    session: float | None
    card: dict[Family, list[Row]]
    outcomes: list[Outcome]


@click.command("scorecard", context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--campaigns", type=click.IntRange(5), default=300, show_default=True, help="Of each family.")
@click.option("--seed", type=click.IntRange(0), default=1, show_default=True, help="Of everything random.")
@click.option("--jobs", type=click.IntRange(1), default=os.cpu_count() or 1, show_default=True, help="Cores.")
@click.option("--family", type=click.Choice([*FAMILIES, "all"]), default="effects", show_default=True)
@click.option(
    "--session",
    type=click.FloatRange(0.0, 2000.0, min_open=True),
    metavar="HOURS",
    help="Where effects are left open, plan tests within so many hours, simulate them and diagnose again.",
)
@click.option("--keep", is_flag=True, help="Keep the campaigns and the sealed truths, in -o/campaigns.")
@click.option("-o", "--output", type=click.Path(path_type=Path), help="Folder for the results [nothing is written].")
@click.option("-v", "--verbose", is_flag=True)
@click.option("-q", "--quiet", is_flag=True)
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON on standard output.")
@click.option("--force", is_flag=True, help="Replace results that stand.")
def command(campaigns: int, seed: int, jobs: int, family: str, session: float | None, keep: bool, **given: Any) -> None:
    """Judge `diagnose` on hidden campaigns of random bushings, and print how often it is right.

    The time-domain rig makes the data. Families: effects (every effect alone, pairs, none, and what the library lacks
    or is made to lack), mistakes (in what a file says), awkward (clean, with the noise and the plans of real rigs),
    faults (of rigs), outside (laws that the library never gains), library (effects of any size). Laws of effects in
    time are shared with the fit, those of outside are not. The truth is sealed in files that the workflow does not
    read, and opened afterwards.

    A target is met where the whole 95 % interval of the rate lies within it; told odds are true where the interval of
    the share right holds them. -o takes scorecard.json. Seeds from 77000 on are kept for cards that are shown; try and
    tune with others.
    """
    output = Output(no_plots=True, **given)
    folder = output.output
    if keep and folder is None:
        raise click.UsageError("--keep needs a folder: -o/--output")
    if folder:
        check_free(folder, [SCORECARD], overwrite=output.force)
    kept = folder / "campaigns" if folder and keep else None
    outcomes = {}
    for each in (name for name in FAMILIES if family in (name, "all")):
        chosen = tasks(campaigns, seed, each)
        with Progress(console=output.console, transient=True, disable=output.quiet) as progress:
            bar = progress.add_task("hidden campaigns", total=len(chosen))
            outcomes[each] = run(chosen, kept, jobs, lambda _, at=bar, told=progress: told.advance(at), session)
    cards = {name: card(found, name) for name, found in outcomes.items()}
    purpose = "kept for shown cards" if seed >= CARD_SEEDS else "for working"
    for name, rows in cards.items():
        title = f"score card: {len(outcomes[name])} hidden campaigns ({name}), seed {seed}, {purpose}"
        cells = []
        for row in rows:
            open_ = "too few to say" if row.target and row.over else ""
            met = open_ if row.met is None else ("met" if row.met else "missed")
            cells.append((row.measure, row.figure, str(row.over), row.target, met))
        output.print_table(title, ("measure", "figure", "over", "target", ""), cells)
        for test, count in Counter(outcome.decides for outcome in outcomes[name] if outcome.decides).most_common():
            output.print(f"{count} x to be decided elsewhere: {test}")
        for outcome in outcomes[name]:
            if outcome.error:
                output.print(f"failed: {outcome.task}: {outcome.error}")
    whole: Scorecard = {
        "schema": "bushfit/scorecard/3",
        "version": __version__,
        "families": list(outcomes),
        "campaigns": campaigns,
        "seed": seed,
        "session": session,
        "card": cards,
        "outcomes": [outcome for found in outcomes.values() for outcome in found],
    }
    document = to_json_data(whole, Scorecard)
    if folder:
        replace(output, force=True).write(folder, [ResultFile(SCORECARD, "raw", to_json(document))], document)
    else:
        output.print_json(document)
