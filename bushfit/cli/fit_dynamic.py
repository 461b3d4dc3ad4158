"""`bushfit fit-dynamic`: smallest-amplitude sweep -> m, alpha."""

from __future__ import annotations

from pathlib import Path

import click

from bushfit.cli.common import Task, campaign_options, example, open_model, path_option
from bushfit.cli.show import tell_fit


@click.command("fit-dynamic", epilog=example("bushfit fit-dynamic configs/cmp_15961.toml"))
@path_option(
    "--static",
    help="Hold mu, sigma_fmax and eps_half at those of this static.json [fitted to the loops on the spot].",
)
@campaign_options
def command(static: Path | None, task: Task) -> None:
    """Fit m and alpha to the smallest-amplitude sweep of CAMPAIGN, the other three held.

    They are held at --static, and their errors are carried over. Without it the loops of CAMPAIGN are fitted first,
    as fit-static does. [fit] dynamic_amplitudes in the campaign chooses other sweep amplitudes.

    Writes dynamic.json, which `bushfit predict` takes as it is, sweeps.csv and sweeps.png.
    """
    from bushfit.jobs.fits import FitDynamic

    task.perform(FitDynamic(open_model(static) if static else None), tell_fit)
