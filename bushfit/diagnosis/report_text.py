"""The reported diagnosis: summary, named effects with their sizes, regions of disagreement and next test."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from bushfit.diagnosis.described import GapDescription, describe
from bushfit.diagnosis.document import Verdict
from bushfit.diagnosis.evidence import Evidence, fit, result_of
from bushfit.diagnosis.explanation_text import (
    LEVELS,
    NAMELESS,
    causes_text,
    claim_entries,
    explanation_odds,
    label,
    list_candidates,
    probability_text,
    undecided_text,
)
from bushfit.diagnosis.holdout import HoldOut, hold_out
from bushfit.diagnosis.hypotheses import DiagnosisRequest, Hypothesis, mean_parameters
from bushfit.diagnosis.locate import find_regions
from bushfit.diagnosis.next_test import deciding_test
from bushfit.diagnosis.priors import LARGEST_CLOSED_GAP, NAMED
from bushfit.diagnosis.record import Diagnosis, MisfitRegion, NamedCause
from bushfit.diagnosis.search import Search
from bushfit.diagnosis.verdict import Composition, Finding, decide_verdict
from bushfit.effects import get_effect, qualified_name
from bushfit.effects.mistakes import get_candidate
from bushfit.effects.unnamed import NAME as UNNAMED
from bushfit.fitting.preparation import split_by_kind, with_gain_weighting
from bushfit.model.covariance import Covariance
from bushfit.model.result import Result
from bushfit.units import display_unit, format_aligned, number

#: Summary if there is no gap; and note on tests of one direction.
_NOTHING = "the tests show no missing effect beyond noise and tolerance"
_ONE_DIRECTION = (
    "one direction was tested: a deviation of the compound and a smooth fault of the rig cannot be distinguished; test "
    "another direction or specimen"
)


@dataclass(frozen=True, eq=False)
class DiagnosisWriter:
    """Builder of the reported diagnosis from the verdict of a search.

    Args:
        search: completed search, with the tests.
        finding: verdict on the hypotheses, with the explanations to report.
        hypotheses: all hypotheses that were compared, the most probable first.
    """

    search: Search
    finding: Finding
    hypotheses: Sequence[Hypothesis]
    _refitted: dict[Evidence, Evidence] = field(default_factory=dict)

    @property
    def request(self) -> DiagnosisRequest:
        """Input of the search, with the tests and the starting model fitted to them."""
        return self.search.request

    @property
    def first(self) -> Composition | None:
        """Most probable explanation of the gap that is reported; None if nothing is missing."""
        return self.finding.reported[0] if self.finding.reported else None

    def diagnosis(self) -> Diagnosis:
        """Build the diagnosis with all texts.

        Returns:
            Verdict, effects, regions, hold-out, next test and the model to use.
        """
        verdict, first = self.finding.verdict, self.first
        if first is None:
            return self._build(_NOTHING, self.request.base)
        if verdict in ("named", "partly"):
            return self._mistaken_record(first) if first.best.claim else self._named(first)
        return self._open(first)

    def _named(self, first: Composition) -> Diagnosis:
        """Diagnosis in which named effects explain the gap, or part of it with a description of the rest."""
        names, base = self.finding.names, self._with_free_gains(self.request.base)
        after, known = self._fit_with(first)
        plain, verbs = self._with_free_gains(after), ("closes", "explains") if len(names) == 1 else ("close", "explain")
        why = f"lowers chi-square by {base.chi_square - plain.chi_square:.0f}"
        why += " with the other named effects" * (len(names) > 1)
        entries = [NamedCause(name, f"{why}; {probability_text(first, self.finding)}") for name in names]
        gap, holdout, summary = None, None, f"{' and '.join(names)} {verbs[0]} the gap"
        if self.finding.verdict == "named":
            holdout = hold_out(base, plain, self.request.data.bounds)
        else:
            excess = [max(fitted.mean_square - 1.0, 0.0) for fitted in (base, plain)]
            share = 100.0 * (1.0 - excess[1] / excess[0]) if excess[0] else 100.0
            part = f"{number(share, 2)} %" if share >= 1.0 else "part"
            summary = f"{' and '.join(names)} {verbs[1]} {part} of the gap"
            gap = None if first.best.levels else self._described(after)
            entries += [NamedCause(UNNAMED, gap.evidence)] if gap else []
        rest = [part.name for part in first.faulty_parts] + [LEVELS] * first.best.levels
        rest += [f"{NAMELESS} ({gap.sentence})" if gap else NAMELESS] * bool(gap or first.unnamed)
        places = first.best if first.faulty_parts else None
        diagnosis = self._build(
            summary, gap.after if gap else after, entries, rest, places=places, gap=gap, holdout=holdout, known=known
        )
        absent = tuple(name for name in names if _may_be_absent(name, diagnosis.result))
        if holdout and (absent or (holdout.after or 0.0) > LARGEST_CLOSED_GAP):
            finding = decide_verdict(self.hypotheses, self.request.settings.tolerance, gap_stays=True)
        elif absent:  # the model does without these effects
            kept, leads = tuple(name for name in names if name not in absent), (*absent, *self.finding.leads)
            finding = replace(self.finding, verdict="partly" if kept else "described", names=kept, leads=leads)
        else:
            return diagnosis
        return replace(self, finding=finding).diagnosis()

    def _fit_with(self, first: Composition) -> tuple[Evidence, Covariance | None]:
        """Fit the starting model with the effects of an explanation that are certain.

        Args:
            first: the explanation. If it also contains a deviation of the compound, the amounts of the effects are
                fixed at their posterior means, because a fit without the deviation would distort them.

        Returns:
            The fit, and the covariance of the amounts that were fixed; None if all were fitted.
        """
        base, bounds, names = self.request.base, self.request.data.bounds, self.finding.names
        if not names:
            return base, None
        refitted = [h for h in self.hypotheses if h.refitted and not h.claim and set(h.effects) >= set(names)]
        if not first.unnamed:
            state = min((h.state for h in refitted), key=lambda state: len(state.effects) > len(names))
            model = state.evidence.model.without(*{*state.effects} - {*names})
            return fit(model, base.data_sets, base.fixed, bounds), None
        model = base.model
        for name in names:
            model = model.with_effect(name)
        added, known = mean_parameters(refitted, [name for name in model.values if name not in base.model.values])
        return fit(model.with_values(added), base.data_sets, [*base.fixed, *added], bounds), known

    def _described(self, evidence: Evidence) -> GapDescription | None:
        """Describe the gap of a fit by a smooth correction; None if effects are excluded or no correction is valid."""
        data, base, fitted = self.request.data, self.request.base, self._with_free_gains(evidence)
        if not self.request.settings.max_effects:
            return None
        return describe(
            fitted,
            data.campaign.rig,
            self.request.start,
            data.bounds,
            before=self._with_free_gains(base),
            has_candidates=self.finding.verdict == "ambiguous",
        )

    def _mistaken_record(self, first: Composition) -> Diagnosis:
        """Diagnosis in which a mistake in the record explains the gap; the model to use is unchanged."""
        best, claim = first.best, first.best.claim
        assert claim is not None
        command, corrections = f"bushfit diagnose CAMPAIGN {claim.options}", "; ".join(claim.corrections)
        advice = f"if the records of the tests confirm this mistake, state {corrections} (or {command})"
        summary = f"these tests agree if {claim.sentence}"
        entries = claim_entries(first, self.finding, self.request.base)
        diagnosis = self._build(summary, self.request.base, entries, places=best, next_test=advice)
        warning = f"fitted to the tests as they are, which only agree if {claim.sentence}: {advice}"
        after = self._with_free_gains(best.state.evidence)
        return replace(
            diagnosis,
            after=after,
            remainder=find_regions(after),
            holdout=hold_out(diagnosis.before, after, self.request.data.bounds),
            result=replace(diagnosis.result, warnings=(*diagnosis.result.warnings, warning)),
        )

    def _open(self, first: Composition) -> Diagnosis:
        """Diagnosis of a gap without a certain cause: additions that close it, candidate causes, and a deciding test.

        If neither a test nor the record is suspected to be wrong, the effects that all probable explanations contain
        close the gap together with a smooth correction. The candidates are the reported explanations with causes.
        """
        finding, reported, verdict = self.finding, self.finding.reported, self.finding.verdict
        bounds = self.request.data.bounds
        is_ambiguous = verdict == "ambiguous"
        faulty = [composition for composition in reported if composition.faulty_parts] if is_ambiguous else [first]
        may_be_wrong = is_ambiguous and (faulty or any(composition.best.claim for composition in reported))
        after, known = self._fit_with(first)
        gap, holdout = None if may_be_wrong or verdict == "unexplained" else self._described(after), None
        if finding.names and not gap:  # without the rest, their amounts may be distorted
            holdout = hold_out(self._with_free_gains(self.request.base), self._with_free_gains(after), bounds)
            if (holdout.after or np.inf) >= (holdout.before or 0.0):
                return replace(self, finding=replace(finding, names=())).diagnosis()
        rest = "the rest of the gap" if finding.names else "the gap"
        closing = [f"a smooth correction closes {rest}: {gap.sentence}"] if gap else []
        candidates = [c for c in reported if c.probability > 1.0 - NAMED and c.causes]
        leader, advice = candidates[0] if candidates else first, self._deciding_test()
        if claim := leader.best.claim:
            advice = f"check the records of the tests; {'; '.join(claim.corrections)}"
        elif decided := [*(x for x in finding.leads if get_candidate(x).twins), *(() if advice else leader.names)]:
            advice = get_effect(decided[0]).confirmed_by  # of a lead: whether it is of the bushing or of the rig
        if is_ambiguous:
            sentences = [undecided_text(reported), *closing]
            others = tuple(label(composition) for composition in reported if composition is not leader)
            entries = claim_entries(leader, finding, self.request.base, others)
            entries += [NamedCause(x, probability_text(leader, finding), others) for x in leader.names if not claim]
        else:
            sentences = [*(closing or ["no known effect closes the gap"]), *causes_text(candidates, finding)]
            entries = [NamedCause(UNNAMED, gap.evidence, tuple(map(label, candidates)))] if gap else []
            at_fault = " and ".join(part.name for part in first.best.faulty_parts)
            if gap:
                sentences += [f"it is largest at {at_fault}"] if at_fault else []
            elif at_fault:
                sentences = [f"measure again first: {at_fault}; all other tests disagree with this part"]
            elif verdict == "unexplained":
                sentences = ["the levels disagree by more than the class of the rig, and nothing else is missing"]
                advice = "measure the levels again in another session, or state the class of the rig (gain_error under "
                advice += "[rig])"
            verdict = "described" if gap else "unexplained"
        return self._build(
            "; ".join(sentences),
            gap.after if gap else after,
            entries,
            verdict=verdict,
            places=faulty[0].best if faulty and not gap else None,
            next_test=advice,
            gap=gap,
            holdout=holdout,
            known=known,
        )

    def _deciding_test(self) -> str:
        """Test that separates the reported explanations with effects; "" if none does."""
        fitted = [c for c in self.finding.reported if c.best.effects and c.best.refitted]
        models, odds = [c.best.state.evidence.model for c in fitted], [c.probability for c in fitted]
        return deciding_test(models, odds, self.request.base.data_sets, self.request.data.campaign.rig)

    def _build(
        self,
        summary: str,
        after: Evidence,
        entries: Sequence[NamedCause] = (),
        remainder: Sequence[str] = (),
        *,
        verdict: Verdict | None = None,
        places: Hypothesis | None = None,
        next_test: str = "",
        gap: GapDescription | None = None,
        holdout: HoldOut | None = None,
        known: Covariance | None = None,
    ) -> Diagnosis:
        """Build the diagnosis with regions, hold-out, candidates and the model to use.

        Args:
            summary: verdict as a sentence.
            after: fit with the additions, or the starting fit.
            entries: named effects or mistakes.
            remainder: names of the parts of the gap that the entries do not explain; empty if they explain it all.
            verdict: verdict in one word; None for the verdict of `finding`.
            places: hypothesis whose faulty parts of the tests are reported; None without any.
            next_test: advice on the next test; "" for the usual confirmation of the first entry.
            gap: description of a gap without a name; None without one.
            holdout: residuals of held-out tests, if they were computed before.
            known: covariance of the effects' parameters that the fit `after` kept fixed; None without any.
        """
        base, after = self._with_free_gains(self.request.base), self._with_free_gains(after)
        verdict, bounds = verdict or self.finding.verdict, self.request.data.bounds
        if not next_test and entries:
            next_test = get_effect(entries[0].name).confirmed_by
        at_fault = list[MisfitRegion]()
        for part in places.faulty_parts if places else ():
            kind, component = ("loop", "force") if part.family == "loop" else ("sweep", "storage")
            reading = f"{part.name}: a deviation of {number(100 * places.change, 2)} % from all other tests"  # type: ignore[union-attr]
            excess = part.distance(base.residual)
            at_fault.append(
                MisfitRegion(part.direction, kind, part.frequency, part.amplitude, component, excess, reading)
            )
        if places and places.faulty_parts:
            next_test = f"measure again: {places.faulty_parts[0].name}"
        lacking = not (self.first and self.first.best.claim)
        resolved, corrected = {*base.model.effects} - {*self.request.settings.unresolved}, gap.fitted if gap else None
        regions = tuple(sorted((*at_fault, *find_regions(base)), key=lambda region: -region.excess))
        odds = explanation_odds(self.finding)
        rig = self.request.data.campaign.rig
        fitted = result_of(after, bounds, resolved, lacking=lacking, corrected=corrected, rig=rig, fixed=known)
        result = odds.averaged(fitted)
        amounts = filter(None, (_format_amount(entry.name, result) for entry in entries))
        return Diagnosis(
            verdict,
            "; ".join([summary, *amounts, *([f"the rest: {' and '.join(remainder)}"] if remainder else [])]),
            tuple(entries),
            regions,
            regions if after is base else find_regions(after),
            gap.holdout if gap else holdout or hold_out(base, after, bounds),
            next_test,
            tuple(list_candidates(self.search, self.hypotheses, self.first)),
            base,
            after,
            result,
            tuple(self._notes()),
            gap.description if gap else None,
            odds,
        )

    def _with_free_gains(self, evidence: Evidence) -> Evidence:
        """Refit a model without the assumed gain error of loops; unchanged if the campaign states a gain error."""
        loops = split_by_kind(evidence.data_sets)[0]
        gain_is_stated = self.request.data.campaign.rig.stiffness_errors[0] is not None
        if gain_is_stated or not any(loop.gain_weighs for loop in loops):
            return evidence
        if evidence not in self._refitted:
            data_sets = with_gain_weighting(evidence.data_sets, weigh=False)
            self._refitted[evidence] = fit(evidence.model, data_sets, evidence.fixed, self.request.data.bounds)
        return self._refitted[evidence]

    def _notes(self) -> list[str]:
        """Sentences on the effects and kinds of fault that these tests cannot show."""
        unseen = [proposal.name for proposal in self.search.root.proposals if not proposal.visible]
        unseen = [name for name in unseen if not get_effect(name).depends_on]  # not those that need a stated condition
        notes = [f"not identifiable from these tests: {', '.join(unseen)}"] if unseen else []
        directions = {str(test.direction) for test in self.request.base.data_sets}
        return [*notes, *([_ONE_DIRECTION] if self.first and self.first.unnamed and len(directions) == 1 else [])]


def _may_be_absent(name: str, result: Result) -> bool:
    """True if an effect may be absent: its amount is neutral, or its 95 % interval contains the neutral amount."""
    effect = get_effect(name)
    amount, neutral = qualified_name(effect, effect.amount), effect.amount.neutral
    if neutral is None or effect.replaces is not None or amount not in result.model.values:
        return False
    low, high = result.interval(amount) or (result.model.values[amount],) * 2
    return low <= neutral <= high


def _format_amount(name: str, result: Result) -> str:
    """Text on the amount of an effect in a model, with unit and 95 % interval; "" if the model has no such amount."""
    if name == UNNAMED or name not in result.model.effects or (effect := get_effect(name)).replaces is not None:
        return ""
    amount, parameter = effect.amount, qualified_name(effect, effect.amount)
    value, interval = result.model.values[parameter], result.interval(parameter)
    unit, factor = display_unit(amount.unit, 1.0, value)
    value_text, *ends = format_aligned([factor * x for x in (value, *(interval or ()))], 3)
    text = f"{amount.meaning or amount.name}: {f'{value_text} {unit}'.removesuffix(' -').removesuffix(' 1')}"
    return f"{text} (95 % interval {ends[0]} to {ends[1]})" if ends else text
