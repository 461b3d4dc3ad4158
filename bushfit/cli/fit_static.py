"""`bushfit fit-static`: loops -> mu, sigma_fmax, eps_half."""

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


@click.command("fit-static")
@campaign_argument
@click.option(
    "--dynamic",
    type=click.Path(path_type=Path),
    help="Hold the springpot at m and alpha of this dynamic.json or model.json.",
)
@loss_option
@max_nrmse_option
@shared_options
def command(campaign: Path, dynamic: Path | None, loss: str | None, max_nrmse: float | None, options: Options) -> None:
    """Fit mu, sigma_fmax and eps_half to the hysteresis loops of CAMPAIGN, the springpot held.

    m and alpha come from --dynamic, or from [fit] of the campaign where it gives both. Where they are not known
    yet the springpot is left out, and a warning says what this does to the result.

    Writes static.json, loops.csv and loops.png.
    """
    from bushfit.jobs.fits import FitStatic
    from bushfit.model.file import load_result

    job = FitStatic(load_result(dynamic) if dynamic else None)
    perform(options, campaign, job, tell_fit, max_nrmse, loss)
