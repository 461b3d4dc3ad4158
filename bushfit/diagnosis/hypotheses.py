"""Hypotheses: sets of explanations, the state of the model and tests around which each is weighed, and its worth."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from bushfit.campaign.schema import RigSettings
from bushfit.diagnosis.claims import Claim
from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.explanations import (
    Explanation,
    FaultyPlace,
    Meeting,
    MissingEffect,
    compound,
    effects,
    places,
    unnamed,
)
from bushfit.diagnosis.linear_model import Group, GroupEvidence, LinearModel
from bushfit.diagnosis.priors import LEVELS
from bushfit.diagnosis.rig_errors import RigErrors, rig_errors, scattering_alone
from bushfit.effects.contract import Array
from bushfit.fitting.coordinates import Bounds
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.rig_class import ASSUMED, of_class

#: Name of the compound's own deviation among what has no name.
COMPOUND = "compound"
#: Logarithm of odds below which a node of the sizes of the rig's errors does not count; chosen for time, as e^-8 of an
#: answer changes none.
_NEAR = 8.0


@dataclass(frozen=True, eq=False)
class DiagnosisRequest:
    """Request for a search.

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

    data: PreparedCampaign
    base: Evidence
    fitted: Callable[[PreparedCampaign], Evidence]
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
        bent: whether the compound deviates from the model's laws beside all of this.
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
    bent: bool = False

    @property
    def key(self) -> frozenset[Hashable]:
        marks = ["levels"] if self.levels else []
        more = [each for each in (self.unnamed, self.claim and (self.claim.mistake.name, self.claim.tests)) if each]
        return frozenset((*self.effects, *(place.name for place in self.places), *more, *marks))

    @property
    def refitted(self) -> bool:
        """True if all of its effects were refitted, and none was counted linearly only."""
        return self.effects == self.weighed.state.effects

    @property
    def chance(self) -> float:
        """Probability of tests that it meets worse than these."""
        return self.weighed.first.chance(bent=self.bent)


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
    def compound(self) -> Group | None:
        """The compound's own deviation from the model's laws, in residuals as `bare` has them."""
        return compound(self.bare)

    @cached_property
    def deviation(self) -> Group | None:
        """The compound's own deviation in residuals as they are fitted."""
        return compound(self.base)

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
    asked: DiagnosisRequest

    @cached_property
    def bare(self) -> Evidence:
        same = self.state.evidence is self.state.tests.base
        return self.state.tests.bare if same else scattering_alone(self.state.evidence)

    @cached_property
    def first(self) -> LinearModel:
        state, tests = self.state, self.state.tests
        known = [state.precision.get(name, 0.0) for name in self.bare.solution.coordinates.names]
        moves = np.isfinite(known)
        precision = np.array(known)[moves].tolist()
        free = [self.bare.solution.jacobian[moves]]
        for place, amount in zip(state.places, state.amounts, strict=True):
            free.append(place.columns)
            precision += [amount**-2] * len(place.columns)
        rows = np.concatenate(free)
        return LinearModel(self.bare.residual, rows, np.array(precision), tests.errors, compound=tests.compound)

    @cached_property
    def log_posterior(self) -> float:
        whole = float(np.logaddexp(self.first.log_evidence, self.first.log_evidence_bent))
        return self.state.log_prior + self.state.density + whole

    @cached_property
    def bent(self) -> float:
        """Likeliest size of a deviation of the compound, relative to |K|; 0 where none is likelier."""
        first = self.first
        return first.deviation[1] if first.log_evidence_bent > first.log_evidence else 0.0

    @property
    def fitted_beside(self) -> Array | None:
        """Columns beside which effects are refitted, at one standard deviation; None where the compound obeys."""
        deviation = self.state.tests.deviation
        return self.bent * deviation.whole if self.bent and deviation else None

    @cached_property
    def effects(self) -> list[MissingEffect]:
        return effects(self.bare, (*self.asked.without, *self.state.effects), self.asked.held)

    @cached_property
    def group_evidence(self) -> list[tuple[Explanation, GroupEvidence]]:
        """Every explanation that can be counted linearly, at the sizes of the rig's errors that matter."""
        every = [each for each in (*self.effects, *self.state.tests.fixed) if each.group is not None]
        return list(zip(every, self.group_evidence_of(every), strict=True))

    @cached_property
    def _nodes(self) -> Array:
        """Numbers of the nodes that nothing more, a deviation of the compound, or something smooth makes likely."""
        smooth = [each.group for each in self.state.tests.fixed if each.group and each.kind == "unnamed"]
        curves = replace(self.first, groups=smooth, compound=None)
        return np.union1d(self.first.likely(_NEAR), curves.likely(_NEAR))

    def group_evidence_of(self, every: Sequence[Explanation]) -> Sequence[GroupEvidence]:
        """Evidence for explanations that have columns."""
        return replace(self.first, chosen_nodes=self._nodes).group_evidence_of(
            [each.group for each in every if each.group]
        )

    def with_(self, each: Explanation, worth: GroupEvidence, log_odds: float) -> list[Hypothesis]:
        """Hypotheses that extend this state by one explanation, with its evidence counted linearly.

        Args:
            each: the explanation.
            worth: evidence of its columns.
            log_odds: natural log of its prior odds.

        Returns:
            The extended hypothesis, and the same beside a deviation of the compound.
        """
        state, tests = self.state, self.state.tests
        names = (*state.effects, each.name) if each.kind == "effect" else state.effects
        spots = (*state.places, each) if isinstance(each, FaultyPlace) else state.places
        curve = each.name if each.kind == "unnamed" else ""
        prior = state.log_prior + state.density + log_odds
        found = [
            Hypothesis(
                names,
                tests.claim,
                spots,
                curve,
                False,
                prior + worth.log_evidence,
                max(state.size, worth.size),
                worth.size,
                self,
            )
        ]
        if worth.beside and np.isfinite(worth.beside.log_evidence):
            size = max(state.size, worth.beside.size, self.first.deviation[0])
            posterior = prior + worth.beside.log_evidence
            found.append(
                Hypothesis(
                    names, tests.claim, spots, curve or COMPOUND, False, posterior, size, worth.beside.size, self, True
                )
            )
        return found

    @property
    def alone(self) -> list[Hypothesis]:
        """This state with nothing more; with errors of levels beyond the class of the rig; and with a deviation of the
        compound."""
        state, first = self.state, self.first
        prior, claim = state.log_prior + state.density, state.tests.claim
        plain = Hypothesis(
            state.effects, claim, state.places, "", False, prior + first.log_evidence, state.size, 0.0, self
        )
        size = max(state.size, LEVELS[-1][0] * max(of_class(state.tests.rig, ASSUMED)))
        wide = replace(plain, levels=True, log_posterior=prior + first.log_evidence_wide, size=size)
        if not np.isfinite(first.log_evidence_bent):
            return [plain, wide]
        deviation = first.deviation[0]
        bent = replace(
            plain,
            unnamed=COMPOUND,
            log_posterior=prior + first.log_evidence_bent,
            size=max(state.size, deviation),
            last=deviation,
            bent=True,
        )
        return [plain, wide, bent]
