"""The finding as an engineer needs it: what is missing, how large, where, and what to test."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bushfit.diagnosis.beam import Search
from bushfit.diagnosis.claims import Claim
from bushfit.diagnosis.described import Described, describe
from bushfit.diagnosis.document import Verdict
from bushfit.diagnosis.evidence import Evidence, fit, result_of
from bushfit.diagnosis.explanations import FaultyPlace
from bushfit.diagnosis.holdout import hold_out
from bushfit.diagnosis.hypotheses import Hypothesis
from bushfit.diagnosis.locate import locate
from bushfit.diagnosis.next_test import deciding_test
from bushfit.diagnosis.record import Diagnosis, Judged, Named, Odds, Where, chances
from bushfit.diagnosis.words import Composition, Finding
from bushfit.effects import get_effect
from bushfit.effects.unnamed import NAME as UNNAMED
from bushfit.fitting.data import Data
from bushfit.fitting.data_sets import parted, with_gains
from bushfit.units import number

#: What is said of what was weighed and is not told, and where there is no gap.
_LESS_LIKELY = "another explanation is likelier"
_NOTHING = "nothing is missing beyond noise and tolerance"


@dataclass(frozen=True, eq=False)
class Told:
    """A finding put into words.

    Args:
        hypotheses: all that were weighed, the most probable first.
        unresolved: effects of the model as it came that these tests could not tell from a twin of the rig.
    """

    search: Search
    finding: Finding
    hypotheses: Sequence[Hypothesis]
    unresolved: Sequence[str]

    @property
    def data(self) -> Data:
        return self.search.asked.data

    @property
    def base(self) -> Evidence:
        return self.search.asked.base

    @property
    def first(self) -> Composition | None:
        return self.finding.told[0] if self.finding.told else None

    def diagnosis(self) -> Diagnosis:
        """The whole finding."""
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
        best = self.first.best
        if best.claim:
            return self._of_record(best.claim)
        names = [Named(name, self._evidence()) for name in best.effects]
        beside = [place.name for place in best.places] + (["something without a name"] if best.unnamed else [])
        words = f"{_all(best.effects)} {'closes' if len(best.effects) == 1 else 'close'} "
        words += f"part of the gap; the rest: {', '.join(beside)}" if beside else "the gap"
        return self._finished(self.finding.verdict, words, best.weighed.state.evidence, names, places=best)

    def _of_record(self, claim: Claim) -> Diagnosis:
        """A mistake in the record: the gap shrinks if it was made; the model stays as it was."""
        assert self.first
        evidence, best = self._of_claim(self.first), self.first.best
        names = _entries(self.data, claim, evidence)
        command = " ".join(["bushfit diagnose CAMPAIGN", *(f"--adopt {name}" for name in claim.labels(self.data))])
        advice = f"if the records of the tests bear it out, {'; '.join(claim.corrections(self.data))} (or {command})"
        beside = [*best.effects, *(place.name for place in best.places)]
        words = f"these tests agree if {claim.words(self.data)}" + f", with {_all(beside)} beside it" * bool(beside)
        found = self._finished(self.finding.verdict, words, self.base, names, places=best, next_test=advice)
        warning = f"fitted to the tests as they are, which only agree if {claim.words(self.data)}: {advice}"
        after = self._fitted(best.weighed.state.evidence)
        return replace(
            found,
            after=after,
            remainder=locate(after),
            holdout=hold_out(found.before, after, self.search.asked.bounds),
            result=replace(found.result, warnings=(*found.result.warnings, warning)),
        )

    def _of_claim(self, each: Composition) -> str:
        gain = self.base.chi_square - each.best.weighed.state.evidence.chi_square
        return f"takes {gain:.0f} off chi-square without a parameter; {self._probability(each)}"

    def _ambiguous(self) -> Diagnosis:
        told = self.finding.told
        labels = {id(each): self.label(each) for each in told}
        led = next((each for each in told if each.best.effects or each.best.claim), None)
        others = tuple(labels[id(each)] for each in told if each is not led)
        names: list[Named] = []
        if led and led.best.claim:
            names = [
                replace(each, alternatives=others) for each in _entries(self.data, led.best.claim, self._of_claim(led))
            ]
        elif led:
            names = [Named(name, self._probability(led), others) for name in led.best.effects]
        words = f"these tests cannot tell {' from '.join(labels.values())}"
        fitted = [each for each in told if each.best.effects and each.best.refitted]
        models = [each.best.weighed.state.evidence.model for each in fitted]
        advice = deciding_test(models, [each.probability for each in fitted], self.base.data_sets)
        if led and led.best.claim:
            advice = f"look into the records of the tests; {'; '.join(led.best.claim.corrections(self.data))}"
        spot = next((each.best for each in told if each.best.places), None)
        return self._finished("ambiguous", words, self.base, names, places=spot, next_test=advice)

    def _without_name(self) -> Diagnosis:
        """A gap that is described where a correction stands, else unexplained, with the place at fault if one is."""
        asked, finding = self.search.asked, self.finding
        lead = f"; no more than leads: {_all(finding.leads)}" if finding.leads else ""
        spot = self.first.best if self.first and finding.verdict == "unexplained" else None
        rig = self.data.campaign.rig
        if (
            not spot
            and asked.most
            and (found := describe(self._fitted(self.base), rig, asked.start, asked.held, asked.bounds))
        ):
            words = f"a real gap stays that no known effect closes: {found.words}{lead}"
            names = [Named(UNNAMED, found.evidence)]
            return self._finished("described", words, found.after, names, gap=found)
        words = "a real gap stays that no known effect closes" + lead
        advice = ""
        if spot and spot.places:
            words = f"{_all([place.name for place in spot.places])}: this stands out from all other tests; "
            words += "measure it again before looking for physics"
        elif spot:
            words = "the levels disagree by more than the rig's class allows, and by nothing else"
            advice = "measure the levels again in another session; or state the rig's class, gain_error under [rig]"
        return self._finished("unexplained", words, self.base, places=spot, next_test=advice)

    def label(self, each: Composition) -> str:
        """A composition by the names of its effects, or what else it is."""
        best = each.best
        names = [*(best.claim.labels(self.data) if best.claim else ()), *best.effects]
        return " + ".join((*names, *(f"fault: {place.name}" for place in best.places), *_nameless(best)))

    @cached_property
    def odds(self) -> Odds:
        """What is told, the most probable first."""
        told = sorted(self.finding.told, key=lambda each: -each.probability)
        models = (each.best.weighed.state.evidence.model if each.best.refitted else None for each in told)
        pairs = ((self._in_words(each), each.probability) for each in told)
        labels, apart = tuple(map(self.label, told)), self.finding.verdict == "ambiguous"
        return Odds(self.finding.nothing, tuple(pairs), tuple(models), labels, apart)

    def _in_words(self, each: Composition) -> str:
        """A composition as it is told to people: what each of its parts is, with its name."""
        best = each.best
        parts = [best.claim.words(self.data)] if best.claim else []
        parts += [f"{get_effect(name).phrase} ({name})" for name in best.effects]
        parts += [f"the tests are off: {place.name}" for place in best.places]
        *most, last = (*parts, *_nameless(best))
        return ", and ".join(filter(None, (", ".join(most), last)))

    def _evidence(self) -> str:
        """Why effects were named."""
        assert self.first
        after = self._fitted(self.first.best.weighed.state.evidence)
        gain = self._fitted(self.base).chi_square - after.chi_square
        beside = " with what was named beside it" if len(self.first.best.effects) > 1 else ""
        return f"takes {gain:.0f} off chi-square{beside}; {self._probability(self.first)}"

    def _probability(self, each: Composition) -> str:
        others = [other for other in self.finding.told if other is not each]
        words = chances(each.probability)
        return words + (f", next {self.label(others[0])} {chances(others[0].probability)}" if others else "")

    def _finished(
        self,
        verdict: Verdict,
        summary: str,
        after: Evidence,
        names: Sequence[Named] = (),
        *,
        places: Hypothesis | None = None,
        next_test: str = "",
        gap: Described | None = None,
    ) -> Diagnosis:
        base, after, bounds = self._fitted(self.base), self._fitted(after), self.search.asked.bounds
        spots = list(places.places) if places else []
        if not next_test and names:
            next_test = get_effect(names[0].name).confirmed_by
        if spots:
            next_test = f"measure again: {spots[0].name}"
        lacking = verdict in ("partly", "ambiguous", "unexplained") and not (self.first and self.first.best.claim)
        known, corrected = {*base.model.effects} - {*self.unresolved}, gap.fitted if gap else None
        where = (*(_place_where(base, each, places) for each in spots if places), *locate(base))
        return Diagnosis(
            verdict,
            summary,
            tuple(names),
            where,
            where if after is base else locate(after),
            gap.held if gap else hold_out(base, after, bounds),
            next_test,
            tuple(self.candidates),
            base,
            after,
            self.odds.averaged(result_of(after, bounds, known, lacking=lacking, corrected=corrected)),
            self._notes(),
            gap.description if gap else None,
            self.odds,
        )

    def _fitted(self, evidence: Evidence) -> Evidence:
        """The same model as a fit has it, in which a loop's gain weighs only where its class is stated."""
        loops = parted(evidence.data_sets)[0]
        if self.data.campaign.rig.stated[0] is not None or not any(loop.gain_weighs for loop in loops):
            return evidence
        if evidence not in self._refitted:
            asked, data_sets = self.search.asked, with_gains(evidence.data_sets, weigh=False)
            self._refitted[evidence] = fit(evidence.model, data_sets, asked.held, asked.bounds)
        return self._refitted[evidence]

    @cached_property
    def _refitted(self) -> dict[Evidence, Evidence]:
        return {}

    @cached_property
    def candidates(self) -> list[Judged]:
        """Every effect of the library beside the model as it came, and every mistake in the record weighed: its
        score, its refit and its probability; by score."""
        chance = self.hypotheses[0].log_posterior
        weight = {id(each): float(np.exp(each.log_posterior - chance)) for each in self.hypotheses}
        whole = sum(weight.values())
        alone = {
            each.effects[0]: each
            for each in self.hypotheses
            if each.refitted and len(each.effects) == 1 and len(each.key) == 1
        }
        found = list[Judged]()
        for hypothesis in self.hypotheses:
            if (claim := hypothesis.claim) and len(hypothesis.key) == 1:
                share = weight[id(hypothesis)] / whole
                gain = self.base.chi_square - hypothesis.weighed.state.evidence.chi_square
                why = "closes the gap" if self.first and self.first.best is hypothesis else _LESS_LIKELY
                found.append(Judged(" + ".join(claim.labels(self.data)), gain, gain, share, {}, why))
        for each in self.search.root.effects:
            share = sum(weight[id(other)] for other in self.hypotheses if each.name in other.effects) / whole
            found.append(
                self._judged(each.name, each.proposal.score, each.proposal.visible, alone.get(each.name), share)
            )
        return sorted(found, key=lambda judged: -judged.score)

    def _judged(self, name: str, score: float, visible: bool, alone: Hypothesis | None, share: float) -> Judged:
        if alone is None:
            why = "score too small to refit" if visible else "not visible in these tests"
            return Judged(name, score, None, share, {}, why)
        after = alone.weighed.state.evidence
        own = {key: value for key, value in after.model.values.items() if key not in self.base.model.values}
        told = self.first and name in self.first.best.effects
        why = "part of the likeliest explanation" if told else _LESS_LIKELY
        return Judged(name, score, self.base.chi_square - after.chi_square, share, own, why)

    def _notes(self) -> tuple[str, ...]:
        """What these tests could not show at all."""
        unseen = [each.name for each in self.search.root.effects if not each.proposal.visible]
        blind = [name for name in unseen if not get_effect(name).under]  # what no test states is not asked for
        return (f"not identifiable from these tests: {', '.join(blind)}",) if blind else ()


def _nameless(best: Hypothesis) -> list[str]:
    """What a hypothesis holds beside effects, places and mistakes."""
    levels = ["errors of levels beyond the rig's class"] if best.levels else []
    return [*levels, *(["something without a name"] if best.unnamed else [])]


def _all(names: Sequence[str]) -> str:
    return " and ".join(names)


def _entries(data: Data, claim: Claim, evidence: str) -> list[Named]:
    """An entry for each test of a claim."""
    return [
        Named(
            one.mistake.name,
            evidence,
            test=one.test(data),
            sentence=one.words(data),
            correction=one.corrections(data)[0],
        )
        for one in claim.each
    ]


def _place_where(base: Evidence, place: FaultyPlace, best: Hypothesis) -> Where:
    kind, component = ("loop", "force") if place.family == "loop" else ("sweep", "storage")
    reading = f"{place.name} departs by {number(100 * best.size, 2)} % from what all other tests say"
    return Where(
        place.direction,
        kind,
        place.frequency,
        place.amplitude,
        component,
        place.distance(base.residual),
        reading,
    )
