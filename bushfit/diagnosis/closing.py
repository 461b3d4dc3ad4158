"""Close the gap between model and tests: by effects that are certain, and a smooth correction of the stiffness."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bushfit.campaign.schema import RigSettings
from bushfit.diagnosis.document import Description
from bushfit.diagnosis.fits import fit_model
from bushfit.diagnosis.holdout import HoldOut, HoldOutPart, hold_out
from bushfit.diagnosis.hypotheses import Hypothesis, mean_parameters
from bushfit.diagnosis.locate import find_regions
from bushfit.diagnosis.power_law import nearest_power_law
from bushfit.diagnosis.priors import LARGEST_REMAINING_SHARE
from bushfit.diagnosis.search import Search
from bushfit.diagnosis.verdict import Finding
from bushfit.effects.contract import Array
from bushfit.effects.unnamed import NAME, SmoothCorrection
from bushfit.errors import FitError
from bushfit.fitting.agreement import LeaveOut
from bushfit.fitting.coordinates import Bounds
from bushfit.fitting.descent import Descent
from bushfit.fitting.discrepancy import Discrepancy, FittedTests
from bushfit.fitting.model_error import with_model_error
from bushfit.fitting.preparation import MeasuredTest, split_by_kind, with_gain_weighting
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.problem import FitProblem, FitResult
from bushfit.gaussian_process import MAXIMUM_NODES
from bushfit.model.covariance import Z95, Covariance
from bushfit.units import number

#: Maximum number of model evaluations in the refit that the power law is added to: this refit must converge.
_EVALUATIONS = 400


@dataclass(frozen=True, eq=False)
class GapDescription:
    """Gap between model and tests that no known effect explains, described by a smooth correction of the stiffness.

    Args:
        after: model with its smooth correction of the stiffness, and the tests with loops replaced by their first
            harmonic.
        fitted: fit of the parameters with the correction treated as a random error of the model.
        holdout: root mean square residuals of held-out runs inside the tested range, without and with the correction.
        description: power law of frequency and amplitude nearest to the correction; None if the tests show none.
        sentence: text on the size and the form of the gap, for the summary.
        evidence: text on the range of tests in which the correction is valid.
    """

    after: FitResult
    fitted: FitResult
    holdout: HoldOut
    description: Description | None
    sentence: str
    evidence: str


def describe_gap(
    fit: FitResult,
    rig: RigSettings,
    start: Mapping[str, float],
    bounds: Bounds,
    *,
    before: FitResult | None = None,
    has_candidates: bool = False,
) -> GapDescription | None:
    """Correct a model by a smooth function of ln frequency and ln strain, for a gap that no known effect explains.

    The correction is added to the stiffness and described by the nearest power law of frequency and amplitude. Its
    force within a cycle is unknown, so loops are represented by their first harmonic.

    Args:
        fit: the fitted model and the tests.
        rig: stated accuracy class of the rig (gain and phase errors).
        start: starting values estimated from the data, because the gap distorts the fitted parameters.
        bounds: limits of parameters inside their general limits.
        before: fit of the starting model, with whose held-out residuals the correction is compared; None for `fit`.
        has_candidates: True if known effects may explain the gap; the power law is then not estimated.

    Returns:
        The corrected model with its description. None if the correction does not reduce the residuals of held-out
        tests, if the model already has a correction, or if the first harmonics cannot be fitted.
    """
    if NAME in fit.model.effects:
        return None
    description, harmonic = None, tuple(test.fundamental() for test in fit.data_sets)
    fitted, correction = with_model_error(fit, bounds, rig, certain=True)
    if correction is None:
        return None
    plain = replace(fitted, noise_weighted=())  # residuals of the tests with their noise alone
    closest = plain.reevaluate(fitted.model, harmonic)
    beside_effects = _hold_out_inside(fit, closest, correction)
    excess = [(value or 1.0) - 1.0 for value in (beside_effects.before, beside_effects.after)]
    remaining_share = LARGEST_REMAINING_SHARE if correction.uncertainty >= 1.0 else 1.0
    if beside_effects.parts and max(excess[1], 0.0) > remaining_share * excess[0]:
        return None
    half = Z95 * correction.uncertainty * correction.largest
    largest, error = (number(100.0 * size, 2) for size in (correction.largest, half))
    sentence = f"up to {largest} ± {error} % of |K| with refitted parameters"
    if not has_candidates:
        try:
            problem = FitProblem.with_fixed(fit.model, harmonic, fit.fixed_names, bounds)
            base = Descent.start(problem).run(_EVALUATIONS).solution
            problem = FitProblem.with_fixed(base.model, harmonic, (*fit.fixed_names, *base.at_bound), bounds)
            base = Descent.start(problem).run(_EVALUATIONS).solution
        except FitError:  # too few points are left for the parameters
            return None
        law = nearest_power_law(base, rig, start, bounds)
        if law and law.is_likely and any(law.are_determined):
            description = Description(law.phase_deg, law.frequency_power, law.amplitude_power, law.sentence)
            sentence += f"; {law.sentence}"
    model = replace(fitted.model, effects=(*fit.model.effects, NAME), unnamed=correction)
    after = plain.reevaluate(model, with_gain_weighting(harmonic, weigh=True))
    whole = plain.reevaluate(model, fit.data_sets)
    holdout = beside_effects if before is None else _hold_out_inside(before, closest, correction)
    return GapDescription(after, fitted, holdout, description, sentence, _validity_sentence(correction, whole))


def _hold_out_inside(before: FitResult, closest: FitResult, correction: SmoothCorrection) -> HoldOut:
    """Predict parts of the sweeps inside the tested range from the other parts, without and with the correction.

    Args:
        before: fit of the model without the correction.
        closest: closest fit, without the correction, with loops replaced by their first harmonic.
        correction: correction of this fit. Its Gaussian process is conditioned on the other parts of the tests alone.

    Returns:
        Root mean square residuals, without and with the correction, of every third frequency (or amplitude, where that
        is stepped), of the middle level and of the last repeat of the sweeps.
    """
    chosen: dict[str, dict[MeasuredTest, Array]] = {}
    for sweep in split_by_kind(before.data_sets)[1]:
        rank = np.unique(sweep.step, return_inverse=True)[1]
        levels, level = np.unique(sweep.run_level, return_inverse=True)
        last_repeat = (sweep.repeat == sweep.repeat.max()) & (np.ptp(sweep.repeat) > 0)
        masks = {
            f"every third {sweep.test.stepped or 'point'}": (rank % 3 == 1) & (rank < rank.max()),
            "the middle of the held-out part": (level == levels.size // 2) & (levels.size > 2),
            "the last repeat": last_repeat,
        }
        for name, mask in masks.items():
            if mask.any():
                chosen.setdefault(name, {})[sweep] = mask
    groups = tuple(patch.directions for patch in correction.patches)
    process = Discrepancy.over_tests(FittedTests(closest), groups, correction.lengths, MAXIMUM_NODES)
    columns = process.tests.residual_changes(correction.size * process.complex_shapes)
    amounts = np.eye(len(columns), closest.residual.size + len(columns), closest.residual.size)  # rows of their prior
    amounts[:, : columns.shape[1]] = columns
    slopes = np.pad(closest.jacobian[closest.inner_indices], ((0, 0), (0, len(columns))))
    with_process = LeaveOut.from_fit(np.concatenate((slopes, amounts)), np.pad(closest.residual, (0, len(columns))))
    without_process = LeaveOut.from_fit(before.jacobian[before.inner_indices], before.residual)
    models = (before, without_process, len(before.inner_indices)), (closest, with_process, len(slopes))
    residuals = dict[str, Array]()
    for name, by_sweep in chosen.items():
        pairs = []
        for fit, leave_out, count in models:
            rows = HoldOutPart.of_tests(name, by_sweep, fit.data_sets).rows(fit.data_sets)
            rows = np.pad(rows, (0, leave_out.residual.size - rows.size))
            if not leave_out.undetermined(rows)[:count].any():  # else the rest does not determine the parameters
                pairs.append(leave_out.predicted_residual(rows))
        if len(pairs) == len(models):
            residuals[name] = np.array(pairs)
    return HoldOut.from_residuals(residuals)


def _validity_sentence(correction: SmoothCorrection, whole: FitResult) -> str:
    """Sentence with the range of frequency and amplitude of the correction, and the misfit of the worst loop."""

    def span(values: Sequence[float], factor: float = 1.0) -> str:
        return " to ".join(number(factor * end, 2) for end in (min(values), max(values)))

    patches = "; ".join(
        f"{', '.join(patch.directions)} {span(patch.frequency_Hz)} Hz, {span(patch.strain, 100.0)} % strain"
        for patch in correction.patches
    )
    misfit = max((region.excess for region in find_regions(whole) if region.kind == "loop"), default=0.0)
    stays = f" (in the shape of loops, a gap of {number(misfit, 2)} σ remains)" if misfit else ""
    loops = f"; in loops, it changes the first harmonic only{stays}" if split_by_kind(whole.data_sets)[0] else ""
    return f"no effect explains it; valid only for this bushing and between these tests ({patches}){loops}"


@dataclass(frozen=True, eq=False)
class ClosedGap:
    """Fits that reduce the misfit of a diagnosed campaign: with the effects found, then with a smooth correction.

    Args:
        effects_fit: fit of the starting model with the effects whose probability is 97 % or more, if any.
        fixed_amounts: covariance of those effects' parameters that this fit kept fixed; None if all were fitted.
        gap: smooth correction of the stiffness for the rest of the misfit; None without a correction.
        holdout: root mean square residuals of held-out tests, if they were compared with and without the effects.
    """

    effects_fit: FitResult
    fixed_amounts: Covariance | None = None
    gap: GapDescription | None = None
    holdout: HoldOut | None = None

    @property
    def final_fit(self) -> FitResult:
        """Fit of the model to report: with the smooth correction if there is one, else with the effects alone."""
        return self.gap.after if self.gap else self.effects_fit


def close_gap(search: Search, finding: Finding, hypotheses: Sequence[Hypothesis], base: FitResult) -> ClosedGap:
    """Fit the effects with a probability of 97 % or more, and correct the stiffness for the rest of the misfit.

    The correction is a smooth function of frequency and strain. It is left out if the effects explain the misfit, or if
    tests may be faulty or wrongly recorded. The amounts of effects may then be distorted, so held-out tests are
    predicted with and without them.

    Args:
        search: completed search, with the tests.
        finding: verdict, with the explanations to report.
        hypotheses: all hypotheses that were compared, the most probable first.
        base: fit of the starting model without the assumed gain errors of loops, see `without_assumed_gain_errors`.

    Returns:
        The fit, the smooth correction, and the misfit of held-out tests where the two are compared.
    """
    verdict, reported, data = finding.verdict, finding.reported, search.data
    may_be_wrong = {
        "partly": reported[0].best.has_level_errors,
        "ambiguous": any(composition.faulty_parts or composition.best.mistake for composition in reported),
    }
    certain, amounts = _fit_certain(search, finding, hypotheses)
    fit, gap = base if certain is search.base else without_assumed_gain_errors(certain, data), None
    if search.settings.max_effects and verdict not in ("named", "unexplained") and not may_be_wrong.get(verdict):
        rig, has_candidates = data.campaign.rig, verdict == "ambiguous"
        gap = describe_gap(fit, rig, search.start, data.bounds, before=base, has_candidates=has_candidates)
    is_compared = verdict == "named" or (verdict == "ambiguous" and finding.names and not gap)
    return ClosedGap(fit, amounts, gap, hold_out(base, fit, data.bounds) if is_compared else None)


def _fit_certain(
    search: Search, finding: Finding, hypotheses: Sequence[Hypothesis]
) -> tuple[FitResult, Covariance | None]:
    """Fit the starting model with the effects of a finding that are certain (a probability of 97 % or more).

    If the first explanation also contains a smooth deviation of the rubber, the amounts of the effects are fixed at
    their posterior means, because a fit without the deviation would distort them.

    Returns:
        The fit, and the covariance of the amounts that were fixed; None if all were fitted.
    """
    base, bounds, names = search.base, search.data.bounds, finding.names
    refitted = [h for h in hypotheses if h.is_refitted and not h.mistake and set(h.effects) >= set(names)]
    if not names or not refitted:
        return base, None
    if not finding.reported[0].unnamed:
        state = min((h.state for h in refitted), key=lambda state: len(state.effects) > len(names))
        model = state.fit.model.without(*{*state.effects} - {*names})
        return fit_model(model, base.data_sets, base.fixed_names, bounds), None
    model = base.model
    for name in names:
        model = model.with_effect(name)
    added, covariance = mean_parameters(refitted, [name for name in model.values if name not in base.model.values])
    return fit_model(model.with_values(added), base.data_sets, [*base.fixed_names, *added], bounds), covariance


def without_assumed_gain_errors(fit: FitResult, data: PreparedCampaign) -> FitResult:
    """Refit with weights that exclude an assumed gain error of loops; return the same fit if [rig] states the error."""
    gain_is_stated = data.campaign.rig.stiffness_errors[0] is not None
    if gain_is_stated or not any(loop.gain_weighs for loop in split_by_kind(fit.data_sets)[0]):
        return fit
    return fit_model(fit.model, with_gain_weighting(fit.data_sets, weigh=False), fit.fixed_names, data.bounds)
