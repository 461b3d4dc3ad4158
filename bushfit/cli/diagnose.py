"""`bushfit diagnose`: where do model and measurement disagree, and what is missing?"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from rich.markup import escape

from bushfit.cli.common import Options, Task, open_model, with_task
from bushfit.cli.options import command_called, explanations, file_option, option, under
from bushfit.cli.show import tell_parameters, tell_table
from bushfit.errors import BushfitError, error_location
from bushfit.units import display_unit, format_aligned, number, parse_quantity

if TYPE_CHECKING:
    from bushfit.diagnosis.record import Diagnosis
    from bushfit.jobs.diagnose import Diagnosed

#: Colours of the verdicts on a terminal.
_COLOURS = {"consistent": "green", "named": "green", "unexplained": "red"}


@command_called("diagnose", "configs/mystery_mount.toml")
@under(
    "What may be missing",
    option("--max-effects", "N", "Effects to add at most [3].", type=click.IntRange(0, 5), default=3),
    option(
        "--adopt",
        "EFFECT",
        (
            "Add this effect, such as inertia, or mend this mistake in the record of a test, such as "
            "peak_to_peak:sweep_axial; may be given again. A wrong EFFECT lists all."
        ),
        multiple=True,
        shell_complete=explanations,
    ),
    option(
        "--without",
        "EFFECT",
        "Do not consider this effect or mistake; may be given again.",
        multiple=True,
        shell_complete=explanations,
    ),
    option("--tolerance", "SHARE", "Gaps below this share of the stiffness do not count [1 %].", default="1 %"),
    file_option("--model", "Start from the effects of this model.json [the paper's three]."),
)
@with_task("pages", soft_l1="the same with outliers left out")
def command(
    model: Path | None, adopt: tuple[str, ...], without: tuple[str, ...], max_effects: int, tolerance: str, task: Task
) -> None:
    """Find where the model and the tests of CAMPAIGN disagree, name the missing effect, add it, show the gap shrink.

    All tests are used, in every direction. The verdict is consistent (nothing is missing), named (what was added, or
    one test recorded wrongly, closes the gap), ambiguous (look-alikes: all are listed, none is added), described (no
    name, but a smooth correction), partly (a little remains) or unexplained. Mistakes are told, and mended by --adopt.

    Writes diagnosis.json, model.json with what was added, gap.csv, candidates.csv, gap.png, report.html.
    """
    from bushfit.diagnosis.record import Settings
    from bushfit.jobs.diagnose import Diagnose

    start = open_model(model) if model else None
    with error_location(place="--tolerance"):
        share = parse_quantity(tolerance, "1")
        if not 0.0 <= share <= 1.0:
            raise BushfitError("this is no share of |K|", found=f'"{tolerance}"', expected="0 % to 100 %")
    settings = Settings(max_effects, share, adopt, without, start.unresolved if start else ())
    task.perform(Diagnose(settings, start.model if start else None), tell_diagnosis)


def tell_diagnosis(options: Options, name: str, outcome: Diagnosed) -> None:
    """The finding at a glance: the result with its gap, where it is, the next test, and then the details."""
    diagnosis = outcome.diagnosis
    tell_verdict(options, name, outcome)
    tell_findings(options, outcome)
    for effect in outcome.document["effects"]:
        options.console.print(f"  [bold]why {effect['name']}:[/bold] {escape(effect['evidence'])}")
    if options.verbose:
        _tell_candidates(options, diagnosis)
    if diagnosis.added or options.verbose:
        title = "model with what was added" if diagnosis.added else "model as it was"
        tell_parameters(options, title, diagnosis.result)
    options.warn(outcome.document["warnings"])


def tell_verdict(options: Options, name: str, outcome: Diagnosed) -> None:
    """The verdict in a word, with what stays unknown, in a sentence, and how probable what may be missing is."""
    from bushfit.diagnosis.record import odds_in_words

    colour = _COLOURS.get(outcome.headline, "yellow")
    options.console.print(f"[bold]{escape(name)}:[/bold] [bold {colour}]{escape(outcome.headline)}[/]")
    for line in (outcome.diagnosis.summary, *odds_in_words(outcome.document)):
        options.console.print(f"  {escape(line)}")


def tell_findings(options: Options, outcome: Diagnosed) -> None:
    """The effects named with their sizes, the gap before and after, what is usable, where it is, and the next test."""
    console, diagnosis, document = options.console, outcome.diagnosis, outcome.document
    for effect in document["effects"]:
        _tell_effect(options, effect)
    _tell_gap(options, document)
    for title, regions in (("where", diagnosis.where), ("what remains", diagnosis.remainder)):
        if regions and not (title == "what remains" and diagnosis.remainder == diagnosis.where):
            console.print(f"  [bold]{title}[/bold]")
            for where in regions:
                console.print(f"    {where.excess:5.1f} x noise: {escape(where.reading)}")
    if diagnosis.next_test:
        console.print(f"  [bold]next test:[/bold] {escape(diagnosis.next_test)}")


def _tell_gap(options: Options, document: Mapping[str, Any]) -> None:
    """The gap, held out first, and within what the model is usable."""
    gap, usable, console = document["gap"], document["usable"], options.console
    held = gap["heldout"]
    held_out = [f"{held[when]:.2f}" for when in ("before", "after")] if held else ["not testable", ""]
    rows = (("held out", *held_out), ("data fitted", *(f"{value:.2f}" for value in gap["calibration"].values())))
    tell_table(options, "gap, in units of noise (1 is the floor)", ("", "before", "after"), rows)
    if usable:
        how = "of what was predicted from other runs" if usable["held_out"] else "of what was fitted"
        words = f"{number(100 * usable['stiffness'], 2)} % of stiffness and {number(usable['loss_factor'], 2)}"
        console.print(f"  usable within {words} of loss factor (95 % {how})")
    if options.verbose:
        for part in gap["skipped"]:
            console.print(f"  not held out: {part['part']}; {part['reason']}")


def _tell_effect(options: Options, effect: Mapping[str, Any]) -> None:
    """One effect that was named, as an entry of the document: its physics, sizes, evidence and look-alikes."""
    console = options.console
    test = f" in {effect['test']}" if effect["test"] else ""
    console.print(f"  [bold]{effect['name']}[/bold]{escape(test)} ({effect['level']}): {escape(effect['sentence'])}")
    for parameter, entry in effect["parameters"].items():
        unit, factor = display_unit(entry["unit"], 1.0, entry["value"])
        value, *ends = format_aligned(
            [factor * x for x in (entry["value"], *(entry["ci95"] or ()))], 4, minimum_digits=2
        )
        sure = f"95 % {' to '.join(ends)}" if ends else "without an interval"
        console.print(f"    {parameter} = {f'{value} {unit}'.removesuffix(' -')}, {sure}")
    if effect["twins"]:
        names = " or ".join((effect["name"], *effect["twins"]))
        if effect["alternatives"]:
            console.print(f"    whether it is {names}, the tests do not tell")
        else:
            console.print(f"    how large it is, the tests tell; whether it is {names}, they do not")
    if effect["correction"]:
        console.print(f"    the line that puts it right: {escape(effect['correction'])}")
    if effect["alternatives"]:
        console.print(f"    cannot be told from: {escape(', '.join(effect['alternatives']))}")


def _tell_candidates(options: Options, diagnosis: Diagnosis) -> None:
    """Every candidate that was refitted, and why it won or lost."""
    title = "candidates: what each takes off chi-square, and how probably it is part of what is missing"
    known = ((each, each.gain) for each in diagnosis.candidates if each.gain is not None)
    rows = ((each.name, each.why, f"{gain:.0f}", f"{each.probability:.2f}") for each, gain in known)
    tell_table(options, title, ("candidate", "why", "gain", "probability"), rows, names=2)
