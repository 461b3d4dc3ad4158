"""Hypotheses: sets of explanations, and the states of model and tests around which they are weighed."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from bushfit.campaign.schema import RigSettings
from bushfit.diagnosis.claims import Claim
from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.explanations import COMPOUND, Explanation, FaultyPlace, Meeting, compound, unnamed
from bushfit.diagnosis.faulty_places import faulty_places
from bushfit.diagnosis.groups import Group, GroupEvidence
from bushfit.diagnosis.linear_model import LinearModel
from bushfit.diagnosis.priors import LEVELS
from bushfit.diagnosis.propose import Proposal, proposals
from bushfit.diagnosis.rig_errors import RigErrors, rig_errors, scattering_alone
from bushfit.effects.contract import Array
from bushfit.fitting.coordinates import Bounds
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.rig_class import ASSUMED, of_class

#: Logarithm of odds below which a node of the sizes of the rig's errors does not count; chosen for time, as e^-8 of an
#: answer changes none.
_NEAR = 8.0


@dataclass(frozen=True, eq=False)
class DiagnosisRequest:
    """Request for a search.

    Args:
        data: the tests.
        base: the starting model, fitted to them.
        fit_mended: fits the starting model to tests with a corrected record.
        without: effects and mistakes not to consider.
        max_effects: maximum number of added effects.
        tolerance: relative change of |K| that counts as nothing.
        start: starting values read off the data, for a model whose parameters the gap has bent too far.
        meetings: frequencies at which several outliers lie.
        fixed: parameters that are not fitted.
        bounds: limits of the others inside their general limits.
    """

    data: PreparedCampaign
    base: Evidence
    fit_mended: Callable[[PreparedCampaign], Evidence]
    without: Sequence[str]
    max_effects: int
    tolerance: float
    start: Mapping[str, float]
    meetings: Sequence[Meeting]
    fixed: Sequence[str]
    bounds: Bounds


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A set of explanations with its posterior.

    Args:
        effects: names of the effects, in the order in which they were added.
        claim: mistake in a record, or None.
        places: faulty places of the tests.
        unnamed: the process without a name; "" without.
        levels: True if errors of levels are larger than the class of the rig allows.
        log_posterior: natural log of prior times evidence.
        change: relative change of |K| by all of them.
        last_change: relative change by the last explanation where it was counted linearly; else 0.
        state: the state that this is, with its effects refitted, or to which the last explanation was added linearly.
        bent: True if the compound deviates from the model's laws beside all of this.
    """

    effects: tuple[str, ...]
    claim: Claim | None
    places: tuple[FaultyPlace, ...]
    unnamed: str
    levels: bool
    log_posterior: float
    change: float
    last_change: float
    state: State
    bent: bool = False

    @property
    def key(self) -> frozenset[Hashable]:
        """Identity of the set of explanations; empty if it has none."""
        marks = [self.unnamed, "levels" if self.levels else "", self.claim and self.claim.key]
        return frozenset((*self.effects, *(place.name for place in self.places), *filter(None, marks)))

    @property
    def refitted(self) -> bool:
        """True if all of its effects were refitted, and none was counted linearly only."""
        return self.effects == self.state.effects

    @property
    def chance(self) -> float:
        """Probability of tests that agree less with the hypothesis than these."""
        return self.state.linear.chance(bent=self.bent)


