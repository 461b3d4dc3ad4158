"""Texts, probabilities and amounts of the explanations of a gap, and the table of all candidates."""

from collections import defaultdict
from collections.abc import Sequence

from scipy.special import softmax

from bushfit.caveat import join_names
from bushfit.diagnosis.fits import misfit_covariance
from bushfit.diagnosis.hypotheses import Hypothesis
from bushfit.diagnosis.record import CandidateResult, Odds, format_probability
from bushfit.diagnosis.search import Search
from bushfit.diagnosis.verdict import Composition, Finding
from bushfit.effects import get_effect, qualified_name
from bushfit.effects.unnamed import NAME as UNNAMED
from bushfit.model.covariance import Covariance
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.units import display_unit, format_aligned

#: Reason for a candidate that is not part of the explanation.
_LESS_LIKELY = "another explanation is more probable"
#: Reason for an effect of the most probable explanation that is not named: the deviation of the compound includes it.
_LEAD = "reduces the gap; a smooth deviation of the compound, which is also present, may have the same cause"


def probability_text(label: str, finding: Finding) -> str:
    """Text with the probability of an effect or mistake, and of a rival: "probability 90 %, that of inertia 10 %"."""
    probability = sum(composition.probability for composition in finding.reported if label in composition.labels)
    rivals = [rival for rival in finding.reported if label not in rival.labels][:1]
    following = [f"that of {rival.label} {format_probability(rival.probability)}" for rival in rivals]
    return ", ".join([f"probability {format_probability(probability)}", *following])


def undecided_text(reported: Sequence[Composition]) -> str:
    """Return a sentence on the explanations that the tests cannot distinguish, and on the parts they share."""
    parts = [[label.replace("fault: ", "a fault of ") for label in composition.labels] for composition in reported]
    shared = [name for name in parts[0] if all(name in names for names in parts)]
    common = f"every probable explanation contains {join_names(shared)}"
    rests = [" + ".join(name for name in names if name not in shared) for names in parts]
    if "" in rests:
        return f"{common}; a further cause is possible: {join_names(filter(None, rests), 'or')}"
    sentence = f"these tests cannot distinguish between {join_names(rests)}"
    return f"{sentence}; {common}" if shared else sentence


def check_first(compositions: Sequence[Composition]) -> list[str]:
    """Sentence that asks to check the recording mistakes in explanations, in a list that is empty without any."""
    mistakes = {c.best.mistake.key: c.best.mistake.sentence for c in compositions if c.best.mistake}
    return [f"check first whether {' or whether '.join(mistakes.values())}"] if mistakes else []


def causes_text(candidates: Sequence[Composition], finding: Finding) -> list[str]:
    """List at most one sentence on the possible causes of a gap, beside the lines with their probabilities.

    Args:
        candidates: explanations by effects or recording mistakes, the most probable first.
        finding: verdict, with all reported explanations and its leads (effects that reduce the gap without closing it).

    Returns:
        If every reported explanation is a recording mistake, a sentence that asks to check them. Otherwise a sentence
        that there are neither candidates nor leads; else nothing.
    """
    if all(composition.best.mistake for composition in finding.reported):
        return check_first(finding.reported)
    return [] if candidates or finding.leads else ["no known effect explains the gap"]


def leads_text(candidates: Sequence[Composition], finding: Finding) -> str:
    """Sentence on the leads of a verdict (see `Finding`) that no candidate contains; "" without any.

    A lead has a probability of 90 % or more, but describes the rubber in part only: `list_candidates` says why.
    """
    leads = [name for name in finding.leads if not any(name in candidate.causes for candidate in candidates)]
    friction = any(get_effect(name).is_friction for name in leads)
    law = "the friction law of the model does not hold for this rubber: " if friction else ""
    return f"{law}{join_names(leads)} would reduce the gap, but not close it" if leads else ""


