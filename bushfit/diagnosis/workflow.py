"""diagnose: from a campaign to a verdict."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bushfit.diagnosis.claims import adopted
from bushfit.diagnosis.evidence import Evidence, fit_from
from bushfit.diagnosis.mistakes import mistaken
from bushfit.diagnosis.record import Diagnosis, Settings
from bushfit.diagnosis.refit import can_reach
from bushfit.diagnosis.search import Search
from bushfit.diagnosis.verdict import judge
from bushfit.effects import effect_named, qualified
from bushfit.effects.mistakes import candidate_named, mistake_named
from bushfit.fitting.data import Data
from bushfit.fitting.robust import estimate, outliers_at, told
from bushfit.model.model import Model
from bushfit.model.result import Outlier


def diagnose(data: Data, model: Model | None = None, settings: Settings | None = None) -> Diagnosis:
    """Find where model and measurement disagree, name what is missing, add it, and show the gap shrink.

    Args:
        data: the campaign; all directions are used.
        model: where to start; the paper's three branches, and what [fit] adds, unless told. Its effects are kept, its
            values refitted.
        settings: limits, and what to adopt or to leave out.

    Raises:
        FitError: no test, or data that cannot support the fit.
        ModelError: an unknown effect or mistake to adopt or to leave out.
    """
    settings = settings or Settings()
    for name in (*settings.adopt, *settings.without):
        candidate_named(name)
    mended = [name for name in settings.adopt if mistake_named(name)]
    data, said = adopted(data, mended)
    begun = _begin(data, model, settings)
    search = Search.begin(begun.evidence, settings, begun.start, begun.held, data.bounds)
    found = None if search.matters else judge(search, search.base, ())
    if found is None or found.verdict != "consistent":
        told_wrong = mistaken(search, data, lambda mended, goal: _begin(mended, model, settings, goal).evidence)
        found = told_wrong or found or judge(search, *search.reconsider(*search.grow()))
    outliers = begun.outliers if data.robust else outliers_at(found.result.model, search.base.data_sets)
    notes = (*said, *found.notes, *told(outliers, robust=data.robust))
    warnings = (*said, *found.result.warnings)
    result = replace(found.result, outliers=outliers, warnings=warnings, specimens=data.campaign.specimens)
    return replace(found, notes=notes, result=result)


class _Begun(NamedTuple):
    """A model fitted to all tests of a campaign before the search adds anything, and the start of the paper's own."""

    evidence: Evidence
    start: dict[str, float]
    held: list[str]
    outliers: tuple[Outlier, ...]


def _begin(data: Data, model: Model | None, settings: Settings, goal: float = np.inf) -> _Begun:
    """Fit the model as it came, with the effects that the user adopts; no further than it may come below a goal of
    chi-square."""
    hint = "add measured tests to the campaign"
    data_sets = data.some([*data.loops, *data.sweeps], "there is nothing to diagnose", hint)
    held = [name for name, setting in data.campaign.fit.parameters.items() if not setting.vary]
    start = data.start(data_sets, {})
    model = model or Model.started(data.campaign.bushing, data.effects, start)
    start = {name: value for name, value in start.items() if name in model.values and name not in held}
    for name in settings.adopt:
        if mistake_named(name) is None and name not in model.effects:
            # at a tenth of its typical size: at its neutral value a fit may not see it
            amount = (effect := effect_named(name)).amount
            model = model.with_effect(name, {qualified(effect, amount): amount.sized(0.1)})
    outliers: tuple[Outlier, ...] = ()
    if data.robust:
        names = [name for name in model.parameters if name not in held]
        robust = estimate(model, data_sets, names, data.bounds, robust=True)
        outliers, data_sets = robust.outliers, [data_set.standing() for data_set in robust.data_sets]
    descent = fit_from(model, data_sets, held, data.bounds)
    while can_reach(descent, goal):
        descent = descent.stepped()
    return _Begun(Evidence(descent.solution, tuple(data_sets)), start, held, outliers)
