"""Sets of explanations, grown one at a time from the most probable: each weighed by the evidence of the tests.

Effects are refitted with all parameters and counted by Laplace's method; places and curves without a name stay linear.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from math import log

import numpy as np

from bushfit.diagnosis.claims import Screen, claims
from bushfit.diagnosis.evidence import Evidence, fit
from bushfit.diagnosis.explanations import COMPOUND, Explanation, FaultyPlace, Meeting
from bushfit.diagnosis.hypotheses import DiagnosisRequest, Hypothesis, State, Tests
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
#: Quantities of each point that a record states.
_RECORDED = ("measured", "amplitude", "frequency")
#: Reduced chi-square beyond which a model has bent its parameters too far for a refit to start from its values.
_BENT = 1.5


class Search:
    """A beam search over sets of explanations."""

    def __init__(self, request: DiagnosisRequest) -> None:
        self.request = request
        self._known: dict[frozenset[Hashable], Hypothesis] = {}
        self._visited: set[frozenset[Hashable]] = set()
        tests = Tests(request.base, request.data.campaign.rig, log(1.0 - sum(ODDS.values())))
        self.root = State.of_tests(tests, request)
        self._log_priors = prior_odds([*self.root.proposals, *tests.explanations])
        families = {e.family for e in (*request.meetings, *tests.explanations) if e.kind == "place"}
        self._meeting_odds = log(ODDS["place"] / max(len(families), 1)) - tests.log_prior

    def run(self) -> list[Hypothesis]:
        """Search sets of explanations.

        Returns:
            All hypotheses that were compared, the most probable first.
        """
        beam = [self._register(self.root)]
        for depth in range(ROUNDS + 1):
            for state in track(f"round {depth + 1} of at most {ROUNDS + 1}", beam):
                for explanation, evidence in state.weighed:
                    if len(state.effects) < self.request.max_effects or explanation.kind != "effect":
                        log_odds = self._log_prior(explanation) - log(depth + 1)
                        for hypothesis in state.extended(explanation, evidence, log_odds):
                            self._note(hypothesis)
            if depth == ROUNDS or self._is_sure():
                break
            fresh = [grown for state in track("with one more", beam) for grown in self._grow(state, depth)]
            if depth == 0:
                fresh += self._corrected_records()
            followed = [h for h in self._known.values() if h.unnamed in ("", COMPOUND) and not h.levels]
            limit = max(hypothesis.log_posterior for hypothesis in followed) - FAR
            nearest = sorted(fresh, key=lambda state: -state.log_posterior)[: BEAM[min(depth, 1)]]
            beam = [state for state in nearest if state.log_posterior > limit]
            if not beam:
                break
        self._settle()
        return self._ordered()

    def _ordered(self) -> list[Hypothesis]:
        return sorted(self._known.values(), key=lambda hypothesis: -hypothesis.log_posterior)

    def _is_sure(self) -> bool:
        """True if one explanation has nearly all of the probability, was refitted and fits the tests."""
        finding = judged(self._ordered(), self.request.tolerance)
        if finding.verdict == "consistent":
            return finding.nothing >= NAMED and self.root.linear.chance() >= DOES_NOT_FIT
        return finding.verdict == "named" and finding.reported[0].best.refitted

    def _settle(self) -> None:
        """Refit hypotheses that only a linear count promises, as long as they are among the most probable."""
        for _ in range(_SETTLED):
            ordered = self._ordered()
            share = np.exp([hypothesis.log_posterior - ordered[0].log_posterior for hypothesis in ordered])
            ahead = (np.cumsum(share) - share) / share.sum()
            candidates = zip(ordered, ahead.tolist(), strict=True)
            linear = next((h for h, before in candidates if before < NAMED and not h.refitted), None)
            if linear is None:
                return
            if not self._with_effects(linear.state, [linear.effects[-1]], len(linear.state.key)):
                del self._known[linear.key]  # no response with it, or far behind

    def _log_prior(self, explanation: Explanation) -> float:
        """Log of the prior odds; an explanation that only applies beside another has the least of its kind."""
        key = explanation.kind, explanation.name
        if key not in self._log_priors:
            self._log_priors[key] = min(odds for (kind, _), odds in self._log_priors.items() if kind == key[0])
        return self._log_priors[key]

    def _register(self, state: State) -> State:
        """Mark a state as visited and note its hypotheses."""
        self._visited.add(state.key)
        for hypothesis in state.hypotheses:
            self._note(hypothesis)
        return state

    def _note(self, hypothesis: Hypothesis) -> None:
        """Keep the better of two ways to the same hypothesis, a refitted one before a linear one; also with each
        frequency at which outliers meet beside it."""
        for candidate in (hypothesis, *(self._with_meeting(hypothesis, place) for place in self.request.meetings)):
            before = self._known.get(candidate.key)
            rank = candidate.refitted, candidate.log_posterior
            if before is None or rank > (before.refitted, before.log_posterior):
                self._known[candidate.key] = candidate

    def _with_meeting(self, hypothesis: Hypothesis, place: Meeting) -> Hypothesis:
        """The hypothesis beside a disturbance at the frequency where points without weight meet."""
        log_posterior = hypothesis.log_posterior + self._meeting_odds + place.log_odds
        if hypothesis.change > self.request.tolerance:
            change = max(hypothesis.change, place.size)
            places = (*hypothesis.places, place)
            return replace(hypothesis, places=places, log_posterior=log_posterior, change=change)
        plain = self.root.hypotheses[0]  # what is smaller than the tolerance is no part of an explanation
        return replace(plain, places=(place,), log_posterior=log_posterior, change=place.size, last_change=place.size)

    def _grow(self, state: State, depth: int) -> Iterator[State]:
        """The state with each of its most promising effects, refitted, and places; and without an effect that may only
        have led the way."""
        by_evidence, by_score = REFITS[1 if depth else 2 if state.evidence.reduced > _BENT else 0]
        for grown in self._with_effects(state, self._promising(state, by_evidence, by_score), depth):
            yield grown
            yield from self._without_earlier(grown)
        yield from self._with_places(state, depth)

    def _promising(self, state: State, by_evidence: int, by_score: int) -> list[str]:
        """Effects to refit: those with the most evidence as far as they are linear, and those that take most off
        chi-square, which says more where the gap is large."""
        scores = {p.name: p.score for p in state.proposals if state.key | {p.name} not in self._visited}
        prior = {p.name: self._log_prior(p) for p in state.proposals}
        base = state.log_prior + state.log_density - state.log_posterior
        gains = {e.name: base + prior[e.name] + evidence.total for e, evidence in state.weighed if e.kind == "effect"}
        gains = {name: gain for name, gain in gains.items() if name in scores}
        first = sorted(gains, key=lambda name: -gains[name])[:by_evidence]
        second = [name for name, score in scores.items() if 0.5 * score + prior[name] > -_SLIGHT][:by_score]
        return list(dict.fromkeys([*(name for name in first if gains[name] > -_SLIGHT), *second]))

    def _with_effects(self, state: State, names: Sequence[str], depth: int) -> list[State]:
        """The state with each of some effects, refitted: beside the compound's likeliest deviation, and by noise alone
        where nothing of the deviation is left beside the effect."""
        request = self.request
        if not names or len(state.effects) >= request.max_effects:
            return []
        proposed = [proposal for proposal in state.proposals if proposal.name in names]
        start = request.start if not state.effects and state.evidence.reduced > _BENT else {}
        grown: dict[str, State] = {}
        for deviation in dict.fromkeys((state.likeliest_deviation, 0.0)):
            columns = state.free_columns(deviation)
            remaining = [p for p in proposed if p.name not in grown or not grown[p.name].likeliest_deviation]
            fits = (
                refitted(state.evidence, remaining, start, request.fixed, request.bounds, columns) if remaining else {}
            )
            for name, evidence in fits.items():
                candidate = self._register(self._with_effect(state, name, evidence, depth))
                if name not in grown or candidate.log_posterior > grown[name].log_posterior:
                    grown[name] = candidate
        return list(grown.values())

    def _with_effect(self, state: State, name: str, evidence: Evidence, depth: int) -> State:
        """The state with an effect, whose fit is given."""
        log_density, precision, change = laplace(name, evidence, state.evidence)
        return replace(
            state,
            effects=(*state.effects, name),
            evidence=evidence,
            log_prior=state.log_prior + self._log_priors["effect", name] - log(depth + 1),
            precision={**state.precision, **precision},
            log_density=state.log_density + log_density,
            change=max(state.change, change),
        )

    def _with_places(self, state: State, depth: int) -> Iterator[State]:
        """The state with each of its likeliest places, as a shift or with an error of every point."""
        places = [(e, evidence) for e, evidence in state.weighed if isinstance(e, FaultyPlace)]
        places.sort(key=lambda pair: -(self._log_prior(pair[0]) + pair[1].total))
        for place, shifted in places[:_PLACES]:
            scattered_place = place.point_by_point()
            (scattered,) = state.weigh([scattered_place])
            better, worth = (scattered_place, scattered) if scattered.total > shifted.total else (place, shifted)
            log_prior = state.log_prior + self._log_prior(place) - log(depth + 1)
            improves = log_prior + state.log_density + worth.total > state.log_posterior
            if not improves or state.key | {place.name} in self._visited:
                continue
            evidence = state.evidence
            if evidence.reduced > _BENT:  # perhaps by the place
                start = {} if state.effects else self.request.start
                evidence = refit_with_free_columns(evidence, state.bare, better.columns, start, self.request.bounds)
            grown = replace(
                state,
                evidence=evidence,
                places=(*state.places, better),
                log_prior=log_prior,
                amounts=(*state.amounts, worth.likeliest),
                change=max(state.change, worth.size),
            )
            yield self._register(grown)

    def _without_earlier(self, state: State) -> Iterator[State]:
        """A state without each of the effects before its last, refitted: they may only have led the way."""
        if state.places:
            return
        data_sets, request = state.evidence.data_sets, self.request
        for name in state.effects[:-1]:
            if state.key - {name} in self._visited:
                continue
            with suppress(FitError, ModelError):  # no response without it
                model = state.evidence.model.without(name)
                if not all(has_what_it_uses(effect, model) for effect in model.records):
                    continue
                evidence = fit(model, data_sets, request.fixed, {**within_reach(model, data_sets), **request.bounds})
                shorter = State.of_tests(state.tests, request)
                for order, effect_name in enumerate(effect for effect in state.effects if effect != name):
                    shorter = self._with_effect(shorter, effect_name, evidence, order)
                yield self._register(shorter)

    def _corrected_records(self) -> Iterator[State]:
        """The most promising mistakes in the record, the starting model fitted to the tests with each corrected."""
        data, base = self.request.data, self.request.base
        possible = claims(data, self.request.without)
        for claim in track("mistakes put right", list(Screen(data).best(possible, _CLAIMS))):
            with suppress(FitError, ModelError):  # corrected tests that nothing can be fitted to
                evidence = self.request.fit_mended(claim.mended(data))
                if [test.size for test in evidence.data_sets] == [test.size for test in base.data_sets]:
                    log_prior = log(ODDS["record"]) - log(len(possible))
                    tests = Tests(evidence, data.campaign.rig, log_prior, claim, _record_change(base, evidence))
                    yield self._register(State.of_tests(tests, self.request))


def _record_change(base: Evidence, mended: Evidence) -> float:
    """Largest relative change of what a record says: of a stiffness, an amplitude, a frequency; other dimensions of
    the bushing, or another direction of a test, change all."""
    pairs = list(zip(base.data_sets, mended.data_sets, strict=True))
    if base.model.bushing != mended.model.bushing or any(
        before.direction != after.direction for before, after in pairs
    ):
        return 1.0
    recorded = [(getattr(before, name), getattr(after, name)) for before, after in pairs for name in _RECORDED]
    return max(float(np.max(np.abs(after / before - 1.0))) for before, after in recorded)


def prior_odds(explanations: Sequence[Explanation]) -> dict[tuple[str, str], float]:
    """Natural log of the prior odds of explanations, by kind and name.

    A kind's odds are shared by its families; in a family of effects the one that acts everywhere has half, those of
    single places the other half; in a family of places each has the same.

    Args:
        explanations: all that are considered.

    Returns:
        Log odds of each.
    """
    members = Counter((explanation.kind, explanation.family) for explanation in explanations)
    families = Counter(kind for kind, _ in members)
    log_odds = {}
    for explanation in explanations:
        kind, count = explanation.kind, members[explanation.kind, explanation.family]
        share = ODDS[kind] / families[kind]
        if kind != "effect":
            share /= count
        elif count > 1:
            share *= 0.5 if explanation.name == explanation.family else 0.5 / (count - 1)
        log_odds[kind, explanation.name] = log(share)
    return log_odds
