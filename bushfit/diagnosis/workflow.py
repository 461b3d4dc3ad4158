"""Diagnose a campaign, from the tests to a verdict."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from bushfit.caveat import Caveat
from bushfit.diagnosis.closing import without_assumed_gain_errors
from bushfit.diagnosis.condense import shorten_tests
from bushfit.diagnosis.faulty_parts import outlier_clusters
from bushfit.diagnosis.fits import fit_model
from bushfit.diagnosis.record import Diagnosis, DiagnosisSettings
from bushfit.diagnosis.recording_mistakes import MistakeScreening, correct_adopted, possible_mistakes
from bushfit.diagnosis.report_text import DiagnosisWriter
from bushfit.diagnosis.search import Search
from bushfit.diagnosis.verdict import decide_verdict
from bushfit.effects import effect_name_of, get_effect, place_suffix, qualified_name
from bushfit.effects.mistakes import get_candidate, get_mistake
from bushfit.effects.unnamed import NAME as UNNAMED
from bushfit.errors import FitError, quote_path
from bushfit.fitting.preparation import split_by_kind, with_gain_weighting
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.problem import FitProblem, FitResult
from bushfit.fitting.robust import list_outliers, outlier_warnings, solve_problem
from bushfit.geometry import get_places
from bushfit.model.model import Model
from bushfit.model.result import Outlier

#: Maximum number of rounds of outlier rejection: each may uncover further outliers.
_MAXIMUM_ROUNDS = 4


def diagnose(
    data: PreparedCampaign, model: Model | None = None, settings: DiagnosisSettings | None = None
) -> Diagnosis:
    """Diagnose a campaign: find regions where model and measurement disagree, name missing effects and add them.

    Args:
        data: campaign with prepared tests; all directions are used.
        model: starting model, whose effects are kept and whose values are refitted; None for the branches elastic,
            springpot and friction and the effects of [fit].
        settings: limits, and effects to adopt or to leave out; None for the defaults.

    Returns:
        The verdict with its reasons, the misfit before and after, and the model to use.

    Raises:
        FitError: no test, or data that cannot support the fit.
        ModelError: an unknown effect or mistake to adopt or to leave out.
    """
    settings = settings or DiagnosisSettings()
    for name in (*settings.adopt, *settings.without):
        get_candidate(name)
        if place := place_suffix(name):
            get_places(place, data.campaign.specimens)
    data, messages = correct_adopted(data, [name for name in settings.adopt if get_mistake(name)])
    excluded: tuple[Outlier, ...] = ()
    fixed = [name for name, setting in data.campaign.fit.parameters.items() if not setting.vary]
    refit = partial(_initial_fit, model=model, settings=settings, fixed=fixed)
    for _ in range(_MAXIMUM_ROUNDS):  # single outliers of sweeps, which repeats and neighbours contradict
        try:
            base, start, outliers = refit(data)
        except FitError as error:
            thousands = [mistake for mistake in possible_mistakes(data, settings.without) if mistake.kind.scales]
            for mistake in MistakeScreening(data).best(thousands, 1):
                adopted = " --adopt ".join(map(quote_path, mistake.labels))
                error.hint = f"probable mistake in the record: {mistake.sentence}; --adopt {adopted} corrects it"
            raise
        known_rows = {(outlier.test, outlier.row) for outlier in excluded}  # a robust fit finds them anew
        candidates = (*outliers, *list_outliers(base.model, split_by_kind(base.data_sets)[1]))
        wild = tuple(outlier for outlier in candidates if (outlier.test, outlier.row) not in known_rows)
        if not wild:
            break
        data, excluded = data.without(wild), (*excluded, *wild)
    whole, (data, reductions) = data, shorten_tests(data)
    if reductions:
        base, start, outliers = refit(data)
    clusters = outlier_clusters(excluded, whole.sweeps, base.model)
    search = Search(data, base, lambda mended: refit(mended)[0], settings, start, clusters)
    hypotheses = search.run()
    finding = decide_verdict(hypotheses, settings.tolerance)
    diagnosis = DiagnosisWriter(search, finding, hypotheses, without_assumed_gain_errors(base, data)).diagnosis()
    pairs = zip(whole.sweeps, data.sweeps, strict=True)
    reduced = {after.name for before, after in pairs if after.size < before.size}
    counts = Counter(outlier.test for outlier in outliers if outlier.test in reduced)
    deviating = "of these points are left out, because they deviate by more than noise"
    left_out = (Caveat("outlying_means", f"{count} {deviating}").about(name) for name, count in counts.items())
    of_loops = list_outliers(diagnosis.result.model, data.loops)
    warnings = (*outlier_warnings(of_loops, robust=data.robust), *outlier_warnings(excluded, robust=True))
    notes = (*messages, *reductions, *left_out, *diagnosis.notes, *data.assumptions, *warnings)
    result = replace(
        diagnosis.result,
        outliers=(*of_loops, *excluded),
        warnings=(*messages, *diagnosis.result.warnings, *data.preload_notes, *warnings),
        specimens=data.campaign.specimens,
    )
    return replace(diagnosis, notes=notes, result=result)


def _initial_fit(
    data: PreparedCampaign, model: Model | None, settings: DiagnosisSettings, fixed: Sequence[str]
) -> tuple[FitResult, dict[str, float], tuple[Outlier, ...]]:
    """Fit the starting model with the adopted effects; gain errors of loops have the stated or an assumed size.

    Args:
        data: campaign with prepared tests.
        model: starting model; None for the branches elastic, springpot and friction and the effects of [fit].
        settings: settings of the diagnosis, with the effects to adopt.
        fixed: names of parameters that are not fitted.

    Returns:
        The fit, starting values by parameter that were estimated from the data, and the points that a robust fit left
        out.
    """
    hint = "add measured tests to the campaign"
    data_sets = data.require_tests(data.data_sets, "there is nothing to diagnose", hint)
    start = data.start_values(data_sets)
    model = replace(model or data.starting_model(data.effects, data_sets), constraints=data.constraints)
    if settings.adopt:
        model = model.without(UNNAMED)  # a correction of an earlier diagnosis contains what is adopted now
    start = {name: value for name, value in start.items() if name in model.values and name not in fixed}
    for name in settings.adopt:
        if get_mistake(name) is None and name not in (model := model.with_twin(name)).effects:
            # at a tenth of its typical size: at its neutral value a fit may not see it
            amount = (effect := get_effect(name)).amount
            initial_values = {} if effect.replaces else {qualified_name(effect, amount): amount.value_at_share(0.1)}
            model = model.with_effect(name, initial_values)
    stated_values = data.given_values.items()
    model = model.with_values({name: value for name, value in stated_values if effect_name_of(name) in settings.adopt})
    outliers: tuple[Outlier, ...] = ()
    if data.robust:
        robust = solve_problem(FitProblem.with_fixed(model, data_sets, fixed, data.bounds), robust=True)
        outliers, data_sets = robust.outliers, robust.data_sets
    data_sets = [data_set.with_weight() for data_set in with_gain_weighting(data_sets, weigh=True)]
    return fit_model(model, data_sets, fixed, data.bounds), start, outliers
