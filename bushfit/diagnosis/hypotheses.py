"""Hypotheses (sets of explanations of a gap), and the fitted models around which their evidence is computed."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from bushfit.campaign.schema import RigSettings
from bushfit.diagnosis.claims import Claim
from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.explanations import COMPOUND, Explanation, FaultyPart, OutlierCluster, compound, unnamed_curves
from bushfit.diagnosis.faulty_parts import find_faulty_parts
from bushfit.diagnosis.groups import Group, GroupEvidence
from bushfit.diagnosis.linear_model import LinearModel
from bushfit.diagnosis.priors import LEVELS
from bushfit.diagnosis.propose import Proposal, proposals
from bushfit.diagnosis.rig_errors import RigErrors, in_scatter_units, rig_errors
from bushfit.effects import get_effect, qualified_name
from bushfit.effects.contract import Array
from bushfit.fitting.coordinates import Bounds
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.rig_class import ASSUMED, class_errors

#: Natural log of the odds below the best at which a noise case is left out; chosen for time: a case of relative weight
#: e^-8 changes no verdict.
_NEAR = 8.0


@dataclass(frozen=True, eq=False)
class DiagnosisRequest:
    """Input of a search for explanations of the gap between model and tests.

    Args:
        data: campaign with the prepared tests.
        base: starting model, fitted to the tests.
        fit_corrected: function that fits the starting model to a campaign with a corrected record.
        without: names of effects and mistakes not to consider.
        max_effects: maximum number of added effects.
        tolerance: relative change of |K| up to which an explanation is neglected.
        start: starting values read from the data, by parameter, for a fit that the gap has distorted.
        outlier_clusters: frequencies at which several outliers were left out.
        fixed: names of parameters that are not fitted.
        bounds: limits of the fitted parameters inside their general limits.
    """

    data: PreparedCampaign
    base: Evidence
    fit_corrected: Callable[[PreparedCampaign], Evidence]
    without: Sequence[str]
    max_effects: int
    tolerance: float
    start: Mapping[str, float]
    outlier_clusters: Sequence[OutlierCluster]
    fixed: Sequence[str]
    bounds: Bounds


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One set of explanations of the gap between model and tests, with its posterior probability.

    Args:
        effects: names of the effects, in the order in which they were added.
        claim: mistake in the record; None without a mistake.
        faulty_parts: faulty parts of the tests: frequencies, levels, repeats or loops.
        unnamed: name of the smooth curve or compound deviation that stands for an unknown effect; "" without one.
        levels: True if errors of amplitude levels are larger than the accuracy class of the rig allows.
        log_posterior: natural log of prior times evidence, not normalised.
        change: largest relative change of |K| by any of the explanations.
        last_change: relative change of |K| by the last explanation if its evidence is that of the linear model; 0 if it
            was refitted.
        state: step of the search (fitted model) that has exactly these explanations, or all but the last.
        compound_deviates: True if the compound deviates from the model's laws in addition.
    """

    effects: tuple[str, ...]
    claim: Claim | None
    faulty_parts: tuple[FaultyPart, ...]
    unnamed: str
    levels: bool
    log_posterior: float
    change: float
    last_change: float
    state: SearchState
    compound_deviates: bool = False

    @property
    def key(self) -> frozenset[Hashable]:
        """Names that identify this set of explanations; empty for the hypothesis that nothing is missing."""
        marks = [self.unnamed, "levels" if self.levels else "", self.claim and self.claim.key]
        return frozenset((*self.effects, *(part.name for part in self.faulty_parts), *filter(None, marks)))

    @property
    def refitted(self) -> bool:
        """True if all effects were refitted, so that no evidence rests on a linear model alone."""
        return self.effects == self.state.effects

    @property
    def p_value(self) -> float:
        """Posterior predictive p-value: probability of a larger chi-square than measured if the hypothesis is true."""
        return self.state.linear.p_value(compound_deviates=self.compound_deviates)


@dataclass(frozen=True, eq=False)
class Tests:
    """Tests as recorded, or with one mistake in the record corrected, with the starting model fitted to them.

    Args:
        base: fit of the starting model; its residuals are whitened by scatter and by errors that points share.
        rig: stated accuracy class of the rig (gain and phase errors).
        log_prior: natural log of the prior probability that these are the right records and nothing is missing.
        claim: mistake that is corrected; None for the tests as recorded.
        change: relative change of the recorded quantities by the correction; 0 for the tests as recorded.
    """

    base: Evidence
    rig: RigSettings
    log_prior: float
    claim: Claim | None = None
    change: float = 0.0

    @cached_property
    def bare(self) -> Evidence:
        """Fit of the starting model with residuals in units of the scatter from point to point, to compare hypotheses.

        Errors that points share are not part of this unit; `errors` describes them.
        """
        return in_scatter_units(self.base)

    @cached_property
    def errors(self) -> RigErrors:
        """Errors of the rig that points share, as changes of residuals in units of the scatter from point to point."""
        return rig_errors(self.bare, self.rig)

    @cached_property
    def compound(self) -> Group | None:
        """Changes of the residuals (in units of the scatter) by a smooth deviation of the rubber from the model's laws.

        They are used to compare hypotheses; None without tests.
        """
        return compound(self.bare)

    @cached_property
    def compound_in_fits(self) -> Group | None:
        """Changes of the residuals (whitened as in a fit) by a smooth deviation of the rubber from the model's laws.

        A refit with an effect also estimates the amounts of these changes, without a prior; None without tests.
        """
        return compound(self.base)

    @cached_property
    def faulty_parts_in_fits(self) -> dict[str, FaultyPart]:
        """Faulty parts by name, with the residuals that a fit minimises in place of those in units of the scatter."""
        return {part.name: part for part in find_faulty_parts(self.base)}

    @cached_property
    def explanations(self) -> list[Explanation]:
        """Explanations of the gap that are independent of the model's effects: faulty test parts, and smooth curves."""
        return [*find_faulty_parts(self.bare), *unnamed_curves(self.bare)]


