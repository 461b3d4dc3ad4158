"""`bushfit fit-static`, `fit-dynamic` and `fit`: parameters from loops, sweeps, or both together."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from bushfit.cli.options import command_called, effect_option, file_option, flag, place_option, under
from bushfit.cli.output import Output, with_output
from bushfit.cli.printing import print_fit
from bushfit.cli.shared_options import campaign_options, exit_above, open_campaign

if TYPE_CHECKING:
    from bushfit.campaign.schema import Loss
    from bushfit.commands.fit import FitOutput


@command_called("fit-static", "configs/cmp_15961.toml")
@under("How it is fitted", file_option("--dynamic", "Hold m and alpha at those of this dynamic.json."))
@campaign_options()
@with_output("results/<campaign name>", "tables", "pictures")
def static(
    campaigns: tuple[Path, ...], dynamic: Path | None, loss: Loss | None, max_nrmse: float | None, output: Output
) -> None:
    """Fit mu, sigma_fmax and eps_half to the hysteresis loops of CAMPAIGN, at given m and alpha.

    These come from --dynamic, or from [fit] of the campaign. Where they are not known yet the part of the model that
    depends on frequency (the springpot) is left out, and a warning says what this does to the result.

    Writes static.json, loops.csv and loops.png.
    """
    from bushfit.commands.fit import fit_static
    from bushfit.commands.loading import load_model

    campaign, start = open_campaign(campaigns), load_model(dynamic) if dynamic else None
    folder = output.free_folder(campaign.name, "static.json")
    _finish(output, folder, fit_static(campaign, dynamic=start, loss=loss), dynamic, max_nrmse)


@command_called("fit-dynamic", "configs/cmp_15961.toml")
@under(
    "How it is fitted",
    file_option(
        "--static", "Hold mu, sigma_fmax and eps_half at those of this static.json [the loops are fitted first]."
    ),
)
@campaign_options()
@with_output("results/<campaign name>", "tables", "pictures")
def dynamic(
    campaigns: tuple[Path, ...], static: Path | None, loss: Loss | None, max_nrmse: float | None, output: Output
) -> None:
    """Fit m and alpha to the smallest-amplitude sweep of CAMPAIGN, at given mu, sigma_fmax and eps_half.

    These come from --static, and their errors are carried over; without it the loops of CAMPAIGN are fitted first.
    [fit] dynamic_amplitudes in the campaign chooses other sweep amplitudes.

    Writes dynamic.json, a model that bushfit predict takes, sweeps.csv and sweeps.png.
    """
    from bushfit.commands.fit import fit_dynamic
    from bushfit.commands.loading import load_model

    campaign, start = open_campaign(campaigns), load_model(static) if static else None
    folder = output.free_folder(campaign.name, "dynamic.json")
    _finish(output, folder, fit_dynamic(campaign, static=start, loss=loss), static, max_nrmse)


@command_called("fit", "configs/arm_bushing.toml --direction axial --direction radial --profile")
@under(
    "What is fitted",
    place_option(
        "Tests in this direction (axial, radial, torsion) or of this specimen; may be given again [axial, and all "
        "specimens]."
    ),
    effect_option("Add an effect to the model, such as inertia; may be given again. A wrong NAME lists all."),
    flag("--profile", "Add 95 % intervals by profile likelihood (some seconds)."),
)
@campaign_options()
@with_output("results/<campaign name>", "tables", "pictures")
def fit(
    campaigns: tuple[Path, ...],
    directions: tuple[str, ...],
    effects: tuple[str, ...],
    profile: bool,
    loss: Loss | None,
    max_nrmse: float | None,
    output: Output,
) -> None:
    """Fit all five parameters to the loops and sweeps of CAMPAIGN together.

    This is the fit to use: bushfit predict takes its model. Without axial loops, or axial sweeps, it takes those of all
    directions. Tests that were not fitted are shown as predictions. Where [fit] of the campaign holds all five
    (vary = false) nothing is fitted, and the command reports how well these values agree with the tests. --profile is
    right also where a parameter is hardly determined and the interval from the standard error is not.

    Writes model.json, and of loops and sweeps a table and a plot each.
    """
    from bushfit.commands.fit import fit as fit_campaign

    campaign = open_campaign(campaigns)
    folder = output.free_folder(campaign.name, "model.json")
    result = fit_campaign(campaign, directions=directions, effects=effects, profile=profile, loss=loss)
    _finish(output, folder, result, None, max_nrmse)


def _finish(output: Output, folder: Path, fitted: FitOutput, model: Path | None, max_nrmse: float | None) -> None:
    """Print and write the output of a fit; `model` is the model file that was read."""
    from bushfit.commands.provenance import input_files

    campaign = fitted.data.campaign
    output.warn(fitted.data.notes)
    print_fit(output, campaign.name, fitted)
    inputs = [*input_files(campaign), *([model] if model else [])]
    output.write(folder, fitted.files, fitted.document, inputs)
    exit_above(max_nrmse, fitted.result)
