"""Close the gap between model and tests as far as possible: with effects that are certain, and a smooth correction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from bushfit.diagnosis.described import GapDescription, describe
from bushfit.diagnosis.fits import fit_model
from bushfit.diagnosis.holdout import HoldOut, hold_out
from bushfit.diagnosis.hypotheses import Hypothesis, mean_parameters
from bushfit.diagnosis.search import Search
from bushfit.diagnosis.verdict import Finding
from bushfit.fitting.preparation import split_by_kind, with_gain_weighting
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.problem import FitResult
from bushfit.model.covariance import Covariance


@dataclass(frozen=True, eq=False)
class Closing:
    """Fitted model that closes the gap between model and tests as far as possible.

    Args:
        certain: fit of the starting model with the effects that are certain.
        known: covariance of the amounts of effects that the fit kept fixed; None without any.
        gap: smooth correction of the model for the rest of the gap, with its description; None without a correction.
        holdout: residuals of held-out tests, if they were needed to decide on a correction; else None.
    """

    certain: FitResult
    known: Covariance | None = None
    gap: GapDescription | None = None
    holdout: HoldOut | None = None

    @property
    def fit(self) -> FitResult:
        """Model that closes the gap: with the certain effects, and with the smooth correction if there is one."""
        return self.gap.after if self.gap else self.certain


def close_gap(search: Search, finding: Finding, hypotheses: Sequence[Hypothesis], base: FitResult) -> Closing:
    """Fit the effects that are certain, and correct the model for the rest of the gap by a smooth function.

    The model is not corrected if the effects close the gap, or if tests may be faulty or wrongly recorded. The amounts
    of effects may then be distorted, so held-out tests are predicted with and without them.

    Args:
        search: completed search, with the tests.
        finding: verdict, with the explanations to report.
        hypotheses: all hypotheses that were compared, the most probable first.
        base: fit of the starting model without the assumed gain errors of loops, see `with_free_gains`.
    """
    verdict, reported, data = finding.verdict, finding.reported, search.data
    may_be_wrong = {
        "partly": reported[0].best.levels,
        "ambiguous": any(composition.faulty_parts or composition.best.claim for composition in reported),
    }
    certain, known = _fit_certain(search, finding, hypotheses)
    fit, gap = base if certain is search.base else with_free_gains(certain, data), None
    if search.settings.max_effects and verdict not in ("named", "unexplained") and not may_be_wrong.get(verdict):
        rig, has_candidates = data.campaign.rig, verdict == "ambiguous"
        gap = describe(fit, rig, search.start, data.bounds, before=base, has_candidates=has_candidates)
    is_compared = verdict == "named" or (verdict == "ambiguous" and finding.names and not gap)
    return Closing(fit, known, gap, hold_out(base, fit, data.bounds) if is_compared else None)


def _fit_certain(
    search: Search, finding: Finding, hypotheses: Sequence[Hypothesis]
) -> tuple[FitResult, Covariance | None]:
    """Fit the starting model with the effects of a finding that are certain.

    If the first explanation also contains a smooth deviation of the rubber, the amounts of the effects are fixed at
    their posterior means, because a fit without the deviation would distort them.

    Returns:
        The fit, and the covariance of the amounts that were fixed; None if all were fitted.
    """
    base, bounds, names = search.base, search.data.bounds, finding.names
    refitted = [h for h in hypotheses if h.refitted and not h.claim and set(h.effects) >= set(names)]
    if not names or not refitted:
        return base, None
    if not finding.reported[0].unnamed:
        state = min((h.state for h in refitted), key=lambda state: len(state.effects) > len(names))
        model = state.fit.model.without(*{*state.effects} - {*names})
        return fit_model(model, base.data_sets, base.fixed, bounds), None
    model = base.model
    for name in names:
        model = model.with_effect(name)
    added, known = mean_parameters(refitted, [name for name in model.values if name not in base.model.values])
    return fit_model(model.with_values(added), base.data_sets, [*base.fixed, *added], bounds), known


def with_free_gains(fit: FitResult, data: PreparedCampaign) -> FitResult:
    """Refit a model without the gain error of loops that bushfit assumes if the campaign states none."""
    gain_is_stated = data.campaign.rig.stiffness_errors[0] is not None
    if gain_is_stated or not any(loop.gain_weighs for loop in split_by_kind(fit.data_sets)[0]):
        return fit
    return fit_model(fit.model, with_gain_weighting(fit.data_sets, weigh=False), fit.fixed, data.bounds)
