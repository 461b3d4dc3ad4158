"""Hypotheses (sets of explanations of a gap), and the fitted models around which their evidence is computed."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.special import softmax

from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.explanations import Explanation
from bushfit.diagnosis.faulty_parts import FaultyPart, OutlierCluster
from bushfit.diagnosis.laplace import laplace
from bushfit.diagnosis.linear_model import LinearModel
from bushfit.diagnosis.priors import LEVELS
from bushfit.diagnosis.projected_columns import SignatureSet
from bushfit.diagnosis.recorded_tests import ExplanationColumns, RecordedTests
from bushfit.diagnosis.recording_mistakes import FACTOR_RANGE, RecordingMistake
from bushfit.diagnosis.smooth_deviations import COMPOUND
from bushfit.effects import get_effect, get_parameter, qualified_name
from bushfit.effects.contract import Array
from bushfit.fitting.problem import FitResult
from bushfit.fitting.rig_class import ASSUMED, class_errors
from bushfit.model.covariance import Z95, Covariance

#: Natural log of the odds below the best at which a noise case is left out; chosen for time: a case of relative weight
#: e^-8 changes no verdict.
_NEAR = 8.0
#: Standard deviation of the normal distribution of the natural log of an estimated factor, around its best value, that
#: has the density of the uniform distribution over `FACTOR_RANGE`.
_FACTOR_SIZE = np.ptp(FACTOR_RANGE) / np.sqrt(2.0 * np.pi)


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One set of explanations of the gap between model and tests, with its posterior probability.

    Args:
        state: fitted model of the search that has exactly these explanations, or all but the last.
        log_posterior: natural log of prior times evidence, not normalised.
        change: largest relative change of |K| by any of the explanations.
        last: explanation that is not fitted in `state` and whose evidence is from the linearised model; None if all are
            fitted.
        last_change: relative change of |K| due to the last explanation or the compound's deviation; 0 without either.
        compound_deviates: True if the hypothesis includes a smooth deviation of the rubber from the model's laws.
        has_level_errors: True if the hypothesis includes rig errors of whole levels (constant amplitudes or
            frequencies) that are larger than the rig's accuracy class allows.
        clusters: disturbances at frequencies with several outliers that were left out.
    """

    state: SearchState
    log_posterior: float
    change: float
    last: Explanation | None = None
    last_change: float = 0.0
    compound_deviates: bool = False
    has_level_errors: bool = False
    clusters: tuple[OutlierCluster, ...] = ()

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects that the hypothesis adds to the model, in the order of the search."""
        return (*self.state.effects, *([] if self.is_refitted or not self.last else [self.last.name]))

    @property
    def faulty_parts(self) -> tuple[FaultyPart, ...]:
        """Faulty parts of the tests: frequencies, levels, repeats or loops."""
        last = [self.last] if isinstance(self.last, FaultyPart) else []
        return (*self.state.faulty_parts, *last, *self.clusters)

    @property
    def mistake(self) -> RecordingMistake | None:
        """Recording mistake that this hypothesis assumes; None without one."""
        return self.state.tests.mistake

    @property
    def unnamed(self) -> str:
        """Name of the smooth curve, or of the rubber's smooth deviation, for an unknown effect; "" without one."""
        is_curve = self.last is not None and self.last.kind == "unnamed"
        return self.last.name if is_curve and self.last else COMPOUND * self.compound_deviates

    @cached_property
    def key(self) -> frozenset[Hashable]:
        """Names that identify this set of explanations; empty for the hypothesis that nothing is missing."""
        marks = [self.unnamed, "levels" if self.has_level_errors else "", self.mistake and self.mistake.key]
        return frozenset((*self.effects, *(part.name for part in self.faulty_parts), *filter(None, marks)))

    @property
    def is_refitted(self) -> bool:
        """True if all effects of the hypothesis were refitted; False if one was weighed in the linear model alone."""
        return self.last is None or self.last.kind != "effect"

    @cached_property
    def p_value(self) -> float:
        """Posterior predictive p-value: probability of a larger chi-square than measured if the hypothesis is true."""
        linear, signature = self.state.linear, self.last.signature if self.last else None
        if signature and self.last_change:
            rows = replace(signature, columns=signature.scaled).whole
            precision = np.full(len(rows), self.last_change**-2)
            linear = replace(
                linear,
                jacobian=np.concatenate((linear.jacobian, rows)),
                precision=np.concatenate((linear.precision, precision)),
            )
        return linear.p_value(compound_deviates=self.compound_deviates)


