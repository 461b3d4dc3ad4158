"""The workflow: detect, name, add, refit, hold out, and say what is certain and what is not.

Nowhere does it ask for an effect by name: effects propose themselves with evidence, and evidence decides.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from bushfit.diagnosis.calibrate import SENSITIVITY_LEFT, Questions
from bushfit.diagnosis.evidence import Evidence, fit
from bushfit.diagnosis.name import REFITTED, Candidate, Proposal, finished, proposals, refit
from bushfit.diagnosis.record import Settings
from bushfit.errors import FitError, ModelError
from bushfit.fitting.solve import Bounds

#: Probability with which noise alone stays below the threshold of the best candidate.
_LEVEL = 0.995
#: Candidates within this of the best by BIC are one set; a rival must stay this far by chi-square to be excluded.
SAME, APART = 6.0, 10.0
#: Rivals farther than this from the data than the best are excluded without asking what the test could tell.
_PLAIN = 60.0
#: A richer rival that meets a simpler model's prediction this closely contains it.
_CONTAINS = 1.0
_MOST_SWAPS = 4
#: Candidates with less than this share of the best score are not refitted.
_PROMISING = 0.1
#: And those that gained less than this share of the best gain in their first steps are not fitted to their end.
_CLOSE = 0.5


@dataclass(frozen=True, eq=False)
class Step:
    """One effect of the model.

    Args:
        name: the effect.
        gain: chi-square that it takes off, all others refitted without it.
        rivals: candidates in its place that these tests cannot tell from it.
        richer: candidates that contain it as a limit.
        tried: best refit of every candidate in its place.
    """

    name: str
    gain: float
    rivals: tuple[Candidate, ...]
    richer: tuple[Candidate, ...]
    tried: tuple[Candidate, ...]


@dataclass(frozen=True, eq=False)
class Search:
    """The search for effects on one campaign.

    Args:
        base: the model as it came, refitted.
        settings: of the user.
        start: values of the paper's parameters read off the data.
        held: parameters the campaign holds.
        bounds: limits the campaign sets.
        proposed: every effect's claim on the base model.
        rounds: per set of added effects the refitted model and the best refit of each candidate beside it.
        critical: gain on the base model that noise alone exceeds with probability 1 - _LEVEL.
    """

    base: Evidence
    settings: Settings
    start: Mapping[str, float]
    held: tuple[str, ...]
    bounds: Bounds
    proposed: tuple[Proposal, ...] = ()
    rounds: dict[frozenset[str], tuple[Evidence, list[Candidate]]] = field(default_factory=dict)
    critical: float = 0.0

    @classmethod
    def begin(
        cls, base: Evidence, settings: Settings, start: Mapping[str, float], held: Sequence[str], bounds: Bounds
    ) -> Search:
        """Ask every effect of the library, and refit the best."""
        proposed = tuple(proposals(base, settings.without))
        search = cls(base, settings, start, tuple(held), bounds, proposed, {}, critical_gain(base, proposed))
        search.rounds[frozenset()] = base, search.refitted(base, proposed)
        return search

    @property
    def judged(self) -> dict[str, Candidate]:
        """Best refit of every candidate on the base model, by name."""
        return {candidate.name: candidate for candidate in self.rounds[frozenset()][1]}

    def refitted(self, evidence: Evidence, proposed: Sequence[Proposal]) -> list[Candidate]:
        """The best scores refitted, best by BIC first."""
        least = max(evidence.penalty / 2.0, _PROMISING * max((proposal.score for proposal in proposed), default=0.0))
        promising = [proposal for proposal in proposed if proposal.score > least][:REFITTED]
        begun = [refit(evidence, proposal, self.start, self.held, self.bounds) for proposal in promising]
        fits = [candidate for candidate in begun if candidate is not None]
        reach = _CLOSE * max((candidate.gain for candidate in fits), default=0.0)
        fits = [
            finished(evidence, candidate, self.held, self.bounds) if candidate.gain > reach else candidate
            for candidate in fits
        ]
        return sorted(fits, key=lambda candidate: candidate.evidence.bic)

    def grow(self) -> tuple[Evidence, list[str]]:
        """Add the best effect, look again, and stop when what is left is chance or too small to matter."""
        current, added = self.base, list[str]()
        tried, critical = self.rounds[frozenset()][1], self.critical
        while len(added) < self.settings.max_effects:
            best = min(tried, key=lambda candidate: candidate.evidence.bic, default=None)
            if best is None or not self.convincing(current, best, critical):
                break
            current, added = best.evidence, [*added, best.name]
            proposed = tuple(proposals(current, self.settings.without))
            tried = self.refitted(current, proposed)
            self.rounds[frozenset(added)] = current, tried
            critical = critical_gain(current, proposed)
        return current, added

    def convincing(self, current: Evidence, best: Candidate, critical: float) -> bool:
        """Real, and large enough to matter."""
        large = footprint(current, best.evidence) > self.settings.tolerance
        return large and _real(current, best, critical)

    def trace(self) -> Candidate | None:
        """The best candidate on the base model where it is real but too small to matter."""
        best = min(self.judged.values(), key=lambda candidate: candidate.evidence.bic, default=None)
        if best is None or not _real(self.base, best, self.critical):
            return None
        return None if self.convincing(self.base, best, self.critical) else best

    def reconsider(self, current: Evidence, added: Sequence[str]) -> tuple[Evidence, list[Step]]:
        """Try every added effect's rivals in its place, and dropping it; swap where that is better."""
        names = list(added)
        steps: list[Step] = []
        for swaps_left in range(_MOST_SWAPS, -1, -1):
            steps, swapped = [], False
            for name in names:
                others = [other for other in names if other != name]
                reduced, tried = self._place(current, others)
                best = tried[0] if tried else None
                if swaps_left and best and best.name != name and best.evidence.bic < current.bic - 1e-6:
                    names[names.index(name)] = best.name
                    current, swapped = best.evidence, True
                    break
                if swaps_left and reduced.bic - current.bic < SAME and others:
                    names.remove(name)
                    current, swapped = reduced, True
                    break
                steps.append(self._step(name, current, reduced, tried))
            if not swapped:
                break
        return current, steps

    def _step(self, name: str, current: Evidence, reduced: Evidence, tried: Sequence[Candidate]) -> Step:
        """Sort an effect's rivals: those these tests cannot tell from it, and those that contain it.

        A rival is the same within SAME by BIC, or nearer than APART to the model's own noise-free prediction. A richer
        one that meets this prediction contains the model: then the simpler name stands.
        """
        rivals, richer = [], []
        for rival in tried:
            if rival.name == name or rival.evidence.chi_square - current.chi_square > _PLAIN:
                continue
            distance = self._distance(current, rival)
            if distance < _CONTAINS and rival.evidence.parameters > current.parameters:
                richer.append(rival)
            elif rival.evidence.bic - current.bic < SAME or distance < APART:
                rivals.append(rival)
        gain = reduced.chi_square - current.chi_square
        return Step(name, gain, tuple(rivals), tuple(richer), tuple(tried))

    def _place(self, current: Evidence, others: Sequence[str]) -> tuple[Evidence, list[Candidate]]:
        """The model with no more than some of the added effects, refitted, and its candidates; each set once."""
        key = frozenset(others)
        if key not in self.rounds:
            model = self.base.model
            for other in others:
                own = {name: value for name, value in current.model.values.items() if name.startswith(f"{other}.")}
                model = model.with_effect(other, own)
            start = {name: value for name, value in current.model.values.items() if name in model.values}
            reduced = fit(model.with_values(start), current.terms, self.held, self.bounds)
            proposed = proposals(reduced, (*self.settings.without, *others))
            self.rounds[key] = reduced, self.refitted(reduced, proposed)
        return self.rounds[key]

    def _distance(self, current: Evidence, rival: Candidate) -> float:
        """Chi-square of the rival, fitted to what the model itself would have measured without noise."""
        terms = [term.noise_free(current.model) for term in current.terms]
        try:
            return fit(rival.evidence.model, terms, self.held, self.bounds).chi_square
        except (FitError, ModelError):
            return float("inf")


def _real(current: Evidence, best: Candidate, critical: float) -> bool:
    """More than chance, and more than its price."""
    return best.gain > critical and current.bic - best.evidence.bic > SAME


def critical_gain(evidence: Evidence, proposed: Sequence[Proposal]) -> float:
    """The gain that the best of all candidates makes of noise alone, with probability 1 - _LEVEL."""
    columns = np.array([proposal.column for proposal in proposed])
    questions = Questions(evidence, columns, [np.array([i]) for i in range(len(proposed))], SENSITIVITY_LEFT)
    return questions.largest_by_chance(_LEVEL, [proposal.sense for proposal in proposed])


def footprint(before: Evidence, after: Evidence) -> float:
    """Largest change of the model's prediction over all tests, relative to |K| or to half a loop's force range."""
    return max(term.change(before.model, after.model) for term in before.terms)
