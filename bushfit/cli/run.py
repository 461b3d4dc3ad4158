"""`bushfit run`: every fit, the diagnosis, and the prediction."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from bushfit.caveat import join_names
from bushfit.cli.diagnose import print_findings, print_verdict
from bushfit.cli.options import command_called
from bushfit.cli.output import Output, with_output
from bushfit.cli.predict import print_predictions
from bushfit.cli.printing import print_origin, print_result, print_step, print_validations
from bushfit.cli.shared_options import campaign_options, exit_above, open_campaign
from bushfit.errors import quote_path
from bushfit.units import format_range

if TYPE_CHECKING:
    from bushfit.campaign.schema import Loss
    from bushfit.commands.run import RunOutput


@command_called("run", "configs/cmp_15961.toml")
@campaign_options
@with_output("results/<campaign name>", "tables", "pictures", "pages")
def command(campaigns: tuple[Path, ...], loss: Loss | None, max_nrmse: float | None, output: Output) -> None:
    """Fit, diagnose and predict in one go: the main command.

    Prints the verdict on the model, the parameters, the tested range, and the predicted stiffness at the lowest and
    highest frequency. -v prints every step. Steps for which tests are missing are skipped and listed.

    Writes model.json (the model to use), report.html, diagnosis.json, candidates.csv, static.json and dynamic.json; and
    a table and a plot of the loops, the sweeps, the gap (measured minus model), and each direction and specimen. If the
    diagnosis adds an effect to the model, joint.json contains the fit without this effect.
    """
    from bushfit.commands.provenance import input_files
    from bushfit.commands.run import run
    from bushfit.effects.unnamed import effect_label

    campaign = open_campaign(campaigns)
    folder = output.folder(campaign.name, "model.json", "diagnosis.json")
    outcome = run(campaign, loss=loss)
    output.warn(outcome.data.notes)
    diagnosis, action = outcome.diagnosed and outcome.diagnosed.diagnosis, f"use {folder / 'model.json'}, "
    if diagnosis and diagnosis.has_added_effects:
        effects, before = diagnosis.result.model.effects, diagnosis.before.model.effects
        added = [effect_label(name) for name in effects if name not in before]
        action += f"with {join_names(added)}; joint.json is the fit without {'it' if len(added) == 1 else 'them'}"
    elif diagnosis and (diagnosis.is_changed or diagnosis.verdict == "unexplained"):
        action = ""  # no model to use before the record is corrected, or the cause is known
    else:
        action += "the joint fit"
    again = output.command(f"diagnose {quote_path(campaign.path)}{f' --loss {loss}' if loss else ''}", campaign.name)
    print_run(output, campaign.name, outcome, action, again)
    output.write(folder, outcome.files, outcome.document, input_files(campaign))
    exit_above(max_nrmse, outcome.result)


def print_run(output: Output, name: str, outcome: RunOutput, action: str, again: str) -> None:
    """Print the result of `bushfit run`, with -v each step, and one line on the paper's two-step procedure.

    Args:
        output: output of the command.
        name: name of the campaign.
        outcome: results of all steps.
        action: next step for the user, printed below the verdict.
        again: command that repeats the diagnosis.
    """
    diagnosed, result = outcome.diagnosed, outcome.result
    if diagnosed:
        print_verdict(output, diagnosed, again, action)
    else:
        output.print_headline(name, "every parameter is fixed, so there is nothing to diagnose", action)
    tests = f"the {join_names(result.measured.directions)} tests" if result.measured else "these tests"
    fit = "model to use, fitted to" if outcome.has_added_effects else "joint fit of"
    print_result(output, f"{name}: {fit} {tests}", result)
    if diagnosed and (output.verbose or diagnosed.diagnosis.verdict != "consistent"):
        print_findings(output, diagnosed)
    _print_range(output, outcome)
    print_validations(output, outcome.validations)
    print_origin(output, result)
    print_predictions(output, outcome.predicted)
    two_step, joint = outcome.two_step, outcome.joint.result
    if output.verbose:
        for title, step in outcome.static.steps if outcome.static else ():
            print_step(output, f"{name}: {title}", step, "static.json")
        if two_step:
            print_step(output, f"{name}: static and dynamic fit in turn", two_step.result, "dynamic.json")
        if outcome.has_added_effects:
            print_step(output, f"{name}: joint fit", joint, "joint.json")
    left_out, shown = f"skipped ({outcome.reason_left_out})", "static.json and dynamic.json; -v shows the parameters"
    output.print(f"two-step procedure of the paper: {shown if two_step else left_out}")


def _print_range(output: Output, outcome: RunOutput) -> None:
    """Print the tested range of frequency and amplitude for each direction, fitted or not."""
    if not (measured := outcome.result.measured):
        return
    output.console.print("tested range; beyond it the model extrapolates (strain: all fitted directions)", style="bold")
    for direction in dict.fromkeys(data_set.direction for data_set in outcome.data.data_sets):
        tests = [data_set for data_set in outcome.data.data_sets if data_set.direction == direction]
        frequencies = [end for test in tests for end in (test.frequency.min(), test.frequency.max())]
        ends = [end for test in tests for end in (test.amplitude.min(), test.amplitude.max())]
        amplitude = direction.display.displacement.text(min(ends), max(ends))
        frequency = format_range("Hz", min(frequencies), max(frequencies))
        use = "" if str(direction) in measured.directions else ", not fitted"
        output.print(f"  {direction}: {frequency}, {amplitude}{use}")
