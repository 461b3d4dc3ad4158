"""The workflow: detect, name, add, refit, hold out, and say what is certain and what is not.

Nowhere does it ask for an effect by name: effects propose themselves with evidence, and evidence decides.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from bushfit.diagnosis.calibrate import largest_by_chance
from bushfit.diagnosis.evidence import Evidence, fit
from bushfit.diagnosis.name import REFITTED, Candidate, Proposal, proposals, refit
from bushfit.diagnosis.record import Settings
from bushfit.errors import FitError
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


@dataclass(frozen=True, eq=False)
class Step:
    """One effect of the model, its rivals in that place, and the best refit of each candidate."""

    name: str
    gain: float
    rivals: tuple[Candidate, ...] = ()
    tried: tuple[Candidate, ...] = ()


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
        judged: best refit of every candidate on the base model, by name.
        critical: gain on the base model that noise alone exceeds with probability 1 - _LEVEL.
    """

    base: Evidence
    settings: Settings
    start: Mapping[str, float]
    held: tuple[str, ...]
    bounds: Bounds
    proposed: tuple[Proposal, ...] = ()
    judged: dict[str, Candidate] = field(default_factory=dict)
    critical: float = 0.0

    @classmethod
    def begin(
        cls, base: Evidence, settings: Settings, start: Mapping[str, float], held: Sequence[str], bounds: Bounds
    ) -> Search:
        """Ask every effect of the library, and refit the best."""
        proposed = tuple(proposals(base, settings.without))
        search = cls(base, settings, start, tuple(held), bounds, proposed, {}, critical_gain(base, proposed))
        search.judged.update({candidate.name: candidate for candidate in search.refitted(base, proposed)})
        return search

    def refitted(self, evidence: Evidence, proposed: Sequence[Proposal]) -> list[Candidate]:
        """The best scores refitted, best by BIC first."""
        least = max(evidence.penalty / 2.0, _PROMISING * max((proposal.score for proposal in proposed), default=0.0))
        promising = [proposal for proposal in proposed if proposal.score > least][:REFITTED]
        fits = [refit(evidence, proposal, self.start, self.held, self.bounds) for proposal in promising]
        return sorted((fit for fit in fits if fit is not None), key=lambda fit: fit.evidence.bic)

    def grow(self) -> tuple[Evidence, list[str]]:
        """Add the best effect, look again, and stop when what is left is chance or too small to matter."""
        current, added = self.base, list[str]()
        proposed, tried, critical = self.proposed, list(self.judged.values()), self.critical
        while len(added) < self.settings.max_effects:
            best = min(tried, key=lambda candidate: candidate.evidence.bic, default=None)
            if best is None or not self.convincing(current, best, critical):
                break
            current, added = best.evidence, [*added, best.name]
            proposed = tuple(proposals(current, self.settings.without))
            tried = self.refitted(current, proposed)
            critical = critical_gain(current, proposed)
        return current, added

    def convincing(self, current: Evidence, best: Candidate, critical: float) -> bool:
        """More than chance, more than its price, and large enough to matter."""
        worth = current.bic - best.evidence.bic
        return best.gain > critical and worth > SAME and footprint(current, best.evidence) > self.settings.tolerance

    def reconsider(self, current: Evidence, added: Sequence[str]) -> tuple[Evidence, list[Step]]:
        """Try every added effect's rivals in its place, and dropping it; swap where that is better."""
        names = list(added)
        steps: list[Step] = []
        for _ in range(_MOST_SWAPS):
            steps, swapped = [], False
            for name in names:
                others = [other for other in names if other != name]
                reduced = self._without(current, others)
                tried = self._rivals(reduced, others)
                best = tried[0] if tried else None
                if best and best.name != name and best.evidence.bic < current.bic - 1e-6:
                    names[names.index(name)] = best.name
                    current, swapped = best.evidence, True
                    break
                if reduced.bic - current.bic < SAME and others:
                    names.remove(name)
                    current, swapped = reduced, True
                    break
                rivals = tuple(rival for rival in tried if rival.name != name and self._same(current, rival))
                steps.append(Step(name, reduced.chi_square - current.chi_square, rivals, tuple(tried)))
            if not swapped:
                break
        return current, steps

    def _without(self, current: Evidence, others: Sequence[str]) -> Evidence:
        """The model with no more than some of the added effects, refitted."""
        if not others:
            return self.base
        model = self.base.model
        for other in others:
            own = {key: value for key, value in current.model.values.items() if key.startswith(f"{other}.")}
            model = model.with_effect(other, own)
        start = {key: value for key, value in current.model.values.items() if key in model.values}
        return fit(model.with_values(start), current.terms, self.held, self.bounds)

    def _rivals(self, reduced: Evidence, others: Sequence[str]) -> list[Candidate]:
        if not others:
            return sorted(self.judged.values(), key=lambda candidate: candidate.evidence.bic)
        return self.refitted(reduced, proposals(reduced, (*self.settings.without, *others)))

    def _same(self, current: Evidence, rival: Candidate) -> bool:
        """Whether these tests could not tell a rival from the model.

        Within SAME by BIC, or nearer than APART to the model's own noise-free prediction. A richer rival that meets
        this prediction contains the model: then the simpler name stands.
        """
        behind = rival.evidence.bic - current.bic
        if rival.evidence.chi_square - current.chi_square > _PLAIN:
            return False
        distance = self._distance(current, rival)
        if distance < _CONTAINS and rival.evidence.parameters > current.parameters:
            return False
        return behind < SAME or distance < APART

    def _distance(self, current: Evidence, rival: Candidate) -> float:
        """Chi-square of the rival, fitted to what the model itself would have measured without noise."""
        terms = [term.noise_free(current.model) for term in current.terms]
        try:
            return fit(rival.evidence.model, terms, self.held, self.bounds).chi_square
        except FitError:
            return float("inf")


def critical_gain(evidence: Evidence, proposed: Sequence[Proposal]) -> float:
    """The gain that the best of all candidates makes of noise alone, with probability 1 - _LEVEL."""
    visible = [proposal for proposal in proposed if proposal.visible]
    groups = [proposal.direction for proposal in visible]
    return largest_by_chance(evidence, groups, _LEVEL, [proposal.sense for proposal in visible])


def footprint(before: Evidence, after: Evidence) -> float:
    """Largest change of the model's prediction over all tests, relative to |K| or to half a loop's force range."""
    return max(term.change(before.model, after.model) for term in before.terms)
