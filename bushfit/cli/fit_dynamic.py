"""`bushfit fit-dynamic`: smallest-amplitude sweep -> m, alpha."""

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


@click.command("fit-dynamic")
@campaign_argument
@click.option(
    "--static",
    type=click.Path(path_type=Path),
    help="Hold mu, sigma_fmax and eps_half at those of this static.json [fitted to the loops on the spot].",
)
@loss_option
@max_nrmse_option
@shared_options
def command(campaign: Path, static: Path | None, loss: str | None, max_nrmse: float | None, options: Options) -> None:
    """Fit m and alpha to the smallest-amplitude sweep of CAMPAIGN, the other three held.

    They are held at --static, and their errors are carried over. Without it the loops of CAMPAIGN are fitted first,
    as fit-static does. [fit] dynamic_amplitudes in the campaign chooses other sweep amplitudes.

    Writes dynamic.json, which `bushfit predict` takes as it is, sweeps.csv and sweeps.png.
    """
    from bushfit.jobs.fits import FitDynamic
    from bushfit.model.file import load_result

    job = FitDynamic(load_result(static) if static else None)
    perform(options, campaign, job, tell_fit, max_nrmse, loss)
