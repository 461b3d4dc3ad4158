"""diagnose: from a campaign to a verdict."""

from __future__ import annotations

from dataclasses import replace

from bushfit.diagnosis.evidence import fit
from bushfit.diagnosis.record import Diagnosis, Settings
from bushfit.diagnosis.search import Search
from bushfit.diagnosis.verdict import judge
from bushfit.effects import effect_named, qualified
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
        settings: limits, and effects to adopt or to leave out.

    Raises:
        FitError: no test, or data that cannot support the fit.
        ModelError: an unknown effect to adopt or to leave out.
    """
    settings = settings or Settings()
    for name in (*settings.adopt, *settings.without):
        effect_named(name)
    hint = "add measured tests to the campaign"
    data_sets = data.some([*data.loops, *data.sweeps], "there is nothing to diagnose", hint)
    held = [name for name, setting in data.campaign.fit.parameters.items() if not setting.vary]
    start = data.start(data_sets, {})
    model = model or Model.started(data.campaign.bushing, data.effects, start)
    start = {name: value for name, value in start.items() if name in model.values and name not in held}
    for name in settings.adopt:
        if name not in model.effects:  # at a tenth of its typical size: at its neutral value a fit may not see it
            amount = (effect := effect_named(name)).amount
            model = model.with_effect(name, {qualified(effect, amount): amount.sized(0.1)})
    outliers: tuple[Outlier, ...] = ()
    if data.robust:
        names = [name for name in model.parameters if name not in held]
        robust = estimate(model, data_sets, names, data.bounds, robust=True)
        outliers, data_sets = robust.outliers, [data_set.standing() for data_set in robust.data_sets]
    search = Search.begin(fit(model, data_sets, held, data.bounds), settings, start, held, data.bounds)
    grown, added = search.grow()
    found = judge(search, *search.reconsider(grown, added))
    if not data.robust:
        outliers = outliers_at(found.after.model, found.after.data_sets)
    notes = (*found.notes, *told(outliers, robust=data.robust))
    result = replace(found.result, outliers=outliers, specimens=data.campaign.specimens)
    return replace(found, notes=notes, result=result)