@dataclass(frozen=True, eq=False)
class SearchState:
    """Step of the search: a model fitted with some effects and faulty parts of the tests.

    The evidence for each further explanation follows from the residuals linearised around this fit.

    Args:
        tests: tests with their record, as read or corrected.
        fit: fit of the model with the added effects; errors of faulty tests and of a deviating rubber may be fitted,
            too.
        unwhitened: this fit with residuals divided by the random noise alone, not whitened by errors that points share.
        log_prior: natural log of the prior probability of the set of explanations, plus that of the factor by which
            Laplace's method integrates over the effects' parameters with their prior density.
        effects: names of the effects that were added.
        faulty_parts: faulty parts of the tests, whose points may deviate together.
        precision: prior precision (inverse variance) by fitting coordinate of the effects; infinite for a shape
            parameter at an end of its range.
        change: largest relative change of |K| due to the effects and faulty parts.
    """

    tests: RecordedTests
    fit: FitResult
    unwhitened: FitResult
    log_prior: float
    effects: tuple[str, ...] = ()
    faulty_parts: tuple[FaultyPart, ...] = ()
    precision: Mapping[str, float] = field(default_factory=dict)
    change: float = 0.0

    @classmethod
    def of_tests(cls, tests: RecordedTests) -> SearchState:
        """Create the initial state of a search: the starting model with nothing added."""
        return cls(tests, tests.base, tests.unwhitened, tests.log_odds, change=tests.change)

    def with_fit(self, fit: FitResult) -> SearchState:
        """Replace the fit by another fit of the same model, whose effects have the same prior."""
        return replace(self, fit=fit, unwhitened=fit.reevaluate(fit.model, self.tests.unwhitened.data_sets))

    def with_effect(self, name: str, log_odds: float, before: FitResult) -> SearchState:
        """Add an effect that the fit of this state has already.

        Args:
            name: name of the effect.
            log_odds: natural log of the prior odds of the effect.
            before: fit without the effect.

        Returns:
            State with the effect and the prior of the effect's parameters.
        """
        log_density, precision, change = laplace(name, self.fit, before)
        return replace(
            self,
            effects=(*self.effects, name),
            log_prior=self.log_prior + log_odds + log_density,
            precision={**self.precision, **precision},
            change=max(self.change, change),
        )

    @cached_property
    def plain(self) -> FitResult:
        """The fit with residuals whitened by noise alone, not by errors of faulty tests and of a deviating rubber."""
        return self.fit.reevaluate(self.fit.model, self.fit.data_sets) if self.fit.problem.shared_error else self.fit

    @cached_property
    def key(self) -> frozenset[Hashable]:
        """Names that identify this search state: effects, faulty parts of the tests, and corrected mistake."""
        mistakes = [self.tests.mistake.key] if self.tests.mistake else []
        return frozenset((*self.effects, *(part.name for part in self.faulty_parts), *mistakes))

    @cached_property
    def has_influence(self) -> Array:
        """Mask of the k fitted parameters that change the predicted tests and are not at an end of their range, (k,).

        A parameter has no influence if an effect replaces the branch of the model in which it acts.
        """
        precision = np.array([self.precision.get(name, 0.0) for name in self.unwhitened.names])
        return np.isfinite(precision) & self.unwhitened.jacobian.any(axis=1)

    @cached_property
    def linear(self) -> LinearModel:
        """Residuals linearised at the fit, to compute the evidence for further explanations."""
        fit, moves, columns = self.unwhitened, self.has_influence, self.columns
        precision = np.array([self.precision.get(name, 0.0) for name in fit.names])[moves]
        common = [(part.columns, part.amount) for part in self.faulty_parts if part.form != "points"]
        common.append((self.tests.factor_column(fit), _FACTOR_SIZE))
        rows = np.concatenate([fit.jacobian[moves], *(columns for columns, _ in common)])
        precision = np.concatenate([precision, *(np.full(len(columns), amount**-2) for columns, amount in common)])
        return LinearModel(fit.residual, rows, precision, columns.errors, columns.compound)

    @cached_property
    def columns(self) -> ExplanationColumns:
        """Residual changes by further explanations, beside the errors of the faulty parts in this state."""
        scattered = [part.amount * part.columns for part in self.faulty_parts if part.form == "points"]
        variances = [np.square(columns).sum(axis=0) for columns in scattered]
        return self.tests.columns.with_variance(np.sum(variances, axis=0)) if variances else self.tests.columns

    @property
    def log_posterior(self) -> float:
        """Natural log of prior times evidence of this state, summed over rubber with and without a smooth deviation."""
        return self.log_weight + self.linear.evidence.total

    @cached_property
    def log_weight(self) -> float:
        """Natural log of the prior probability of these explanations times the prior density of all parameters.

        Notes:
            The prior of the rubber's parameters is uniform in the predicted tests, in units of noise (Jeffreys, 1946):
            density |J J^T|^(1/2), where J are the derivatives of the residuals. A density uniform in the logarithms
            would reward fits in which a parameter has no influence, such as mu near zero. If an effect replaces a
            branch, its best determined parameters count in place of those of the branch.
        """
        added = [get_effect(name) for name in self.effects]
        replacing = {qualified_name(e, parameter) for e in added if e.replaces for parameter in e.parameters}
        of_rubber = [name not in self.precision or name in replacing for name in self.unwhitened.names]
        volume = np.linalg.svd(self.unwhitened.jacobian[of_rubber], compute_uv=False)
        count = len(self.tests.base.names)
        return self.log_prior + float(np.sum(np.log(np.maximum(volume[:count], 1e-12))))

    @property
    def likeliest_deviation(self) -> float:
        """Most probable size (standard deviation relative to |K|) of the rubber's smooth deviation; 0 for none."""
        plain, bent = self.linear.evidence, self.linear.evidence.with_compound
        return bent.likeliest if bent and bent.log_evidence > plain.log_evidence else 0.0

    def free_columns(self, deviation: float) -> Array | None:
        """Changes of the residuals due to faulty tests and a deviating rubber, to be fitted beside an effect.

        Without these columns an effect would be fitted to the faults.

        Args:
            deviation: standard deviation of the rubber's smooth deviation from the model, relative to |K|; 0 for no
                deviation.

        Returns:
            Change of the whitened residuals per standard deviation, (c, n); None without faulty parts and deviation.
        """
        columns = [_FACTOR_SIZE * self.tests.factor_column(self.tests.base)]
        for part in self.faulty_parts:
            fitted = self.tests.faulty_parts_in_fits[part.name]
            columns.append(part.amount * fitted.in_form(part.form).columns)
        compound = self.tests.compound_in_fits if deviation else None
        columns += [deviation * compound.whole] if compound else []
        return np.concatenate(columns) if sum(map(len, columns)) else None

    @cached_property
    def parameters(self) -> tuple[dict[str, float], Covariance]:
        """Posterior means [SI] and covariance of the parameters that are not at a bound.

        The covariance allows for errors of the rig and for a smooth deviation of the rubber from its model.
        """
        fit, values, moves = self.unwhitened, self.unwhitened.model.values, self.has_influence
        slopes, count = fit.coordinates.slopes(values)[moves], np.count_nonzero(moves)
        names = tuple(np.array(fit.names)[moves].tolist())
        mean, covariance = self.linear.posterior_parameters()
        steps = dict(zip(names, slopes * mean[:count], strict=True))
        means = {name: float(np.clip(values[name] + x, *get_parameter(name).bounds)) for name, x in steps.items()}
        fitted = Covariance(names, covariance[:count, :count] * np.outer(slopes, slopes))
        return means, fitted.select([name for name in names if name not in fit.at_bound])

    def refined_mistake(self) -> RecordingMistake:
        """Recording mistake of these tests, with the estimated factor and its 95 % interval from all parameters."""
        assert self.tests.mistake is not None
        mean, covariance = self.linear.posterior_parameters()
        ends = mean[-1] + np.array([-Z95, 0.0, Z95]) * np.sqrt(covariance[-1, -1])
        low, middle, high = np.exp(ends) / self.tests.mistake.kind.force
        return replace(self.tests.mistake.with_force(1.0 / middle), interval=(low, high))

    def weigh(self, sets: Sequence[SignatureSet]) -> list[Evidence]:
        """Evidence of the tests for further explanations, averaged over the likely sizes of the rig's errors.

        Args:
            sets: signatures (residual changes) of the explanations, in sets that change the same residuals.

        Returns:
            One evidence per explanation, in the same order.
        """
        return self.linear.explanation_evidence(sets, self._likely_cases)

    @cached_property
    def _likely_cases(self) -> Array:
        """Indices of the c noise cases (sizes of the errors of rig and rubber) with a high evidence, (c,)."""
        return self.linear.likely_cases(self.columns.curves, _NEAR)

    def extend(self, evidence: Evidence, last: Explanation | None = None, log_odds: float = 0.0) -> list[Hypothesis]:
        """List the hypotheses with the explanations of this search state and at most one further explanation.

        Args:
            evidence: evidence for this state with the further explanation, from the linearised model; for this state
                alone if `last` is None.
            last: further explanation; None for this state alone.
            log_odds: natural log of its prior odds.

        Returns:
            The hypothesis without and, if it is considered, with a smooth deviation of the rubber from the model's
            laws.
        """
        log_prior, bent = self.log_weight + log_odds, evidence.with_compound
        change, log_posterior = max(self.change, evidence.size), log_prior + evidence.log_evidence
        extended = [Hypothesis(self, log_posterior, change, last, evidence.size)]
        alone = self.linear.evidence.with_compound
        if bent and alone and np.isfinite(bent.log_evidence):
            change, log_posterior = max(self.change, bent.size, alone.size), log_prior + bent.log_evidence
            extended.append(Hypothesis(self, log_posterior, change, last, bent.size, compound_deviates=True))
        return extended

    @cached_property
    def hypotheses(self) -> list[Hypothesis]:
        """Hypotheses about the gap that have the explanations of this search state and no further effect or fault.

        The three hypotheses are the explanations alone, with a smooth deviation of the rubber compound from the model's
        laws, and with rig errors of amplitude levels beyond the stated accuracy.
        """
        log_posterior = self.log_weight + self.linear.log_evidence_with_level_errors
        change = max(self.change, LEVELS[-1][0] * max(class_errors(self.tests.rig, ASSUMED)))
        return [*self.extend(self.linear.evidence), Hypothesis(self, log_posterior, change, has_level_errors=True)]


