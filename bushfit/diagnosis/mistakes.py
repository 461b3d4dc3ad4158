"""Is the record mistaken? The best claims are refitted, and weighed against every effect and every fault."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from bushfit.diagnosis.claims import Claim, Screen, claims
from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.holdout import hold_out
from bushfit.diagnosis.locate import locate
from bushfit.diagnosis.record import Diagnosis, Judged, Named
from bushfit.diagnosis.refit import EXCLUDED, Candidate
from bushfit.diagnosis.search import SAME, Search, critical_gain
from bushfit.diagnosis.verdict import finish, is_consistent, worst_fault
from bushfit.effects import effect_named, qualified
from bushfit.errors import FitError, ModelError
from bushfit.fitting.data import Data
from bushfit.units import number

#: Claims that are refitted at most, those first under which the tests could agree best; chosen for time: the truth
#: ranks second at worst on the score card.
_MOST_REFITTED = 4

#: Fits the model to a campaign that may have been mended, no further than it may come below a chi-square.
Fitted = Callable[[Data, float], Evidence]


@dataclass(frozen=True, eq=False)
class Weighed:
    """A claim, the fit to the tests as it would have them, and the price of having looked at so many claims."""

    claim: Claim
    evidence: Evidence
    price: float

    @property
    def bic(self) -> float:
        return self.evidence.bic + self.price


def mistaken(search: Search, data: Data, fitted: Fitted) -> Diagnosis | None:
    """The finding where a mistake in the record explains the whole gap; None where none does.

    Notes:
        Two effects cost more by BIC than a claim and the margin by which candidates count as one set, and a claim that
        closes the gap leaves nothing that they could gain: so it need only be weighed against single effects. One whose
        free factor makes the claim at one value has to be better by the margin: else the claim is the simpler name.
        Where a gap is slight, a claim may close it by chance: it has to gain more than chance makes of the best effect,
        if these tests could show any.
    """
    fault, effect = worst_fault(search, search.base), search.first.real
    rivals = {effect.name: effect.evidence.bic} if effect else {}
    rivals |= {f"fault: {fault.suspect.words}": search.base.bic - fault.worth} if fault else {}
    weighed = _weighed(search, data, fitted, min(rivals.values(), default=search.base.bic) + SAME)
    if not weighed:
        return None
    largest = critical_gain(search.base, search.first.proposed, known=True)
    chance = largest if np.isfinite(largest) else 0.0
    near = (one for one in weighed if one.bic < weighed[0].bic + SAME and _taken(search, one) > chance)
    closing = [one for one in near if _closes(one.evidence, search)]
    if not closing:
        return None
    free = (effect.name,) if effect and _frees(effect, closing[0].claim) else ()
    rivals |= {name: rivals[name] + 2.0 * SAME for name in free}
    others = [name for name, bic in rivals.items() if bic < closing[0].bic + SAME]
    closing.sort(key=lambda one: len(one.claim.tests))
    if others or len(closing) > 1:
        told = _doubtful(search, data, closing, others)
    else:
        told = _told(search, data, closing[0], [one for one in weighed if one is not closing[0]], free)
    candidates = [*told.candidates, *_judged(search, data, weighed, closing, chance)]
    return replace(told, candidates=tuple(sorted(candidates, key=lambda judged: -judged.score)))


def _frees(effect: Candidate, claim: Claim) -> bool:
    """Whether one value of the effect's amount makes the claim: it acts in all tests of the claim, and in no other."""
    record, model = effect_named(effect.name), effect.evidence.model
    if claim.mistake.name not in record.frees:
        return False
    without = model.with_values({qualified(record, record.amount): record.amount.neutral or 0.0})
    moved = [each.residual(model) - each.residual(without) for each in effect.evidence.data_sets]
    return {place for place, change in enumerate(moved) if change.any()} == {*claim.tests}


def _weighed(search: Search, data: Data, fitted: Fitted, goal: float) -> list[Weighed]:
    """The most promising claims, refitted, that come below a goal of BIC; the best first."""
    listed = claims(data, search.settings.without)
    price = 2.0 * float(np.log(max(len(listed), 1)))
    done = []
    for claim in Screen(data).best(listed, _MOST_REFITTED):
        with suppress(FitError, ModelError):  # tests that nothing can be fitted to as mended
            evidence = fitted(claim.mended(data), goal - price - search.base.bic + search.base.chi_square)
            if [data_set.size for data_set in evidence.data_sets] == [d.size for d in search.base.data_sets]:
                done.append(Weighed(claim, evidence, price))
    return sorted((one for one in done if one.bic < goal), key=lambda one: one.evidence.bic)


