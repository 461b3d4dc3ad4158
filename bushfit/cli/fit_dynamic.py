"""`bushfit fit-dynamic`: smallest-amplitude sweep -> m, alpha."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

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

if TYPE_CHECKING:
    from bushfit.fitting.data import Data
    from bushfit.results import Result


@click.command("fit-dynamic")
@campaign_argument
@click.option(
    "--static",
    type=click.Path(path_type=Path),
    help="Hold mu, sigma_fmax and eps_half at those of this static.json [fitted to the loops on the spot].",
)
@max_nrmse_option
@shared_options
def command(campaign: Path, static: Path | None, max_nrmse: float | None, options: Options) -> None:
    """Fit m and alpha to the smallest-amplitude sweep of CAMPAIGN, the other three held.

    They are held at --static, and their errors are carried over. Without it the loops of CAMPAIGN are fitted first,
    as fit-static does. [fit] dynamic_amplitudes in the campaign chooses other sweep amplitudes.

    Writes dynamic.json, which `bushfit predict` takes as it is, sweeps.csv and sweeps.png.
    """
    from bushfit.campaign import load_campaign
    from bushfit.cli.artifacts import artifact_names, sweep_files
    from bushfit.fitting.data import Data
    from bushfit.fitting.procedures import fit_dynamic
    from bushfit.results import load_result

    loaded = load_campaign(campaign)
    folder = options.folder(loaded.slug)
    options.require_free(folder, ["dynamic.json", *artifact_names(["sweeps"], plots=options.plots)])
    data = Data.of(loaded)
    result = fit_dynamic(data, load_result(static) if static else _static(options, data))
    document = result.to_document()
    report(options, f"{loaded.name}: dynamic fit of the smallest sweep", result)
    files = {"dynamic.json": to_json(document), **sweep_files(result.model, data.sweeps, plots=options.plots)}
    options.write(folder, files)
    options.tell(document)
    enforce_nrmse(result, max_nrmse)


def _static(options: Options, data: Data) -> Result:
    """What to hold where no --static was given: the campaign's own values, or a fit of its loops."""
    from bushfit.errors import FitError
    from bushfit.fitting.procedures import fit_static, given_static

    known = given_static(data)
    if known is not None:
        return known
    if not data.loops:
        raise FitError(
            "nothing says at which mu, sigma_fmax and eps_half to hold the fit",
            file=data.campaign.path,
            found="no --static, no [[loops]], and no values of all three in [fit]",
            hint="give --static static.json, add a loop, or run bushfit fit for all five parameters together",
        )
    result = fit_static(data)
    report(options, f"{data.campaign.name}: static fit of the loops, because no --static was given", result)
    return result
