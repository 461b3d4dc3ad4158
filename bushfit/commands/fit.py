"""fit, fit-static and fit-dynamic: parameters from loops and sweeps."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import Loss
from bushfit.commands.loading import HasResult, as_result
from bushfit.commands.provenance import campaign_document, option_words, result_document
from bushfit.effects import with_base
from bushfit.errors import FitError
from bushfit.fitting import procedures
from bushfit.fitting.master_curve import can_shift, master_curve
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.model.result import Result
from bushfit.prediction.other_bushings import predict_each_bushing
from bushfit.report import plots, tables
from bushfit.report.results import ResultFile


@dataclass(frozen=True, eq=False, repr=False)
class FitOutput:
    """Output of the commands fit, fit-static and fit-dynamic: result of each step, and result files.

    Args:
        data: the campaign, prepared for the fit.
        steps: title and result of each step; the last is the result of the fit.
        document: content of the model file.
        files: model file, tables and figures.
    """

    data: PreparedCampaign
    steps: tuple[tuple[str, Result], ...]
    document: Mapping[str, Any]
    files: Sequence[ResultFile]

    def __repr__(self) -> str:
        return repr(self.result)

    @property
    def result(self) -> Result:
        """Fitted model: the result of the last step."""
        return self.steps[-1][1]


def fit(
    campaign: Campaign | PreparedCampaign,
    *,
    directions: Sequence[str] = (),
    effects: Sequence[str] = (),
    profile: bool = False,
    loss: Loss | None = None,
) -> FitOutput:
    """Fit all parameters to the loops and sweeps of a campaign together: the fit to use.

    Args:
        campaign: the campaign, or a campaign prepared by `prepare_tests`.
        directions: directions or specimens whose tests are fitted; default axial, and all specimens.
        effects: effects added to the paper's three, such as "inertia".
        profile: True to add 95 % intervals by profile likelihood, which takes some seconds.
        loss: "soft_l1" reduces the weight of distant points and leaves outliers out; default the campaign's.

    Returns:
        Fitted result with its covariance, and the result files.

    Raises:
        BushfitError: tests or settings that cannot support the fit.
    """
    data = prepare_tests(campaign, loss)
    names = with_base(dict.fromkeys((*data.campaign.fit.effects, *effects)))
    result = procedures.fit_joint(data, effects=names, directions=directions or None, profile=profile)
    options = option_words(direction=directions, effect=effects, profile=profile)
    document = result_document(result, campaign_document(data, "fit", options))
    files = [ResultFile("model", "json", document), *campaign_files(data, result)]
    if len({place.body for place in result.fitted_places if place.axis and place.body}) > 1:
        predicted = partial(predict_each_bushing, data, names, directions or None)
        files.append(ResultFile("bushings", "table", predicted))
    return FitOutput(data, (("joint fit", result),), document, files)


def fit_static(
    campaign: Campaign | PreparedCampaign, *, dynamic: Result | HasResult | None = None, loss: Loss | None = None
) -> FitOutput:
    """Fit the static modulus mu and the friction (sigma_fmax, eps_half) to the loops of a campaign.

    Args:
        campaign: the campaign, or a campaign prepared by `prepare_tests`.
        dynamic: result whose springpot (m, alpha) is kept fixed; default the values of [fit], or else no springpot.
        loss: "soft_l1" or "linear"; default the campaign's.

    Returns:
        Fitted result with its covariance, and the result files.
    """
    data = prepare_tests(campaign, loss)
    result = procedures.fit_static(data, as_result(dynamic) if dynamic else None)
    options = ("--dynamic", "DYNAMIC.json") if dynamic else ()
    document = result_document(result, campaign_document(data, "fit-static", options))
    files = [ResultFile("static", "json", document), *campaign_files(data, result, ["loop"])]
    return FitOutput(data, (("static fit of the loops", result),), document, files)


def fit_dynamic(
    campaign: Campaign | PreparedCampaign, *, static: Result | HasResult | None = None, loss: Loss | None = None
) -> FitOutput:
    """Fit the springpot (m, alpha) to the sweep of smallest amplitude of a campaign.

    Args:
        campaign: the campaign, or a campaign prepared by `prepare_tests`.
        static: result whose mu, sigma_fmax and eps_half are kept fixed; default the values in the campaign, or else a
            fit of its loops.
        loss: "soft_l1" or "linear"; default the campaign's.

    Returns:
        Fitted result, preceded by the static fit if one was necessary, and the result files.

    Raises:
        FitError: no result, no values in the campaign, and no loops.
    """
    data, steps = prepare_tests(campaign, loss), []
    fixed = as_result(static) if static else procedures.fixed_static_result(data)
    if fixed is None:
        if not data.loops:
            raise FitError(
                "the values of mu, sigma_fmax and eps_half for this fit are not stated",
                file=data.campaign.path,
                found="no --static, no [[loops]], and no values of all three in [fit]",
                hint="give --static static.json, add a loop, or run bushfit fit for all five parameters together",
            )
        fixed = procedures.fit_static(data)
        steps.append(("static fit of the loops, because no --static was given", fixed))
    result = procedures.fit_dynamic(data, fixed)
    options = ("--static", "STATIC.json") if static else ()
    document = result_document(result, campaign_document(data, "fit-dynamic", options))
    files = [ResultFile("dynamic", "json", document), *campaign_files(data, result, ["sweep"])]
    return FitOutput(data, (*steps, ("dynamic fit of the smallest sweep", result)), document, files)


def prepare_tests(campaign: Campaign | PreparedCampaign, loss: Loss | None = None) -> PreparedCampaign:
    """Prepare a campaign for a fit: one data set with its noise for each test.

    Args:
        campaign: the campaign; a prepared campaign is returned unchanged.
        loss: "soft_l1" or "linear"; default the campaign's.

    Returns:
        The campaign with one data set per test: measured values, noise and weights.
    """
    if isinstance(campaign, PreparedCampaign):
        return campaign
    return PreparedCampaign.from_campaign(replace(campaign, fit=replace(campaign.fit, loss=loss)) if loss else campaign)


def campaign_files(
    data: PreparedCampaign, result: Result, kinds: Collection[str] = ("loop", "sweep")
) -> list[ResultFile]:
    """Tables and figures that compare the tests with the model; outliers that the fit left out have no weight.

    Sweeps at several temperatures add a master curve and its shift factors, if the model has the effect of temperature.

    Args:
        data: campaign, prepared for a fit.
        result: fit of the campaign.
        kinds: kinds of tests to show: "loop", "sweep".

    Returns:
        Tables and figures, not yet rendered.
    """
    marked, model = data.without(result.outliers), result.model
    title = model.name if model.bushing else data.campaign.name
    files = list[ResultFile]()
    if "loop" in kinds and marked.loops:
        loops = ResultFile("loops", "table", partial(tables.loops_table, model, marked.loops))
        files += [loops, ResultFile("loops", "figure", lambda: plots.fits.loops_figure(result, loops.content(), title))]
    if "sweep" in kinds and marked.sweeps:
        sweeps = ResultFile("sweeps", "table", partial(tables.sweeps_table, model, marked.sweeps))
        figure = ResultFile("sweeps", "figure", lambda: plots.fits.sweeps_figure(result, sweeps.content(), title))
        files += [sweeps, figure]
        if "temperature" in model.effects and any(map(can_shift, data.campaign.sweeps)):
            shifted = cache(partial(master_curve, result, marked.sweeps))
            files += [
                ResultFile("master_curve", "table", lambda: tables.master_curve_table(shifted())),
                ResultFile(
                    "master_curve", "figure", lambda: plots.master_curve.master_curve_figure(model, shifted(), title)
                ),
                ResultFile("shift_factors", "table", lambda: tables.shift_factors_table(shifted())),
            ]
    return files