def _closes(evidence: Evidence, search: Search) -> bool:
    """Whether nothing is missing beyond noise and tolerance in mended tests."""
    return is_consistent(search.anew(evidence))


def _named(
    data: Data, claim: Claim, evidence: str, alternatives: Sequence[str] = (), richer: Sequence[str] = ()
) -> list[Named]:
    """An entry for each test of a claim."""
    told = (evidence, tuple(alternatives), tuple(richer))
    return [
        Named(one.mistake.name, *told, one.test(data), one.words(data), one.corrections(data)[0]) for one in claim.each
    ]


def _taken(search: Search, one: Weighed) -> float:
    """What a claim takes off chi-square."""
    return search.base.chi_square - one.evidence.chi_square


def _gain(search: Search, one: Weighed) -> str:
    return f"takes {_taken(search, one):.0f} off chi-square without a parameter"


def _told(search: Search, data: Data, one: Weighed, behind: Sequence[Weighed], richer: Sequence[str]) -> Diagnosis:
    """The finding that names one mistake: the gap shrinks if it was made; the model stays as it was.

    Args:
        richer: effects whose free factor makes the claim at one value.
    """
    evidence = _gain(search, one)
    if behind:
        next_best = f"{' + '.join(behind[0].claim.labels(data))}, {number(behind[0].bic - one.bic, 3)} behind by BIC"
        evidence += f"; next best of the record {next_best}"
    command = " ".join(["bushfit diagnose CAMPAIGN", *(f"--adopt {name}" for name in one.claim.labels(data))])
    advice = f"if the records of the tests bear it out, {'; '.join(one.claim.corrections(data))} (or {command})"
    if_so = f"agree if {one.claim.words(data)}"
    names = _named(data, one.claim, evidence, richer=richer)
    diagnosis = finish(search, "named", f"these tests {if_so}", search.base, names, next_test=advice)
    warning = f"fitted to the tests as they are, which only {if_so}: {advice}"
    return replace(
        diagnosis,
        after=one.evidence,
        remainder=locate(one.evidence),
        holdout=hold_out(search.base, one.evidence, search.bounds),
        result=replace(diagnosis.result, warnings=(*diagnosis.result.warnings, warning)),
    )


def _doubtful(search: Search, data: Data, closing: Sequence[Weighed], others: Sequence[str]) -> Diagnosis:
    """The finding where several claims, or a claim and an effect or a fault, explain the tests alike."""
    rivals = [" + ".join(one.claim.labels(data)) for one in closing[1:]] + list(others)
    words = f"these tests agree if {', or if '.join(dict.fromkeys(one.claim.words(data) for one in closing))}"
    words += f"; {' or '.join(others)} explains them as well" if others else ""
    names = _named(data, closing[0].claim, _gain(search, closing[0]), rivals)
    lines = "; or ".join("; ".join(one.claim.corrections(data)) for one in closing)
    return finish(
        search, "ambiguous", words, search.base, names, next_test=f"look into the records of the tests; {lines}"
    )


def _judged(
    search: Search, data: Data, weighed: Sequence[Weighed], closing: Sequence[Weighed], chance: float
) -> list[Judged]:
    """Every claim that was refitted, and why it won or lost; `chance` alone can make so much."""
    base, judged = search.base, []
    for one in weighed:
        gain = _taken(search, one)
        far = one.evidence.chi_square > weighed[0].evidence.chi_square + EXCLUDED
        lost = "does not close the gap, or an effect does better"
        lost = lost if gain > chance else f"gain below {number(chance, 3)}, which chance alone can make"
        lost = "far behind the best of the record" if far else lost
        why = "closes the gap" if one in closing else lost
        held = hold_out(base, one.evidence, search.bounds).after
        judged.append(Judged(" + ".join(one.claim.labels(data)), gain, gain, base.bic - one.bic, held, {}, why))
    return judged
