"""`bushfit diagnose`: where model and tests disagree, and which effect is missing."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from rich.markup import escape

from bushfit.caveat import join_names
from bushfit.cli.options import TYPED, command_called, file_option, option, option_group
from bushfit.cli.output import Output, with_output
from bushfit.cli.printing import print_parameters, print_tests, print_validations
from bushfit.cli.shared_options import campaign_options, exit_above, open_campaign, quantity
from bushfit.errors import quote_path
from bushfit.units import number

if TYPE_CHECKING:
    from bushfit.commands.diagnose import DiagnosisOutput

#: Title of the regions in which model and tests disagree.
_WHERE = "where tests and plain model disagree (size of the smooth part of the gap, in standard errors σ)"
#: Terminal colours of the verdicts.
_COLOURS = {"consistent": "green", "named": "green", "unexplained": "red"}


@command_called("diagnose", "configs/mystery_mount.toml")
@option_group(
    "What may be missing",
    option(
        "--max-effects N", "Largest number of effects to add to the model [3].", type=click.IntRange(0, 5), default=3
    ),
    option(
        "--adopt EFFECT",
        "Add this effect, such as inertia, or correct this mistake in a test file, such as "
        "peak_to_peak:sweep_axial. To list all names, state an unknown one.",
        multiple=True,
    ),
    option("--without EFFECT", "Exclude this effect or mistake from the search.", multiple=True),
    option(
        "--tolerance SHARE",
        "Ignore differences between tests and model below this share of the stiffness [1 %].",
        type=quantity("1", "0 % to 100 %", lambda share: 0.0 <= share <= 1.0),
        default="1 %",
    ),
    file_option("--model", "Start from the model in this model.json [the paper's model]."),
)
@campaign_options
@with_output("results/<campaign name>/diagnose", "tables", "pictures", "pages")
def command(
    campaigns: tuple[Path, ...], model: Path | None, max_nrmse: float | None, output: Output, **settings: Any
) -> None:
    """Find where the model and the tests of CAMPAIGN disagree, name the missing effect, and add it.

    All tests in all directions are used. The verdict is consistent (nothing is missing), named (one explanation was
    found), ambiguous (several explanations are possible), described (no known effect, but a smooth correction fits),
    partly (a part of the difference stays unexplained) or unexplained. A named effect is added to the model. A mistake
    in a test file, such as a wrong unit, is reported; with --adopt, the fit uses the corrected values.

    Writes diagnosis.json, model.json with the added effects, gap.csv, candidates.csv, gap.png, report.html.
    """
    from bushfit.commands.diagnose import diagnose
    from bushfit.commands.loading import load_model
    from bushfit.commands.provenance import input_files
    from bushfit.effects.mistakes import get_candidate

    start = load_model(model) if model else None
    campaign = open_campaign(campaigns)
    for name in (*settings["adopt"], *settings["without"]):
        get_candidate(name)
    folder = output.folder(campaign.name, "diagnosis.json", "model.json")
    diagnosed = diagnose(campaign, model=start, **settings)
    output.warn(diagnosed.data.notes)
    print_diagnosis(output, diagnosed, click.get_current_context().meta[TYPED])
    output.write(folder, diagnosed.files, diagnosed.document, input_files(campaign, model))
    exit_above(max_nrmse, diagnosed.result)


def print_diagnosis(output: Output, diagnosed: DiagnosisOutput, typed: str) -> None:
    """Print a diagnosis: verdict, gap (root mean square residual in units of noise), next test, and details.

    Args:
        output: output of the command.
        diagnosed: the diagnosis.
        typed: command that the user typed.
    """
    from bushfit.effects import BASE
    from bushfit.effects.unnamed import effect_label

    diagnosis = diagnosed.diagnosis
    print_verdict(output, diagnosed, typed + " --force" * ("--force" not in typed.split()))
    print_findings(output, diagnosed)
    print_validations(output, diagnosed.validations)
    for effect in diagnosed.document["effects"] if diagnosis.verdict != "ambiguous" else ():
        output.console.print(f"  [bold]why {effect_label(effect['name'])}:[/bold] {escape(effect['evidence'])}")
    print_tests(output, (), diagnosis.result.usable)
    if tuple(diagnosis.result.model.effects) != BASE or output.verbose:
        print_parameters(output, "fitted model", diagnosis.result)
    output.warn(diagnosis.warnings)


def print_verdict(output: Output, diagnosed: DiagnosisOutput, again: str, action: str = "") -> None:
    """Print the verdict of a diagnosis, the next step, a summary, and probabilities of missing effects.

    Args:
        output: output of the command.
        diagnosed: the diagnosis.
        again: command that repeats the diagnosis, to which effects to adopt are added.
        action: next step; "" for the permitted use of the numbers.
    """
    from bushfit.diagnosis.record import format_odds
    from bushfit.report.diagnosed import permitted_use

    colour, use = _COLOURS.get(diagnosed.headline, "yellow"), permitted_use(diagnosed.document)
    output.print_headline(diagnosed.data.campaign.name, diagnosed.headline, action or use, f"bold {colour}")
    lines = [use] if action and colour != "green" else []
    lines += [*diagnosed.diagnosis.summary.split("; "), *format_odds(diagnosed.document)]
    if labels := diagnosed.adoptable_names:
        is_open, included = diagnosed.diagnosis.verdict == "ambiguous", diagnosed.result.model.effects
        uncertain = [label for label in labels if is_open and label not in included]
        source = "the records" if any(effect["correction"] for effect in diagnosed.document["effects"]) else "tests"
        for answer, option, names in (("confirm", "--adopt", labels), ("exclude", "--without", uncertain)):
            if options := "".join(f" {option} {quote_path(name)}" for name in names):
                lines.append(f"if {source} {answer} {join_names(names)}: {again}{options}")
    for line in lines:
        output.console.print(f"  {escape(line)}")


def print_findings(output: Output, diagnosed: DiagnosisOutput) -> None:
    """Print the named effects with their sizes, the gap (rms residual / noise), its location, and the next test.

    The size of an effect that the fitted model includes is among the parameters of the model.
    """
    from bushfit.effects.unnamed import effect_label
    from bushfit.report.parameters import effect_sizes

    console, diagnosis, document = output.console, diagnosed.diagnosis, diagnosed.document
    for effect in document["effects"]:
        test = f" in {effect['test']}" if effect["test"] else ""
        level = "bushing or rig" if effect["level"] == "unresolved" else effect["level"]
        title = f"[bold]{effect_label(effect['name'])}[/bold]{escape(test)}"
        console.print(f"  {title} ({level}): {escape(effect['sentence'])}")
        in_model = effect["name"] in diagnosis.result.model.effects
        for parameter, value, interval in () if in_model else effect_sizes(effect):
            error = f"95 % {interval}" if interval else "error not known: do not quote this value"
            console.print(f"    {parameter} = {value}, {error}")
        if effect["correction"]:
            console.print(f"    correction in the campaign: {escape(effect['correction'])}")
    _print_gap(output, document)
    for title, regions in ((_WHERE, diagnosis.where), ("what remains", diagnosis.remainder)):
        if regions and not (title == "what remains" and diagnosis.remainder == diagnosis.where):
            console.print(f"  [bold]{title}[/bold]")
            for region in regions:
                console.print(f"    {number(region.excess, 2):>5} σ: {escape(region.sentence)}")
    if diagnosis.next_test:
        console.print(f"  [bold]next test:[/bold] {escape(diagnosis.next_test)}")
    if diagnosed.rivals:
        campaign = diagnosed.data.campaign
        plan = output.command(f"plan {quote_path(campaign.path)} --rivals {','.join(diagnosed.rivals)}", campaign.name)
        output.print(f"  or, with tests of the bushing alone, plan tests that distinguish the causes: {plan}")


def _print_gap(output: Output, document: Mapping[str, Any]) -> None:
    """Print the gap (misfit in units of noise) for held-out and fitted data, from the content of diagnosis.json."""
    gap = document["gap"]
    held_out = gap["heldout"]
    cells = [f"{held_out[when]:.2f}" for when in ("before", "after")] if held_out else ["not testable", ""]
    rows = (("held out", *cells), ("data fitted", *(f"{value:.2f}" for value in gap["calibration"].values())))
    title = "gap (measured minus model) in units of the noise; 1: noise alone"
    if any(effect["correction"] for effect in document["effects"]):
        title += "; after: with the corrected record"
    output.print_table(title, ("", "before", "after"), rows)
    if output.verbose:
        for part in gap["skipped"]:
            output.console.print(f"  not held out: {part['part']}; {part['reason']}")
