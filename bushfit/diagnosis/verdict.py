"""Verdict of a diagnosis, decided from the probabilities of the explanations of the gap."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from scipy.special import softmax

from bushfit.diagnosis.document import Verdict
from bushfit.diagnosis.faulty_parts import FaultyPart, OutlierCluster, is_pattern
from bushfit.diagnosis.hypotheses import Hypothesis
from bushfit.diagnosis.priors import DOES_NOT_FIT, LEAST_NAMED_SHARE, MOST_REPORTED, NAMED, NOTHING
from bushfit.diagnosis.smooth_deviations import COMPOUND
from bushfit.effects import get_effect
from bushfit.effects.contract import Level

#: Component of an explanation: kind ("effect", "mistake", "unnamed", or `_FAULT` and the kind of a fault), and name.
_Component = tuple[str, Any]
_FAULT = "fault: "
#: Probability of a hypothesis below which it changes no figure: thousands of hypotheses are merged in each round.
_NEGLIGIBLE = 1e-12
#: Conditions of a test, on which a smooth deviation of the compound does not depend.
_CONDITIONS = ("temperature", "preload")
#: Texts for the components of an explanation that are no known effect.
NAMELESS = "an unknown cause"
LEVELS = "errors of levels beyond the class of the rig"


@dataclass(frozen=True, eq=False)
class Composition:
    """Explanation of a gap by a set of components: effects, faults and recording mistakes, merged from hypotheses.

    Args:
        probability: probability of these components, given that something is missing in the model.
        best: most probable hypothesis with these components.
        names: effects in the set. If the set includes a smooth deviation of the rubber, or a curve without a name,
            effects of the rubber are not listed, because the deviation includes them.
        unnamed: True if an unnamed smooth curve, or a deviation of the compound, is part of the explanation.
    """

    probability: float
    best: Hypothesis
    names: tuple[str, ...] = ()
    unnamed: bool = False

    @property
    def faulty_parts(self) -> tuple[FaultyPart, ...]:
        """Faulty parts of the tests; empty if they form a pattern that may be physics without a name."""
        return () if is_pattern(self.best.faulty_parts) else self.best.faulty_parts

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of all components: recording mistake (as --adopt accepts it), effects, faults, smooth curves."""
        mistake, faults = self.best.mistake, (f"fault: {part.name}" for part in self.faulty_parts)
        return (*(mistake.labels if mistake else ()), *self.names, *faults, *self.nameless)

    @property
    def label(self) -> str:
        """Names of all components, joined by +."""
        return " + ".join(self.labels)

    @property
    def nameless(self) -> tuple[str, ...]:
        """Texts for the components without a known effect: errors at one amplitude or frequency, and smooth curves."""
        return (*([LEVELS] if self.best.has_level_errors else []), *([NAMELESS] if self.unnamed else []))

    @property
    def causes(self) -> tuple[str, ...]:
        """Names of the recording mistake and of the effects of the explanation."""
        return (*([str(self.best.mistake.kind.name)] if self.best.mistake else []), *self.names)

    @property
    def components(self) -> frozenset[str]:
        """Names that identify the explanation: of effects, of the mistake, "part: level" for a faulty level, and so on.

        "levels" stands for rig errors of whole levels, and "unnamed" for a smooth curve or deviation.
        """
        marks = [f"part: {part.family}" for part in self.faulty_parts] + ["levels"] * self.best.has_level_errors
        marks += [str(self.best.mistake.key)] if self.best.mistake else []
        return frozenset((*self.names, *marks, *["unnamed"] * self.unnamed))

    @property
    def may_mislead(self) -> bool:
        """True if the explanation contains a fault (of a level, repeat or frequency) that may bias its effects.

        A faulty loop, which is a separate test, and points that were left out of the fit do not bias effects.
        """
        faults = [part for part in self.faulty_parts if not isinstance(part, OutlierCluster)]
        return bool(self.faulty_parts) and (not self.names or any(part.family != "loop" for part in faults))


@dataclass(frozen=True, eq=False)
class Finding:
    """Verdict on the gap between model and tests, and the explanations to report.

    Args:
        verdict: verdict in one word.
        nothing: probability that nothing is missing that changes the stiffness by more than the tolerance.
        reported: explanations to report, the most probable first, only one if its probability is 97 % or more; empty
            if nothing is missing.
        leads: names of effects that reduce the gap but do not explain it.
        names: names of effects with a probability of 97 % or more, which are all or a part of the explanation.
    """

    verdict: Verdict
    nothing: float
    reported: tuple[Composition, ...]
    leads: tuple[str, ...] = ()
    names: tuple[str, ...] = ()


