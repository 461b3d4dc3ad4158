"""Priors and ties of parameters in [fit] of a campaign."""

import re
from collections.abc import Sequence
from graphlib import CycleError, TopologicalSorter

import numpy as np

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.quantities import parameter_value
from bushfit.campaign.schema import ParameterSetting
from bushfit.effects import get_parameter, is_parameter, library_parameters, place_suffix
from bushfit.errors import CampaignError, error_location
from bushfit.geometry import get_places
from bushfit.model.constraints import Constraints, Prior, Tie
from bushfit.model.file import load_result
from bushfit.model.result import Result
from bushfit.validation import unknown_key

#: Number of a prior, and its value and standard deviation, each with a unit; one unit may serve both.
_NUMBER = r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
_PLUS_MINUS = re.compile(rf"\s*{_NUMBER}\s*(|[^\d\s+].*?)\s*(?:\+/?-|±)\s*{_NUMBER}\s*(|[^\d\s].*?)\s*")


def constraints_of(campaign: Campaign) -> Constraints:
    """Read the constraints that a campaign states for its parameters: priors (earlier knowledge), and ties.

    Args:
        campaign: campaign with its [fit].

    Returns:
        Priors, and ties (expressions of other parameters) in an order in which each can be computed.

    Raises:
        CampaignError: a text that is not a prior, ties in a circle, or settings that exclude each other.
        ModelError: an earlier model that cannot be used, or an expression without a value.
    """
    settings = campaign.fit.parameters
    priors = list[Prior]()
    for name, setting in settings.items():
        text = setting.prior or ""
        earlier = load_result(campaign.path.parent / text) if text.endswith(".json") else None
        with error_location(campaign.path, place=f"fit.{name}"):
            _require_compatible_keys(setting)
            if earlier:
                priors.append(_prior_from_result(campaign, earlier, text, only=name))
            elif text:
                priors.append(_prior(text, name))
    if whole := campaign.fit.prior:
        earlier = load_result(campaign.path.parent / whole)
        without = [name for name, setting in settings.items() if setting.prior or not setting.vary or setting.tie]
        with error_location(campaign.path, place="fit.prior"):
            priors.append(_prior_from_result(campaign, earlier, whole, without=without))
    with error_location(campaign.path):
        return Constraints(priors, _ties(campaign))


def _require_compatible_keys(setting: ParameterSetting) -> None:
    """Raise a CampaignError for settings of a parameter that exclude each other."""
    limits = [key for key in ("value", "min", "max") if getattr(setting, key) is not None]
    keys = [key for key in ("equal", "expression") if getattr(setting, key)]
    keys += limits if keys else []
    keys += ["vary = false"] * (not setting.vary and bool(keys or setting.prior))
    if len(keys) > 1 or (setting.prior and not setting.vary):
        found = ", ".join([*keys, *(["prior"] * bool(setting.prior))])
        expected = "equal or expression as the only key, or a prior of a parameter that varies"
        raise CampaignError("these keys exclude each other", found=found, expected=expected)


def _prior(text: str, name: str) -> Prior:
    """Parse a prior of one parameter, such as "0.24 +- 0.03" (value and standard deviation)."""
    match = _PLUS_MINUS.fullmatch(text)
    if not match or (match[4] == "%" and not match[2]):  # 3 % may be of the value, or added to it
        expected = '"0.24 +- 0.03" (with a unit if the parameter has one), or the model.json of an earlier fit'
        raise CampaignError("this is not a prior", found=f'"{text}"', expected=expected)
    parameter = get_parameter(name)
    parts = (match[1], match[2] or match[4]), (match[3], match[4])
    mean, deviation = (
        parameter_value("prior", name, f"{number} {unit}" if unit else float(number)) for number, unit in parts
    )
    low, high = parameter.bounds
    if not (low <= mean <= high and deviation > 0.0 and (mean > 0.0 or not parameter.log)):
        limits = f"{low:g} to {high:g} {parameter.unit}".removesuffix(" 1")
        expected = f"a value within {limits}, and a positive standard deviation"
        raise CampaignError("this is not a prior", found=f'"{text}"', expected=expected)
    return Prior((name,), np.array([mean]), np.array([[deviation**2]]), text)


def _prior_from_result(
    campaign: Campaign, result: Result, file: str, only: str | None = None, without: Sequence[str] = ()
) -> Prior:
    """Prior from the fitted values and the covariance of an earlier model.

    Args:
        campaign: campaign whose tests the earlier fit must not have used.
        result: earlier fit.
        file: its model.json, as the campaign states it.
        only: name of the only parameter to use; None for all fitted parameters that are free in the campaign.
        without: names of parameters to leave out.
    """
    sources = [loop.source for loop in campaign.loops] + [sweep.source for sweep in campaign.sweeps]
    hashes = {source.sha256 for source in sources if source}
    if twice := [file for file, sha256 in result.files.items() if sha256 in hashes]:
        expected = "a model fitted to other tests: a test that is used twice makes intervals too narrow"
        raise CampaignError("the prior was fitted to tests of this campaign", found=", ".join(twice), expected=expected)
    names = [name for name in result.fitted if name not in result.at_bound and name not in without]
    names = [name for name in names if only in (None, name) and result.covariance.stderr(name)]
    if not names:
        found = f"{only} is not fitted in {file}" if only else f"no fitted parameter in {file}"
        raise CampaignError("the earlier model has no such parameter", found=found, expected="a fitted parameter")
    covariance = result.covariance.select(names)
    mean = np.array([result.model.values[name] for name in covariance.names])
    return Prior(covariance.names, mean, covariance.matrix, file)


def _tie(campaign: Campaign, name: str, setting: ParameterSetting) -> Tie:
    """Parse the expression, or the name of an equal parameter of the same unit, that a parameter is tied to."""
    labels = [label for specimen in campaign.specimens for label in specimen.labels]
    if equal := (setting.equal or "").strip():
        tie = Tie(name, equal, (equal,), "p0", campaign.path)
        if not is_parameter(equal):
            hint = 'expression = "..." takes the value of an expression'
            raise unknown_key(equal, library_parameters(), hint)
    else:
        tie = Tie.from_expression(name, setting.expression or "", labels, campaign.path)
    for used in tie.names:
        if place := place_suffix(used):
            get_places(place, campaign.specimens)
    unit, equal_unit = get_parameter(name).unit, get_parameter(equal or name).unit
    if unit != equal_unit:
        found, expected = f"{name} [{unit}], {equal} [{equal_unit}]", "two parameters of the same unit"
        hint = f'expression = "{equal}" uses the value in SI units'
        raise CampaignError("parameters of different units cannot be equal", found=found, expected=expected, hint=hint)
    return tie


def _ties(campaign: Campaign) -> list[Tie]:
    """Parse the ties and sort them: each after the ties of the parameters that it uses."""
    ties: dict[str, Tie] = {}
    for name, setting in campaign.fit.parameters.items():
        if setting.tie:
            with error_location(place=f"fit.{name}"):
                ties[name] = _tie(campaign, name, setting)
    try:
        order = [*TopologicalSorter({name: ties.keys() & {*tie.names} for name, tie in ties.items()}).static_order()]
    except CycleError as error:
        circle = ", ".join(f"{name} = {ties[name].expression}" for name in error.args[1][:0:-1])
        expected = "one that is free"
        raise CampaignError("parameters are tied in a circle", place="fit", found=circle, expected=expected) from None
    return [ties[name] for name in order]
