"""The search for missing effects: add the best candidate, look again, and try every rival in its place.

No effect is asked for by name: effects propose themselves with evidence, and evidence decides.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from bushfit.diagnosis.evidence import Evidence, fit, fit_from
from bushfit.diagnosis.faults import Faults, faults
from bushfit.diagnosis.propose import Proposal, proposals
from bushfit.diagnosis.record import Settings
from bushfit.diagnosis.refit import EXCLUDED, Candidate, can_reach, near_its_end, refits
from bushfit.diagnosis.score_test import SENSITIVITY_LEFT, ScoreTest
from bushfit.effects import effect_named, qualified
from bushfit.effects.contract import Array
from bushfit.errors import FitError, ModelError
from bushfit.fitting.data_sets import DataSet
from bushfit.fitting.solve import Bounds

#: Probability with which noise alone stays below the thresholds of the best candidate, of a remainder and of a fault:
#: all are asked of every clean campaign, and one false alarm in 170 is what the score card's 1 % leaves room for.
CHANCE_LEVEL = 0.998
#: Difference in BIC within which candidates are one set: odds of 20 to 1, "strong" after Kass and Raftery (1995).
SAME = 6.0
#: Chi-square that a rival must stay away from the model's noise-free prediction to be excluded: three standard errors.
APART = 10.0
#: Chi-square within which a richer rival meets a simpler model's noise-free prediction: then it contains the simpler.
_CONTAINS = 1.0
#: Times that an added effect is exchanged before the search ends; chosen: more only go round in circles.
_MOST_SWAPS = 4
#: A swap counts where it improves BIC by more than this, which is above rounding.
_LEAST_IMPROVEMENT = 1e-6
#: Reduced chi-square beyond which a model has bent its parameters too far for a refit to start from its values.
_BENT = 1.5
#: Candidates that are refitted in each round at most, the best scores first; chosen for time: the truth ranks third
#: at worst on the score card, and look-alikes of it up to the seventh.
_MOST_REFITTED = 8
#: Of these, the best so many by score are refitted whatever an earlier search said of them.
_ALWAYS_REFITTED = 3
#: Share of the best score that a candidate needs to be refitted.
_LEAST_SCORE = 0.1
#: Share of what an effect takes off chi-square within which that is known well enough to judge what is in its place.
_GAIN_KNOWN = 0.01
#: Threshold of the first round, so many times which a gain is beyond that of any other: chosen; they differ by a third.
_SURELY = 1.5
#: Share of what chance makes that its score has to reach: a refit may gain more than its score, but not so much more.
_LEAST_CHANCE = 0.3


@dataclass(frozen=True, eq=False)
class Step:
    """One effect that was added, and what came near it.

    Args:
        gain: chi-square that it takes off, all others refitted without it.
        rivals: candidates in its place that these tests cannot tell from it.
        richer: candidates that contain it as a limit.
        place: the model without it, and every candidate in its place.
    """

    name: str
    gain: float
    rivals: tuple[Candidate, ...]
    richer: tuple[Candidate, ...]
    place: Round


@dataclass(frozen=True, eq=False)
class Scored:
    """A fitted model, and every effect that it lacks with what that promises, the best score first."""

    evidence: Evidence
    proposed: tuple[Proposal, ...]

    @cached_property
    def critical(self) -> float:
        """The gain that noise alone exceeds with probability 1 - CHANCE_LEVEL."""
        return critical_gain(self.evidence, self.proposed)


@dataclass(frozen=True, eq=False)
class Round:
    """A fitted model, what every missing effect promises it, and the best of these refitted.

    Args:
        tried: the most promising refitted with all parameters, the best by BIC first.
        first: the scores of the first round, whose threshold is much the same: tests and candidates are.
    """

    scored: Scored
    tried: tuple[Candidate, ...]
    first: Scored

    @property
    def evidence(self) -> Evidence:
        """The fitted model."""
        return self.scored.evidence

    @property
    def proposed(self) -> tuple[Proposal, ...]:
        """Every effect that the model lacks, the best score first."""
        return self.scored.proposed

    @property
    def critical(self) -> float:
        """The gain that noise alone exceeds with probability 1 - CHANCE_LEVEL."""
        return self.scored.critical

    @property
    def best(self) -> Candidate | None:
        """The best candidate; in place of one that acts in one direction alone, where it is the same by BIC, that which
        acts in all."""
        if not self.tried:
            return None
        first = self.tried[0]
        everywhere = next((other for other in self.tried if other.name == first.name.partition(".")[0]), first)
        return everywhere if everywhere.evidence.bic - first.evidence.bic < SAME else first

    @property
    def real(self) -> Candidate | None:
        """The best candidate, where it is more than chance and more than its price."""
        return self.best if self.best and self.is_real(self.best) else None

    def is_real(self, candidate: Candidate) -> bool:
        """Whether a candidate is more than chance and more than its price."""
        if self.evidence.bic - candidate.evidence.bic <= SAME:
            return False
        return candidate.gain > _SURELY * self.first.critical or candidate.gain > self.critical


@dataclass(frozen=True, eq=False)
class Search:
    """The search for effects on one campaign.

    Args:
        start: values of the paper's parameters read off the data.
        held, bounds: parameters the campaign holds, and limits it sets.
        rounds: per set of added effects the refitted model and what every effect says of it.
        earlier: a search on much the same tests, from whose refits this one's start; None without.
        narrowed: whether what fell far behind in that search is refitted only where its score is near the best.
        most_of_level: departure of a level, as a share of |K|, beyond which no rig of the class makes it.
    """

    settings: Settings
    start: Mapping[str, float]
    held: tuple[str, ...]
    bounds: Bounds
    rounds: dict[frozenset[str], Round] = field(default_factory=dict)
    earlier: Search | None = None
    narrowed: bool = False
    most_of_level: float = np.inf

    @classmethod
    def begin(
        cls,
        base: Evidence,
        settings: Settings,
        start: Mapping[str, float],
        held: Sequence[str],
        bounds: Bounds,
        earlier: Search | None = None,
        *,
        most_of_level: float = np.inf,
    ) -> Search:
        """A search that has scored every effect of the library once, and refitted the best."""
        return cls(settings, start, tuple(held), bounds, earlier=earlier, most_of_level=most_of_level)._begun(base)

    @cached_property
    def _base_faults(self) -> Faults:
        return faults(self.base, CHANCE_LEVEL)

    def faults(self, evidence: Evidence) -> Faults:
        """Every single place that could be at fault beside a fitted model; of the model as it came they are kept."""
        return self._base_faults if evidence is self.base else faults(evidence, CHANCE_LEVEL)

    def anew(self, base: Evidence) -> Search:
        """The same search from another fit, of the same tests or of tests read anew."""
        return replace(self, rounds={}, earlier=None)._begun(base)

    def without_part(self, rest: Evidence, most_effects: int) -> Search:
        """The same search on the tests without a part, narrowed by what this one found."""
        settings = replace(self.settings, max_effects=most_effects)
        return replace(self, settings=settings, rounds={}, earlier=self, narrowed=True)._begun(rest)

    def _begun(self, base: Evidence) -> Search:
        self._round(base, ())
        return self

    @property
    def first(self) -> Round:
        """What every effect says of the model as it came, refitted."""
        return self.rounds[frozenset()]

    @property
    def base(self) -> Evidence:
        """The model as it came, refitted."""
        return self.first.evidence

    def _round(self, evidence: Evidence, added: Sequence[str], known: Sequence[Candidate] = ()) -> Round:
        """Score every effect that the model lacks, and refit the best of those not known already.

        A model that lacks something large has bent its own parameters to make up for it: then the refits start from
        the values read off the data, or from those of a candidate that is known already, where that is the shorter way.
        """
        key = frozenset(added)
        if key not in self.rounds:
            proposed = tuple(proposals(evidence, (*self.settings.without, *added), self.held))
            scored = Scored(evidence, proposed)
            first = self.first.scored if self.rounds else scored
            least = max(_LEAST_CHANCE * first.critical, _LEAST_SCORE * proposed[0].score) if proposed else 0.0
            passed_over = {*(candidate.name for candidate in known), *self._left_earlier(key, proposed)}
            best = [
                claim for claim in proposed[:_MOST_REFITTED] if claim.score > least and claim.name not in passed_over
            ]
            read: Mapping[str, float] = self.start if not added and evidence.reduced > _BENT else {}
            starts = {claim.name: self._found_earlier(key, claim.name) or read for claim in best}
            near = known[0].evidence.model.values if known else None
            tried = refits(evidence, best, known, starts, self.held, self.bounds, near)
            self.rounds[key] = Round(scored, tuple(self._with_limit(evidence, tried)), first)
        return self.rounds[key]

    def _with_limit(self, evidence: Evidence, tried: Sequence[Candidate]) -> Sequence[Candidate]:
        """With the simpler effect that the best candidate has nearly become, fitted from there.

        Its own score may be next to nothing: a springpot of the model that stands in for a dashpot leaves none.
        """
        name, values_at = (tried and effect_named(tried[0].name).becomes) or ("", None)
        values = values_at(tried[0].evidence.model.values) if values_at else None
        if values is None or name in evidence.model.effects:
            return tried
        if name in self.settings.without:
            return tried[1:]  # it is that effect under another name
        beside = {key: value for key, value in tried[0].evidence.model.values.items() if key in evidence.model.values}
        with suppress(FitError, ModelError):
            model = evidence.model.with_effect(name).with_values({**beside, **values})
            end = fit(model, evidence.data_sets, self.held, self.bounds)
            found = Candidate(name, end, evidence.chi_square - end.chi_square)
            both = [*(candidate for candidate in tried if candidate.name != name), found]
            return sorted(both, key=lambda candidate: candidate.evidence.bic)
        return tried

    def _left_earlier(self, added: frozenset[str], proposed: Sequence[Proposal]) -> set[str]:
        """Candidates that the earlier search left far behind beside the same effects, and whose score is far behind,
        too."""
        before = self.earlier.rounds.get(added) if self.earlier and self.narrowed else None
        left = {each.name for each in before.tried if each.left} if before else set()
        near = [claim for claim in proposed if claim.score > proposed[0].score - EXCLUDED]
        return left - {claim.name for claim in (*near, *proposed[:_ALWAYS_REFITTED])}

    def _found_earlier(self, added: frozenset[str], name: str) -> Mapping[str, float]:
        """Values at which the earlier search left a candidate beside the same effects; none where it met a bound, as
        the shape of what has no amount means nothing."""
        before = self.earlier.rounds.get(added) if self.earlier else None
        found = next((each.evidence.solution for each in (before.tried if before else ()) if each.name == name), None)
        return found.model.values if found and not found.at_bound else {}

    def grow(self) -> tuple[Evidence, list[str]]:
        """Add the best effect, look again, and stop when what is left is chance or too small to matter."""
        current, added = self.base, list[str]()
        while len(added) < self.settings.max_effects:
            best = self._round(current, added).real
            if best is None or footprint(current, best.evidence) <= self.settings.tolerance:
                break
            current, added = best.evidence, [*added, best.name]
        return current, added

    @cached_property
    def matters(self) -> bool:
        """Whether the best candidate on the base model is real and large enough to matter."""
        best = self.first.real
        return best is not None and footprint(self.base, best.evidence) > self.settings.tolerance

    def trace(self) -> Candidate | None:
        """The best candidate on the base model where it is real but too small to matter.

        One whose amount comes to rest on its bound is none: it would close more of the gap than it may.
        """
        best = self.first.real
        if best is None or self.matters:
            return None
        effect = effect_named(best.name)
        return None if qualified(effect, effect.amount) in best.evidence.solution.at_bound else best

    def exchange(self, current: Evidence, added: Sequence[str]) -> tuple[Evidence, list[str]]:
        """Try every added effect's rivals in its place, and dropping it; swap where that is better."""
        names, settled, swaps = list(added), 0, 0
        while settled < len(names):
            name = names[settled]
            others = [other for other in names if other != name]
            place = self._place(current, name, others)
            best, least = place.best, current.bic - _LEAST_IMPROVEMENT
            if any(effect_named(other).after == name for other in others):
                settled += 1
            elif best and best.name != name and best.evidence.bic < least and swaps < _MOST_SWAPS:
                names[settled], current = best.name, best.evidence
                settled, swaps = 0, swaps + 1
            elif others and not self._counts(name, current, place):
                names, settled = others, 0
                current = fit(place.evidence.model, current.data_sets, self.held, self.bounds)
            else:
                settled += 1
        return current, names

    def steps(self, current: Evidence, added: Sequence[str]) -> list[Step]:
        """Every added effect with what came near it in its place."""
        return [self._step(name, current, [other for other in added if other != name]) for name in added]

    def _counts(self, name: str, current: Evidence, place: Round) -> bool:
        """Whether an added effect, beside all that were added since, is still real and large enough to matter."""
        kept = _added(name, current, place.evidence)
        return place.is_real(kept) and footprint(place.evidence, current) > self.settings.tolerance

    def _step(self, name: str, current: Evidence, others: Sequence[str]) -> Step:
        """Sort an effect's rivals: those these tests cannot tell from it, and those that contain it.

        A rival is the same within SAME by BIC, or nearer than APART to the model's own noise-free prediction. A richer
        one that meets this prediction contains the model: then the simpler name stands.
        """
        place, rivals, richer = self._place(current, name, others), [], []
        clean = [data_set.noise_free(current.model) for data_set in current.data_sets]
        for rival in place.tried:
            if rival.name == name or rival.evidence.chi_square - current.chi_square > EXCLUDED:
                continue
            distance = self._distance(clean, rival)
            if distance < _CONTAINS and rival.evidence.parameters > current.parameters:
                richer.append(rival)
            elif rival.evidence.bic - current.bic < SAME or distance < APART:
                rivals.append(rival)
        gain = _added(name, current, place.evidence).gain
        return Step(name, gain, tuple(rivals), tuple(richer), place)

    def _place(self, current: Evidence, name: str, others: Sequence[str]) -> Round:
        """The model without an added effect, refitted, and its candidates, of which that effect is one; each once."""
        if frozenset(others) in self.rounds:
            return self.rounds[frozenset(others)]
        model = self.base.model
        for other in others:
            model = model.with_effect(other)
        start = {parameter: value for parameter, value in current.model.values.items() if parameter in model.values}
        descent = fit_from(model.with_values(start), current.data_sets, self.held, self.bounds)
        reduced = Evidence(near_its_end(descent, current.chi_square, _GAIN_KNOWN).solution, current.data_sets)
        return self._round(reduced, others, [_added(name, current, reduced)])

    def _distance(self, clean: Sequence[DataSet], rival: Candidate) -> float:
        """Chi-square of the rival, fitted to what the model itself would have measured without noise; no further than
        it takes to see whether that is far or next to nothing."""
        try:
            descent = fit_from(rival.evidence.model, clean, self.held, self.bounds)
        except (FitError, ModelError):
            return float("inf")
        while descent.chi_square > _CONTAINS and can_reach(descent, APART):
            descent = descent.stepped()
        return descent.chi_square


