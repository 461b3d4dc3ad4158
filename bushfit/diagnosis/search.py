"""Search for the most probable sets of explanations of a gap, extended by one explanation at a time.

The evidence of effects comes from refits of all parameters, by Laplace's method; that of faulty parts and of curves
without a name comes from a linear model.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from math import log
from typing import NamedTuple

import numpy as np

from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.explanations import Explanation
from bushfit.diagnosis.faulty_parts import FaultyPart, OutlierCluster
from bushfit.diagnosis.fits import fit_rivals, start_rivals
from bushfit.diagnosis.hypotheses import Hypothesis, SearchState
from bushfit.diagnosis.priors import BEAM, DOES_NOT_FIT, LOG_ODDS_CUTOFF, NAMED, ODDS, REFITS, ROUNDS, SIZES
from bushfit.diagnosis.projected_columns import SignatureSet
from bushfit.diagnosis.propose import Proposal, has_used_parameters, proposals
from bushfit.diagnosis.record import DiagnosisSettings
from bushfit.diagnosis.recorded_tests import RecordedTests, modulus_deviation, record_change
from bushfit.diagnosis.recording_mistakes import MistakeScreening, RecordingMistake, possible_mistakes
from bushfit.diagnosis.smooth_deviations import COMPOUND, POWER_LAW
from bushfit.diagnosis.verdict import decide_verdict
from bushfit.effects.contract import Array
from bushfit.effects.mistakes import get_mistake
from bushfit.errors import FitError, ModelError
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.problem import FitResult
from bushfit.progress import track

#: Maximum number of refits of hypotheses that are probable by the linear model alone; for time.
_LAST_REFITS = 8
#: Number of mistakes that are fitted; of those that are combined with effects, or whose factor is estimated, the most
#: promising first; and of faulty parts added to a state; for time.
_MISTAKES, _CORRECTED, _FAULTY_PARTS = 4, 2, 2
#: Natural log of the odds below its state within which an effect is refitted; for time.
_SLIGHT = 3.0
#: Number of rivals that are refitted from the values of the most probable state in each round; for time.
_RIVALS = 6
#: Reduced chi-square above which the gap has distorted the parameters too much to start a refit from their values.
_DISTORTED = 1.5


class _WeighedState(NamedTuple):
    """Fitted model of the search, with the explanations that may be added to it and their evidence.

    Args:
        state: fitted model with its explanations so far.
        effects: effects that may be added, the highest expected decrease of chi-square first.
        evidence: further explanations of the gap, each with the evidence for it by the linearised residuals.
    """

    state: SearchState
    effects: Sequence[Proposal]
    evidence: Sequence[tuple[Explanation, Evidence]]


@dataclass(eq=False)
class Search:
    """Beam search over sets of explanations of the gap between a fitted model and the tests.

    A state of the search is a model fitted with some explanations; the search extends the most probable states.

    Args:
        data: campaign with the prepared tests.
        base: starting model, fitted to the tests.
        fit_corrected: function that fits the starting model to a campaign with a corrected record.
        settings: limits of the diagnosis, and effects and mistakes not to consider.
        start: starting values read from the data, by parameter, for a fit that the gap has distorted.
        outlier_clusters: frequencies at which several outliers were left out.
        refits: fits of the starting model with one effect and without a smooth deviation, by the name of the effect;
            None for a fit far behind the others.
    """

    data: PreparedCampaign
    base: FitResult
    fit_corrected: Callable[[PreparedCampaign], FitResult]
    settings: DiagnosisSettings
    start: Mapping[str, float]
    outlier_clusters: Sequence[OutlierCluster]
    refits: dict[str, FitResult | None] = field(default_factory=dict)
    _known: dict[frozenset[Hashable], Hypothesis] = field(default_factory=dict)
    _visited: set[frozenset[Hashable]] = field(default_factory=set)

    def __post_init__(self) -> None:
        settings = self.settings
        adopted = sum(get_mistake(name) is None for name in settings.adopt)
        self._most_effects = max(settings.max_effects - adopted, min(settings.max_effects, 1))
        tests = RecordedTests.of_fit(self.base, self.data.campaign.rig)
        self.root = SearchState.of_tests(tests)
        self.proposals = proposals(tests.unwhitened, settings.without, self.base.fixed_names)
        self._start_rivals = partial(start_rivals, fixed=self.base.fixed_names, bounds=self.data.bounds)
        self._log_priors = prior_odds([*self.proposals, *tests.explanations])
        families = {e.family for e in (*self.outlier_clusters, *tests.explanations) if e.kind == "part"}
        self._meeting_odds = log(ODDS["part"] / max(len(families), 1))
        # disturbances are independent: each cluster alone, and all that are more probable than a coincidence
        likely = tuple(c for c in self.outlier_clusters if self._meeting_odds + c.log_odds > 0.0)
        self._cluster_sets = dict.fromkeys(filter(None, [*((c,) for c in self.outlier_clusters), likely]))

    def run(self) -> list[Hypothesis]:
        """Run the search: extend the most probable sets of explanations by one more, for a few rounds.

        Returns:
            All hypotheses that were compared, the most probable first.
        """
        beam = [self._visit(self.root)]
        for depth in range(ROUNDS + 1):
            steps = list[_WeighedState]()
            for state in track(f"round {depth + 1} of at most {ROUNDS + 1}", beam):
                effects = list[Proposal]()
                if len(state.effects) < self._most_effects:
                    excluded = (*self.settings.without, *state.effects)
                    fixed = self.base.fixed_names if depth < ROUNDS else None  # in the last round nothing is refitted
                    effects = self.proposals if state is self.root else proposals(state.unwhitened, excluded, fixed)
                sets = SignatureSet.split([effect.signature for effect in effects], state.columns.errors)
                evidence = state.weigh([*sets, *state.columns.sets])
                explanations = [*(effect for effect in effects if effect.signature), *state.tests.explanations]
                steps.append(_WeighedState(state, effects, list(zip(explanations, evidence, strict=True))))
                for explanation, of_explanation in steps[-1].evidence:
                    log_odds = self._log_odds(explanation.kind, explanation.name)
                    self._record(state.extend(of_explanation, explanation, log_odds))
            if depth == ROUNDS or self._is_decided():
                break
            fresh = list[SearchState]()
            for step in track("with one more", steps):
                for grown in self._with_effects(step.state, self._select_effects(step, depth)):
                    fresh += [grown, *self._without_earlier(grown)]
                fresh += self._with_faulty_parts(step)
            fresh = self._with_common_start([*beam, *fresh])[len(beam) :]
            if depth == 0:
                fresh += self._corrected_records()
                if self._is_decided(by_power_law=True):
                    break
            followed = [h for h in self._known.values() if h.unnamed in ("", COMPOUND) and not h.has_level_errors]
            limit = max(hypothesis.log_posterior for hypothesis in followed) - LOG_ODDS_CUTOFF
            nearest = sorted(fresh, key=lambda state: -state.log_posterior)
            beam = [state for state in nearest[: BEAM[min(depth, 1)]] if state.log_posterior > limit]
            corrected = dict[tuple[int, ...], tuple[SearchState, frozenset[Hashable]]]()
            for state in nearest:  # the most probable one with a mistake in these tests
                if mistake := state.tests.mistake:
                    corrected.setdefault(mistake.tests, (state, state.key - {mistake.key}))
            for state, key in [*corrected.values()][:_CORRECTED]:
                as_recorded = self._known.get(key)
                is_improved = as_recorded is None or state.log_posterior > as_recorded.state.log_posterior
                if state not in beam and is_improved:
                    beam.append(state)  # because neither explains tests that have a mistake and an effect
            if not beam:
                break
        for linear in self._unrefitted_hypotheses():
            assert isinstance(linear.last, Proposal)  # all other explanations need no refit
            if not self._with_effects(linear.state, [linear.last]):
                del self._known[linear.key]  # no response with this effect, or improbable
        return self._ordered_hypotheses()

    def _ordered_hypotheses(self) -> list[Hypothesis]:
        """Hypotheses about the gap that the search has recorded so far, the most probable first."""
        return sorted(self._known.values(), key=lambda hypothesis: -hypothesis.log_posterior)

    def _is_decided(self, *, by_power_law: bool = False) -> bool:
        """True if one explanation, or that nothing is missing, has a probability of 97 % or more and fits the tests.

        Args:
            by_power_law: True if only a power law alone ends the search.
        """
        finding = decide_verdict(self._ordered_hypotheses(), self.settings.tolerance)
        if finding.verdict == "consistent":
            return not by_power_law and finding.nothing >= NAMED and self.root.linear.p_value() >= DOES_NOT_FIT
        first, best = finding.reported[0], finding.reported[0].best
        if by_power_law:
            is_alone = best.last is not None and best.last.family == POWER_LAW and len(best.key) == 1
            return is_alone and first.probability >= NAMED and best.p_value >= DOES_NOT_FIT
        return finding.verdict == "named" and best.is_refitted

    def _unrefitted_hypotheses(self) -> Iterator[Hypothesis]:
        """Yield the most probable hypotheses whose evidence is from the linear model, one by one, to be refitted."""
        for _ in range(_LAST_REFITS):
            ordered = self._ordered_hypotheses()
            share = np.exp([hypothesis.log_posterior - ordered[0].log_posterior for hypothesis in ordered])
            ahead = (np.cumsum(share) - share) / share.sum()
            candidates = zip(ordered, ahead.tolist(), strict=True)
            linear = next((h for h, before in candidates if before < NAMED and not h.is_refitted), None)
            if linear is None:
                return
            yield linear

    def _log_odds(self, kind: str, name: str) -> float:
        """Natural log of the prior odds of an explanation; if it is not listed, the lowest odds of its kind.

        Args:
            kind: kind of the explanation.
            name: name of the explanation.

        Notes:
            The prior assumes independent explanations: the odds of a set are the product of its members' odds. With the
            sum O of all odds, all sets of n explanations together weigh O^n/n!, as a Poisson number of explanations of
            mean O does; the search records a set only once, so no further factor corrects for the order.
        """
        if (kind, name) not in self._log_priors:
            self._log_priors[kind, name] = min(odds for (other, _), odds in self._log_priors.items() if other == kind)
        return self._log_priors[kind, name]

    def _visit(self, state: SearchState) -> SearchState:
        """Record a state of the search (a fitted model) and its hypotheses, to visit it only once; return the state."""
        self._visited.add(state.key)
        self._record(state.hypotheses)
        return state

    def _record(self, hypotheses: Sequence[Hypothesis]) -> None:
        """Store hypotheses, each without and with a disturbance at each frequency where outliers were left out.

        Of two fits of the same set of explanations, a refit replaces a linear fit; otherwise the more probable fit
        stays.
        """
        candidates = list(hypotheses)
        for hypothesis, clusters in product(hypotheses, self._cluster_sets):
            log_odds = sum(self._meeting_odds + cluster.log_odds for cluster in clusters)
            log_posterior = hypothesis.log_posterior + log_odds
            if hypothesis.change <= self.settings.tolerance:  # explanations within the tolerance are left out
                hypothesis = self.root.hypotheses[0]
            change = max(hypothesis.change, *(cluster.size for cluster in clusters))
            candidates.append(replace(hypothesis, clusters=clusters, log_posterior=log_posterior, change=change))
        for candidate in candidates:
            before = self._known.get(candidate.key)
            rank = candidate.is_refitted, candidate.log_posterior
            if before is None or rank > (before.is_refitted, before.log_posterior):
                self._known[candidate.key] = candidate

    def _select_effects(self, step: _WeighedState, depth: int) -> list[Proposal]:
        """Select the effects to refit as additions to a state of the search.

        These are the effects with the highest evidence in the linearised model, and those with the largest expected
        decrease of chi-square, which is the better criterion for a large gap.

        Args:
            step: state that the effects are added to, with the evidence for them.
            depth: number of explanations in the state.
        """
        state = step.state
        by_evidence, by_score = REFITS[1 if depth else 2 if state.plain.reduced_chi_square > _DISTORTED else 0]
        effects = [effect for effect in step.effects if state.key | {effect.name} not in self._visited]
        prior = {effect.name: self._log_odds("effect", effect.name) for effect in effects}
        base = state.log_weight - state.log_posterior
        gains = {e.name: base + prior[e.name] + evidence.total for e, evidence in step.evidence if e.name in prior}
        first = sorted((effect for effect in effects if effect.signature), key=lambda effect: -gains[effect.name])
        first = [effect for effect in first[:by_evidence] if gains[effect.name] > -_SLIGHT]
        second = [effect for effect in effects if 0.5 * effect.score + prior[effect.name] > -_SLIGHT][:by_score]
        return list(dict.fromkeys([*first, *second]))

    def _with_effects(self, state: SearchState, effects: Sequence[Proposal]) -> list[SearchState]:
        """Extend a state of the search by each of several effects, refitted with all parameters.

        Each effect is fitted twice: without and with a smooth deviation of the rubber of the likeliest size. The search
        continues from the more probable fit.

        Args:
            state: fitted model with some explanations.
            effects: effects to add, one at a time.
        """
        if not effects:
            return []
        models = {effect.name: effect.model for effect in effects}
        start = self.start if not state.effects and state.plain.reduced_chi_square > _DISTORTED else {}
        grown, starts = dict[str, SearchState](), self._start_rivals(models, state.fit.data_sets, start)
        for deviation in dict.fromkeys((state.likeliest_deviation, 0.0)):
            fits = fit_rivals(starts, state.free_columns(deviation))
            if not deviation and not state.key:
                self.refits.update({name: fits.get(name) for name in models})
            for name, fit in fits.items():
                log_odds = self._log_odds("effect", name)
                with suppress(ModelError):  # the fitted model without one of its effects has no finite response
                    candidate = self._visit(state.with_fit(fit).with_effect(name, log_odds, state.fit))
                    if name not in grown or candidate.log_posterior > grown[name].log_posterior:
                        grown[name] = candidate
        return list(grown.values())

    def _with_faulty_parts(self, step: _WeighedState) -> Iterator[SearchState]:
        """Extend a state by each of its likeliest faulty parts of the tests, with errors of the most probable form."""
        state = step.state
        # the faulty part itself may have distorted the parameters
        is_distorted = state.plain.reduced_chi_square > _DISTORTED
        faulty_parts = [(part, evidence) for part, evidence in step.evidence if isinstance(part, FaultyPart)]
        faulty_parts.sort(key=lambda pair: -(self._log_odds("part", pair[0].name) + pair[1].total))
        for common, _ in faulty_parts[:_FAULTY_PARTS]:
            if state.key | {common.name} in self._visited:
                continue
            parts = [common.in_form(form) for form in common.forms]
            evidences = state.weigh(SignatureSet.split([part.signature for part in parts], state.columns.errors))
            part, evidence = max(zip(parts, evidences, strict=True), key=lambda pair: pair[1].total)
            log_odds = self._log_odds("part", part.name)
            if state.log_weight + log_odds + evidence.total < state.log_posterior - _SLIGHT * is_distorted:
                continue
            grown = replace(
                state,
                faulty_parts=(*state.faulty_parts, replace(part, amount=evidence.likeliest)),
                log_prior=state.log_prior + log_odds - log(SIZES.size * evidence.share),  # in place of all sizes
                change=max(state.change, evidence.size),
            )
            if is_distorted:
                models, tests, columns = {"": grown.fit.model}, grown.fit.data_sets, grown.free_columns(0.0)
                starts = [self._start_rivals(models, tests, s) for s in ([{}] if state.effects else [{}, self.start])]
                fits = [fit for rivals in starts for fit in fit_rivals(rivals, columns).values()]
                grown = grown.with_fit(min(fits, key=lambda fit: fit.chi_square)) if fits else grown
            yield self._visit(grown)

    def _without_earlier(self, state: SearchState) -> Iterator[SearchState]:
        """Yield refitted states without one of the earlier effects, which the last effect may make unnecessary."""
        for name in () if state.faulty_parts else state.effects[:-1]:
            model = state.fit.model.without(name)
            if state.key - {name} not in self._visited and all(has_used_parameters(e, model) for e in model.records):
                yield from self._refit(state, [effect for effect in state.effects if effect != name], {}, None)

    def _refit(
        self, state: SearchState, effects: Sequence[str], start: Mapping[str, float], columns: Array | None
    ) -> Iterator[SearchState]:
        """Refit a state of the search with some of its effects, and yield the new state.

        Args:
            state: state with the tests.
            effects: names of the effects to keep.
            start, columns: further starting values and errors that tests share, see `start_rivals` and `fit_rivals`.
        """
        model = state.fit.model.without(*{*state.effects} - {*effects})
        for fit in fit_rivals(self._start_rivals({"": model}, state.fit.data_sets, start), columns).values():
            fitted = SearchState.of_tests(state.tests).with_fit(fit)
            with suppress(ModelError):  # as in `_with_effects`
                for name in effects:
                    fitted = fitted.with_effect(name, self._log_odds("effect", name), fit)
                yield self._visit(fitted)

    def _with_common_start(self, states: list[SearchState]) -> list[SearchState]:
        """Refit the states of a round, starting from the most probable one, so that all are compared near one minimum.

        A rubber that deviates from the model's laws has several fits of almost equal misfit. An effect must not be
        preferred only because its fit happened to find the best of these.

        Args:
            states: states of one round of the search.

        Returns:
            The states; a refitted state replaces the original if it is more probable.
        """
        leader = max(states, key=lambda state: state.log_posterior)
        near = [n for n, state in enumerate(states) if state is not leader and not state.faulty_parts]
        near.sort(key=lambda n: -states[n].log_posterior)
        for n in near[:_RIVALS] if leader.likeliest_deviation and not leader.faulty_parts else ():
            columns, values = states[n].free_columns(leader.likeliest_deviation), leader.fit.model.values
            for fitted in self._refit(states[n], states[n].effects, values, columns):
                states[n] = max(states[n], fitted, key=lambda state: state.log_posterior)
        return states

    def _corrected_records(self) -> Iterator[SearchState]:
        """Generate states in which one recording mistake is corrected, the most promising first."""
        possible, select = possible_mistakes(self.data, self.settings.without), MistakeScreening(self.data).best
        constant, estimated = ([m for m in possible if m.kind.is_estimated is flag] for flag in (False, True))
        for mistake in track("mistakes corrected", [*select(constant, _MISTAKES), *select(estimated, _CORRECTED)]):
            with suppress(FitError, ModelError):  # the model cannot be fitted to the corrected tests
                log_odds = log(ODDS["record"] / len(possible))
                state = self._corrected_record(mistake, log_odds)
                if state and mistake.kind.is_estimated:  # by all parameters
                    state = self._corrected_record(state.refined_mistake(), log_odds)
                if state:
                    yield self._visit(state)

    def _corrected_record(self, mistake: RecordingMistake, log_odds: float) -> SearchState | None:
        """Fit the starting model to tests with a corrected mistake, whose prior odds have the natural log `log_odds`.

        Returns:
            State of the search; None if the fit leaves out other outliers than the fit to the tests as recorded.

        Raises:
            FitError, ModelError: the model cannot be fitted to the corrected tests.
        """
        fit = self.fit_corrected(mistake.corrected_campaign())
        if [test.size for test in fit.data_sets] != [test.size for test in self.base.data_sets]:
            return None
        log_odds -= 0.5 * (modulus_deviation(fit) ** 2 - modulus_deviation(self.base) ** 2)
        tests, change = RecordedTests.of_fit(fit, self.data.campaign.rig), record_change(self.base, fit)
        return SearchState.of_tests(replace(tests, log_odds=log_odds, mistake=mistake, change=change))


def prior_odds(explanations: Sequence[Explanation]) -> dict[tuple[str, str], float]:
    """Compute the natural log of the prior odds of each explanation.

    The odds of a kind, in `priors.ODDS`, are divided equally among its families. In a family of effects, the effect
    that acts in all directions has half, and those in single directions share the other half; in a family of faulty
    parts, all have equal odds, divided among the forms of a fault.

    Args:
        explanations: all explanations considered.

    Returns:
        Log odds by (kind, name).
    """
    members = Counter((explanation.kind, explanation.family) for explanation in explanations)
    families = Counter(kind for kind, _ in members)
    log_odds = {}
    for explanation in explanations:
        kind, count = explanation.kind, members[explanation.kind, explanation.family]
        share = ODDS[kind] / families[kind]
        if isinstance(explanation, FaultyPart):
            share /= len(explanation.forms)
        if kind != "effect":
            share /= count
        elif count > 1:
            share *= 0.5 if explanation.name == explanation.family else 0.5 / (count - 1)
        log_odds[kind, explanation.name] = log(share)
    return log_odds