def explanation_odds(finding: Finding) -> Odds:
    """Collect the text, probability and fitted model of each reported explanation.

    Returns:
        Explanations, the most probable first.
    """
    compositions = sorted(finding.reported, key=lambda composition: -composition.probability)
    sentences, fits = list[str](), list[tuple[Model, Covariance] | None]()
    for composition in compositions:
        mistake = composition.best.mistake
        parts = [mistake.sentence] if mistake else []
        effects = [get_effect(name) for name in composition.names]
        parts += [f"{effect.phrase} ({' or '.join((effect.name, *effect.twins))})" for effect in effects]
        parts += [f"a faulty test: {part.name}" for part in composition.faulty_parts]
        sentences.append(" + ".join((*parts, *composition.nameless)))
        is_rival = finding.verdict == "ambiguous" or composition is not finding.reported[0]
        fit = composition.best.state.plain if is_rival and composition.best.is_refitted else None
        fits.append((fit.model, misfit_covariance(fit)) if fit else None)
    pairs = tuple(zip(sentences, (composition.probability for composition in compositions), strict=True))
    labels = tuple(composition.labels for composition in compositions)
    return Odds(finding.nothing, pairs, tuple(fits), labels)


def list_candidates(
    search: Search, hypotheses: Sequence[Hypothesis], first: Composition | None
) -> list[CandidateResult]:
    """List the result of every effect that the starting model lacks and of every recording mistake that was tried.

    Args:
        search: completed search, with the tests.
        hypotheses: all hypotheses that were compared, the most probable first.
        first: most probable explanation that is reported; None if nothing is missing.

    Returns:
        Candidates with the result of their refit and their probability, the highest score first.
    """
    base = search.base
    shares = softmax([hypothesis.log_posterior for hypothesis in hypotheses]).tolist()
    candidates, probability = list[CandidateResult](), defaultdict[str, float](float)
    for hypothesis, share in zip(hypotheses, shares, strict=True):
        for name in {*hypothesis.effects}:
            probability[name] += share
        if len(hypothesis.key) == 1 and (mistake := hypothesis.mistake):
            score = base.chi_square - hypothesis.state.plain.chi_square
            why = "closes the gap" if first and first.best is hypothesis else _LESS_LIKELY
            candidates.append(CandidateResult(" + ".join(mistake.labels), score, score, share, {}, why))
    for proposal in search.proposals:
        name, after = proposal.name, search.refits.get(proposal.name)
        gain, values = None, dict[str, float]()
        why = "score too small to refit" if proposal.visible else "not visible in these tests"
        if after:
            gain = base.chi_square - after.chi_square
            values = {key: value for key, value in after.model.values.items() if key not in base.model.values}
        if first and name in first.best.effects:
            why = "part of the most probable explanation" if name in first.names else _LEAD
        elif name in search.refits:
            why = _LESS_LIKELY if after else "its refit is far behind that of another effect"
        candidates.append(CandidateResult(name, proposal.score, gain, probability[name], values, why))
    return sorted(candidates, key=lambda candidate: -candidate.score)


def format_amount(name: str, result: Result) -> str:
    """Format the amount of an effect in a model.

    Args:
        name: name of the effect.
        result: fitted result.

    Returns:
        Text such as "moving mass: 0.25 kg (95 % interval 0.24 to 0.26)"; "" if the model has no such amount.
    """
    if name == UNNAMED or name not in result.model.effects or (effect := get_effect(name)).replaces is not None:
        return ""
    amount, parameter = effect.amount, qualified_name(effect, effect.amount)
    value, interval = result.model.values[parameter], result.interval(parameter)
    unit, factor = display_unit(amount.unit, 1.0, value)
    quantity, _, _ = (amount.meaning or amount.name).partition(" (")
    if value < 0.0 and amount.opposite:
        quantity, factor, interval = amount.opposite, -factor, interval and interval[::-1]
    value_text, *ends = format_aligned([factor * x for x in (value, *(interval or ()))], 3)
    text = f"{quantity}: {f'{value_text} {unit}'.removesuffix(' -').removesuffix(' 1')}"
    if end := amount.reached_bound(value):
        return f"{text} (at its {end}imum)"
    return f"{text} (95 % interval {ends[0]} to {ends[1]})" if ends else text
