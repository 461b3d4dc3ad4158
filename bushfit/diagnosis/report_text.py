"""Texts and figures of a diagnosis: missing effects, their sizes, regions of disagreement and the next test."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bushfit.diagnosis.claims import Claim
from bushfit.diagnosis.described import GapDescription, describe
from bushfit.diagnosis.document import Verdict
from bushfit.diagnosis.evidence import Evidence, fit, result_of
from bushfit.diagnosis.explanations import FaultyPlace
from bushfit.diagnosis.holdout import hold_out
from bushfit.diagnosis.hypotheses import Hypothesis
from bushfit.diagnosis.locate import locate
from bushfit.diagnosis.next_test import deciding_test
from bushfit.diagnosis.priors import MOST_LEFT
from bushfit.diagnosis.record import CandidateResult, Diagnosis, Named, Odds, Where, format_probability
from bushfit.diagnosis.search import Search
from bushfit.diagnosis.verdict import Composition, Finding
from bushfit.effects import get_effect, qualified_name
from bushfit.effects.unnamed import NAME as UNNAMED
from bushfit.fitting.preparation import split_by_kind, with_gains
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.model.result import Result
from bushfit.units import display_unit, format_aligned, number

#: What is said of what was weighed and is not told, and where there is no gap.
_LESS_LIKELY = "another explanation is more probable"
_NOTHING = "nothing is missing beyond noise and tolerance"
_ONE_DIRECTION = (
    "one direction was tested: a deviation of the compound and a smooth fault of the rig cannot be distinguished; test "
    "another direction or specimen"
)


@dataclass(frozen=True, eq=False)
class DiagnosisWriter:
    """Writer of the texts of a diagnosis.

    Args:
        search: the search with the data.
        finding: its verdict.
        hypotheses: all hypotheses weighed, the most probable first.
        unresolved: effects of the starting model that earlier tests could not distinguish from a twin of the rig.
    """

    search: Search
    finding: Finding
    hypotheses: Sequence[Hypothesis]
    unresolved: Sequence[str]

    @property
    def data(self) -> PreparedCampaign:
        return self.search.request.data

    @property
    def base(self) -> Evidence:
        return self.search.request.base

    @property
    def first(self) -> Composition | None:
        return self.finding.reported[0] if self.finding.reported else None

    def diagnosis(self) -> Diagnosis:
        """Build the diagnosis with all texts.

        Returns:
            Verdict, effects, regions, hold-out, next test and the model to use.
        """
        match self.finding.verdict:
            case "consistent":
                return self._finished("consistent", _NOTHING, self.base)
            case "named" | "partly":
                return self._named()
            case "ambiguous":
                return self._ambiguous()
        return self._without_name()

    def _named(self) -> Diagnosis:
        assert self.first
        first, names = self.first, self.finding.names
        if first.best.claim:
            return self._of_record(first.best.claim)
        after = self._with_names(names)
        entries = [Named(name, self._evidence()) for name in names]
        if self.finding.verdict == "named" and (doubt := self._doubt(after, names)):
            return self._partly(after, entries, doubt)
        if self.finding.verdict == "partly":
            return self._partly(after, entries, "")
        words = f"{_all(names)} {'closes' if len(names) == 1 else 'close'} the gap"
        return self._finished("named", words, after, entries, places=first.best)

    def _with_names(self, names: Sequence[str]) -> Evidence:
        """The model as it came with these effects, fitted to noise alone."""
        of_names = [
            hypothesis
            for hypothesis in self.hypotheses
            if set(hypothesis.effects) == set(names) and hypothesis.refitted
        ]
        supersets = [
            hypothesis
            for hypothesis in self.hypotheses
            if set(hypothesis.effects) >= set(names) and hypothesis.refitted
        ]
        fitted = (of_names or supersets)[0].state
        model = fitted.evidence.model
        for name in fitted.effects:
            if name not in names:
                model = model.without(name)
        request = self.search.request
        return fit(model, fitted.evidence.data_sets, request.fixed, request.bounds)

    def _doubt(self, after: Evidence, names: Sequence[str]) -> str:
        """Why names that are all but sure do not explain the whole gap; "" if they do."""
        holdout = hold_out(self._fitted(self.base), self._fitted(after), self.search.request.bounds)
        if holdout.after is not None and holdout.after > MOST_LEFT:
            return f"a held-out gap of {number(holdout.after, 3)} times the noise"
        result = result_of(self._fitted(after), self.search.request.bounds, after.model.effects, lacking=False)
        for name in names:
            effect = get_effect(name)
            amount = qualified_name(effect, effect.amount) if effect.replaces is None else ""
            low, high = (result.interval(amount) if amount in result.model.values else None) or (1.0, 1.0)
            if effect.amount.neutral is not None and low <= effect.amount.neutral <= high:
                return f"{name} may be absent: the 95 % interval of its amount includes zero"
        return ""

    def _partly(self, after: Evidence, entries: Sequence[Named], doubt: str) -> Diagnosis:
        """Names that explain part of the gap, with the rest described where a correction stands."""
        assert self.first
        best, names = self.first.best, [entry.name for entry in entries]
        base, plain = self._fitted(self.base), self._fitted(after)
        excess = [
            max(evidence.chi_square / sum(d.counted for d in evidence.data_sets) - 1.0, 0.0)
            for evidence in (base, plain)
        ]
        share = 1.0 - excess[1] / excess[0] if excess[0] else 1.0
        words = f"{_all(names)} {'explains' if len(names) == 1 else 'explain'} {number(100 * share, 2)} % of the gap"
        remainder = [place.name for place in self.first.places]
        remainder += ["errors of levels beyond the class of the rig"] if best.levels else []
        gap = self._described(after) if not best.levels else None
        if gap:
            entries = [*entries, Named(UNNAMED, gap.evidence)]
            remainder.append(f"something without a name, {gap.sentence}")
        elif self.first.unnamed:
            remainder.append("something without a name")
        words += f"; the rest: {', '.join([*remainder, *filter(None, [doubt])])}" if remainder or doubt else ""
        return self._finished("partly", words, gap.after if gap else after, entries, places=best, gap=gap)

    def _described(self, evidence: Evidence) -> GapDescription | None:
        request, rig = self.search.request, self.data.campaign.rig
        return (
            describe(self._fitted(evidence), rig, request.start, request.fixed, request.bounds)
            if request.max_effects
            else None
        )

    def _of_record(self, claim: Claim) -> Diagnosis:
        """Diagnosis of a mistake in the record; the model stays as it was."""
        assert self.first
        evidence, best = self._of_claim(self.first), self.first.best
        names = _entries(self.data, claim, evidence)
        command = " ".join(["bushfit diagnose CAMPAIGN", *(f"--adopt {name}" for name in claim.labels(self.data))])
        advice = (
            f"if the records of the tests confirm it, state {'; '.join(claim.corrections(self.data))} (or {command})"
        )
        companions = [*best.effects, *(place.name for place in best.places)]
        words = f"these tests agree if {claim.words(self.data)}" + f", and with {_all(companions)}" * bool(companions)
        found = self._finished(self.finding.verdict, words, self.base, names, places=best, next_test=advice)
        warning = f"fitted to the tests as they are, which only agree if {claim.words(self.data)}: {advice}"
        after = self._fitted(best.state.evidence)
        return replace(
            found,
            after=after,
            remainder=locate(after),
            holdout=hold_out(found.before, after, self.search.request.bounds),
            result=replace(found.result, warnings=(*found.result.warnings, warning)),
        )

    def _of_claim(self, composition: Composition) -> str:
        gain = self.base.chi_square - composition.best.state.evidence.chi_square
        return f"lowers chi-square by {gain:.0f} without a new parameter; {self._probability(composition)}"

    def _ambiguous(self) -> Diagnosis:
        compositions = self.finding.reported
        labels = {id(composition): self.label(composition) for composition in compositions}
        led = next((composition for composition in compositions if composition.names or composition.best.claim), None)
        lookalikes = tuple(labels[id(composition)] for composition in compositions if composition is not led)
        names: list[Named] = []
        if led and led.best.claim:
            names = [
                replace(entry, alternatives=lookalikes)
                for entry in _entries(self.data, led.best.claim, self._of_claim(led))
            ]
        elif led:
            names = [Named(name, self._probability(led), lookalikes) for name in led.names]
        *first_labels, last_label = labels.values()
        words = f"these tests cannot distinguish between {', '.join(first_labels)} and {last_label}"
        fitted = [composition for composition in compositions if composition.best.effects and composition.best.refitted]
        models = [composition.best.state.evidence.model for composition in fitted]
        advice = deciding_test(
            models, [composition.probability for composition in fitted], self.base.data_sets, self.data.campaign.rig
        )
        if led and led.best.claim:
            advice = f"check the records of the tests; {'; '.join(led.best.claim.corrections(self.data))}"
        spot = next((composition.best for composition in compositions if composition.places), None)
        return self._finished("ambiguous", words, self.base, names, places=spot, next_test=advice)

    def _without_name(self) -> Diagnosis:
        """A gap that is described where a correction stands, else unexplained, with the place at fault if one is."""
        finding = self.finding
        lead = f"; leads: {_all(finding.leads)}" if finding.leads else ""
        spot = self.first.best if self.first and finding.verdict == "unexplained" else None
        if not spot and (found := self._described(self.base)):
            largest = [place.name for place in self.first.best.places] if self.first else []
            words = f"no known effect closes the gap: {found.sentence}{lead}"
            words += f"; it is largest at {_all(largest)}" if largest else ""
            names = [Named(UNNAMED, found.evidence)]
            return self._finished("described", words, found.after, names, gap=found)
        words = "no known effect closes the gap" + lead
        advice = ""
        spot = spot or (self.first.best if self.first and self.first.best.places else None)
        if spot and spot.places:
            words = f"{_all([place.name for place in spot.places])}: this deviates from all other tests; "
            words += "measure it again first"
        elif spot:
            words = "the levels disagree by more than the class of the rig, and nothing else is missing"
            advice = (
                "measure the levels again in another session, or state the class of the rig (gain_error under [rig])"
            )
        return self._finished("unexplained", words, self.base, places=spot, next_test=advice)

    def label(self, composition: Composition) -> str:
        """Name of a composition: its mistakes, effects, faulty places and other parts, joined by " + "."""
        best = composition.best
        names = [*(best.claim.labels(self.data) if best.claim else ()), *composition.names]
        return " + ".join((*names, *(f"fault: {place.name}" for place in composition.places), *_nameless(composition)))

    @cached_property
    def odds(self) -> Odds:
        """Explanations that are reported, the most probable first."""
        compositions = sorted(self.finding.reported, key=lambda composition: -composition.probability)
        models = (
            composition.best.state.evidence.model if composition.best.refitted else None for composition in compositions
        )
        pairs = ((self._in_words(composition), composition.probability) for composition in compositions)
        labels, exclusive = tuple(map(self.label, compositions)), self.finding.verdict == "ambiguous"
        return Odds(self.finding.nothing, tuple(pairs), tuple(models), labels, exclusive)

    def _in_words(self, composition: Composition) -> str:
        """Sentence on a composition, with the name of each part."""
        best = composition.best
        parts = [best.claim.words(self.data)] if best.claim else []
        parts += [f"{get_effect(name).phrase} ({name})" for name in composition.names]
        parts += [f"a faulty test: {place.name}" for place in composition.places]
        *first_parts, last = (*parts, *_nameless(composition))
        return ", and ".join(filter(None, (", ".join(first_parts), last)))

    def _evidence(self) -> str:
        """Why effects were named."""
        assert self.first
        after = self._fitted(self._with_names(self.finding.names))
        gain = self._fitted(self.base).chi_square - after.chi_square
        suffix = " with the other named effects" if len(self.finding.names) > 1 else ""
        return f"lowers chi-square by {gain:.0f}{suffix}; {self._probability(self.first)}"

    def _probability(self, composition: Composition) -> str:
        rivals = [rival for rival in self.finding.reported if rival is not composition]
        words = f"probability {format_probability(composition.probability)}"
        if not rivals:
            return words
        return f"{words}, next {self.label(rivals[0])} {format_probability(rivals[0].probability)}"

    def _finished(
        self,
        verdict: Verdict,
        summary: str,
        after: Evidence,
        names: Sequence[Named] = (),
        *,
        places: Hypothesis | None = None,
        next_test: str = "",
        gap: GapDescription | None = None,
    ) -> Diagnosis:
        base, after, bounds = self._fitted(self.base), self._fitted(after), self.search.request.bounds
        spots = list(places.places) if places else []
        if not next_test and names:
            next_test = get_effect(names[0].name).confirmed_by
        if spots:
            next_test = f"measure again: {spots[0].name}"
        lacking = verdict in ("partly", "ambiguous", "unexplained") and not (self.first and self.first.best.claim)
        resolved, corrected = {*base.model.effects} - {*self.unresolved}, gap.fitted if gap else None
        regions = (*(_place_where(base, place, places) for place in spots if places), *locate(base))
        result = self.odds.averaged(result_of(after, bounds, resolved, lacking=lacking, corrected=corrected))
        return Diagnosis(
            verdict,
            "; ".join([summary, *filter(None, (_format_amount(entry.name, result) for entry in names))]),
            tuple(names),
            regions,
            regions if after is base else locate(after),
            gap.holdout if gap else hold_out(base, after, bounds),
            next_test,
            tuple(self.candidates),
            base,
            after,
            result,
            self._notes(),
            gap.description if gap else None,
            self.odds,
        )

    def _fitted(self, evidence: Evidence) -> Evidence:
        """Fit of the same model with free gains of loops, unless the class of the gain is stated."""
        loops = split_by_kind(evidence.data_sets)[0]
        if self.data.campaign.rig.stiffness_errors[0] is not None or not any(loop.gain_weighs for loop in loops):
            return evidence
        if evidence not in self._refitted:
            request, data_sets = self.search.request, with_gains(evidence.data_sets, weigh=False)
            self._refitted[evidence] = fit(evidence.model, data_sets, request.fixed, request.bounds)
        return self._refitted[evidence]

    @cached_property
    def _refitted(self) -> dict[Evidence, Evidence]:
        return {}

    @cached_property
    def candidates(self) -> list[CandidateResult]:
        """Every effect of the library beside the model as it came, and every mistake in the record weighed: its
        score, its refit and its probability; by score."""
        chance = self.hypotheses[0].log_posterior
        weight = {id(candidate): float(np.exp(candidate.log_posterior - chance)) for candidate in self.hypotheses}
        whole = sum(weight.values())
        alone = {
            candidate.effects[0]: candidate
            for candidate in self.hypotheses
            if candidate.refitted and len(candidate.effects) == 1 and len(candidate.key) == 1
        }
        found = list[CandidateResult]()
        for hypothesis in self.hypotheses:
            if (claim := hypothesis.claim) and len(hypothesis.key) == 1:
                share = weight[id(hypothesis)] / whole
                gain = self.base.chi_square - hypothesis.state.evidence.chi_square
                why = "closes the gap" if self.first and self.first.best is hypothesis else _LESS_LIKELY
                found.append(CandidateResult(" + ".join(claim.labels(self.data)), gain, gain, share, {}, why))
        for candidate in self.search.root.proposals:
            share = (
                sum(weight[id(hypothesis)] for hypothesis in self.hypotheses if candidate.name in hypothesis.effects)
                / whole
            )
            found.append(
                self._judged(
                    candidate.name,
                    candidate.score,
                    candidate.visible,
                    alone.get(candidate.name),
                    share,
                )
            )
        return sorted(found, key=lambda judged: -judged.score)

    def _judged(
        self, name: str, score: float, visible: bool, alone: Hypothesis | None, share: float
    ) -> CandidateResult:
        if alone is None:
            why = "score too small to refit" if visible else "not visible in these tests"
            return CandidateResult(name, score, None, share, {}, why)
        after = alone.state.evidence
        values = {key: value for key, value in after.model.values.items() if key not in self.base.model.values}
        is_named = self.first and name in self.first.names
        why = "part of the most probable explanation" if is_named else _LESS_LIKELY
        return CandidateResult(name, score, self.base.chi_square - after.chi_square, share, values, why)

    def _notes(self) -> tuple[str, ...]:
        """Sentence on the effects that these tests cannot show."""
        unseen = [candidate.name for candidate in self.search.root.proposals if not candidate.visible]
        blind = [name for name in unseen if not get_effect(name).under]  # what no test states is not asked for
        notes = [f"not identifiable from these tests: {', '.join(blind)}"] if blind else []
        if self.first and self.first.unnamed and len({str(test.direction) for test in self.base.data_sets}) == 1:
            notes.append(_ONE_DIRECTION)
        return tuple(notes)


def _format_amount(name: str, result: Result) -> str:
    """Amount of an effect in a model, with its 95 % interval; "" if the model has no such amount."""
    if name == UNNAMED or name not in result.model.effects or (effect := get_effect(name)).replaces is not None:
        return ""
    amount = effect.amount
    value, interval = (
        result.model.values[qualified_name(effect, amount)],
        result.interval(qualified_name(effect, amount)),
    )
    unit, factor = display_unit(amount.unit, 1.0, value)
    value_text, *ends = format_aligned([factor * x for x in (value, *(interval or ()))], 3)
    text = f"{amount.meaning or amount.name}: {f'{value_text} {unit}'.removesuffix(' -').removesuffix(' 1')}"
    return f"{text} (95 % interval {ends[0]} to {ends[1]})" if ends else text


def _nameless(composition: Composition) -> list[str]:
    """Parts of a composition beside effects, places and mistakes."""
    levels = ["errors of levels beyond the class of the rig"] if composition.best.levels else []
    return [*levels, *(["something without a name"] if composition.unnamed else [])]


def _all(names: Sequence[str]) -> str:
    return " and ".join(names)


def _entries(data: PreparedCampaign, claim: Claim, evidence: str) -> list[Named]:
    """An entry for each test of a claim."""
    return [
        Named(
            one.mistake.name,
            evidence,
            test=one.test(data),
            sentence=one.words(data),
            correction=one.corrections(data)[0],
        )
        for one in claim.single_tests
    ]


def _place_where(base: Evidence, place: FaultyPlace, best: Hypothesis) -> Where:
    kind, component = ("loop", "force") if place.family == "loop" else ("sweep", "storage")
    reading = f"{place.name} departs by {number(100 * best.change, 2)} % from all other tests"
    return Where(
        place.direction,
        kind,
        place.frequency,
        place.amplitude,
        component,
        place.distance(base.residual),
        reading,
    )
