"""`bushfit diagnose`: where do model and measurement disagree, and what is missing?"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from bushfit.cli.common import Options, Task, campaign_options, example, naming_option, open_model, path_option
from bushfit.cli.show import new_table, parameter_table, warn
from bushfit.errors import BushfitError
from bushfit.units import alike, for_people, quantity

if TYPE_CHECKING:
    from bushfit.jobs.diagnose import Diagnosed

#: Colours of the verdicts on a terminal.
_COLOURS = {"consistent": "green", "named": "green", "ambiguous": "yellow", "partly": "yellow", "unexplained": "red"}


@click.command("diagnose", epilog=example("bushfit diagnose configs/mystery_mount.toml"))
@path_option("--model", help="Start from this model's effects [the paper's three]; its values are fitted anew.")
@click.option(
    "--adopt",
    multiple=True,
    metavar="EFFECT",
    help="Add this effect by hand, such as inertia, or mend a mistake in the record of a test, such as "
    "peak_to_peak:sweep_axial; may be given again.",
)
@click.option(
    "--without", multiple=True, metavar="EFFECT", help="Do not consider this effect or mistake; may be given again."
)
@click.option("--max-effects", type=click.IntRange(0, 5), default=3, show_default=True, help="Effects to add at most.")
@click.option("--tolerance", default="1 %", show_default=True, help="Gaps below this share of |K| do not count.")
@partial(campaign_options, soft_l1="the same with outliers left out")
def command(
    model: Path | None,
    adopt: tuple[str, ...],
    without: tuple[str, ...],
    max_effects: int,
    tolerance: str,
    task: Task,
) -> None:
    """Find where the model and the tests of CAMPAIGN disagree, name the missing effect, add it, show the gap shrink.

    All tests are used, in every direction. The verdict is one of: consistent (nothing is missing), named (what was
    added closes the gap; or the tests agree if one of them was recorded wrongly, which is told and never mended unless
    adopted), ambiguous (look-alikes: all are listed, none is added), partly (a remainder stays) or unexplained (no
    known effect closes the gap; the model is left as it was).

    Writes diagnosis.json, model.json with what was added, gap.csv, candidates.csv and gap.png.
    """
    from bushfit.diagnosis.record import Settings
    from bushfit.jobs.diagnose import Diagnose

    settings = Settings(max_effects, _share(tolerance), adopt, without)
    task.perform(Diagnose(settings, open_model(model).model if model else None), tell_diagnosis)


def _share(text: str) -> float:
    with naming_option("--tolerance"):
        share = quantity(text, "1")
        if not 0.0 <= share <= 1.0:
            raise BushfitError("this is no share of |K|", found=f'"{text}"', expected="0 % to 100 %")
    return share


def tell_diagnosis(options: Options, name: str, outcome: Diagnosed) -> None:
    """The finding at a glance: verdict, names with sizes, gap before and after, where, and what to do next."""
    diagnosis = outcome.diagnosis
    tell_verdict(options, name, outcome)
    tell_findings(options, outcome)
    if diagnosis.added or options.verbose:
        title = "model with what was added" if diagnosis.added else "model as it was"
        options.console.print(parameter_table(title, diagnosis.result))
    warn(options, (*diagnosis.notes, *diagnosis.result.warnings))


def tell_verdict(options: Options, name: str, outcome: Diagnosed) -> None:
    """The verdict in a word and in a sentence."""
    from rich.markup import escape

    verdict = outcome.diagnosis.verdict
    options.console.print(f"[bold]{escape(name)}:[/bold] [bold {_COLOURS[verdict]}]{verdict}[/]")
    options.console.print(f"  {escape(outcome.diagnosis.summary)}")


def tell_findings(options: Options, outcome: Diagnosed) -> None:
    """The effects named, the gap before and after, where it is, and the next test."""
    from rich.markup import escape

    console, diagnosis = options.console, outcome.diagnosis
    for effect in outcome.document["effects"]:
        _tell_effect(options, effect)
    table = new_table("gap, in units of noise (1 is the floor)", "", "before", "after")
    table.add_row("data fitted", *(f"{value:.2f}" for value in diagnosis.calibration))
    table.add_row("held out", f"{diagnosis.holdout.before:.2f}", f"{diagnosis.holdout.after:.2f}")
    console.print(table)
    for title, regions in (("where", diagnosis.where), ("what remains", diagnosis.remainder)):
        if regions and not (title == "what remains" and diagnosis.remainder == diagnosis.where):
            console.print(f"  [bold]{title}[/bold]")
            for where in regions:
                console.print(f"    {where.excess:5.1f} x noise: {escape(where.reading)}")
    if diagnosis.next_test:
        console.print(f"  [bold]next test:[/bold] {escape(diagnosis.next_test)}")


def _tell_effect(options: Options, effect: Mapping[str, Any]) -> None:
    """One effect that was named, as an entry of the document: its physics, sizes, evidence and look-alikes."""
    from rich.markup import escape

    console = options.console
    test = f" in {effect['test']}" if effect["test"] else ""
    console.print(f"  [bold]{effect['name']}[/bold]{escape(test)} ({effect['level']}): {escape(effect['sentence'])}")
    for parameter, entry in effect["parameters"].items():
        unit, factor = for_people(entry["unit"], 1.0, entry["value"])
        value, *ends = alike([factor * x for x in (entry["value"], *(entry["ci95"] or ()))], 4, least=2)
        size = f"{value} {unit}".removesuffix(" -")
        console.print(f"    {parameter} = {size}" + (f", 95 % {' to '.join(ends)}" if ends else ""))
    console.print(f"    {escape(effect['evidence'])}")
    if effect["correction"]:
        console.print(f"    the line that puts it right: {escape(effect['correction'])}")
    if effect["alternatives"]:
        console.print(f"    cannot be told from: {escape(', '.join(effect['alternatives']))}")
    if effect["richer"]:
        console.print(f"    the simpler name; a limit of {', '.join(effect['richer'])}, which these tests do not show")
