"""Names, texts and probabilities of the explanations of a gap, and the table of all candidates."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.hypotheses import Hypothesis
from bushfit.diagnosis.record import CandidateResult, NamedCause, Odds, format_probability
from bushfit.diagnosis.search import Search
from bushfit.diagnosis.verdict import Composition, Finding
from bushfit.effects import get_effect
from bushfit.model.covariance import Covariance
from bushfit.model.model import Model

#: Texts for the parts of an explanation that are no known effect.
NAMELESS = "something without a name"
LEVELS = "errors of levels beyond the class of the rig"
#: Reason for a candidate that is not part of the explanation.
_LESS_LIKELY = "another explanation is more probable"


def label(composition: Composition) -> str:
    """Name of an explanation: its mistakes (as --adopt accepts them), effects, faults and other parts, joined by +."""
    claim, faults = composition.best.claim, (f"fault: {part.name}" for part in composition.faulty_parts)
    return " + ".join((*(claim.labels if claim else ()), *composition.names, *faults, *_nameless(composition)))


def _nameless(composition: Composition) -> list[str]:
    """Texts for the parts of an explanation that are not known effects: level errors, and unnamed smooth curves."""
    return [LEVELS] * composition.best.levels + [NAMELESS] * composition.unnamed


def probability_text(composition: Composition, finding: Finding) -> str:
    """Text with the probability of an explanation and of its most probable rival among those reported.

    Returns:
        Text such as "probability 90 %, that of inertia 10 %".
    """
    rivals = [rival for rival in finding.reported if rival is not composition][:1]
    following = [f"that of {label(rival)} {format_probability(rival.probability)}" for rival in rivals]
    return ", ".join([f"probability {format_probability(composition.probability)}", *following])


def claim_entries(
    composition: Composition, finding: Finding, base: Evidence, alternatives: tuple[str, ...] = ()
) -> list[NamedCause]:
    """List the reported entries for the mistake in the record of an explanation, one for each affected test.

    Args:
        composition: the explanation.
        finding: verdict, with all reported explanations.
        base: starting model, fitted to the tests as recorded.
        alternatives: names of explanations that the tests cannot distinguish from this one.

    Returns:
        Entries with the sentence and the correction; none if the explanation has no mistake.
    """
    if (claim := composition.best.claim) is None:
        return []
    gain = base.chi_square - composition.best.state.evidence.chi_square
    why = f"lowers chi-square by {gain:.0f} without a new parameter; {probability_text(composition, finding)}"
    singles = [replace(claim, tests=(index,)) for index in claim.tests] or [claim]
    return [
        NamedCause(
            single.mistake.name,
            why,
            alternatives,
            test=next((test.name for test in single.affected), None),
            sentence=single.sentence,
            correction=single.corrections[0],
        )
        for single in singles
    ]


def undecided_text(reported: Sequence[Composition]) -> str:
    """Sentence that lists explanations that the tests cannot distinguish, and the parts that all of them contain."""
    parts = [label(composition).split(" + ") for composition in reported]
    shared = [name for name in parts[0] if all(name in names for names in parts)]
    *labels, last = (" + ".join(name for name in names if name not in shared) or "nothing else" for names in parts)
    sentence = f"these tests cannot distinguish between {', '.join(labels)} and {last}"
    return f"all probable explanations contain {' and '.join(shared)}; beside this, {sentence}" if shared else sentence


def causes_text(candidates: Sequence[Composition], finding: Finding) -> list[str]:
    """List sentences on the possible causes of a gap.

    Args:
        candidates: explanations with causes, the most probable first.
        finding: verdict, with all explanations and leads.

    Returns:
        Sentences on the candidates with their probabilities and on leads (effects that reduce the gap without closing
        it) that no candidate has; or on the mistakes to check.
    """
    claims = {c.best.claim.key if c.best.claim else None: c.best.claim for c in finding.reported}
    if all(claims.values()):
        return [f"check first whether {' or whether '.join(claim.sentence for claim in claims.values() if claim)}"]
    names = [f"{label(candidate)} ({format_probability(candidate.probability)})" for candidate in candidates]
    sentences = [f"the cause may be {' or '.join(names)}"] if names else []
    leads = [name for name in finding.leads if not any(name in candidate.causes for candidate in candidates)]
    sentences += [f"leads: {' and '.join(leads)}"] if leads else []
    return sentences or ["no known effect explains the gap"]


def explanation_odds(finding: Finding) -> Odds:
    """Collect the text, probability and fitted model of each reported explanation.

    Returns:
        Explanations, the most probable first.
    """
    compositions = sorted(finding.reported, key=lambda composition: -composition.probability)
    sentences, fits = list[str](), list[tuple[Model, Covariance] | None]()
    for composition in compositions:
        claim = composition.best.claim
        parts = [claim.sentence] if claim else []
        parts += [f"{get_effect(name).phrase} ({name})" for name in composition.names]
        parts += [f"a faulty test: {part.name}" for part in composition.faulty_parts]
        *parts, last = (*parts, *_nameless(composition))
        sentences.append(", and ".join(filter(None, (", ".join(parts), last))))
        is_rival = finding.verdict == "ambiguous" or composition is not finding.reported[0]
        evidence, shown = composition.best.state.evidence, is_rival and composition.best.refitted
        fits.append((evidence.model, evidence.covariance_of(evidence.model.values)) if shown else None)
    pairs = tuple(zip(sentences, (composition.probability for composition in compositions), strict=True))
    labels = tuple(label(composition) for composition in compositions)
    return Odds(finding.nothing, pairs, tuple(fits), labels, finding.verdict in ("ambiguous", "partly"))


def list_candidates(
    search: Search, hypotheses: Sequence[Hypothesis], first: Composition | None
) -> list[CandidateResult]:
    """List all effects that the starting model lacks, and all mistakes that were tried, each with its result.

    Args:
        search: completed search, with the tests.
        hypotheses: all hypotheses that were compared, the most probable first.
        first: most probable explanation that is reported; None if nothing is missing.

    Returns:
        Candidates with the result of their refit and their probability, the highest score first.
    """
    base = search.request.base
    log_posteriors = np.array([hypothesis.log_posterior for hypothesis in hypotheses])
    weights = np.exp(log_posteriors - log_posteriors[0])
    shares = (weights / weights.sum()).tolist()
    candidates, alone, probability = list[CandidateResult](), dict[str, Evidence](), defaultdict[str, float](float)
    for hypothesis, share in zip(hypotheses, shares, strict=True):
        evidence, claim = hypothesis.state.evidence, hypothesis.claim
        for name in {*hypothesis.effects}:
            probability[name] += share
        if len(hypothesis.key) != 1:
            continue
        if hypothesis.refitted and hypothesis.effects:
            alone[hypothesis.effects[0]] = evidence
        elif claim:
            gain = base.chi_square - evidence.chi_square
            why = "closes the gap" if first and first.best is hypothesis else _LESS_LIKELY
            candidates.append(CandidateResult(" + ".join(claim.labels), gain, gain, share, {}, why))
    for proposal in search.root.proposals:
        name, after = proposal.name, alone.get(proposal.name)
        if after is None:
            why = "score too small to refit" if proposal.visible else "not visible in these tests"
            candidates.append(CandidateResult(name, proposal.score, None, probability[name], {}, why))
            continue
        values = {key: value for key, value in after.model.values.items() if key not in base.model.values}
        why = "part of the most probable explanation" if first and name in first.names else _LESS_LIKELY
        gain = base.chi_square - after.chi_square
        candidates.append(CandidateResult(name, proposal.score, gain, probability[name], values, why))
    return sorted(candidates, key=lambda candidate: -candidate.score)