def decide_verdict(hypotheses: Sequence[Hypothesis], tolerance: float, *, gap_stays: bool = False) -> Finding:
    """Decide the verdict from the probabilities of hypotheses.

    Args:
        hypotheses: all hypotheses that were compared, the most probable first.
        tolerance: relative change of |K| below which an explanation is neglected.
        gap_stays: True if held-out tests show a gap that remains with the most probable explanation. The rubber then
            deviates from the model's laws in a way that no effect describes, and only hypotheses with such a deviation
            are compared.

    Returns:
        Verdict, probability that nothing is missing, and the explanations behind the verdict.
    """
    hypotheses = [hypothesis for hypothesis in hypotheses if hypothesis.compound_deviates or not gap_stays]
    weights = softmax([hypothesis.log_posterior for hypothesis in hypotheses]).tolist()
    small = [not gap_stays and (h.change <= tolerance or not h.key) for h in hypotheses]
    nothing = sum(weight for weight, is_small in zip(weights, small, strict=True) if is_small)
    triples = zip(hypotheses, weights, small, strict=True)
    large = [(h, weight) for h, weight, is_small in triples if not is_small and weight > _NEGLIGIBLE]
    if nothing >= NOTHING or not large:
        return Finding("consistent", nothing, ())
    compositions = compose(large)
    first, leads = compositions[0], _leads(large)
    before = np.cumsum([0.0, *(composition.probability for composition in compositions[:-1])])
    likely = [composition for composition, sum_before in zip(compositions, before, strict=True) if sum_before < NAMED]
    common = frozenset.intersection(*(composition.components for composition in likely))
    unnamed = sum(composition.probability for composition in likely if composition.unnamed)
    if first.components == (common | {"unnamed"} if unnamed > 0.5 else common):
        # all probable explanations have these components, and they have no other common component
        return _verdict_on_components(likely, nothing, leads)
    reported, fits = tuple(likely[:MOST_REPORTED]), first.best.p_value >= DOES_NOT_FIT
    # faulty parts that are certain must be measured again before a verdict on the rest
    if fits and common and all(component.startswith("part: ") for component in common):
        return Finding("unexplained", nothing, reported, leads)
    share = {name: sum(c.probability for c in compositions if name in c.names) for name in first.names}
    names = tuple(name for name in first.names if share[name] >= NAMED)
    nameless = sum(composition.probability for composition in likely if composition.components == {"unnamed"})
    agree = {*names} == {cause for composition in likely for cause in composition.causes}
    if len(likely) <= MOST_REPORTED and nameless < 0.5 and fits and not (names and agree):
        return Finding("ambiguous", nothing, reported, leads, names)
    if names and (first.unnamed or agree) and fits:  # these effects, in addition to faults or an unknown cause
        return Finding("partly", nothing, reported, leads, names)
    return Finding("described", nothing, reported, leads)


def _verdict_on_components(likely: Sequence[Composition], nothing: float, leads: Sequence[str]) -> Finding:
    """Decide the verdict if the components of the most probable explanation have a probability of 97 % or more.

    Args:
        likely: probable explanations, the first with these components.
        nothing: probability that nothing is missing.
        leads: names of effects that reduce the gap but do not explain it.
    """
    first, best, reported = likely[0], likely[0].best, tuple(likely)
    leads = tuple(dict.fromkeys((*first.causes, *leads)))
    fits = best.p_value >= DOES_NOT_FIT
    if fits and (first.may_mislead or not (first.causes or first.unnamed)):
        return Finding("unexplained", nothing, reported, leads)
    curve = best.unnamed not in ("", COMPOUND) and best.last_change >= (1.0 - LEAST_NAMED_SHARE) * best.change
    # a mistake must close the gap without effects of the rig, unless its factor is estimated; effects of the rubber are
    # permitted
    rig_effects = any(get_effect(name).level != Level.MATERIAL for name in best.effects)
    compensated = best.mistake and (rig_effects or best.faulty_parts)
    is_estimated = best.mistake and best.mistake.kind.is_estimated
    if not first.causes or curve or ((compensated or not fits) and not is_estimated):
        return Finding("described", nothing, reported, leads)
    partly = first.unnamed or best.has_level_errors or first.faulty_parts or (best.mistake and best.effects) or not fits
    return Finding("partly" if partly else "named", nothing, reported, leads, first.names)