@dataclass(frozen=True, eq=False)
class Tests:
    """Tests as they are recorded, or with a corrected record, and the starting model fitted to them.

    Args:
        base: the fit.
        rig: stated class of the rig.
        log_prior: natural log of their prior probability with nothing else missing.
        claim: the mistake that is corrected, or None.
        change: relative change of what the record says; 0 for the tests as they are.
    """

    base: Evidence
    rig: RigSettings
    log_prior: float
    claim: Claim | None = None
    change: float = 0.0

    @cached_property
    def bare(self) -> Evidence:
        """The fit with residuals in units of the scatter from point to point."""
        return scattering_alone(self.base)

    @cached_property
    def errors(self) -> RigErrors:
        """Errors of the rig, in residuals of `bare`."""
        return rig_errors(self.bare, self.rig)

    @cached_property
    def compound(self) -> Group | None:
        """The compound's own deviation from the model's laws, in residuals of `bare`."""
        return compound(self.bare)

    @cached_property
    def compound_in_fits(self) -> Group | None:
        """The compound's own deviation in residuals as they are fitted."""
        return compound(self.base)

    @cached_property
    def _places_in_fits(self) -> dict[str, FaultyPlace]:
        return {place.name: place for place in faulty_places(self.base)}

    def in_fits(self, place: FaultyPlace) -> FaultyPlace:
        """A faulty place in residuals as they are fitted."""
        fitted = self._places_in_fits[place.name]
        return fitted if len(fitted.columns) == len(place.columns) else fitted.point_by_point()

    @cached_property
    def explanations(self) -> list[Explanation]:
        """Explanations that do not depend on the model: faulty places and smooth curves."""
        return [*faulty_places(self.bare), *unnamed(self.bare)]


