"""The reported diagnosis: what closes the gap, and the texts on it.

`DiagnosisWriter` receives the verdict of a search, and changes it if held-out tests or intervals contradict it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from bushfit.caveat import Caveat, join_names
from bushfit.diagnosis.closing import ClosedGap, close_gap, without_assumed_gain_errors
from bushfit.diagnosis.document import Verdict
from bushfit.diagnosis.explanation_text import (
    causes_text,
    check_first,
    explanation_odds,
    format_amount,
    leads_text,
    list_candidates,
    probability_text,
    undecided_text,
)
from bushfit.diagnosis.fits import result_of
from bushfit.diagnosis.holdout import HoldOut, hold_out
from bushfit.diagnosis.hypotheses import Hypothesis
from bushfit.diagnosis.locate import find_regions
from bushfit.diagnosis.next_test import MEASURE_AGAIN, deciding_test
from bushfit.diagnosis.priors import DOES_NOT_FIT, LARGEST_CLOSED_GAP, LEAST_NAMED_SHARE, NAMED
from bushfit.diagnosis.record import Diagnosis, NamedCause
from bushfit.diagnosis.rig_shares import with_alternatives
from bushfit.diagnosis.search import Search
from bushfit.diagnosis.verdict import LEVELS, NAMELESS, Composition, Finding, decide_verdict
from bushfit.effects import get_effect, get_parameter, qualified_name
from bushfit.effects.unnamed import NAME as UNNAMED
from bushfit.fitting.agreement import prior_uses, prior_warnings
from bushfit.fitting.problem import FitResult
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.units import number

#: Summary if there is no gap; and warning if one direction was tested.
_NOTHING = "the tests show no missing effect beyond noise and tolerance"
_ONE_DIRECTION = Caveat(
    "one_direction",
    "only one direction was tested: a smooth fault of the rig, such as a compliant fixture, would be taken for a "
    "property of the rubber. Test another direction or specimen, or a spring of known stiffness, or state the size of "
    "the compliance (compliance_error under [rig])",
)
#: Advice if levels disagree by more than the class of the rig.
_LEVELS_ADVICE = "measure the levels again in another session, or state the class of the rig (gain_error under [rig])"


@dataclass(frozen=True, eq=False)
class DiagnosisWriter:
    """Builder of the reported diagnosis from the verdict of a search.

    Args:
        search: completed search, with the tests and the starting model fitted to them.
        finding: verdict on the hypotheses, with the explanations to report.
        hypotheses: all hypotheses that were compared, the most probable first.
        base: fit of the starting model without the assumed gain errors of loops, see `without_assumed_gain_errors`.
    """

    search: Search
    finding: Finding
    hypotheses: Sequence[Hypothesis]
    base: FitResult

    @property
    def first(self) -> Composition | None:
        """Most probable explanation of the gap that is reported; None if nothing is missing."""
        return self.finding.reported[0] if self.finding.reported else None

    def diagnosis(self) -> Diagnosis:
        """Return the diagnosis with all texts: verdict, effects, regions, hold-out, next test, model to use."""
        first, verdict = self.first, self.finding.verdict
        if first is None:
            return self._build(ClosedGap(self.base), _NOTHING)
        mistakes = {reported.best.mistake and reported.best.mistake.key for reported in self.finding.reported}
        if verdict in ("named", "partly", "ambiguous") and first.best.mistake and len(mistakes) == 1:
            return self._record_diagnosis(first)
        closing = close_gap(self.search, self.finding, self.hypotheses, self.base)
        if verdict in ("named", "partly"):
            diagnosis = self._named_diagnosis(first, closing)
            revised = self._revised_finding(diagnosis, closing.holdout)
            return replace(self, finding=revised).diagnosis() if revised else diagnosis
        if (holdout := closing.holdout) and (holdout.after or np.inf) >= (holdout.before or 0.0):
            return replace(self, finding=replace(self.finding, names=())).diagnosis()
        write = self._undecided_diagnosis if verdict == "ambiguous" else self._nameless_diagnosis
        return write(first, closing)

    def _named_diagnosis(self, first: Composition, closing: ClosedGap) -> Diagnosis:
        """Diagnosis in which named effects explain the gap, or part of it with a description of the rest."""
        names, base, fit, gap = self.finding.names, self.base, closing.effects_fit, closing.gap
        verbs = ("closes", "explains") if len(names) == 1 else ("close", "explain")
        why = f"lowers chi-square by {base.chi_square - fit.chi_square:.0f}"
        why += " with the other named effects" * (len(names) > 1)
        entries = [NamedCause(name, f"{why}; {probability_text(name, self.finding)}") for name in names]
        summary, advice = f"{join_names(names)} {verbs[0]} the gap", ""
        if self.finding.verdict == "partly":
            excess = [max(fitted.mean_square - 1.0, 0.0) for fitted in (base, fit)]
            share = 100.0 * (1.0 - excess[1] / excess[0]) if excess[0] else 100.0
            part = "more than 99 %" if share > 99.0 else f"{number(share, 2)} %" if share >= 1.0 else "part"
            summary = f"{join_names(names)} {verbs[1]} {part} of the gap"
            if share < 50.0:  # the next test is for the larger part
                advice = _LEVELS_ADVICE if first.best.has_level_errors else get_effect(UNNAMED).confirmed_by
            entries += [NamedCause(UNNAMED, gap.evidence)] if gap else []
        rest = [part.name for part in first.faulty_parts] + [LEVELS] * first.best.has_level_errors
        rest += [f"{NAMELESS}, {gap.sentence}" if gap else NAMELESS] * bool(gap or first.unnamed)
        faulty = first.best if first.faulty_parts else None
        return self._build(closing, summary, entries, rest, at_fault=faulty, next_test=advice)

    def _revised_finding(self, diagnosis: Diagnosis, holdout: HoldOut | None) -> Finding | None:
        """New verdict if intervals or held-out tests contradict the named effects; else None.

        Args:
            diagnosis: diagnosis with the named effects.
            holdout: residuals of held-out tests with effects that should close the gap; None if a part of it stays.
        """
        finding, names = self.finding, self.finding.names
        absent = tuple(name for name in names if _may_be_absent(name, diagnosis.result))
        if holdout and (absent or (holdout.after or 0.0) > LARGEST_CLOSED_GAP):
            return decide_verdict(self.hypotheses, self.search.settings.tolerance, gap_stays=True)
        if not absent:
            return None
        kept, leads = tuple(name for name in names if name not in absent), (*absent, *finding.leads)
        return replace(finding, verdict="partly" if kept else "described", names=kept, leads=leads)

    def _record_diagnosis(self, first: Composition) -> Diagnosis:
        """Diagnosis in which a recording mistake explains the gap; the model to use remains the starting model."""
        best, mistake, base = first.best, first.best.mistake, self.base
        assert mistake is not None
        advice = f"if the records of the tests confirm this mistake, correct {'; '.join(mistake.corrections)}"
        summary = f"probable mistake in the record: {mistake.sentence}"
        if self.finding.verdict == "ambiguous":
            summary += "; correct this first: the tests do not decide yet what else is missing"
        after = without_assumed_gain_errors(best.state.plain, self.search.data)
        closing = ClosedGap(base, holdout=hold_out(base, after, self.search.data.bounds))
        diagnosis = self._build(closing, summary, self._record_entries(first), at_fault=best, next_test=advice)
        warning = Caveat("mistaken_record", f"fitted to the tests as they are; probable mistake: {mistake.sentence}")
        result = replace(diagnosis.result, warnings=(*diagnosis.result.warnings, warning))
        return replace(diagnosis, after=after, remainder=find_regions(after), result=result)

    def _undecided_diagnosis(self, first: Composition, closing: ClosedGap) -> Diagnosis:
        """Diagnosis of a gap with several possible causes: a smooth correction, the causes, and a test that decides."""
        reported, gap = self.finding.reported, closing.gap
        candidates = self._candidates
        leader = candidates[0] if candidates else first
        rest = "the rest of the gap" if self.finding.names else "the gap"
        sentences = [*check_first(candidates), undecided_text(reported)]
        sentences += [f"a smooth correction closes {rest}: {gap.sentence}"] if gap else []
        rivals = tuple(composition for composition in reported if composition is not leader)
        entries = self._record_entries(leader, rivals)
        if not entries:
            for name in leader.names:
                alternatives = tuple(rival for rival in rivals if name not in rival.names)
                entries.append(NamedCause(name, probability_text(name, self.finding), alternatives))
        faulty = next((composition.best for composition in reported if composition.faulty_parts), None)
        advice = self._deciding_advice(leader)
        return self._build(closing, "; ".join(sentences), entries, at_fault=faulty, next_test=advice)

    def _nameless_diagnosis(self, first: Composition, closing: ClosedGap) -> Diagnosis:
        """Diagnosis of a gap that no known effect explains: a smooth correction, or the tests to measure again."""
        gap, candidates = closing.gap, self._candidates
        advice = self._deciding_advice(candidates[0] if candidates else first)
        parts = {part.name for part in first.best.faulty_parts}
        at_fault, is_faulty = join_names(sorted(parts)), self.finding.verdict == "unexplained"
        causes = causes_text(candidates, self.finding)
        place = [f"the gap is largest at {at_fault}"] if at_fault else []
        if not gap and not first.best.unnamed and first.best.p_value >= DOES_NOT_FIT:
            shared = (c.probability for c in self.finding.reported if parts & {x.name for x in c.best.faulty_parts})
            is_faulty |= sum(shared) >= LEAST_NAMED_SHARE
        if gap:
            before, after = gap.holdout.before or 1.0, gap.holdout.after or 1.0
            closes = "closes the gap"
            if after > LARGEST_CLOSED_GAP:
                closes = f"reduces the held-out gap from {number(before, 2)} to {number(after, 2)} times the noise"
            sentences = [f"a smooth correction {closes}: {gap.sentence}", *causes, *place]
        elif is_faulty and at_fault:
            sentences = [f"measure again first: {at_fault}; all other tests disagree with this part"]
        elif is_faulty:
            sentences = ["the levels disagree by more than the class of the rig, and nothing else is missing"]
            advice = _LEVELS_ADVICE
        else:
            sentences = [*dict.fromkeys(["no known effect explains the gap", *causes, *place])]
            if not find_regions(self.base):  # a prior may be the gap
                sentences = [warning.text for warning in prior_warnings(prior_uses([self.base], None))] or sentences
        entries = [NamedCause(UNNAMED, gap.evidence, tuple(candidates))] if gap else []
        faulty = first.best if is_faulty else None
        reported: Verdict = "described" if gap else "unexplained"
        return self._build(closing, "; ".join(sentences), entries, verdict=reported, at_fault=faulty, next_test=advice)

    @property
    def _candidates(self) -> list[Composition]:
        """Reported explanations that name an effect or a mistake and are probable, the most probable first."""
        return [c for c in self.finding.reported if c.probability > 1.0 - NAMED and c.causes]

    def _deciding_advice(self, leader: Composition) -> str:
        """Advice on the test that separates the possible causes, of which `leader` is the most probable.

        An effect with a twin may be in the rig as well.
        """
        if (mistake := leader.best.mistake) and leader is self.first:
            return f"check the records of the tests; {'; '.join(mistake.corrections)}"
        fitted = [c for c in self.finding.reported if c.best.effects and c.best.is_refitted]
        models, odds = list[Model](), list[float]()
        for composition in fitted:
            model = composition.best.state.fit.model
            twins = [twin for name in composition.best.effects for twin in get_effect(name).twins[:1]]
            versions = [model, reduce(Model.with_twin, twins, model)] if twins else [model]
            models += versions
            odds += [composition.probability / len(versions)] * len(versions)
        advice = deciding_test(models, odds, self.search.base.data_sets, self.search.data.campaign.rig)
        return advice or (get_effect(leader.names[0]).confirmed_by if leader.names else "")

    def _record_entries(self, composition: Composition, alternatives: tuple[Composition, ...] = ()) -> list[NamedCause]:
        """List the entries on the recording mistake of an explanation, one per affected test; none without a mistake.

        Args:
            composition: the explanation.
            alternatives: explanations that the tests cannot distinguish from this one.
        """
        if (mistake := composition.best.mistake) is None:
            return []
        gain = self.search.base.chi_square - composition.best.state.plain.chi_square
        parameter = "with one parameter" if mistake.kind.is_estimated else "without a new parameter"
        why = f"lowers chi-square by {gain:.0f} {parameter}; {probability_text(mistake.labels[0], self.finding)}"
        singles = [replace(mistake, tests=(index,)) for index in mistake.tests] or [mistake]
        return [
            NamedCause(
                single.kind.name,
                why,
                alternatives,
                test=next((test.name for test in single.affected_tests), None),
                sentence=single.sentence,
                correction=single.corrections[0],
            )
            for single in singles
        ]

    def _build(
        self,
        closing: ClosedGap,
        summary: str,
        entries: Sequence[NamedCause] = (),
        remainder: Sequence[str] = (),
        *,
        verdict: Verdict | None = None,
        at_fault: Hypothesis | None = None,
        next_test: str = "",
    ) -> Diagnosis:
        """Build the diagnosis with regions, hold-out, candidates and the model to use.

        Args:
            closing: model that closes the gap as far as possible.
            summary: verdict as a sentence.
            entries: named effects or mistakes.
            remainder: names of the parts of the gap that the entries do not explain; empty if they explain it all.
            verdict: verdict in one word; None for the verdict of `finding`.
            at_fault: hypothesis whose faulty parts of the tests are reported; None without any.
            next_test: advice on the next test; "" for the usual confirmation of the first entry.
        """
        search, base, after, gap = self.search, self.base, closing.final_fit, closing.gap
        bounds, regions = search.data.bounds, find_regions(base)
        faulty_parts = at_fault.faulty_parts if at_fault else ()
        faults = [part.region(base.residual, at_fault.change) for part in faulty_parts] if at_fault else []
        where = tuple(sorted((*faults, *regions), key=lambda region: -region.excess))
        if faulty_parts:
            next_test = MEASURE_AGAIN + faulty_parts[0].name
        elif not next_test and entries:
            next_test = get_effect(entries[0].name).confirmed_by
        fitted = result_of(
            after,
            bounds,
            {*base.model.effects} - {*search.settings.unresolved},
            lacking=self.finding.verdict == "ambiguous" or not (self.first and self.first.best.mistake),
            corrected=gap.fitted if gap else None,
            rig=search.data.campaign.rig,
            fixed=closing.fixed_amounts,
        )
        added = {name: value for name, value in fitted.model.values.items() if name not in base.model.values}
        ends = {name: end for name, value in added.items() if (end := get_parameter(name).reached_bound(value))}
        fitted = replace(fitted, at_bound={**fitted.at_bound, **ends})
        odds = explanation_odds(self.finding)
        result = with_alternatives(odds.widen(fitted), self.hypotheses, base, search.settings.tolerance)
        amounts = [format_amount(entry.name, result) for entry in entries]
        leads = "" if at_fault else leads_text(self._candidates, self.finding)  # else measure again first
        rest = [f"the rest: {join_names(remainder)}"] if remainder else []
        return Diagnosis(
            verdict or self.finding.verdict,
            "; ".join(filter(None, [summary, *amounts, leads, *rest])),
            tuple(entries),
            where,
            where if after is base else find_regions(after),
            gap.holdout if gap else closing.holdout or hold_out(base, after, bounds),
            next_test,
            tuple(list_candidates(search, self.hypotheses, self.first)),
            base,
            after,
            result,
            tuple(self._notes()),
            gap.description if gap else None,
            odds,
            measure_again=bool(faulty_parts),
        )

    def _notes(self) -> list[Caveat]:
        """Warnings on the effects and kinds of fault that these tests cannot show."""
        unseen = [proposal.name for proposal in self.search.proposals if not proposal.visible]
        unseen = [name for name in unseen if not get_effect(name).depends_on]  # not those that need a stated condition
        sentence = f"these tests cannot show {join_names(unseen, 'or')}"
        notes = [Caveat("effects_not_visible", sentence)] if unseen else []
        directions = {str(test.direction) for test in self.search.base.data_sets}
        return [*notes, *([_ONE_DIRECTION] if len(directions) == 1 else [])]


def _may_be_absent(name: str, result: Result) -> bool:
    """True if an effect may be absent: its amounts are neutral, or their 95 % region contains the neutral amounts."""
    effect = get_effect(name)
    neutral = {qualified_name(effect, p): p.neutral for p in effect.parameters if p.neutral is not None}
    if effect.replaces is not None or not neutral or neutral.keys() - result.model.values.keys():
        return False
    deviations = {key: result.model.values[key] - value for key, value in neutral.items()}
    if len(neutral) > 1:  # all together: each alone is uncertain where the tests determine a combination of them
        return result.covariance.may_be_zero(deviations)
    ((amount, value),) = neutral.items()
    low, high = result.interval(amount) or (result.model.values[amount],) * 2
    return low <= value <= high
