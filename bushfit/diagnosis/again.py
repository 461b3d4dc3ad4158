"""Does the same name come out again where a part of the tests is not there?

Notes:
    A wrong effect may shrink the gap where it was fitted and where it was not; which effect does so best seldom stays
    the same with every part left out, unless it is the true one, or nearly equal to it.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

from bushfit.diagnosis.evidence import Evidence, fit, fit_from
from bushfit.diagnosis.holdout import HoldOut, Part, parts
from bushfit.diagnosis.refit import comes_below
from bushfit.diagnosis.search import SAME, Search, Step
from bushfit.errors import FitError, ModelError


@dataclass(frozen=True)
class Again:
    """What the search makes of the tests without a part.

    Args:
        came_again: whether every effect that was named leads a set, or stands in one, or all of them together close
            what is left of the gap better, by more than chance, than what was found in their place.
        others: effects that lead a set in place of one that was named, other than its look-alikes.
    """

    part: str
    came_again: bool
    others: tuple[str, ...]


def searched_again(search: Search, final: Evidence, steps: Sequence[Step], held: HoldOut) -> list[Again]:
    """The search made anew without each part that was held out, with the same noise, and what comes of it.

    Of several effects another name without one part is enough to take them back, and ends it.
    """
    told, found = {part.part for part in held.parts}, list[Again]()
    for part in parts(search.base.data_sets):
        if part.name in told:
            with suppress(FitError, ModelError):
                found.append(_without(part, search, final, steps))
                if found[-1].others and len(steps) > 1:
                    break
    return found


def _without(part: Part, search: Search, final: Evidence, steps: Sequence[Step]) -> Again:
    """What the search makes of the tests without a part.

    It adds as many effects as were named and looks for no more: what a part less brings beside them is not asked. Each
    candidate starts where all the tests left it, and one that they left far behind is refitted only where its score
    without the part is near or among the best. Where the same effects are added, they came again, and so they did where
    they fit the rest better than what was added and nothing comes near them: the search goes step by step and may miss
    the best. Else rivals are tried in place of what was added, or of what was named if that fits better.

    Raises:
        FitError: fewer data than parameters.
        ModelError: no response.
    """
    named, came_again = [step.name for step in steps], Again(part.name, True, ())
    rest = fit(search.base.model, part.rest(search.base.data_sets), search.held, search.bounds)
    anew = search.without_part(rest, len(steps))
    found, added = anew.grow()
    if {*added} == {*named}:
        return came_again
    same = fit(final.model, rest.data_sets, search.held, search.bounds)
    if same.bic < found.bic - SAME:
        if not _is_challenged(same, search, steps):
            return came_again
        found, added = same, named
    found, added = anew.exchange(found, added)
    if {*added} == {*named}:
        return came_again
    again, known = anew.steps(found, added), {name for step in steps for name in _set(step)}
    every = {*named} <= {name for step in again for name in _set(step)} or same.bic < found.bic - SAME
    others = () if every else tuple(step.name for step in again if not known & {*_set(step)})
    return Again(part.name, every, others)


def _is_challenged(same: Evidence, search: Search, steps: Sequence[Step]) -> bool:
    """Whether the tests without a part like the model as well with a rival in place of an effect that was named, other
    than its look-alikes, or without the effect; each is refitted from where all the tests left it.

    Args:
        same: the model with what was named, fitted to the tests without the part.
    """
    for step in steps:
        rivals = (each.evidence.model for each in step.place.tried if each.name not in _set(step))
        for model in (*rivals, step.place.evidence.model):
            with suppress(FitError, ModelError):  # no response without the part: no rival
                begun = fit_from(model, same.data_sets, search.held, search.bounds)
                if comes_below(begun, same.bic + SAME - len(begun.coordinates.names) * same.penalty):
                    return True
    return False


def _set(step: Step) -> list[str]:
    """An effect with all that these tests cannot tell from it."""
    return [step.name, *(rival.name for rival in (*step.rivals, *step.richer))]