@dataclass(frozen=True, eq=False)
class State:
    """A model with refitted effects and free places, around which every further explanation is weighed linearly.

    Args:
        tests: the tests.
        request: the request for the search.
        evidence: fit of the model with the effects.
        log_prior: natural log of the prior probability.
        effects: names of the effects that were added.
        places: faulty places whose points move freely.
        precision: prior precision of coordinates of effects, by name; infinite for one at an end of its range.
        log_density: natural log of their prior density, with the factor of Laplace's method.
        amounts: size of each place's amounts, relative to |K|.
        change: relative change of |K| by the effects and places.
    """

    tests: Tests
    request: DiagnosisRequest
    evidence: Evidence
    log_prior: float
    effects: tuple[str, ...] = ()
    places: tuple[FaultyPlace, ...] = ()
    precision: Mapping[str, float] = field(default_factory=dict)
    log_density: float = 0.0
    amounts: tuple[float, ...] = ()
    change: float = 0.0

    @classmethod
    def of_tests(cls, tests: Tests, request: DiagnosisRequest) -> State:
        """The state of tests with nothing added."""
        return cls(tests, request, tests.base, tests.log_prior, change=tests.change)

    @property
    def key(self) -> frozenset[Hashable]:
        """Identity of the state."""
        claim = self.tests.claim
        return frozenset((*self.effects, *(place.name for place in self.places), *([claim.key] if claim else [])))

    @cached_property
    def bare(self) -> Evidence:
        """The fit with residuals in units of the scatter from point to point."""
        return self.tests.bare if self.evidence is self.tests.base else scattering_alone(self.evidence)

    @cached_property
    def linear(self) -> LinearModel:
        """The linear model with nothing more, at every size of the rig's errors."""
        tests, solution = self.tests, self.bare.solution
        precision = np.array([self.precision.get(name, 0.0) for name in solution.coordinates.names])
        moves = np.isfinite(precision)
        of_places = [np.full(len(p.columns), x**-2) for p, x in zip(self.places, self.amounts, strict=True)]
        rows = np.concatenate([solution.jacobian[moves], *(place.columns for place in self.places)])
        precision = np.concatenate([precision[moves], *of_places])
        return LinearModel(self.bare.residual, rows, precision, tests.errors, compound=tests.compound)

    @cached_property
    def log_posterior(self) -> float:
        """Natural log of prior times evidence, with a deviation of the compound and without."""
        total = float(np.logaddexp(self.linear.log_evidence, self.linear.log_evidence_bent))
        return self.log_prior + self.log_density + total

    @cached_property
    def likeliest_deviation(self) -> float:
        """Likeliest size of a deviation of the compound, relative to |K|; 0 where none is likelier."""
        linear = self.linear
        return linear.deviation[1] if linear.log_evidence_bent > linear.log_evidence else 0.0

    def free_columns(self, deviation: float) -> Array | None:
        """Residuals beside which effects are refitted, at one standard deviation: those of the faulty places, without
        which an effect would have to follow them, and of the compound.

        Args:
            deviation: size of the compound's deviation, relative to |K|.

        Returns:
            Columns (c, n); None without a place and a deviation.
        """
        columns = [x * self.tests.in_fits(place).columns for place, x in zip(self.places, self.amounts, strict=True)]
        compound = self.tests.compound_in_fits if deviation else None
        columns += [deviation * compound.whole] if compound else []
        return np.concatenate(columns) if columns else None

    @cached_property
    def proposals(self) -> list[Proposal]:
        """Effects of the library that the model lacks, the highest score first."""
        return proposals(self.bare, (*self.request.without, *self.effects), self.request.fixed)

    @cached_property
    def weighed(self) -> list[tuple[Explanation, GroupEvidence]]:
        """Every explanation that can be counted linearly, with its evidence."""
        explanations = [e for e in (*self.proposals, *self.tests.explanations) if e.group is not None]
        return list(zip(explanations, self.weigh(explanations), strict=True))

    def weigh(self, explanations: Sequence[Explanation]) -> list[GroupEvidence]:
        """Evidence for explanations that have columns, at the sizes of the rig's errors that matter."""
        at_nodes = replace(self.linear, chosen_nodes=self._likely_nodes)
        return at_nodes.group_evidence_of([e.group for e in explanations if e.group is not None])

    @cached_property
    def _likely_nodes(self) -> Array:
        """Nodes that nothing more, a deviation of the compound, or something smooth makes likely."""
        smooth = [e.group for e in self.tests.explanations if e.group and e.kind == "unnamed"]
        curves = replace(self.linear, groups=smooth, compound=None)
        return np.union1d(self.linear.likely(_NEAR), curves.likely(_NEAR))

    def extended(self, explanation: Explanation, evidence: GroupEvidence, log_odds: float) -> list[Hypothesis]:
        """Hypotheses that extend this state by one explanation, with its evidence counted linearly.

        Args:
            explanation: the explanation.
            evidence: evidence of its columns.
            log_odds: natural log of its prior odds.

        Returns:
            The extended hypothesis, and the same beside a deviation of the compound.
        """
        plain = self.hypotheses[0]
        if explanation.kind == "effect":
            plain = replace(plain, effects=(*plain.effects, explanation.name))
        elif isinstance(explanation, FaultyPlace):
            plain = replace(plain, places=(*plain.places, explanation))
        else:
            plain = replace(plain, unnamed=explanation.name)
        log_prior = self.log_prior + self.log_density + log_odds
        extended = [
            replace(
                plain,
                log_posterior=log_prior + evidence.log_evidence,
                change=max(self.change, evidence.size),
                last_change=evidence.size,
            )
        ]
        if evidence.beside and np.isfinite(evidence.beside.log_evidence):
            bent = replace(
                plain,
                unnamed=plain.unnamed or COMPOUND,
                log_posterior=log_prior + evidence.beside.log_evidence,
                change=max(self.change, evidence.beside.size, self.linear.deviation[0]),
                last_change=evidence.beside.size,
                bent=True,
            )
            extended.append(bent)
        return extended

    @cached_property
    def hypotheses(self) -> list[Hypothesis]:
        """This state with nothing more; with errors of levels beyond the class of the rig; and with a deviation of the
        compound."""
        linear, tests = self.linear, self.tests
        log_prior = self.log_prior + self.log_density
        plain = Hypothesis(
            self.effects,
            tests.claim,
            self.places,
            unnamed="",
            levels=False,
            log_posterior=log_prior + linear.log_evidence,
            change=self.change,
            last_change=0.0,
            state=self,
        )
        wide = replace(
            plain,
            levels=True,
            log_posterior=log_prior + linear.log_evidence_wide,
            change=max(self.change, LEVELS[-1][0] * max(of_class(tests.rig, ASSUMED))),
        )
        if not np.isfinite(linear.log_evidence_bent):
            return [plain, wide]
        deviation = linear.deviation[0]
        bent = replace(
            plain,
            unnamed=COMPOUND,
            log_posterior=log_prior + linear.log_evidence_bent,
            change=max(self.change, deviation),
            last_change=deviation,
            bent=True,
        )
        return [plain, wide, bent]
