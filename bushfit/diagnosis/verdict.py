"""Decide the verdict from the probabilities of explanations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from bushfit.diagnosis.document import Verdict
from bushfit.diagnosis.explanations import FaultyPlace, Meeting, is_pattern
from bushfit.diagnosis.hypotheses import COMPOUND, Hypothesis
from bushfit.diagnosis.priors import DOES_NOT_FIT, MOST_TOLD, MOSTLY, NAMED, NOTHING
from bushfit.effects import get_effect
from bushfit.effects.contract import Level


@dataclass(frozen=True, eq=False)
class Composition:
    """Set of parts that explains a gap, over all hypotheses that have these parts.

    Args:
        probability: if anything is missing.
        best: the likeliest hypothesis of these parts.
        names: effects that are part of it. Beside a deviation of the compound these are none of the rubber: such a law
            is part of the deviation.
        unnamed: whether something without a name is beside them, a deviation of the compound among them.
    """

    probability: float
    best: Hypothesis
    names: tuple[str, ...] = ()
    unnamed: bool = False

    @property
    def places(self) -> tuple[FaultyPlace, ...]:
        """Places at fault; none where they form a pattern, which is something without a name."""
        return () if is_pattern(self.best.places) else self.best.places

    @property
    def parts(self) -> frozenset[str]:
        """Names of its effects, kinds of places and other parts."""
        best = self.best
        spots = [f"place: {place.family}" for place in self.places] + (["levels"] if best.levels else [])
        claim = [str(best.claim.mistake.name)] if best.claim else []
        return frozenset((*self.names, *spots, *(["unnamed"] if self.unnamed else []), *claim))


@dataclass(frozen=True, eq=False)
class Finding:
    """The verdict, with the probabilities that it stands on.

    Args:
        nothing: probability that nothing is missing beyond noise and tolerance.
        told: what may explain the gap, the most probable first; of a single explanation that one.
        leads: effects that help, but are no explanation; beside a name what may be there too.
        names: effects that are named.
    """

    verdict: Verdict
    nothing: float
    told: tuple[Composition, ...]
    leads: tuple[str, ...] = ()
    names: tuple[str, ...] = ()


def judged(hypotheses: Sequence[Hypothesis], tolerance: float) -> Finding:
    """Verdict on hypotheses.

    Args:
        hypotheses: all hypotheses that were compared, the most probable first.
        tolerance: change of |K|, relative, below which an explanation counts as nothing.

    Returns:
        Verdict, probability that nothing is missing, and the explanations behind the verdict.
    """
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
    leads = _leads(left)
    if first.probability >= NAMED:
        return _of_one(first, nothing, leads)
    told, together = list[Composition](), 0.0
    for each in compositions:
        if together < NAMED:
            told.append(each)
            together += each.probability
    common = frozenset.intersection(*(each.parts for each in told))
    unnamed = sum(each.probability for each in told if each.unnamed)
    shown = common | {"unnamed"} if unnamed > 0.5 else common
    sure = next((each for each in told if each.parts == shown), None)
    if sure:  # all that is probable has these parts; what else there is is not shown, but that there is something
        found = _of_one(sure, nothing, leads)
        return replace(found, told=(sure, *(each for each in told if each is not sure)))
    if common and all(part.startswith("place: ") for part in common):  # whatever else there is, this has to go first
        return Finding("unexplained", nothing, tuple(told[:MOST_TOLD]), leads)
    nameless = sum(each.probability for each in told if each.parts == {"unnamed"})
    fits = first.best.claim is not None or first.best.chance >= DOES_NOT_FIT
    if len(told) <= MOST_TOLD and nameless < 0.5 and fits:
        return Finding("ambiguous", nothing, tuple(told))
    names = tuple(name for name in first.names if sum(e.probability for e in compositions if name in e.names) >= NAMED)
    if names and first.unnamed:  # whatever the compound does beside them
        return Finding("partly", nothing, tuple(told[:MOST_TOLD]), leads, names)
    return Finding("described", nothing, tuple(told[:MOST_TOLD]), leads)


def _is_nothing(each: Hypothesis, tolerance: float) -> bool:
    return each.size <= tolerance or not each.key


def _of_one(first: Composition, nothing: float, leads: Sequence[str]) -> Finding:
    """The verdict where one composition is all but sure."""
    best, names = first.best, first.names
    leads = tuple(dict.fromkeys((*names, *leads)))
    if _bend_names(first) or not (names or best.claim or first.unnamed):  # a place that is off has to go first
        return Finding("unexplained", nothing, (first,), leads)
    curve = best.unnamed not in ("", COMPOUND) and best.last >= (1.0 - MOSTLY) * best.size
    if not best.claim and (not names or curve or best.chance < DOES_NOT_FIT):
        return Finding("described", nothing, (first,), leads)
    if first.unnamed or best.levels or first.places:
        return Finding("partly", nothing, (first,), names=names)
    return Finding("named", nothing, (first,), names=names)


def _bend_names(composition: Composition) -> bool:
    """True if the places at fault may bend the names beside them: a fault of a level, a repeat or a frequency does. A
    loop is a test of its own, and points that were left out have no weight."""
    faults = [place for place in composition.places if not isinstance(place, Meeting)]
    return bool(composition.places) and (not composition.names or any(place.family != "loop" for place in faults))


def _leads(pairs: Sequence[tuple[Hypothesis, float]]) -> tuple[str, ...]:
    """Effects that nearly all that is probable has in common."""
    share: dict[str, float] = {}
    for each, weight in pairs:
        for name in each.effects:
            share[name] = share.get(name, 0.0) + weight
    whole = sum(weight for _, weight in pairs)
    return tuple(name for name in pairs[0][0].effects if share[name] >= MOSTLY * whole)


def _compositions(pairs: Sequence[tuple[Hypothesis, float]]) -> list[Composition]:
    """Hypotheses of the same parts as one, with a deviation of the compound beside them or without.

    A part without which a composition does better is not shown by these tests, and it counts with the simpler one; so
    does an effect that has another as its limit. Places that overlap are one, told several ways.
    """
    best: dict[_Parts, Hypothesis] = {}
    total: dict[_Parts, float] = {}
    bent: dict[_Parts, float] = {}
    for each, weight in pairs:  # the most probable first
        parts = _parts(each)
        best.setdefault(parts, each)
        if not best[parts].refitted and each.refitted:
            best[parts] = each
        total[parts] = total.get(parts, 0.0) + weight
        bent[parts] = bent.get(parts, 0.0) + weight * (bool(each.unnamed) or is_pattern(each.places))
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
    found = [
        Composition(
            sum(merged[parts] for parts in each) / whole,
            best[each[0]],
            tuple(name for name in best[each[0]].effects if name in each[0][0]),
            bent[each[0]] > 0.5 * total[each[0]],
        )
        for each in kinds.values()
    ]
    return sorted(found, key=lambda each: -each.probability)


#: Effects, places by kind and name, whether there is nothing but something without a name, and the claim on a record.
_Parts = tuple[frozenset[str], frozenset[str], bool, object]


def _parts(each: Hypothesis) -> _Parts:
    spots = [f"{place.family}:{place.name}" for place in each.places] + (["levels:"] if each.levels else [])
    claim = each.claim and (each.claim.mistake.name, each.claim.tests)
    names = frozenset(name for name in each.effects if not (each.bent and _is_of_rubber(name)))
    pattern = is_pattern(each.places)
    spots = [] if pattern else spots
    return names, frozenset(spots), (pattern or bool(each.unnamed)) and not (names or spots or claim), claim


def _is_of_rubber(name: str) -> bool:
    return get_effect(name).level == Level.MATERIAL


def _within(one: _Parts, other: _Parts) -> bool:
    """True if a composition is another one with some parts left out."""
    less = one[0] <= other[0] and one[1] <= other[1] and one[2] <= other[2] and one[3] in (None, other[3])
    return less and one != other and bool(one[0] or one[1] or one[2] or one[3])


def _limit(name: str) -> str:
    return get_effect(name).limit or name