def _added(name: str, current: Evidence, without: Evidence) -> Candidate:
    """An effect of the current model as a candidate of the model without it."""
    return Candidate(name, current, without.chi_square - current.chi_square)


def critical_gain(evidence: Evidence, proposed: Sequence[Proposal], *, known: bool = False) -> float:
    """The gain that the best of all candidates makes of noise alone, with probability 1 - CHANCE_LEVEL; with errors of
    levels taken as known, or as few levels tell them."""
    if not proposed:
        return float("inf")
    columns = np.concatenate([proposal.columns for proposal in proposed])
    places = np.split(np.arange(len(columns)), np.cumsum([len(proposal.columns) for proposal in proposed])[:-1])
    groups, senses = list[Array](), list[int]()
    for proposal, own in zip(proposed, places, strict=True):
        each = [own] if proposal.together else np.split(own, len(own))
        groups += each
        senses += [proposal.sense] * len(each)
    return ScoreTest(evidence, columns, groups, SENSITIVITY_LEFT).largest_by_chance(CHANCE_LEVEL, senses, known=known)


def footprint(before: Evidence, after: Evidence) -> float:
    """Largest change of the model's prediction over all tests, relative to |K| or to half a loop's force range."""
    return max(data_set.change(before.model, after.model) for data_set in before.data_sets)
