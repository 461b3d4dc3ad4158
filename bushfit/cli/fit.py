"""`bushfit fit`: loops and sweeps -> all parameters together."""

from __future__ import annotations

from pathlib import Path

import click

from bushfit.cli.common import (
    Options,
    campaign_argument,
    loss_option,
    max_nrmse_option,
    perform,
    shared_options,
    tell_fit,
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
@loss_option
@max_nrmse_option
@shared_options
def command(
    campaign: Path,
    directions: tuple[str, ...],
    effects: tuple[str, ...],
    loss: str | None,
    max_nrmse: float | None,
    options: Options,
) -> None:
    """Fit all five parameters to the loops and sweeps of CAMPAIGN together.

    Writes model.json, and the tables and plots of both: loops.csv, loops.png, sweeps.csv, sweeps.png. Tests in
    directions that were not fitted are shown as predictions.
    """
    from bushfit.geometry import Direction
    from bushfit.jobs.fits import Fit

    job = Fit(tuple(Direction(direction) for direction in directions), effects)
    perform(options, campaign, job, tell_fit, max_nrmse, loss)
