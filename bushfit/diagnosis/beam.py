"""Sets of explanations, grown one at a time from the most probable: each weighed by the evidence of the tests.

Effects are refitted with all parameters and counted by Laplace's method; places and what has no name stay linear.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import log

import numpy as np
from scipy.special import logsumexp

from bushfit.campaign.schema import RigSettings
from bushfit.diagnosis.claims import Claim, Screen, claims
from bushfit.diagnosis.currency import Block, Ledger, Node, Worth
from bushfit.diagnosis.evidence import Evidence, fit
from bushfit.diagnosis.explanations import Explanation, FaultyPlace, MissingEffect, effects, places, unnamed
from bushfit.diagnosis.priors import BEAM, FAR, LARGEST, LEVELS, NAMED, ODDS, REFITS, ROUNDS, SIZES
from bushfit.diagnosis.propose import probes
from bushfit.diagnosis.refit import refitted, within_reach
from bushfit.diagnosis.rig_errors import blocks, nodes, scattering_alone
from bushfit.effects import effect_named, qualified
from bushfit.errors import FitError, ModelError
from bushfit.fitting.data import Data
from bushfit.fitting.rig_class import ASSUMED, of_class
from bushfit.fitting.solve import Bounds

#: Probability of nothing from which on records are not doubted. For time: each claim is a fit.
_SURE = 0.99
#: Refits at most of what is probable by a linear count alone. For time.
_SETTLED = 8
#: Claims that are fitted, those first under which the tests could agree best; places added to a state. For time.
_CLAIMS, _PLACES = 4, 2
#: Logarithm of odds behind its state within which an effect is refitted; for time.
_SLIGHT = 3.0
#: Sizes over which the prior of an amount is averaged, and the least relative error that they resolve.
_FINE, _SHARPEST = 1000, 0.01
#: What a mistake in the record changes, relative to |K|: never so little that it counts as nothing.
_A_RECORD = 1.0
#: Reduced chi-square beyond which a model has bent its parameters too far for a refit to start from its values.
_BENT = 1.5


@dataclass(frozen=True, eq=False)
class Asked:
    """What a search works with.

    Args:
        data: the tests.
        base: the model as it came, fitted to them.
        fitted: fits it to tests of which a record was put right.
        without: effects and mistakes not to consider.
        most: effects added at the most.
        start: values read off the data, for a model that the gap has bent too far.
        held, bounds: parameters that do not move, and limits of the others inside their own.
    """

    data: Data
    base: Evidence
    fitted: Callable[[Data], Evidence]
    without: Sequence[str]
    most: int
    start: Mapping[str, float]
    held: Sequence[str]
    bounds: Bounds


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A set of explanations and what it is worth.

    Args:
        effects: by name, in the order in which they were added.
        claim: that a record is mistaken, or None.
        places: of the tests gone wrong.
        unnamed: the process without a name; "" without.
        levels: whether errors of levels are larger than the class of the rig allows.
        log_posterior: logarithm of prior times evidence.
        size: of what it changes, relative to |K|.
        last: of this, what its last explanation changes, where it was counted linearly; else 0.
        weighed: the state that it is, with its effects refitted, or to which its last explanation was added linearly.
    """

    effects: tuple[str, ...]
    claim: Claim | None
    places: tuple[FaultyPlace, ...]
    unnamed: str
    levels: bool
    log_posterior: float
    size: float
    last: float
    weighed: Weighed

    @property
    def key(self) -> frozenset[Hashable]:
        marks = ["levels"] if self.levels else []
        more = [each for each in (self.unnamed, self.claim and (self.claim.mistake.name, self.claim.tests)) if each]
        return frozenset((*self.effects, *(place.name for place in self.places), *more, *marks))

    @property
    def refitted(self) -> bool:
        """Whether all of its effects were refitted, and not only counted linearly."""
        return self.effects == self.weighed.state.effects

    @property
    def chance(self) -> float:
        """Probability of tests that it meets worse than these."""
        return self.weighed.first.chance


