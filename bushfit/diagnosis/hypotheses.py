"""Hypotheses: sets of explanations, the state of the model and tests around which each is weighed, and its worth."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from bushfit.campaign.schema import RigSettings
from bushfit.diagnosis.claims import Claim
from bushfit.diagnosis.currency import Ledger, Worth
from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.explanations import Explanation, FaultyPlace, Meeting, MissingEffect, effects, places, unnamed
from bushfit.diagnosis.priors import FAR
from bushfit.diagnosis.rig_errors import RigErrors, rig_errors, scattering_alone
from bushfit.effects.contract import Array
from bushfit.fitting.coordinates import Bounds
from bushfit.fitting.data import Data


@dataclass(frozen=True, eq=False)
class Asked:
    """What a search works with.

    Args:
        data: the tests.
        base: the model as it came, fitted to them.
        fitted: fits it to tests of which a record was put right.
        without: effects and mistakes not to consider.
        most: effects added at the most.
        tolerance: change of |K|, relative, that counts as nothing.
        start: values read off the data, for a model that the gap has bent too far.
        met: points without weight that meet at a frequency.
        held, bounds: parameters that do not move, and limits of the others inside their own.
    """

    data: Data
    base: Evidence
    fitted: Callable[[Data], Evidence]
    without: Sequence[str]
    most: int
    tolerance: float
    start: Mapping[str, float]
    met: Sequence[Meeting]
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
    def errors(self) -> RigErrors:
        return rig_errors(self.bare, self.rig)

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
        return Ledger(self.bare.residual, np.concatenate(free), np.array(precision), tests.errors)

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
        return list(zip(every, self.worths_of(every), strict=True))

    @cached_property
    def _likely(self) -> Array:
        """Numbers of the nodes that nothing more, or something smooth, makes likely."""
        curves = [each.group for each in self.state.tests.fixed if each.group and each.kind == "unnamed"]
        return replace(self.first, groups=curves).likely(FAR)

    def worths_of(self, every: Sequence[Explanation]) -> Sequence[Worth]:
        """Of explanations that have columns."""
        return replace(self.first, at=self._likely).worths_of([each.group for each in every if each.group])

    def with_(self, each: Explanation, worth: Worth, log_odds: float) -> Hypothesis:
        """This state with an explanation more, counted linearly."""
        state = self.state
        names = (*state.effects, each.name) if each.kind == "effect" else state.effects
        spots = (*state.places, each) if isinstance(each, FaultyPlace) else state.places
        curve = each.name if each.kind == "unnamed" else ""
        posterior, size = state.log_prior + state.density + log_odds + worth.log_evidence, max(state.size, worth.size)
        return Hypothesis(names, state.tests.claim, spots, curve, False, posterior, size, worth.size, self)
