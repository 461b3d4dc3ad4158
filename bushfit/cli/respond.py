"""`bushfit respond`: force over time for a displacement history."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from bushfit.caveat import join_names
from bushfit.cli.file_options import metadata_options, options_named, require_tests
from bushfit.cli.options import FILE, Option, command_called, flag, option, option_group
from bushfit.cli.output import Output, with_output
from bushfit.cli.printing import permitted_use
from bushfit.cli.shared_options import TEMPERATURE, quantity

if TYPE_CHECKING:
    from bushfit.commands.respond import ResponseOutput


@command_called("respond", "data/arm_bushing/truth.json data/road/axial_radial.csv")
@click.argument("model", metavar="MODEL", type=FILE)
@click.argument("history", metavar="HISTORY", type=FILE, callback=require_tests)
@option_group(
    "Motion and conditions",
    click.option(
        *("--direction", "directions"),
        cls=Option,
        metavar="PLACE",
        help="Direction (axial, radial, torsion) or specimen of the motion [from headers or the file name].",
        multiple=True,  # more than one is an error
    ),
    flag("--steady", "Treat the history as whole cycles of a steady motion [as a motion from rest]."),
    option(
        "--lowpass FREQUENCY",
        'Remove the noise of the displacement above this frequency, such as "200 Hz"; friction would turn the '
        "noise into force [no filter].",
        type=quantity("Hz"),
    ),
    TEMPERATURE,
)
@metadata_options("displacements")
@with_output("results/<model name>/respond", "tables", "pictures")
def command(model: Path, history: Path, directions: tuple[str, ...], output: Output, **settings: Any) -> None:
    """Predict the force over time for a displacement history, with its 95 % band.

    MODEL is the model.json of run, fit or diagnose, or its folder. HISTORY is a table or recording with a time and a
    displacement in one or more directions: road load, steps, ramps, any waveform. Effects of the rig are left out. A
    warning reports strains and rates outside the tested range.

    Writes response.csv (time, displacement, force, band) and response.png.
    """
    from bushfit.commands.loading import load_model, model_file
    from bushfit.commands.respond import respond
    from bushfit.reading.layout import FileFormat
    from bushfit.validation import validate_tables

    if len(directions) > 1:
        raise click.UsageError("'--direction' takes one direction; a file with several states them in its headers.")
    result = load_model(model)
    folder = output.folder(result.name, output.formats.table("response"))
    test_options = settings.pop("test_options")
    settings |= {key: test_options.pop(key, None) for key in ("columns", "units")}
    settings |= {"direction": directions[0] if directions else None}
    with options_named():
        settings["file_format"] = validate_tables(test_options, None, FileFormat)
        response = respond(result, history, **settings)
    print_response(output, response)
    output.write(folder, response.files, response.document, [model_file(model), history])


def print_response(output: Output, response: ResponseOutput) -> None:
    """Print peak and rms force, power, largest strain and rate of each direction, and collect the warnings."""
    from bushfit.units import number

    rows, largest, beyond = [], list[str](), list[float | None]()
    for part in response.responses:
        (unit, factor), figures = part.direction.display.force, part.summary
        shares = [figures[f"share_of_time_above_tested_{quantity}"] for quantity in ("strain", "strain_rate")]
        exceeded = ["" if share is None else f"{number(100.0 * share, 2)} %" for share in shares]
        forces = [f"{number(factor * figures[key], 4)} {unit}" for key in ("peak_force", "rms_force")]
        strain, rate = number(100.0 * figures["largest_strain"], 3), number(figures["largest_strain_rate_per_s"], 3)
        power_unit = "W/m^3" if part.direction.motion.force_unit == "Pa" else "W"
        power = f"{number(figures['energy_per_second'], 3)} {power_unit}"
        rows.append((str(part.direction), *forces, power, strain, exceeded[0], rate, exceeded[1]))
        largest.append(f"{forces[0]} {part.label}")
        beyond += shares
    duration = number(response.responses[0].history.step * response.time.size, 3)
    verdict = f"force up to {join_names(largest)} over {duration} s"
    if None not in beyond:
        share = max(filter(None, beyond), default=0.0)
        tested = f"{number(100.0 * share, 2)} % of the time beyond the" if share else "within the"
        verdict += f", {tested} tested strains and strain rates"
    action = permitted_use(response.warnings, "The force may be used with its 95 % band.", [row[0] for row in rows])
    output.print_headline(response.result.name, verdict, action)
    heads = ("peak", "rms", "mean power", "strain [%]", "beyond tests", "rate [1/s]", "beyond tests")
    output.print_table("force, power, and largest strain and rate", ("direction", *heads), rows)
    output.warn(response.warnings)