@dataclass(frozen=True, eq=False)
class Tests:
    """Tests as they are recorded, or with a record put right, and the model as it came fitted to them.

    Args:
        log_odds: of these beforehand, with nothing else missing.
        size: of what a record that is put right changes; 0 of the tests as they are.
    """

    base: Evidence
    rig: RigSettings
    log_odds: float
    claim: Claim | None = None
    size: float = 0.0

    @property
    def state(self) -> State:
        return State(self, (), (), self.base, self.log_odds, size=self.size)

    @cached_property
    def bare(self) -> Evidence:
        return scattering_alone(self.base)

    @cached_property
    def blocks(self) -> list[Block]:
        return blocks(self.bare, self.rig)

    @cached_property
    def nodes(self) -> list[Node]:
        return nodes(self.bare)

    @cached_property
    def fixed(self) -> list[Explanation]:
        """Explanations that do not depend on the model."""
        return [*places(self.bare), *unnamed(self.bare)]


@dataclass(frozen=True, eq=False)
class State:
    """A set of effects and places around which everything else is weighed.

    Args:
        precision: prior precision of coordinates of effects, by name; infinite of what rests on an end of its range.
        density: ln of their prior density, with the factor of Laplace's method.
        amounts: size of each place's amounts, relative to |K|.
    """

    tests: Tests
    effects: tuple[str, ...]
    places: tuple[FaultyPlace, ...]
    evidence: Evidence
    log_prior: float
    precision: Mapping[str, float] = field(default_factory=dict)
    density: float = 0.0
    amounts: tuple[float, ...] = ()
    size: float = 0.0

    @property
    def key(self) -> frozenset[Hashable]:
        claim = self.tests.claim
        own = [(claim.mistake.name, claim.tests)] if claim else []
        return frozenset((*self.effects, *(place.name for place in self.places), *own))


@dataclass(frozen=True, eq=False)
class Weighed:
    """A state with what every explanation beside it is worth.

    Args:
        bare: the fit with residuals in units of what scatters from point to point.
        first: of nothing more, at every size of the rig's errors.
    """

    state: State
    asked: Asked

    @cached_property
    def bare(self) -> Evidence:
        same = self.state.evidence is self.state.tests.base
        return self.state.tests.bare if same else scattering_alone(self.state.evidence)

    @cached_property
    def first(self) -> Ledger:
        state, tests = self.state, self.state.tests
        known = [state.precision.get(name, 0.0) for name in self.bare.solution.coordinates.names]
        moves = np.isfinite(known)
        precision = np.array(known)[moves].tolist()
        free = [self.bare.solution.jacobian[moves]]
        for place, amount in zip(state.places, state.amounts, strict=True):
            free.append(place.columns)
            precision += [amount**-2] * len(place.columns)
        return Ledger(self.bare.residual, np.concatenate(free), np.array(precision), tests.blocks, (), tests.nodes)

    @cached_property
    def log_posterior(self) -> float:
        return self.state.log_prior + self.state.density + self.first.log_evidence

    @cached_property
    def effects(self) -> list[MissingEffect]:
        return effects(self.bare, (*self.asked.without, *self.state.effects), self.asked.held)

    @cached_property
    def worths(self) -> list[tuple[Explanation, Worth]]:
        """Every explanation that can be counted linearly, at the sizes of the rig's errors that matter: those that
        nothing more, or something smooth, makes likely."""
        every = [each for each in (*self.effects, *self.state.tests.fixed) if each.group is not None]
        curves = [each.group for each in every if each.group and each.kind == "unnamed"]
        likely = replace(self.first, groups=curves).likely(FAR)
        groups = [each.group for each in every if each.group]
        return list(zip(every, replace(self.first, groups=groups, nodes=likely).worths, strict=True))

    def with_(self, each: Explanation, worth: Worth, log_odds: float) -> Hypothesis:
        """This state with an explanation more, counted linearly."""
        state = self.state
        names = (*state.effects, each.name) if each.kind == "effect" else state.effects
        spots = (*state.places, each) if isinstance(each, FaultyPlace) else state.places
        curve = each.name if each.kind == "unnamed" else ""
        posterior, size = state.log_prior + state.density + log_odds + worth.log_evidence, max(state.size, worth.size)
        return Hypothesis(names, state.tests.claim, spots, curve, False, posterior, size, worth.size, self)