@dataclass(frozen=True, eq=False)
class SearchState:
    """Step of the search: a model fitted with some effects and faulty parts of the tests.

    The evidence for each further explanation follows from the residuals linearised around this fit.

    Args:
        tests: tests with their record, as read or corrected.
        request: input of the search.
        evidence: fit of the model with the added effects.
        log_prior: natural log of the prior probability of the set of explanations.
        effects: names of the effects that were added.
        faulty_parts: faulty parts of the tests, whose points may deviate together.
        precision: prior precision (inverse variance) by fitting coordinate of the effects; infinite for a shape
            parameter at an end of its range.
        log_density: natural log of the prior density of these coordinates, with the factor of Laplace's method.
        amounts: prior standard deviation of each faulty part's deviation, relative to |K|.
        change: largest relative change of |K| by the effects and faulty parts.
    """

    tests: Tests
    request: DiagnosisRequest
    evidence: Evidence
    log_prior: float
    effects: tuple[str, ...] = ()
    faulty_parts: tuple[FaultyPart, ...] = ()
    precision: Mapping[str, float] = field(default_factory=dict)
    log_density: float = 0.0
    amounts: tuple[float, ...] = ()
    change: float = 0.0

    @classmethod
    def of_tests(cls, tests: Tests, request: DiagnosisRequest) -> SearchState:
        """Create the initial state of a search: the starting model with nothing added."""
        return cls(tests, request, tests.base, tests.log_prior, change=tests.change)

    @property
    def key(self) -> frozenset[Hashable]:
        """Names that identify this step of the search: effects, faulty parts of the tests, and corrected mistake."""
        claim = self.tests.claim
        return frozenset((*self.effects, *(part.name for part in self.faulty_parts), *([claim.key] if claim else [])))

    @cached_property
    def bare(self) -> Evidence:
        """Fit of this step with residuals in units of the scatter from point to point, without shared errors."""
        return self.tests.bare if self.evidence is self.tests.base else in_scatter_units(self.evidence)

    @cached_property
    def linear(self) -> LinearModel:
        """Residuals linearised at the fit, from which the evidence is computed for each noise case of the rig."""
        tests, solution = self.tests, self.bare.solution
        precision = np.array([self.precision.get(name, 0.0) for name in solution.coordinates.names])
        moves = np.isfinite(precision)
        of_faulty_parts = [np.full(len(p.columns), x**-2) for p, x in zip(self.faulty_parts, self.amounts, strict=True)]
        rows = np.concatenate([solution.jacobian[moves], *(part.columns for part in self.faulty_parts)])
        precision = np.concatenate([precision[moves], *of_faulty_parts])
        return LinearModel(self.bare.residual, rows, precision, tests.errors, compound=tests.compound)

    @cached_property
    def log_posterior(self) -> float:
        """Natural log of prior times evidence of these explanations, with or without a deviation of the compound.

        The probabilities of both cases are added.
        """
        total = float(np.logaddexp(self.linear.log_evidence, self.linear.log_evidence_with_compound))
        return self.log_weight + total

    @cached_property
    def log_weight(self) -> float:
        """Natural log of the prior probability of these explanations times the prior density of all parameters.

        Notes:
            The prior of the rubber's parameters is uniform in what they change of the tests, in units of noise
            (Jeffreys, 1946): density |J J^T|^(1/2), where J are the derivatives of the residuals. A density uniform in
            the logarithms would reward fits in which a parameter has no influence, such as mu near zero. If an effect
            replaces a branch, its best determined parameters count in place of those of the branch.
        """
        solution, added = self.bare.solution, [get_effect(name) for name in self.effects]
        replacing = {qualified_name(e, parameter) for e in added if e.replaces for parameter in e.parameters}
        of_rubber = [name not in self.precision or name in replacing for name in solution.coordinates.names]
        volume = np.linalg.svd(solution.jacobian[of_rubber], compute_uv=False)
        count = len(self.tests.base.solution.coordinates.names)
        return self.log_prior + self.log_density + float(np.sum(np.log(np.maximum(volume[:count], 1e-12))))

    @property
    def likeliest_deviation(self) -> float:
        """Likeliest standard deviation of the compound's deviation, relative to |K|; 0 if none is more probable."""
        linear = self.linear
        return linear.deviation[1] if linear.log_evidence_with_compound > linear.log_evidence else 0.0

    def free_columns(self, deviation: float) -> Array | None:
        """Changes of the residuals by faulty parts of the tests and the compound, left free in refits of effects.

        Without these columns an effect would be fitted to the faults.

        Args:
            deviation: standard deviation of the compound's deviation, relative to |K|; 0 for no deviation.

        Returns:
            Change of the whitened residuals per standard deviation, (c, n); None without faulty parts and deviation.
        """
        columns = []
        for part, amount in zip(self.faulty_parts, self.amounts, strict=True):
            fitted = self.tests.faulty_parts_in_fits[part.name]
            fitted = fitted if len(fitted.columns) == len(part.columns) else fitted.point_by_point()
            columns.append(amount * fitted.columns)
        compound = self.tests.compound_in_fits if deviation else None
        columns += [deviation * compound.whole] if compound else []
        return np.concatenate(columns) if columns else None

    @cached_property
    def proposals(self) -> list[Proposal]:
        """Effects of the library that the model lacks, ranked by expected decrease of chi-square."""
        return proposals(self.bare, (*self.request.without, *self.effects), self.request.fixed)

    @cached_property
    def explanation_evidence(self) -> list[tuple[Explanation, GroupEvidence]]:
        """Further explanations of the gap, each with the evidence of the tests for it in the linearised model."""
        explanations = [e for e in (*self.proposals, *self.tests.explanations) if e.group is not None]
        return list(zip(explanations, self.weigh(explanations), strict=True))

    def weigh(self, explanations: Sequence[Explanation]) -> list[GroupEvidence]:
        """Compute the evidence of the tests for given explanations, averaged over likely sizes of the rig's errors.

        Args:
            explanations: effects, faulty parts or curves, each with its residual columns.

        Returns:
            One evidence per explanation, in the same order.
        """
        near = replace(self.linear, chosen_cases=self._likely_cases)
        return near.group_evidence_of([e.group for e in explanations if e.group is not None])

    @cached_property
    def _likely_cases(self) -> Array:
        """Indices of the combinations of rig errors that are likely, alone or together with a smooth curve."""
        smooth = [e.group for e in self.tests.explanations if e.group and e.kind == "unnamed"]
        curves = replace(self.linear, groups=smooth, compound=None)
        return np.union1d(self.linear.likely_cases(_NEAR), curves.likely_cases(_NEAR))

    def extended(self, explanation: Explanation, evidence: GroupEvidence, log_odds: float) -> list[Hypothesis]:
        """Extend this state by one explanation, whose evidence comes from the linear model.

        Args:
            explanation: the added explanation.
            evidence: evidence of the tests for the explanation.
            log_odds: natural log of the explanation's prior odds.

        Returns:
            The extended hypothesis and, if the search considers a smooth deviation of the compound from the model, a
            second one with this deviation.
        """
        plain = self.hypotheses[0]
        if explanation.kind == "effect":
            plain = replace(plain, effects=(*plain.effects, explanation.name))
        elif isinstance(explanation, FaultyPart):
            plain = replace(plain, faulty_parts=(*plain.faulty_parts, explanation))
        else:
            plain = replace(plain, unnamed=explanation.name)
        bent, extended = evidence.with_compound, list[Hypothesis]()
        for case in (evidence, bent) if bent and np.isfinite(bent.log_evidence) else (evidence,):
            new = replace(
                plain,
                log_posterior=self.log_weight + log_odds + case.log_evidence,
                change=max(self.change, case.size),
                last_change=case.size,
            )
            if case is bent:
                change = max(new.change, self.linear.deviation[0])
                new = replace(new, unnamed=plain.unnamed or COMPOUND, change=change, compound_deviates=True)
            extended.append(new)
        return extended

    @cached_property
    def hypotheses(self) -> list[Hypothesis]:
        """Hypotheses about the gap that have the explanations of this state and no further effect or fault.

        They are three: as the state is, with rig errors of amplitude levels beyond the stated accuracy, and with a
        smooth deviation of the rubber compound from the model's laws.
        """
        linear, tests, log_prior = self.linear, self.tests, self.log_weight
        plain = Hypothesis(
            self.effects,
            tests.claim,
            self.faulty_parts,
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
            log_posterior=log_prior + linear.log_evidence_with_level_errors,
            change=max(self.change, LEVELS[-1][0] * max(class_errors(tests.rig, ASSUMED))),
        )
        if not np.isfinite(linear.log_evidence_with_compound):
            return [plain, wide]
        deviation = linear.deviation[0]
        bent = replace(
            plain,
            unnamed=COMPOUND,
            log_posterior=log_prior + linear.log_evidence_with_compound,
            change=max(self.change, deviation),
            last_change=deviation,
            compound_deviates=True,
        )
        return [plain, wide, bent]
