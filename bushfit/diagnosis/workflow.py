"""diagnose: from a campaign to a verdict."""

from __future__ import annotations

from dataclasses import replace

from bushfit.diagnosis.close import Search
from bushfit.diagnosis.evidence import fit
from bushfit.diagnosis.record import Diagnosis, Settings
from bushfit.diagnosis.verdict import judge
from bushfit.effects import BASE, effect_named
from bushfit.errors import FitError
from bushfit.fitting.data import Data
from bushfit.fitting.robust import estimate, outliers_at, told
from bushfit.fitting.starts import start_values
from bushfit.fitting.terms import SweepTerm, Term
from bushfit.model import Model
from bushfit.results import Outlier


def diagnose(data: Data, model: Model | None = None, settings: Settings | None = None) -> Diagnosis:
    """Find where model and measurement disagree, name what is missing, add it, and show the gap shrink.

    Args:
        data: the campaign; all directions are used.
        model: where to start; the paper's three branches unless told. Its effects are kept, its values refitted.
        settings: limits, and effects to adopt or to leave out.

    Raises:
        FitError: no test, or data that cannot support the fit.
        ModelError: an unknown effect to adopt or to leave out.
    """
    settings = settings or Settings()
    for name in (*settings.adopt, *settings.without):
        effect_named(name)
    terms: list[Term] = [*data.loops, *data.sweeps]
    if not terms:
        raise FitError(
            "there is nothing to diagnose",
            file=data.campaign.path,
            found="no [[loops]] and no [[sweeps]]",
            hint="add measured tests to the campaign",
        )
    held = [name for name, setting in data.campaign.fit.parameters.items() if not setting.vary]
    start = {**start_values(data.campaign.bushing, terms, {}), **data.given}
    model = model or Model.started(data.campaign.bushing, BASE, start)
    start = {name: value for name, value in start.items() if name in model.values and name not in held}
    for name in settings.adopt:
        model = model if name in model.effects else _adopted(model, name)
    outliers: tuple[Outlier, ...] = ()
    if data.robust:
        names = [name for name in model.parameters if name not in held]
        robust = estimate(model, terms, names, data.bounds, robust=True)
        outliers, terms = robust.outliers, [_standing(term) for term in robust.terms]
    search = Search.begin(fit(model, terms, held, data.bounds), settings, start, held, data.bounds)
    grown, added = search.grow()
    found = judge(search, *search.reconsider(grown, added))
    if not data.robust:
        outliers = outliers_at(found.after.model, found.after.terms)
    notes = (*found.notes, *told(outliers, robust=data.robust))
    return replace(found, notes=notes, result=replace(found.result, outliers=outliers))


def _standing(term: Term) -> Term:
    return term.standing() if isinstance(term, SweepTerm) else term


def _adopted(model: Model, name: str) -> Model:
    """The model with an effect at a tenth of its typical size: at its neutral value a fit may not see it."""
    amount = next(parameter for parameter in effect_named(name).parameters if parameter.neutral is not None)
    return model.with_effect(name, {f"{name}.{amount.name}": 0.1 * amount.typical})
