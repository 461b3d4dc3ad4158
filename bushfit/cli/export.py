"""`bushfit export`: model -> files of solvers, multibody codes and spreadsheets."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from bushfit.caveat import Caveat, join_names, to_caveats
from bushfit.cli.options import FILE, command_called, flag, option, option_group
from bushfit.cli.output import Output, with_output
from bushfit.cli.printing import permitted_use
from bushfit.cli.shared_options import prediction_options, quantity, static_rate_option

if TYPE_CHECKING:
    from bushfit.export.contract import UnitSystem


def parse_units(text: str) -> UnitSystem:
    """Parse --units, such as "mm t s N"."""
    from bushfit.export.contract import UnitSystem

    return UnitSystem.parse(text)


def parse_cardanic(text: str) -> complex:
    """Parse --cardanic, such as "60 N m/rad, 0.1" (stiffness, loss factor), to a complex stiffness [N m/rad]."""
    stiffness, separator, loss = text.partition(",")
    real = quantity("N*m/rad")(stiffness)
    return complex(real, real * quantity("1")(f"{loss} -") if separator else 0.0)


@command_called(
    "export",
    "data/arm_bushing/truth.json --format nastran --format xlsx",
    'data/arm_bushing/truth.json --format abaqus --units "m kg s N" -o results/si',
)
@click.argument("model", metavar="MODEL", type=FILE)
@option_group(
    "Target program",
    option(
        "--format formats FORMAT",
        "Format to write: fmu, nastran, abaqus, adams, prony, csv or xlsx; required.",
        type=click.Choice(["fmu", "nastran", "abaqus", "adams", "prony", "csv", "xlsx"]),
        multiple=True,
        required=True,
    ),
    option(
        "--units UNITS",
        'Units of length, mass, time and force in the files, such as "m kg s N" [solver files: "mm t s N"].',
        type=parse_units,
    ),
    option(
        "--dialect DIALECT",
        "Solver of the nastran file: optistruct, which reads the stiffness magnitude and the loss angle [Nastran].",
        type=click.Choice(["optistruct"]),
    ),
    flag("--time-domain", "For abaqus: write the materials as Prony series, for analyses in time."),
    option(
        "--cardanic CONSTANTS",
        'Stiffness and loss factor for rotation about x and y in solver files, such as "60 N m/rad, 0.1" [0].',
        type=parse_cardanic,
    ),
    static_rate_option("Rate of the static curves for Adams"),
    option(
        "--accuracy ERROR",
        "Largest permitted error of the modulus in an FMU or prony [1 %].",
        type=quantity("1"),
        default="1 %",
    ),
)
@prediction_options("Use the frequencies and amplitudes of this campaign.")
@with_output("results/<model name>/export", "tables")
def command(model: Path, formats: tuple[str, ...], campaign: Path | None, output: Output, **settings: Any) -> None:
    """Write a fitted model for other programs: a solver, a multibody code, a spreadsheet.

    MODEL is the model.json of run, fit or diagnose, its folder, or dynamic.json. If a format cannot represent a
    property of the model, the command states the error in stiffness. -v also lists properties without a stated error.
    Effects that belong to the test rig are left out. The axis of the bushing is z.

    Depending on the format, writes bushing.bdf, .fem, .inp or .xlsx; bushing_car.bus and bushing_ride.bus (adams);
    one CSV file for each table (csv); prony.csv, a row per term; or an .fmu, with its Maxwell arms in arms.csv.
    """
    from bushfit.campaign.campaign import load_campaign
    from bushfit.commands.export import export
    from bushfit.commands.loading import load_model, model_file, model_source
    from bushfit.commands.provenance import input_files
    from bushfit.prediction.grid import GridOptions

    result, loaded = load_model(model), load_campaign(campaign) if campaign else None
    dialect = settings.pop("dialect")
    if dialect and "nastran" not in formats:
        raise click.UsageError("'--dialect' requires '--format nastran'.")
    if settings["time_domain"] and "abaqus" not in formats:
        raise click.UsageError("'--time-domain' requires '--format abaqus'.")
    comma = output.formats.table_form == "decimal-comma"
    names, file = tuple(dict.fromkeys(formats)), model_file(model)
    settings |= {"dialect": dialect or "nastran", "decimal_comma": comma}
    grid: Any = {key: settings.pop(key) for key in GridOptions.__annotations__}
    document, files = export(result, model_source(file), names, loaded, grid, **settings)
    folder = output.folder(result.name, *(part.name for part in files))
    limits = dict[Caveat, list[str]]()
    for name, entry in document["formats"].items():
        for limit in to_caveats(entry["left_out"], entry["left_out_kinds"]):
            limits.setdefault(limit, []).append(name)
    warnings = to_caveats(document["warnings"], document["warning_kinds"])
    errors = sum(limit.kind == "format_error" for limit in limits)
    verdict = f"written for {join_names(names)}"
    verdict += f", with {errors} error{'s' * (errors > 1)} of the formats" if errors else ""
    action = permitted_use([*limits, *warnings], "The files may be used: there are no warnings.")
    output.print_headline(result.name, verdict, action)
    printed = [limit for limit in limits if output.verbose or limit.kind == "format_error"]
    for limit in printed:
        output.print(f"limit of {', '.join(limits[limit])}: {limit}")
    if remaining := len(limits) - len(printed):
        output.print(f"{remaining} more limit{'s' * (remaining > 1)} of the formats: see -v or the files")
    output.warn(warnings)
    output.write(folder, files, document, input_files(loaded, file))
