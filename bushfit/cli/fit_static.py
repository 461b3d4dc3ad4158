"""`bushfit fit-static`: loops -> mu, sigma_fmax, eps_half."""

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


@click.command("fit-static")
@campaign_argument
@click.option(
    "--dynamic",
    type=click.Path(path_type=Path),
    help="Hold the springpot at m and alpha of this dynamic.json or model.json.",
)
@max_nrmse_option
@shared_options
def command(campaign: Path, dynamic: Path | None, max_nrmse: float | None, options: Options) -> None:
    """Fit mu, sigma_fmax and eps_half to the hysteresis loops of CAMPAIGN, the springpot held.

    m and alpha come from --dynamic, or from [fit] of the campaign where it gives both. Where they are not known
    yet the springpot is left out, and a warning says what this does to the result.

    Writes static.json, loops.csv and loops.png.
    """
    from bushfit.campaign import load_campaign
    from bushfit.cli.artifacts import artifact_names, loop_files
    from bushfit.fitting.data import Data
    from bushfit.fitting.procedures import fit_static
    from bushfit.results import load_result

    loaded = load_campaign(campaign)
    folder = options.folder(loaded.slug)
    options.require_free(folder, ["static.json", *artifact_names(["loops"], plots=options.plots)])
    data = Data.of(loaded)
    result = fit_static(data, load_result(dynamic) if dynamic else None)
    document = result.to_document()
    report(options, f"{loaded.name}: static fit of the loops", result)
    files = {"static.json": to_json(document), **loop_files(result.model, data.loops, plots=options.plots)}
    options.write(folder, files)
    options.tell(document)
    enforce_nrmse(result, max_nrmse)