class Search:
    """A beam over sets of explanations."""

    def __init__(self, asked: Asked) -> None:
        self.asked = asked
        self.found: dict[frozenset[Hashable], Hypothesis] = {}
        self._seen: set[frozenset[Hashable]] = set()
        tests = Tests(asked.base, asked.data.campaign.rig, log(1.0 - sum(ODDS.values())))
        self.root = self._weigh(tests.state)
        self._odds = _odds([*self.root.effects, *tests.fixed])

    def run(self) -> list[Hypothesis]:
        """Every hypothesis that was weighed, the most probable first."""
        beam = [self.root]
        for depth in range(ROUNDS + 1):
            for weighed in beam:
                self._note_with_each(weighed, depth)
            if depth == ROUNDS:
                break
            fresh = [each for weighed in beam for each in self._grown(weighed, depth)]
            if depth == 0 and self.nothing < _SURE:
                fresh += self._of_records()
            for weighed in fresh:
                self._note_state(weighed)
            best = max(each.log_posterior for each in self.found.values() if not (each.unnamed or each.levels))
            near = sorted(fresh, key=lambda each: -each.log_posterior)[: BEAM[min(depth, 1)]]
            beam = [each for each in near if each.log_posterior > best - FAR]
            if not beam:
                break
        self._settle()
        return self.ordered

    @property
    def ordered(self) -> list[Hypothesis]:
        return sorted(self.found.values(), key=lambda each: -each.log_posterior)

    @property
    def nothing(self) -> float:
        """Probability that nothing is missing, as far as the search has come."""
        return float(np.exp(self.root.log_posterior - logsumexp([each.log_posterior for each in self.found.values()])))

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
        for each, worth in weighed.worths:
            if len(weighed.state.effects) < self.asked.most or each.kind != "effect":
                self._note(weighed.with_(each, worth, self._prior(each.kind, each.name) - log(depth + 1)))

    def _note_state(self, weighed: Weighed) -> None:
        state, claim = weighed.state, weighed.state.tests.claim
        self._note(
            Hypothesis(state.effects, claim, state.places, "", False, weighed.log_posterior, state.size, 0.0, weighed)
        )
        wide = state.log_prior + state.density + weighed.first.log_evidence_wide
        size = max(state.size, LEVELS[-1][0] * max(of_class(state.tests.rig, ASSUMED)))
        self._note(Hypothesis(state.effects, claim, state.places, "", True, wide, size, 0.0, weighed))

    def _note(self, hypothesis: Hypothesis) -> None:
        """Keep the better of two ways to the same; what was refitted counts before what was not."""
        before = self.found.get(hypothesis.key)
        if before is None or (hypothesis.refitted, hypothesis.log_posterior) > (before.refitted, before.log_posterior):
            self.found[hypothesis.key] = hypothesis

    def _grown(self, weighed: Weighed, depth: int) -> list[Weighed]:
        """The state with each of its most promising effects, refitted, and places; and without an effect that may only
        have led the way."""
        grown = self._with_effects(weighed, self._promising(weighed, *REFITS[min(depth, 1)]), depth)
        grown += [each for other in grown for each in self._without_earlier(other.state)]
        return grown + self._with_places(weighed, depth)

    def _promising(self, weighed: Weighed, by_evidence: int, by_score: int) -> list[str]:
        """Effects that are worth a refit: so many of those with the most evidence as far as they are linear, and of
        those that take most off chi-square, which tells more where the gap is large."""
        state = weighed.state
        new = [each.name for each in weighed.effects if state.key | {each.name} not in self._seen]
        evidence = {
            each.name: self._prior("effect", each.name) + worth.log_evidence - weighed.first.log_evidence
            for each, worth in weighed.worths
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
        return [
            self._weigh(self._with_effect(state, name, evidence, depth))
            for name, evidence in refitted(state.evidence, proposed, start, asked.held, asked.bounds).items()
        ]

    def _with_effect(self, state: State, name: str, evidence: Evidence, depth: int) -> State:
        density, precision, size = _laplace(name, evidence, state.evidence)
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
        own = [(each, worth) for each, worth in weighed.worths if isinstance(each, FaultyPlace)]
        own.sort(key=lambda pair: -(self._prior("place", pair[0].name) + pair[1].log_evidence))
        for each, worth in own[:_PLACES]:
            odds = self._prior("place", each.name) - log(depth + 1)
            better = weighed.with_(each, worth, odds).log_posterior > weighed.log_posterior
            if better and state.key | {each.name} not in self._seen:
                more = replace(
                    state,
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
                evidence = fit(model, data_sets, held, {**within_reach(model, data_sets), **bounds})
                less = state.tests.state
                for order, other in enumerate(each for each in state.effects if each != name):
                    less = self._with_effect(less, other, evidence, order)
                yield self._weigh(less)

    def _of_records(self) -> list[Weighed]:
        """The most promising mistakes in the record, the model as it came fitted to the tests with each put right."""
        data, base, found = self.asked.data, self.asked.base, []
        listed = claims(data, self.asked.without)
        for claim in Screen(data).best(listed, _CLAIMS):
            with suppress(FitError, ModelError):  # tests that nothing can be fitted to as mended
                evidence = self.asked.fitted(claim.mended(data))
                if [each.size for each in evidence.data_sets] == [each.size for each in base.data_sets]:
                    odds = log(ODDS["record"]) - log(len(listed))
                    found.append(self._weigh(Tests(evidence, data.campaign.rig, odds, claim, _A_RECORD).state))
        return found


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


def _laplace(name: str, evidence: Evidence, before: Evidence) -> tuple[float, dict[str, float], float]:
    """Of an effect that was refitted: ln of the prior density of its own coordinates with the factor of Laplace's
    method, their precision, and what it changes, relative to |K|.

    What an amount changes is log-uniform from the least size on. A shape is uniform over what the tests
    could show; at rest on an end of that it moves no further, and the fall of the likelihood away from the end tells
    how much of it counts. Of an effect in place of a branch each parameter beyond the branch's two is uniform over a
    factor of 20.
    """
    effect, names = effect_named(name), evidence.solution.coordinates.names
    data_sets, model = evidence.data_sets, evidence.model
    other = model.without(name) if effect.replaces is None else before.model
    size = max(each.change(model, other) for each in data_sets)
    density, precision, count = 0.0, {}, 0
    jacobian = evidence.solution.jacobian
    variances = np.diag(np.linalg.pinv(jacobian @ jacobian.T, rcond=1e-12, hermitian=True))
    if effect.replaces is not None:
        count = max(len(effect.parameters) - 2, 0)
        own = {qualified(effect, parameter): 0.5 for parameter in effect.parameters}
        return count * (0.5 * log(2.0 * np.pi) - log(3.0)), own, size
    for parameter in effect.parameters:
        coordinate = qualified(effect, parameter)
        if coordinate not in names:
            continue
        count += 1
        if parameter is effect.amount:
            amount = max(abs(model.values[coordinate] - (parameter.neutral or 0.0)) / parameter.typical, 1e-12)
            precision[coordinate] = 0.25 if parameter.log else 0.25 / amount**2
            error = (1.0 if parameter.log else 1.0 / amount) * np.sqrt(variances[names.index(coordinate)])
            density += _of_amount(size, float(error)) - (0.0 if parameter.log else log(amount))
            density -= 0.0 if parameter.neutral == parameter.bounds[0] else log(2.0)
            continue
        tried = probes(data_sets, model, parameter)
        if parameter.log:
            wide = max(log(tried.max() / max(tried.min(), 1e-30)), 1.0)
        else:
            wide = max(float(np.ptp(tried)) / parameter.typical, 1.0)
        density -= log(wide)
        if coordinate in evidence.solution.at_bound:
            count -= 1
            pull = abs(float(evidence.solution.jacobian[names.index(coordinate)] @ evidence.residual))
            density += log(min(wide, 1.0 / max(pull, 1e-12)))
            precision[coordinate] = np.inf
        else:
            precision[coordinate] = 12.0 / wide**2
    return density + 0.5 * count * log(2.0 * np.pi), precision, size


def _of_amount(size: float, error: float) -> float:
    """Logarithm of the mean prior density of an amount, per relative change, over its likelihood.

    Args:
        size: of what it changes as fitted, relative to |K|.
        error: standard error of the amount, relative to it.
    """
    times = np.geomspace(SIZES[0], LARGEST, _FINE) / max(size, 1e-12)
    error = max(error, _SHARPEST)
    exponent = -0.5 * np.square((times - 1.0) / error)
    return float(logsumexp(exponent)) - log(_FINE) - 0.5 * log(2.0 * np.pi) - log(error)