def mean_parameters(hypotheses: Sequence[Hypothesis], names: Sequence[str]) -> tuple[dict[str, float], Covariance]:
    """Average the posterior means and covariances of parameters over hypotheses, weighted by probability.

    Args:
        hypotheses: refitted hypotheses whose models have these parameters.
        names: names of the k parameters.

    Returns:
        Means [SI]; and covariance, within and between the hypotheses, of the parameters that are not at a bound in all.
    """
    log_posteriors = np.array([hypothesis.log_posterior for hypothesis in hypotheses])
    near = np.flatnonzero(log_posteriors > log_posteriors.max() - _NEAR).tolist()
    weights = softmax(log_posteriors[near])
    states = [hypotheses[n].state for n in near]
    pairs = [({**state.fit.model.values, **state.parameters[0]}, state.parameters[1]) for state in states]
    means = np.array([[values[name] for name in names] for values, _ in pairs])
    mean = np.clip(weights @ means, means.min(axis=0), means.max(axis=0))  # rounding may leave their range
    matrix = np.einsum("n,ni,nj->ij", weights, means - mean, means - mean)
    for weight, (_, covariance) in zip(weights, pairs, strict=True):
        restricted = covariance.select(names)
        indices = [names.index(name) for name in restricted.names]
        matrix[np.ix_(indices, indices)] += weight * restricted.matrix
    determined = [name for _, covariance in pairs for name in covariance.names]
    return dict(zip(names, mean.tolist(), strict=True)), Covariance(tuple(names), matrix).select(determined)
