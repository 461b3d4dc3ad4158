"""`bushfit fit`: loops and sweeps -> all parameters together."""

from __future__ import annotations

from pathlib import Path

import click

from bushfit.cli.common import (
    Options,
    campaign_argument,
    enforce_nrmse,
    max_nrmse_option,
    report,
    shared_options,
    to_json,
)


@click.command("fit")
@campaign_argument
@click.option(
    "--direction",
    "directions",
    type=click.Choice(["axial", "radial", "torsion"]),
    multiple=True,
    help="Tests to fit; may be given again [axial, as in the paper; all where none is axial].",
)
@click.option(
    "--effect",
    "effects",
    multiple=True,
    metavar="NAME",
    help="Add an effect to the paper's three, such as inertia; may be given again. A wrong NAME lists them all.",
)
@max_nrmse_option
@shared_options
def command(
    campaign: Path,
    directions: tuple[str, ...],
    effects: tuple[str, ...],
    max_nrmse: float | None,
    options: Options,
) -> None:
    """Fit all five parameters to the loops and sweeps of CAMPAIGN together.

    Writes model.json, and the tables and plots of both: loops.csv, loops.png, sweeps.csv, sweeps.png. Tests in
    directions that were not fitted are shown as predictions.
    """
    from bushfit.campaign import load_campaign
    from bushfit.cli.artifacts import artifact_names, loop_files, sweep_files
    from bushfit.effects import BASE
    from bushfit.fitting.data import Data
    from bushfit.fitting.procedures import fit_joint
    from bushfit.geometry import Direction

    loaded = load_campaign(campaign)
    folder = options.folder(loaded.slug)
    kinds = [kind for kind, tests in (("loops", loaded.loops), ("sweeps", loaded.sweeps)) if tests]
    options.require_free(folder, ["model.json", *artifact_names(kinds, plots=options.plots)])
    data = Data.of(loaded)
    chosen = [Direction(direction) for direction in directions] or None
    result = fit_joint(data, effects=(*BASE, *effects), directions=chosen)
    document = result.to_document()
    report(options, f"{loaded.name}: joint fit", result)
    files = {
        "model.json": to_json(document),
        **loop_files(result.model, data.loops, plots=options.plots),
        **sweep_files(result.model, data.sweeps, plots=options.plots),
    }
    options.write(folder, files)
    options.tell(document)
    enforce_nrmse(result, max_nrmse)
