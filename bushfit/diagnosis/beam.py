"""Sets of explanations, grown one at a time from the most probable: each weighed by the evidence of the tests.

Effects are refitted with all parameters and counted by Laplace's method; places and what has no name stay linear.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import log

import numpy as np

from bushfit.campaign.schema import RigSettings
from bushfit.diagnosis.currency import Block, Ledger, Node, Worth
from bushfit.diagnosis.evidence import EVALUATIONS, Evidence, fit_from
from bushfit.diagnosis.explanations import Explanation, effects, places, unnamed
from bushfit.diagnosis.priors import BEAM, FAR, ODDS, REFITS, ROUNDS, SIZES
from bushfit.diagnosis.propose import probes
from bushfit.diagnosis.refit import refitted
from bushfit.diagnosis.rig_errors import blocks, nodes, scattering_alone
from bushfit.effects import effect_named, qualified
from bushfit.effects.contract import Array
from bushfit.errors import FitError, ModelError
from bushfit.fitting.solve import Bounds


@dataclass(frozen=True, eq=False)
class Asked:
    """What a search works with.

    Args:
        base: the model as it came, fitted.
        rig: the class of the rig.
        without: effects not to consider.
        most: effects added at the most.
        start: values read off the data, for a model that the gap has bent too far.
        held, bounds: parameters that do not move, and limits of the others inside their own.
    """

    base: Evidence
    rig: RigSettings
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
        places: of the tests gone wrong.
        unnamed: the process without a name; "" without.
        levels: whether errors of levels are larger than the class of the rig allows.
        log_posterior: logarithm of prior times evidence.
        size: of what it changes, relative to |K|.
        evidence: the model with the effects, refitted; None where they were only counted linearly.
        chance: probability of what it leaves; None as of `evidence`.
    """

    effects: tuple[str, ...]
    places: tuple[Explanation, ...]
    unnamed: str
    levels: bool
    log_posterior: float
    size: float
    evidence: Evidence | None = None
    chance: float | None = None

    @property
    def key(self) -> frozenset[str]:
        marks = ["levels"] if self.levels else []
        return frozenset((*self.effects, *(place.name for place in self.places), *filter(None, [self.unnamed]), *marks))


@dataclass(frozen=True, eq=False)
class _State:
    """A set of effects and places around which everything else is weighed.

    Args:
        precision: prior precision of coordinates of effects, by name.
        density: ln of their prior density, with the factor of Laplace's method.
        amounts: size of each place's amounts, relative to |K|.
    """

    effects: tuple[str, ...]
    places: tuple[Explanation, ...]
    evidence: Evidence
    log_prior: float
    precision: Mapping[str, float] = field(default_factory=dict)
    density: float = 0.0
    amounts: tuple[float, ...] = ()
    size: float = 0.0

    @property
    def key(self) -> frozenset[str]:
        return frozenset((*self.effects, *(place.name for place in self.places)))


@dataclass(frozen=True, eq=False)
class _Weighed:
    """A state with what every explanation beside it is worth.

    Args:
        bare: the fit with residuals in units of what scatters from point to point.
        first: what is worth something at every size of the rig's errors: nothing more, and what has no name.
    """

    state: _State
    bare: Evidence
    first: Ledger
    asked: Asked
    places: Sequence[Explanation]

    @property
    def log_posterior(self) -> float:
        return self.state.log_prior + self.state.density + self.first.log_evidence

    @cached_property
    def effects(self) -> list[Explanation]:
        return effects(self.bare, (*self.asked.without, *self.state.effects), self.asked.held)

    @cached_property
    def worths(self) -> list[tuple[Explanation, Worth]]:
        """Every explanation that can be counted linearly, at the sizes of the rig's errors that matter."""
        every = [each for each in (*self.effects, *self.places) if each.group is not None]
        groups = [each.group for each in every if each.group is not None]
        return list(zip(every, replace(self.first, groups=groups, nodes=self.first.likely(FAR)).worths, strict=True))


