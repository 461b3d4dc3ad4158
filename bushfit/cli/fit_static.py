"""`bushfit fit-static`: loops -> mu, sigma_fmax, eps_half."""

from __future__ import annotations

from pathlib import Path

import click

from bushfit.cli.common import Task, campaign_options, example, open_model, path_option
from bushfit.cli.show import tell_fit


@click.command("fit-static", epilog=example("bushfit fit-static configs/cmp_15961.toml"))
@path_option(
    "--dynamic",
    help="Hold the springpot at m and alpha of this dynamic.json or model.json.",
)
@campaign_options
def command(dynamic: Path | None, task: Task) -> None:
    """Fit mu, sigma_fmax and eps_half to the hysteresis loops of CAMPAIGN, the springpot held.

    m and alpha come from --dynamic, or from [fit] of the campaign where it gives both. Where they are not known
    yet the springpot is left out, and a warning says what this does to the result.

    Writes static.json, loops.csv and loops.png.
    """
    from bushfit.jobs.fits import FitStatic

    task.perform(FitStatic(open_model(dynamic) if dynamic else None), tell_fit)
