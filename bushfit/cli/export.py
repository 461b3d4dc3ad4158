"""`bushfit export`: model -> files of solvers, multibody codes and spreadsheets."""

from pathlib import Path
from typing import Literal

import click

from bushfit.cli.common import Options, open_model, with_options
from bushfit.cli.grids import asked_for, kelvin, positive, where_predicted
from bushfit.cli.options import FILE, command_called, option, under


@command_called(
    "export",
    "data/arm_bushing/truth.json --format nastran --format xlsx",
    'data/arm_bushing/truth.json --format abaqus --units "m kg s N" -o results/si',
)
@click.argument("model", metavar="MODEL.json", type=FILE)
@under(
    "For which program",
    option(
        "--format formats",
        "FORMAT",
        "fmu, nastran, abaqus, adams, csv or xlsx; needed, and may be given again.",
        type=click.Choice(["fmu", "nastran", "abaqus", "adams", "csv", "xlsx"]),
        multiple=True,
        required=True,
    ),
    option("--units", "UNITS", 'Length, mass, time and force, such as "m kg s N" [decks: "mm t s N"].'),
    option(
        "--dialect",
        "DIALECT",
        "optistruct: of --format nastran, with stiffness and loss angle.",
        type=click.Choice(["optistruct"]),
    ),
    option("--accuracy", "ERROR", "Largest error of the modulus that an fmu may have [1 %].", default="1 %"),
)
@where_predicted("Take the grid of this campaign.")
@with_options("results/<name>", "tables", "pictures")
def command(
    model: Path,
    formats: tuple[str, ...],
    campaign: Path | None,
    directions: tuple[str, ...],
    temperature: str | None,
    units: str | None,
    dialect: Literal["optistruct"] | None,
    accuracy: str,
    options: Options,
    **grids: str | None,
) -> None:
    """Write a fitted model for other programs: a solver, a multibody code, a spreadsheet.

    MODEL.json is the model.json of run, fit or diagnose, or dynamic.json. What a format cannot carry, and what that
    costs, is said. Effects of the rig are left out. z is the bushing's axis.

    Writes bushing.bdf, .fem, .inp or .xlsx, bushing_car.bus and bushing_ride.bus (adams), a CSV file a table, or an
    .fmu with arms.csv and arms.png, its Maxwell arms.
    """
    from bushfit.campaign.campaign import load_campaign
    from bushfit.errors import error_location
    from bushfit.export.contract import UnitSystem
    from bushfit.jobs.export import Export, source_of
    from bushfit.jobs.predict import Predict
    from bushfit.report.contents import Kinds

    result, loaded = open_model(model), load_campaign(campaign) if campaign else None
    asked = asked_for(directions, grids)
    if dialect and "nastran" not in formats:
        raise click.UsageError("'--dialect' is of '--format nastran'.")
    with error_location(place="--units"):
        system = UnitSystem.parse(units) if units is not None else None
    job = Export(
        tuple(dict.fromkeys(formats)),
        Predict(asked, temperature=kelvin(temperature)),
        positive(accuracy, "--accuracy", "1") or 0.0,
        system,
        dialect or "nastran",
        options.formats.table_form == "decimal-comma",
    )
    folder = options.free_folder((loaded or result).name, Kinds())
    outcome = job.run(result, source_of(model), loaded)
    for name, exported in outcome.exported.items():
        for loss in exported.losses:
            options.say(f"{name} leaves out: {loss}")
    options.warn(outcome.predicted.warnings)
    options.write(folder, {**outcome.files, **options.formats.files(outcome.contents)}, outcome.document)
