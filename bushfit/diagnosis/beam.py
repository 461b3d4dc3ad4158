"""Sets of explanations, grown one at a time from the most probable: each weighed by the evidence of the tests.

Effects are refitted with all parameters and counted by Laplace's method; places and what has no name stay linear.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from math import log

import numpy as np

from bushfit.diagnosis.claims import Screen, claims
from bushfit.diagnosis.evidence import Evidence, fit
from bushfit.diagnosis.explanations import Explanation, FaultyPlace, Meeting
from bushfit.diagnosis.hypotheses import COMPOUND, DiagnosisRequest, Hypothesis, State, Tests, Weighed
from bushfit.diagnosis.laplace import laplace
from bushfit.diagnosis.priors import BEAM, DOES_NOT_FIT, FAR, NAMED, ODDS, REFITS, ROUNDS
from bushfit.diagnosis.propose import has_what_it_uses
from bushfit.diagnosis.refit import refit_with_free_columns, refitted, within_reach
from bushfit.diagnosis.verdict import judged
from bushfit.errors import FitError, ModelError
from bushfit.progress import track

#: Refits at most of what is probable by a linear count alone. For time.
_SETTLED = 8
#: Claims that are fitted, those first under which the tests could agree best; places added to a state. For time.
_CLAIMS, _PLACES = 4, 2
#: Logarithm of odds behind its state within which an effect is refitted; for time.
_SLIGHT = 3.0
#: What a record says of each point.
_SAID = ("measured", "amplitude", "frequency")
#: Reduced chi-square beyond which a model has bent its parameters too far for a refit to start from its values.
_BENT = 1.5


class Search:
    """A beam over sets of explanations."""

    def __init__(self, asked: DiagnosisRequest) -> None:
        self.asked = asked
        self.found: dict[frozenset[Hashable], Hypothesis] = {}
        self._seen: set[frozenset[Hashable]] = set()
        tests = Tests(asked.base, asked.data.campaign.rig, log(1.0 - sum(ODDS.values())))
        self.root = self._weigh(tests.state)
        self._odds = _odds([*self.root.effects, *tests.fixed])

    def run(self) -> list[Hypothesis]:
        """Search sets of explanations.

        Returns:
            All hypotheses that were compared, the most probable first.
        """
        beam = [self.root]
        for depth in range(ROUNDS + 1):
            for weighed in track(f"round {depth + 1} of at most {ROUNDS + 1}", beam):
                self._note_with_each(weighed, depth)
            if depth == ROUNDS or self._is_sure():
                break
            fresh = [one for weighed in track("with one more", beam) for one in self._grown(weighed, depth)]
            if depth == 0:
                fresh += self._of_records()
            for weighed in fresh:
                self._note_state(weighed)
            followed = [each for each in self.found.values() if each.unnamed in ("", COMPOUND) and not each.levels]
            best = max(each.log_posterior for each in followed)
            near = sorted(fresh, key=lambda each: -each.log_posterior)[: BEAM[min(depth, 1)]]
            beam = [each for each in near if each.log_posterior > best - FAR]
            if not beam:
                break
        self._settle()
        return self.ordered

    @property
    def ordered(self) -> list[Hypothesis]:
        return sorted(self.found.values(), key=lambda each: -each.log_posterior)

    def _is_sure(self) -> bool:
        """True if one explanation has nearly all of the probability, was refitted and fits the tests."""
        finding = judged(self.ordered, self.asked.tolerance)
        if finding.verdict == "consistent":
            return finding.nothing >= NAMED and self.root.first.chance() >= DOES_NOT_FIT
        return finding.verdict == "named" and finding.told[0].best.refitted

    def _settle(self) -> None:
        """Refit what only a linear count promises, as long as it is among the most probable."""
        for _ in range(_SETTLED):
            every = self.ordered
            share = np.exp([each.log_posterior - every[0].log_posterior for each in every])
            ahead = np.cumsum(share) - share
            open_ = [
                each
                for each, before in zip(every, ahead / share.sum(), strict=True)
                if before < NAMED and not each.refitted
            ]
            if not open_:
                return
            first = open_[0]
            grown = self._with_effects(first.weighed, [first.effects[-1]], len(first.weighed.state.key))
            for weighed in grown:
                self._note_state(weighed)
            if not grown:  # no response with it, or far behind
                del self.found[first.key]

    def _prior(self, kind: str, name: str) -> float:
        """Logarithm of the odds beforehand; what can only be asked for beside another has the least of its kind."""
        if (kind, name) not in self._odds:
            self._odds[kind, name] = min(odds for (own, _), odds in self._odds.items() if own == kind)
        return self._odds[kind, name]

    def _weigh(self, state: State) -> Weighed:
        self._seen.add(state.key)
        return Weighed(state, self.asked)

    def _note_with_each(self, weighed: Weighed, depth: int) -> None:
        """Note a state, and it with every explanation beside it, counted linearly."""
        self._note_state(weighed)
        for each, worth in weighed.group_evidence:
            if len(weighed.state.effects) < self.asked.most or each.kind != "effect":
                for one in weighed.with_(each, worth, self._prior(each.kind, each.name) - log(depth + 1)):
                    self._note(one)

    def _note_state(self, weighed: Weighed) -> None:
        for each in weighed.alone:
            self._note(each)

    @cached_property
    def _met_odds(self) -> float:
        """Logarithm of the odds beforehand that points without weight meet, over nothing."""
        families = {each.family for each in (*self.asked.met, *self.root.state.tests.fixed) if each.kind == "place"}
        return log(ODDS["place"] / len(families)) - self.root.state.log_prior

    def _met(self, hypothesis: Hypothesis, place: Meeting) -> Hypothesis:
        """The hypothesis and, beside it, a disturbance at the frequency where points without weight meet."""
        posterior = hypothesis.log_posterior + self._met_odds + place.log_odds
        size = max(hypothesis.size, place.size)
        if hypothesis.size <= self.asked.tolerance:  # nothing that anyone would miss
            return Hypothesis((), None, (place,), "", False, posterior, place.size, place.size, self.root)
        return replace(hypothesis, places=(*hypothesis.places, place), log_posterior=posterior, size=size)

    def _note(self, hypothesis: Hypothesis) -> None:
        """Keep the better of two ways to the same, by itself and beside what else is seen; what was refitted counts
        before what was not."""
        for each in (hypothesis, *(self._met(hypothesis, place) for place in self.asked.met)):
            before = self.found.get(each.key)
            if before is None or (each.refitted, each.log_posterior) > (before.refitted, before.log_posterior):
                self.found[each.key] = each

    def _grown(self, weighed: Weighed, depth: int) -> list[Weighed]:
        """The state with each of its most promising effects, refitted, and places; and without an effect that may only
        have led the way."""
        first = 2 if weighed.state.evidence.reduced > _BENT else 0
        grown = self._with_effects(weighed, self._promising(weighed, *REFITS[1 if depth else first]), depth)
        grown += [each for other in grown for each in self._without_earlier(other.state)]
        return grown + self._with_places(weighed, depth)

    def _promising(self, weighed: Weighed, by_evidence: int, by_score: int) -> list[str]:
        """Effects that are worth a refit: so many of those with the most evidence as far as they are linear, and of
        those that take most off chi-square, which tells more where the gap is large."""
        state = weighed.state
        new = [each.name for each in weighed.effects if state.key | {each.name} not in self._seen]
        prior = state.log_prior + state.density - weighed.log_posterior
        evidence = {
            each.name: prior + self._prior("effect", each.name) + worth.total
            for each, worth in weighed.group_evidence
            if each.kind == "effect"
        }
        first = [name for name in sorted(evidence, key=lambda name: -evidence[name]) if name in new]
        scores = {each.name: each.proposal.score for each in weighed.effects}  # the best first
        second = [
            name for name in scores if name in new and 0.5 * scores[name] + self._prior("effect", name) > -_SLIGHT
        ]
        return list(
            dict.fromkeys([*(name for name in first[:by_evidence] if evidence[name] > -_SLIGHT), *second[:by_score]])
        )

    def _with_effects(self, weighed: Weighed, names: Sequence[str], depth: int) -> list[Weighed]:
        state, asked = weighed.state, self.asked
        if not names or len(state.effects) >= asked.most:
            return []
        proposed = [each.proposal for each in weighed.effects if each.name in names]
        start = asked.start if not state.effects and state.evidence.reduced > _BENT else {}
        grown: dict[str, Weighed] = {}
        columns = weighed.fitted_beside
        while proposed:
            fits = refitted(state.evidence, proposed, start, asked.held, asked.bounds, columns)
            for name, evidence in fits.items():
                one = self._weigh(self._with_effect(state, name, evidence, depth))
                self._note_state(one)
                if name not in grown or one.log_posterior > grown[name].log_posterior:
                    grown[name] = one
            if columns is None:
                break
            columns = None  # by noise alone where nothing of the deviation is left beside the effect
            proposed = [each for each in proposed if each.name not in grown or not grown[each.name].bent]
        return list(grown.values())

    def _with_effect(self, state: State, name: str, evidence: Evidence, depth: int) -> State:
        density, precision, size = laplace(name, evidence, state.evidence)
        return replace(
            state,
            effects=(*state.effects, name),
            evidence=evidence,
            log_prior=state.log_prior + self._prior("effect", name) - log(depth + 1),
            precision={**state.precision, **precision},
            density=state.density + density,
            size=max(state.size, size),
        )

    def _with_places(self, weighed: Weighed, depth: int) -> list[Weighed]:
        state, grown = weighed.state, []
        own = [(each, worth) for each, worth in weighed.group_evidence if isinstance(each, FaultyPlace)]
        own.sort(key=lambda pair: -(self._prior("place", pair[0].name) + pair[1].total))
        for place, shifted in own[:_PLACES]:
            free = place.freely
            (scattered,) = weighed.group_evidence_of([free])
            each, worth = (free, scattered) if scattered.total > shifted.total else (place, shifted)
            odds = self._prior("place", each.name) - log(depth + 1)
            better = state.log_prior + state.density + odds + worth.total > weighed.log_posterior
            if better and state.key | {each.name} not in self._seen:
                evidence = state.evidence
                if evidence.reduced > _BENT:  # by the place, too
                    start = {} if state.effects else self.asked.start
                    evidence = refit_with_free_columns(evidence, weighed.bare, each.columns, start, self.asked.bounds)
                more = replace(
                    state,
                    evidence=evidence,
                    places=(*state.places, each),
                    log_prior=state.log_prior + odds,
                    amounts=(*state.amounts, worth.likeliest),
                    size=max(state.size, worth.size),
                )
                grown.append(self._weigh(more))
        return grown

    def _without_earlier(self, state: State) -> Iterator[Weighed]:
        """A state without each of the effects before its last, refitted: they may only have led the way."""
        if state.places:
            return
        data_sets, (held, bounds) = state.evidence.data_sets, (self.asked.held, self.asked.bounds)
        for name in state.effects[:-1]:
            if state.key - {name} in self._seen:
                continue
            with suppress(FitError, ModelError):  # no response without it
                model = state.evidence.model.without(name)
                if not all(has_what_it_uses(effect, model) for effect in model.records):
                    continue
                evidence = fit(model, data_sets, held, {**within_reach(model, data_sets), **bounds})
                less = state.tests.state
                for order, other in enumerate(each for each in state.effects if each != name):
                    less = self._with_effect(less, other, evidence, order)
                yield self._weigh(less)

    def _of_records(self) -> list[Weighed]:
        """The most promising mistakes in the record, the model as it came fitted to the tests with each put right."""
        data, base, found = self.asked.data, self.asked.base, []
        listed = claims(data, self.asked.without)
        for claim in track("mistakes put right", list(Screen(data).best(listed, _CLAIMS))):
            with suppress(FitError, ModelError):  # tests that nothing can be fitted to as mended
                evidence = self.asked.fitted(claim.mended(data))
                if [each.size for each in evidence.data_sets] == [each.size for each in base.data_sets]:
                    odds = log(ODDS["record"]) - log(len(listed))
                    found.append(
                        self._weigh(Tests(evidence, data.campaign.rig, odds, claim, _rewritten(base, evidence)).state)
                    )
        return found


def _rewritten(base: Evidence, mended: Evidence) -> float:
    """The largest change of what a record says, relative: of a stiffness, an amplitude, a frequency; other dimensions
    of the bushing, or another place of a test, change all."""
    pairs = list(zip(base.data_sets, mended.data_sets, strict=True))
    if base.model.bushing != mended.model.bushing or any(one.direction != other.direction for one, other in pairs):
        return 1.0
    read = [(getattr(one, what), getattr(other, what)) for one, other in pairs for what in _SAID]
    return max(float(np.max(np.abs(after / before - 1.0))) for before, after in read)


def _odds(every: Sequence[Explanation]) -> dict[tuple[str, str], float]:
    """Logarithm of the odds beforehand of each explanation, by kind and name.

    A kind's odds are shared by its families; in a family of effects what acts everywhere has half, places the other
    half; in a family of places each has the same.
    """
    families = {kind: Counter(each.family for each in every if each.kind == kind) for kind in ODDS}
    found = {}
    for each in every:
        own, members = families[each.kind], families[each.kind][each.family]
        share = ODDS[each.kind] / len(own)
        if each.kind != "effect":
            share /= members
        elif members > 1:
            share *= 0.5 if each.name == each.family else 0.5 / (members - 1)
        found[each.kind, each.name] = log(share)
    return found