def _leads(pairs: Sequence[tuple[Hypothesis, float]]) -> tuple[str, ...]:
    """Names of the leads: effects in the most probable hypothesis that are present with a probability of 90 % or more.

    The probability is summed over all hypotheses with the effect. Laws of friction resemble each other, so a hypothesis
    with another law of friction counts as well.

    Args:
        pairs: hypotheses and their posterior probabilities, the most probable first.

    Returns:
        Names; empty if there is no such effect.
    """
    laws = {name: "friction" if get_effect(name).is_friction else name for pair in pairs for name in pair[0].effects}
    share: dict[str, float] = defaultdict(float)
    for hypothesis, weight in pairs:
        for law in {laws[name] for name in hypothesis.effects}:
            share[law] += weight
    total = sum(weight for _, weight in pairs)
    return tuple(name for name in pairs[0][0].effects if share[laws[name]] >= LEAST_NAMED_SHARE * total)


def _components_of(hypothesis: Hypothesis) -> frozenset[_Component]:
    """Components of a hypothesis; hypotheses with equal components are merged into one explanation.

    Effects of the rubber are not listed if a deviation of the compound, another curve without a name, a pattern of
    faulty parts, or errors of levels could imitate them. A deviation, a function of frequency and strain, cannot
    imitate effects of temperature and preload. A curve without a name, or a pattern of faulty parts of the tests, is
    listed only if there is nothing else.
    """
    pattern = is_pattern(hypothesis.faulty_parts)
    nameless = Level.MATERIAL if hypothesis.unnamed or pattern or hypothesis.has_level_errors else None
    separable = () if hypothesis.has_level_errors else _CONDITIONS
    effects = [(name, get_effect(name)) for name in hypothesis.effects]
    listed = [name for name, effect in effects if effect.level != nameless or {*effect.depends_on} & {*separable}]
    components: list[_Component] = [("effect", name) for name in listed]
    if not pattern:
        components += [(f"{_FAULT}{part.family}", part.name) for part in hypothesis.faulty_parts]
        components += [(f"{_FAULT}levels", "")] * hypothesis.has_level_errors
    components += [("mistake", hypothesis.mistake.key)] if hypothesis.mistake else []
    return frozenset(components or ([("unnamed", "")] if pattern or hypothesis.unnamed else []))


def compose(pairs: Sequence[tuple[Hypothesis, float]]) -> list[Composition]:
    """Merge hypotheses with the same components, with or without a smooth deviation of the rubber, into explanations.

    A set of components that is less probable than a subset is merged with the subset; the same holds for a subset of
    the set in which effects are replaced by their limiting cases. Faulty parts of the same kinds are merged.

    Args:
        pairs: hypotheses and their posterior weights, the most probable first.

    Returns:
        Explanations, the most probable first, whose probabilities sum to one.
    """
    best: dict[frozenset[_Component], Hypothesis] = {}
    total, unnamed, merged = (defaultdict[frozenset[_Component], float](float) for _ in range(3))
    for hypothesis, weight in pairs:
        components = _components_of(hypothesis)
        if components not in best or (hypothesis.is_refitted and not best[components].is_refitted):
            best[components] = hypothesis
        total[components] += weight
        unnamed[components] += weight * (bool(hypothesis.unnamed) or is_pattern(hypothesis.faulty_parts))
    order = {chosen: rank for rank, chosen in enumerate(sorted(total, key=lambda chosen: -total[chosen]))}
    for whole in order:
        limit = frozenset((kind, (kind == "effect" and get_effect(name).limit) or name) for kind, name in whole)
        counts = range(1, len(whole) + 1)
        subsets = {frozenset(part) for full in (whole, limit) for count in counts for part in combinations(full, count)}
        merged[min(merged.keys() & subsets, key=order.__getitem__, default=whole)] += total[whole]
    kinds = defaultdict[Hashable, list[frozenset[_Component]]](list)
    for whole in sorted(merged, key=lambda chosen: -merged[chosen]):
        kinds[frozenset((kind, "" if kind.startswith(_FAULT) else name) for kind, name in whole)].append(whole)
    sum_of_weights = sum(merged.values())
    compositions = [
        Composition(
            sum(merged[member] for member in members) / sum_of_weights,
            best[members[0]],
            tuple(name for name in best[members[0]].effects if ("effect", name) in members[0]),
            unnamed[members[0]] > 0.5 * total[members[0]],
        )
        for members in kinds.values()
    ]
    return sorted(compositions, key=lambda composition: -composition.probability)
