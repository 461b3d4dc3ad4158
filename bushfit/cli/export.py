"""`bushfit export`: model -> files of solvers, multibody codes and spreadsheets."""

from pathlib import Path
from typing import Literal

import click

from bushfit.cli.common import CAMPAIGN_FOLDER, Options, open_model, with_options
from bushfit.cli.grids import TEMPERATURE, asked_for, grid_options, kelvin, positive
from bushfit.cli.options import FILE, PLOT_FORMAT, TABLE_FORMAT, command_called, place_option


@command_called(
    "export",
    "data/arm_bushing/truth.json --format nastran --format xlsx",
    'data/arm_bushing/truth.json --format abaqus --units "m kg s N" -o results/si',
)
@click.argument("model", type=FILE)
@click.option(
    "--format",
    "formats",
    type=click.Choice(["fmu", "nastran", "abaqus", "adams", "csv", "xlsx"]),
    multiple=True,
    required=True,
    help="May be given again.",
)
@click.option("--campaign", type=FILE, help="Take the grid of this campaign's [predict], or of its sweeps.")
@place_option(
    "axial, radial or torsion, or a specimen's name; may be given again [axial and radial, and all specimens]."
)
@grid_options("the campaign's")
@TEMPERATURE
@click.option(
    "--units", help='Length, mass, time and force that fit together [decks "mm t s N"; tables as predict; fmu SI].'
)
@click.option("--dialect", type=click.Choice(["optistruct"]), help="Of --format nastran: |K| and loss angle.")
@click.option("--accuracy", default="1 %", help="Largest error of the modulus that an fmu may have [1 %].")
@with_options(CAMPAIGN_FOLDER, TABLE_FORMAT, PLOT_FORMAT)
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
    """MODEL (the model.json of run, fit or diagnose, or dynamic.json) in the files of other programs.

    Writes bushing.bdf (nastran), bushing.fem (with --dialect optistruct), bushing.inp (abaqus), bushing_car.bus and
    bushing_ride.bus (adams), a .fmu (fmu) with arms.csv and arms.png, its Maxwell arms and their error, bushing.xlsx,
    or a CSV file for each table. Says what each format cannot carry, and what that costs. Effects of the rig are left
    out. z is the bushing's axis.
    """
    from bushfit.campaign.campaign import load_campaign
    from bushfit.errors import naming
    from bushfit.export.systems import UnitSystem
    from bushfit.jobs.export import Export, source_of
    from bushfit.jobs.predict import Predict
    from bushfit.report.contents import Kinds

    result, loaded = open_model(model), load_campaign(campaign) if campaign else None
    asked = asked_for(directions, grids)
    if dialect and "nastran" not in formats:
        raise click.UsageError("'--dialect' is of '--format nastran'.")
    with naming(place="--units"):
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
    files = {**outcome.files, **options.formats.files(outcome.contents)}
    options.write(folder, files, outcome.document)
