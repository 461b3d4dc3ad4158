"""From the probabilities of explanations to a verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from bushfit.diagnosis.document import Verdict
from bushfit.diagnosis.hypotheses import Hypothesis
from bushfit.diagnosis.priors import DOES_NOT_FIT, MOST_TOLD, MOSTLY, NAMED, NOTHING
from bushfit.effects import get_effect


@dataclass(frozen=True, eq=False)
class Composition:
    """What explains a gap, however often and in whatever detail it was weighed.

    Args:
        probability: if anything is missing.
        best: the likeliest hypothesis of these parts.
    """

    probability: float
    best: Hypothesis

    @property
    def parts(self) -> frozenset[str]:
        """Its effects, kinds of places and what else it is made of."""
        best = self.best
        spots = [f"place: {place.family}" for place in best.places] + (["levels"] if best.levels else [])
        claim = [str(best.claim.mistake.name)] if best.claim else []
        return frozenset((*best.effects, *spots, *(["unnamed"] if best.unnamed else []), *claim))


@dataclass(frozen=True, eq=False)
class Finding:
    """The verdict, with the probabilities that it stands on.

    Args:
        nothing: probability that nothing is missing beyond noise and tolerance.
        told: what may explain the gap, the most probable first; of a single explanation that one.
        leads: effects that help, but are no explanation; beside a name what may be there too.
    """

    verdict: Verdict
    nothing: float
    told: tuple[Composition, ...]
    leads: tuple[str, ...] = ()


def judged(hypotheses: Sequence[Hypothesis], tolerance: float) -> Finding:
    """The verdict on hypotheses, the most probable first; what changes less than the tolerance counts as nothing."""
    weights = np.exp(
        [each.log_posterior for each in hypotheses] - logsumexp([each.log_posterior for each in hypotheses])
    )
    pairs = list(zip(hypotheses, weights.tolist(), strict=True))
    small = [_is_nothing(each, tolerance) for each in hypotheses]
    nothing = sum(weight for (_, weight), is_small in zip(pairs, small, strict=True) if is_small)
    left = [pair for pair, is_small in zip(pairs, small, strict=True) if not is_small]
    if nothing >= NOTHING or not left:
        return Finding("consistent", nothing, ())
    compositions = _compositions(left)
    first = compositions[0]
    if first.probability >= NAMED:
        return _of_one(first, nothing)
    told, together = list[Composition](), 0.0
    for each in compositions:
        if together < NAMED:
            told.append(each)
            together += each.probability
    common = frozenset.intersection(*(each.parts for each in told))
    unnamed = sum(each.probability for each in told if each.best.unnamed)
    shown = common | {"unnamed"} if unnamed > 0.5 else common
    sure = next((each for each in told if each.parts == shown), None)
    if sure:  # all that is probable has these parts; what else there is is not shown, but that there is something
        found = _of_one(sure, nothing)
        return replace(found, told=(sure, *(each for each in told if each is not sure)))
    if common and all(part.startswith("place: ") for part in common):  # whatever else there is, this has to go first
        return Finding("unexplained", nothing, tuple(told[:MOST_TOLD]), _leads(compositions))
    if len(told) <= MOST_TOLD and unnamed < 0.5:
        return Finding("ambiguous", nothing, tuple(told))
    return Finding("described", nothing, tuple(told[:MOST_TOLD]), _leads(compositions))


def _is_nothing(each: Hypothesis, tolerance: float) -> bool:
    return each.size <= tolerance or not each.key


def _of_one(first: Composition, nothing: float) -> Finding:
    """The verdict where one composition is all but sure."""
    best = first.best
    names = best.effects
    if best.unnamed and names and not best.places and best.last < (1.0 - MOSTLY) * best.size:
        return Finding("partly", nothing, (first,))
    if best.unnamed:
        return Finding("described", nothing, (first,), names)
    if best.places or not (names or best.claim):  # whatever else there is, a place that is off has to go first
        return Finding("unexplained", nothing, (first,), names)
    if best.levels:
        return Finding("partly", nothing, (first,))
    if best.chance < DOES_NOT_FIT:
        return Finding("described", nothing, (first,), names)
    return Finding("named", nothing, (first,))


def _leads(compositions: Sequence[Composition]) -> tuple[str, ...]:
    """Effects that nearly all that is probable has in common."""
    names = dict.fromkeys(name for each in compositions[:MOST_TOLD] for name in each.best.effects)
    share = {name: sum(each.probability for each in compositions if name in each.best.effects) for name in names}
    return tuple(name for name in names if share[name] >= MOSTLY)


def _compositions(pairs: Sequence[tuple[Hypothesis, float]]) -> list[Composition]:
    """Hypotheses of the same parts as one.

    A part without which a composition does better is not shown by these tests, and it counts with the simpler one; so
    does an effect that has another as its limit. Places that overlap are one, told several ways.
    """
    best: dict[_Parts, Hypothesis] = {}
    total: dict[_Parts, float] = {}
    for each, weight in pairs:  # the most probable first
        parts = _parts(each)
        best.setdefault(parts, each)
        total[parts] = total.get(parts, 0.0) + weight
    merged: dict[_Parts, float] = {}
    for parts in sorted(total, key=lambda parts: -total[parts]):
        limit = (frozenset(map(_limit, parts[0])), *parts[1:])
        simpler = [other for other in merged if _within(other, parts) or (other == limit and other != parts)]
        home = simpler[0] if simpler else parts
        merged[home] = merged.get(home, 0.0) + total[parts]
    kinds: dict[tuple[object, ...], list[_Parts]] = {}
    for parts in sorted(merged, key=lambda parts: -merged[parts]):
        own = frozenset(place.partition(":")[0] for place in parts[1])
        kinds.setdefault((parts[0], own, *parts[2:]), []).append(parts)
    whole = sum(merged.values())
    found = [Composition(sum(merged[parts] for parts in each) / whole, best[each[0]]) for each in kinds.values()]
    return sorted(found, key=lambda each: -each.probability)


#: Effects, places by kind and name, whether something is unnamed, and the claim on a record.
_Parts = tuple[frozenset[str], frozenset[str], bool, object]


def _parts(each: Hypothesis) -> _Parts:
    spots = [f"{place.family}:{place.name}" for place in each.places] + (["levels:"] if each.levels else [])
    claim = each.claim and (each.claim.mistake.name, each.claim.tests)
    return frozenset(each.effects), frozenset(spots), bool(each.unnamed), claim


def _within(one: _Parts, other: _Parts) -> bool:
    """Whether a composition is another with a part, or some, left out."""
    less = one[0] <= other[0] and one[1] <= other[1] and one[2] <= other[2] and one[3] in (None, other[3])
    return less and one != other and bool(one[0] or one[1] or one[2] or one[3])


def _limit(name: str) -> str:
    return get_effect(name).limit or name
