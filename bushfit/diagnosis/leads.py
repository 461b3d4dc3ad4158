"""Leads where the model misses the tests grossly: which effects would bring it nearest, every test counting alike.

Notes:
    Where a model is off by many times the noise, the most precise points decide what is added, though no model here
    meets them. So each test is given the noise that the plain model's own misfit suggests, and the search is made anew.
    What it finds is no name: with so much noise nearly every effect that helps is let pass.
"""

import numpy as np

from bushfit.diagnosis.evidence import Evidence, fit
from bushfit.diagnosis.search import Search
from bushfit.errors import FitError, ModelError
from bushfit.units import number

#: Misfit of the plain model, relative to |K| or to half a loop's force range, from which leads are looked for: chosen,
#: beyond what any effect is left unnoticed at.
_GROSS = 0.04
#: Rounds of weighing tests by what the model misses of them: chosen, they then agree within a tenth.
_ROUNDS = 3
#: Share of the misfit that leads may leave: chosen, less help is no lead.
_LEFT = 0.75


def leads(search: Search) -> str:
    """The effects that bring a model nearest that misses the tests grossly, in words; "" where it does not, or none.

    Both misfits are root mean squares relative to |K| or to half a loop's force range, every test counting alike.
    """
    if plain_misfit(search.base) < _GROSS:
        return ""
    try:
        begun = _weighed(search)
        anew = search.anew(begun)
        final, added = anew.exchange(*anew.grow())
    except (FitError, ModelError):  # a model of which these tests tell nothing
        return ""
    before, after = plain_misfit(begun), plain_misfit(final)
    if not added or after > _LEFT * before:
        return ""
    steps = anew.steps(final, added)
    sets = " and ".join(" or ".join((step.name, *(rival.name for rival in step.rivals))) for step in steps)
    sizes = f"{number(100.0 * before, 2)} to {number(100.0 * after, 2)} %"
    return f"; no more than leads, every test weighed by what is missed of it: {sets} bring the model from {sizes} off"


def plain_misfit(evidence: Evidence) -> float:
    """Root mean square misfit relative to |K| or to half a loop's force range, every test counting alike."""
    each = [np.mean(np.square(data_set.relative(evidence.model))) for data_set in evidence.data_sets]
    return float(np.sqrt(np.mean(each)))


def _weighed(search: Search) -> Evidence:
    """The plain model fitted to the tests with as much noise as it misses them by."""
    evidence = search.base
    for _ in range(_ROUNDS):
        missed = [float(np.mean(np.square(each.residual(evidence.model)))) for each in evidence.data_sets]
        tests = [
            each.weighted(np.full(each.size // each.parts, 1.0 / max(size, 1.0)))
            for each, size in zip(evidence.data_sets, missed, strict=True)
        ]
        evidence = fit(evidence.model, tests, search.held, search.bounds)
    return evidence
