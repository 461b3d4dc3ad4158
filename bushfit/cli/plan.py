"""`bushfit plan`: choose the next tests before the rig is booked."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from bushfit.caveat import join_names, to_caveats
from bushfit.cli.options import FILE, command_called, direction_option, file_option, option, option_group
from bushfit.cli.output import Output, with_output
from bushfit.cli.shared_options import grid_options, number_up_to, quantity
from bushfit.errors import error_location
from bushfit.units import number

if TYPE_CHECKING:
    from bushfit.planning.contract import Aim
    from bushfit.planning.plan import Plan

#: Maximum of --hours; larger values are typing errors.
_MOST_HOURS = 2000.0
#: Maximum number of amplitudes or frequencies of a test that are all printed.
_MOST_VALUES = 6


def parse_target(text: str) -> tuple[str, float]:
    """Name and relative half width of the 95 % interval (0.01) of a target such as "stiffness.axial=1 %"."""
    name, equals, size = text.rpartition("=")
    if not equals:
        raise click.BadParameter(f"'{text}' is not NAME=SIZE, such as \"mu=2 %\".", param_hint="'--target'")
    return name.strip(), quantity("1")(size.strip())


def parse_names(text: str) -> tuple[str, ...]:
    """Split a comma-separated text into names without duplicates."""
    return tuple(dict.fromkeys(filter(None, (name.strip() for name in text.split(",")))))


@command_called("plan", "configs/arm_bushing.toml --hours 4", 'configs/new_bushing.toml --target "stiffness=1 %"')
@click.argument("source", metavar="CAMPAIGN|MODEL.json", type=FILE)
@option_group(
    "Aim of the plan",
    option(
        "--hours HOURS",
        "Available time on the rig, in hours [8].",
        type=number_up_to(_MOST_HOURS, "time in hours such as 8"),
        default="8",
    ),
    option(
        "--for aim AIM",
        "Purpose of the tests: predictions (small errors of the stiffness), parameters (small errors of the "
        "parameters), or rivals (a decision between possible effects) [predictions].",
        type=click.Choice(["parameters", "predictions", "rivals"]),
    ),
    direction_option("test", "axial and radial, or all specimens", "test_directions"),
    option(
        "--target targets NAME=SIZE",
        'Accuracy to reach, as half the width of the 95 % interval: "mu=2 %", "stiffness=1 %".',
        type=parse_target,
        multiple=True,
    ),
    *(
        option(f"{name} NAME,...", words, type=parse_names, default="")
        for name, words in (
            ("--parameters", "With --for parameters: the parameters to determine [all]."),
            ("--rivals", "With --for rivals: the effects to distinguish [those that diagnose cannot distinguish]."),
        )
    ),
    file_option(
        "--campaign",
        "With MODEL.json: take the limits of the rig and the frequencies and amplitudes from this campaign.",
    ),
)
@option_group("Range of later predictions", grid_options("from the campaign"))
@with_output("results/<name>/plan", "tables")
def command(source: Path, campaign: Path | None, aim: Aim | None, output: Output, **settings: Any) -> None:
    """Select the most informative next tests within the limits of the rig.

    The plan starts from the tests of CAMPAIGN, or from MODEL.json or a folder of results. If CAMPAIGN has no tests, the
    plan starts from the hardness and filler in its [compound] table. If the plan misses a --target, the command states
    why, and the exit status is 1.

    Writes plan.csv (the sheet for the rig operator), plan.json, and campaign.toml for `bushfit simulate`.
    """
    from bushfit.campaign.campaign import Campaign, load_campaign
    from bushfit.commands.loading import load_source
    from bushfit.commands.plan import plan, plan_files
    from bushfit.commands.provenance import input_files

    parameters, rivals, targets = settings["parameters"], settings["rivals"], dict(settings.pop("targets"))
    if aim not in (None, "rivals") and rivals:
        raise click.UsageError("'--rivals' requires '--for rivals'.")
    if aim not in (None, "parameters") and parameters:
        raise click.UsageError("'--parameters' requires '--for parameters'.")
    if targets and (aim or rivals or parameters):
        raise click.UsageError("'--target' cannot be combined with '--for', '--parameters' and '--rivals'.")
    implied: Aim = "targets" if targets else "rivals" if rivals else "parameters" if parameters else "predictions"
    opened, settings_campaign = load_source(source), load_campaign(campaign) if campaign else None
    if settings_campaign and isinstance(opened, Campaign):
        raise click.UsageError("'--campaign' requires MODEL.json.")
    folder = output.folder(opened.name, "plan.json")
    with error_location(source):
        planned = plan(opened, settings_campaign, aim=aim or implied, targets=targets, **settings)
    _print_plan(output, planned)
    read = input_files(opened if isinstance(opened, Campaign) else settings_campaign, source)
    output.write(folder, plan_files(planned), planned.document, read)
    if planned.tests:
        output.print(f"next: make the tests in the order of {folder / output.formats.table('plan')}")
    if missed := [name for name, target in planned.document["targets"].items() if not target["met"]]:
        click.echo(f"bushfit: these targets are not met: {', '.join(missed)}", err=True)
        click.get_current_context().exit(1)


def _print_plan(output: Output, plan: Plan) -> None:
    """Print the planned tests, their expected errors compared with the standard programme, and the warnings."""
    document = plan.document
    hours = number(document["hours_planned"], 3)
    gains = (
        f"{place} from {number(100.0 * row['before'], 2)} to {number(100.0 * row['planned'], 2)} %"
        for place, row in document["stiffness"].items()
    )
    runs = f"{len(document['tests'])} runs in {hours} h"
    if rivals := document["rivals"]:
        chi_square, standard = (number(rivals[key], 3) for key in ("planned", "standard"))
        output.print(f"{runs} to distinguish {join_names(rivals['effects'])}: expected chi-square {chi_square}")
        enough = number(rivals["enough"], 3)
        output.print(f"  {enough} is enough in nine of ten cases; the standard programme reaches {standard}")
    else:
        output.print(f"{runs} reduce the standard error of the stiffness: {', '.join(gains)}")
    output.print(f"starting point: {document['source']}")
    tests, lines = plan.tests, []
    for test, count in Counter(tests).items():
        run, (unit, factor) = document["tests"][tests.index(test)], test.direction.display.displacement
        kind = f"sweep over {run['stepped']}" if run["kind"] == "sweep" else f"loop, {run['cycles']} cycles"
        motion = f"{_listed(run['amplitudes'], factor)} {unit}", _listed(run["frequencies_Hz"], 1.0)
        lines.append((run["place"], kind, *motion, str(count)))
    columns: tuple[str, ...] = ("direction", "test", "amplitude", "frequency [Hz]", "runs")
    output.print_table(f"{len(tests)} runs", columns, lines, text_columns=4)
    error_columns = "quantity", "before", f"plan, {hours} h", f"standard, {number(document['hours_standard'], 3)} h"
    rows = dict(document["parameters"])
    rows |= {f"stiffness, {place}": row for place, row in document["stiffness"].items()}
    rows |= {f"loss factor, {place} [0.01]": row for place, row in document["loss_factor"].items()}
    title = "standard errors [%]: before these tests, after the plan, and after the standard programme"
    if plan.knowledge.result.model_error is not None:
        title += "; stiffness and loss factor: with the model error, parameters: without"
    output.print_table(title, error_columns, _percents(rows, ("before", "planned", "standard")))
    if targets := document["targets"]:
        sizes = _percents(targets, ("asked", "before", "planned", "standard"))
        met = ("met" if target["met"] else "not met" for target in targets.values())
        columns = ("quantity", "asked for", "before", "plan", "standard", "")
        title = "targets: half width of the 95 % interval at the widest point [%]"
        output.print_table(title, columns, [(*row, verdict) for row, verdict in zip(sizes, met, strict=True)])
        for name, target in targets.items():
            if target["why"]:
                output.print(f"{name} is not met: {target['why']}")
    if document["enough"]:
        output.print(document["enough"])
    output.warn(to_caveats(document["warnings"], document["warning_kinds"]))


def _listed(values: Sequence[float], factor: float) -> str:
    """Format values times a factor: up to six values in full, more as the first, the last and their number."""
    words = [number(factor * value, 3) for value in values]
    return ", ".join(words) if len(words) <= _MOST_VALUES else f"{words[0]} to {words[-1]}, {len(words)} values"


def _percents(rows: Mapping[str, Mapping[str, Any]], keys: Sequence[str]) -> list[tuple[str, ...]]:
    """Format rows of numbers by name as table rows: the name, then the values of the given keys in percent."""
    return [(name, *(number(100.0 * row[key], 2) for key in keys)) for name, row in rows.items()]