class Search:
    """A beam over sets of explanations."""

    def __init__(self, asked: Asked) -> None:
        self.asked = asked
        self.found: dict[frozenset[str], Hypothesis] = {}
        bare = scattering_alone(asked.base)
        self._blocks: list[Block] = blocks(bare, asked.rig)
        self._nodes: list[Node] = nodes(bare)
        self._fixed = [*places(bare), *unnamed(bare)]
        self.root = self._weigh(_State((), (), asked.base, log(1.0 - sum(ODDS.values()))), bare)
        self._odds = _odds([*self.root.effects, *self._fixed])

    def run(self) -> list[Hypothesis]:
        """Every hypothesis that was weighed, the most probable first."""
        beam, seen = [self.root], {self.root.state.key}
        for depth in range(ROUNDS + 1):
            for weighed in beam:
                self._tell(weighed, depth)
            if depth == ROUNDS:
                break
            fresh = []
            for weighed in beam:
                for state in self._grown(weighed, depth, seen):
                    seen.add(state.key)
                    with suppress(np.linalg.LinAlgError):
                        fresh.append(self._weigh(state))
            for weighed in fresh:
                self._note_state(weighed)
            fresh.sort(key=lambda each: -each.log_posterior)
            best = max(each.log_posterior for each in self.found.values() if not each.unnamed)
            near = [each for each in fresh if each.log_posterior > best - FAR]
            beam = near[: BEAM[min(depth, 1)]]
            if not beam:
                break
        return sorted(self.found.values(), key=lambda each: -each.log_posterior)

    def _prior(self, kind: str, name: str) -> float:
        """Logarithm of the odds beforehand; what can only be asked for beside another has those of a family."""
        least = min(odds for (own, _), odds in self._odds.items() if own == kind)
        return self._odds.get((kind, name), least)

    def _weigh(self, state: _State, bare: Evidence | None = None) -> _Weighed:
        bare = bare or scattering_alone(state.evidence)
        precision = [state.precision.get(name, 0.0) for name in bare.solution.coordinates.names]
        free = [bare.solution.jacobian]
        for place, amount in zip(state.places, state.amounts, strict=True):
            assert place.group is not None
            free.append(place.group.columns)
            precision += [amount**-2] * len(place.group.columns)
        curves = [each.group for each in self._fixed if each.kind == "unnamed" and each.group]
        first = Ledger(bare.residual, np.concatenate(free), np.array(precision), self._blocks, curves, self._nodes)
        return _Weighed(state, bare, first, self.asked, self._fixed)

    def _tell(self, weighed: _Weighed, depth: int) -> None:
        """Note every explanation beside a state, counted linearly, and the state itself."""
        self._note_state(weighed)
        state, base = weighed.state, weighed.state.log_prior + weighed.state.density - log(depth + 1)
        for each, worth in weighed.worths:
            posterior = base + self._prior(each.kind, each.name) + worth.log_evidence
            size = max(state.size, worth.size)
            more = {
                "effect": ((*state.effects, each.name), state.places, ""),
                "place": (state.effects, (*state.places, each), ""),
                "unnamed": (state.effects, state.places, each.name),
            }[each.kind]
            self._note(Hypothesis(*more, False, posterior, size))

    def _note_state(self, weighed: _Weighed) -> None:
        state, ledger = weighed.state, weighed.first
        self._note(
            Hypothesis(
                state.effects, state.places, "", False, weighed.log_posterior, state.size, state.evidence, ledger.chance
            )
        )
        wide = state.log_prior + state.density + ledger.log_evidence_wide
        self._note(Hypothesis(state.effects, state.places, "", True, wide, max(state.size, 0.0125), state.evidence))

    def _note(self, hypothesis: Hypothesis) -> None:
        before = self.found.get(hypothesis.key)
        if before and before.evidence and not hypothesis.evidence:  # what was refitted is not guessed at
            return
        if before is None or hypothesis.log_posterior > before.log_posterior or (hypothesis.evidence and not before.evidence):
            self.found[hypothesis.key] = hypothesis

    def _grown(self, weighed: _Weighed, depth: int, seen: set[frozenset[str]]) -> list[_State]:
        """The state with each of its most promising effects, refitted, and places; and without an effect that may only
        have led the way."""
        state = weighed.state
        base = state.log_prior + state.density - log(depth + 1)
        least = weighed.log_posterior
        promise = {each.name: base + self._prior("effect", each.name) + worth.log_evidence
                   for each, worth in weighed.worths if each.kind == "effect"}
        for each in weighed.effects:
            if each.group is None and each.proposal:
                promise[each.name] = least + self._prior("effect", each.name) + 0.5 * each.proposal.score - 5.0
        names = [name for name in sorted(promise, key=lambda name: -promise[name]) if promise[name] > least - 3.0]
        names = [name for name in names if state.key | {name} not in seen][: REFITS[min(depth, 1)]]
        grown = []
        if names and len(state.effects) < self.asked.most:
            proposed = [each.proposal for each in weighed.effects if each.name in names and each.proposal]
            start = self.asked.start if depth == 0 and state.evidence.reduced > 1.5 else {}
            for name, evidence in refitted(state.evidence, proposed, start, self.asked.held, self.asked.bounds).items():
                grown.append(self._with_effect(state, name, evidence, depth))
        grown += self._with_places(weighed, depth, seen)
        for each in list(grown):
            if len(each.effects) == 2 and not each.places:
                grown += self._without_first(each, seen)
        return grown

    def _with_effect(self, state: _State, name: str, evidence: Evidence, depth: int) -> _State:
        density, precision, size = _laplace(name, evidence, state.evidence)
        prior = state.log_prior + self._prior("effect", name) - log(depth + 1)
        return _State(
            (*state.effects, name), state.places, evidence, prior, {**state.precision, **precision},
            state.density + density, state.amounts, max(state.size, size),
        )

    def _with_places(self, weighed: _Weighed, depth: int, seen: set[frozenset[str]]) -> list[_State]:
        state, own = weighed.state, [(each, worth) for each, worth in weighed.worths if each.kind == "place"]
        base = state.log_prior + state.density - log(depth + 1)
        own.sort(key=lambda pair: -(self._prior("place", pair[0].name) + pair[1].log_evidence))
        grown = []
        for each, worth in own[:2]:
            posterior = base + self._prior("place", each.name) + worth.log_evidence
            if posterior > weighed.log_posterior and state.key | {each.name} not in seen:
                grown.append(
                    _State(
                        state.effects, (*state.places, each), state.evidence,
                        state.log_prior + self._prior("place", each.name) - log(depth + 1), state.precision, state.density,
                        (*state.amounts, worth.likeliest), max(state.size, worth.size),
                    )
                )
        return grown

    def _without_first(self, state: _State, seen: set[frozenset[str]]) -> list[_State]:
        first, second = state.effects
        if frozenset({second}) in seen:
            return []
        root = self.root.state
        with suppress(FitError, ModelError):
            model = state.evidence.model.without(first)
            descent = fit_from(model, state.evidence.data_sets, self.asked.held, self.asked.bounds).finished(EVALUATIONS)
            return [self._with_effect(root, second, Evidence(descent.solution, state.evidence.data_sets), 0)]
        return []


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

    An amount is log-uniform over two decades, and so is what it changes between the least and the largest size; a shape
    is uniform over what the tests could show. Of an effect in place of a branch each parameter beyond the branch's two
    is uniform over a factor of 20.
    """
    effect, names = effect_named(name), evidence.solution.coordinates.names
    data_sets, model = evidence.data_sets, evidence.model
    other = model.without(name) if effect.replaces is None else before.model
    size = max(each.change(model, other) for each in data_sets)
    density, precision, count = 0.0, {}, 0
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
            precision[coordinate] = 0.25 if parameter.log else 0.25 / max(amount, 1e-6) ** 2
            density -= log(log(100.0)) + (0.0 if parameter.log else log(amount))
            density -= 0.0 if parameter.neutral == parameter.bounds[0] else log(2.0)
            beyond = max(log(max(size, 1e-9) / SIZES[-1]), log(SIZES[0] / max(size, 1e-9)), 0.0)
            density -= 0.5 * (beyond / 0.7) ** 2
        else:
            tried = probes(data_sets, model, parameter)
            wide = log(max(tried.max() / max(tried.min(), 1e-30), np.e)) if parameter.log else max(np.ptp(tried) / parameter.typical, 1.0)
            density -= log(wide)
            precision[coordinate] = 12.0 / wide**2
    return density + 0.5 * count * log(2.0 * np.pi), precision, size
