"""`bushfit fit-static`, `fit-dynamic` and `fit`: parameters from loops, sweeps, or both together."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from bushfit.cli.options import command_called, direction_option, file_option, flag, option, option_group
from bushfit.cli.output import Output, with_output
from bushfit.cli.printing import print_step
from bushfit.cli.shared_options import campaign_options, exit_above, open_campaign
from bushfit.errors import quote_path
from bushfit.units import number

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bushfit.campaign.schema import Loss
    from bushfit.commands.fit import FitOutput

#: Kinds of warnings that the model misses the tests.
_MISFITS = {"misfit", "model_error", "given_values_miss", "unfitted_test_missed"}


@command_called("fit-static", "configs/cmp_15961.toml")
@option_group("Fit", file_option("--dynamic", "Keep m and alpha fixed at their values in this dynamic.json."))
@campaign_options
@with_output("results/<campaign name>/fit-static", "tables", "pictures")
def static(
    campaigns: tuple[Path, ...], dynamic: Path | None, loss: Loss | None, max_nrmse: float | None, output: Output
) -> None:
    """Fit mu, sigma_fmax and eps_half to the hysteresis loops of CAMPAIGN, at given m and alpha.

    m and alpha come from --dynamic or from [fit] of the campaign. Without them, the frequency-dependent part of the
    model (the springpot) is left out, and a warning states by how much this changes the result.

    Writes static.json, loops.csv and loops.png.
    """
    from bushfit.commands.fit import fit_static
    from bushfit.commands.loading import load_model
    from bushfit.commands.provenance import input_files

    campaign, start = open_campaign(campaigns), load_model(dynamic) if dynamic else None
    folder = output.folder(campaign.name, "static.json")
    fitted = fit_static(campaign, dynamic=start, loss=loss)
    _print_and_write(output, folder, fitted, input_files(campaign, dynamic), max_nrmse)


@command_called("fit-dynamic", "configs/cmp_15961.toml")
@option_group(
    "Fit",
    file_option(
        "--static",
        "Take mu, sigma_fmax and eps_half, with their errors, from this static.json [from a fit of the loops].",
    ),
)
@campaign_options
@with_output("results/<campaign name>/fit-dynamic", "tables", "pictures")
def dynamic(
    campaigns: tuple[Path, ...], static: Path | None, loss: Loss | None, max_nrmse: float | None, output: Output
) -> None:
    """Fit m and alpha to the sweep of the smallest amplitude, at given mu, sigma_fmax and eps_half.

    mu, sigma_fmax and eps_half come from --static. Without --static, the loops of CAMPAIGN are fitted first. To fit
    sweeps of other amplitudes, set dynamic_amplitudes under [fit] in the campaign.

    Writes dynamic.json (a model for bushfit predict), sweeps.csv and sweeps.png.
    """
    from bushfit.commands.fit import fit_dynamic
    from bushfit.commands.loading import load_model
    from bushfit.commands.provenance import input_files

    campaign, start = open_campaign(campaigns), load_model(static) if static else None
    folder = output.folder(campaign.name, "dynamic.json")
    fitted = fit_dynamic(campaign, static=start, loss=loss)
    _print_and_write(output, folder, fitted, input_files(campaign, static), max_nrmse)


@command_called("fit", "configs/arm_bushing.toml --direction axial --direction radial --profile")
@option_group(
    "Tests and model",
    direction_option("fit", "axial, and all specimens"),
    option(
        "--effect effects NAME",
        "Add this effect to the model, such as inertia. To list all names, state an unknown one.",
        multiple=True,
    ),
    flag("--profile", "Compute additional 95 % intervals by profile likelihood; takes some seconds."),
)
@campaign_options
@with_output("results/<campaign name>/fit", "tables", "pictures")
def command(campaigns: tuple[Path, ...], max_nrmse: float | None, output: Output, **settings: Any) -> None:
    """Fit all five parameters to the loops and sweeps of CAMPAIGN together: the fit to use.

    This fit replaces the two steps of the paper. It fits the axial tests, or the tests of all directions if
    axial loops or sweeps are missing. The other tests are predicted and shown. If [fit] of the campaign fixes all
    parameters (vary = false), the command reports how well these values agree with the tests. If the tests hardly
    determine a parameter, its standard error is misleading: use --profile.

    Writes model.json, and a table and a plot of loops and sweeps; for several bushings also bushings.csv, which
    compares each bushing with a fit to the others.
    """
    from bushfit.commands.fit import fit
    from bushfit.commands.provenance import input_files

    campaign = open_campaign(campaigns)
    folder = output.folder(campaign.name, "model.json")
    fitted = fit(campaign, **settings)
    _print_and_write(output, folder, fitted, input_files(campaign), max_nrmse)


def _print_and_write(
    output: Output, folder: Path, fitted: FitOutput, inputs: Sequence[Path], max_nrmse: float | None
) -> None:
    """Print the result of a fit (verdict, next step, parameters, each of several bushings), and write its files.

    Args:
        output: output of the command.
        folder: results folder, which the next step names.
        fitted: result of the fit.
        inputs: files that the command has read.
        max_nrmse: misfit above which the command exits with status 1; None without a limit.
    """
    from bushfit.fitting.model_error import BEYOND_NOISE
    from bushfit.prediction.caveats import warnings_of

    campaign, result, file = fitted.data.campaign, fitted.result, quote_path(fitted.data.campaign.path)
    written = quote_path(folder / f"{fitted.files[0].name}.json")
    verdict, aim, words = "nothing was fitted: the tests are not compared", "predict from this model", ""
    by_kind = {warning.kind: warning.text for warning in result.warnings}
    misses = not _MISFITS.isdisjoint(by_kind)
    if quality := result.quality:
        misses |= quality.reduced_chi_square >= BEYOND_NOISE
        verdict = f"the model {'misses' if misses else 'meets'} the tests: NRMSE {number(100 * quality.nrmse, 2)} %"
        verdict += f", reduced chi-square {number(quality.reduced_chi_square, 3)} (1 is noise alone)"
        if misses:
            start = f" --model {written}" if {*result.model.effects} - {*fitted.data.effects} else ""
            aim, words = "find what the model lacks", f"diagnose {file}{start}"
            if not result.fitted:
                aim, words = f"free a parameter in [fit] of {file}, and fit again", f"fit {file}"
    if fitted.files[0].name == "static":
        aim, words = "fit m and alpha", f"fit-dynamic {file} --static {written}"
    elif units := by_kind.get("implausible_modulus"):
        verdict, aim, words = units, "find the file with the wrong unit", f"diagnose {file}"
    elif not misses and (left_open := result.covariance.describe_unknown(result.model.values)):
        verdict, aim, words = left_open, "choose tests that determine them", f"plan {file} --hours 1"
    command = output.command(words, campaign.name) if words else output.command(f"predict {written}", result.name)
    output.print_headline(campaign.name, verdict, f"next, {aim}: {command}")
    output.warn(warnings_of(result))
    for title, step in fitted.steps:
        print_step(output, f"{campaign.name}: {title}", step, "" if step is result else "static fit")
    for table in (part.content() for part in fitted.files if part.name == "bushings"):
        rows = [
            (row[0], str(row[1]), *(number(value, 2) for value in row[2:])) for row in table.itertuples(index=False)
        ]
        output.print_table("each bushing predicted by a fit to the others", list(table.columns), rows)
    output.warn(fitted.data.notes)
    output.write(folder, fitted.files, fitted.document, inputs)
    exit_above(max_nrmse, fitted.result)
