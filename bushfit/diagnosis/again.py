"""Does the same name come out again where a part of the tests is not there?

Notes:
    A wrong effect may shrink the gap where it was fitted and where it was not; which effect does so best seldom stays
    the same with every part left out, unless it is the true one, or nearly equal to it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from bushfit.diagnosis.evidence import Evidence, fit
from bushfit.diagnosis.holdout import HoldOut, parts
from bushfit.diagnosis.search import SAME, Search, Step
from bushfit.errors import FitError, ModelError


@dataclass(frozen=True)
class Again:
    """What the search makes of the tests without a part.

    Args:
        came_again: whether every effect that was named leads a set, or stands in one, or all of them together close
            what is left of the gap better than what was found in their place.
        others: effects that lead a set in place of one that was named, other than its look-alikes.
    """

    part: str
    came_again: bool
    others: tuple[str, ...]


def searched_again(search: Search, final: Evidence, steps: Sequence[Step], held: HoldOut) -> list[Again]:
    """The search made anew without each part that was held out, with the same noise, and what comes of it.

    It adds as many effects as were named and looks for no more: what a part less brings beside them is not asked. Each
    candidate starts where all the tests left it, and one that they left far behind is refitted only where its score
    without the part is near or among the best. Where the same effects are added, they came again; else their rivals are
    tried first. Of several effects another name without one part is enough to take them back, and ends it. The search
    goes step by step and may miss what fits the rest best: where what was named does, it came again.
    """
    named, told = {step.name for step in steps}, {part.part for part in held.parts}
    known = {name for step in steps for name in (step.name, *(each.name for each in (*step.rivals, *step.richer)))}
    found = []
    for part in parts(search.base.data_sets):
        if part.name not in told:
            continue
        try:
            rest = fit(search.base.model, part.rest(search.base.data_sets), search.held, search.bounds)
            anew = search.without_part(rest, len(steps))
            grown, added = anew.grow()
            if {*added} == named:
                found.append(Again(part.name, True, ()))
                continue
            other, instead = anew.exchange(grown, added)
            again = anew.steps(other, instead)
            sets = [{step.name, *(rival.name for rival in (*step.rivals, *step.richer))} for step in again]
            every = all(any(name in members for members in sets) for name in named)
            every = every or fit(final.model, rest.data_sets, search.held, search.bounds).bic < other.bic - SAME
        except (FitError, ModelError):
            continue
        others = () if every else tuple(step.name for step, own in zip(again, sets, strict=True) if not own & known)
        found.append(Again(part.name, every, others))
        if others and len(steps) > 1:
            break
    return found
