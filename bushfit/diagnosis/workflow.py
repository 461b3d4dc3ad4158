"""diagnose: from a campaign to a verdict."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bushfit.diagnosis.claims import adopted
from bushfit.diagnosis.condense import condensed
from bushfit.diagnosis.evidence import Evidence, fit_from
from bushfit.diagnosis.locate import largest_smooth_misfit
from bushfit.diagnosis.mistakes import mistaken
from bushfit.diagnosis.record import Diagnosis, Settings
from bushfit.diagnosis.refit import can_reach
from bushfit.diagnosis.search import Search
from bushfit.diagnosis.verdict import consistent, find_remainder, is_consistent, judge
from bushfit.effects import effect_named, qualified
from bushfit.effects.mistakes import candidate_named, mistake_named
from bushfit.fitting.data import Data
from bushfit.fitting.data_sets import parted
from bushfit.fitting.levels import LevelErrors, level_errors
from bushfit.fitting.rig_class import class_words, largest_error, words_of
from bushfit.fitting.robust import estimate, outliers_at, told
from bushfit.model.model import Model
from bushfit.model.result import Outlier

#: Rounds of looking for wild points at most: each may uncover others beside those left out.
_MOST_ROUNDS = 4
#: Smooth misfit of the model that growth ended with, relative to |K| or to half a loop's force range, beyond which its
#: effects are not exchanged, if it is more than chance; chosen: of 731 searches, 54 left more, and no exchange brought
#: one of these below a tolerance of 1 %, nor any that left more than 4.5 %.
_BEYOND_EXCHANGE = 0.05
#: Largest error of a level, in units of the largest standard deviation that counts as the rig's; chosen: between the
#: 2.1 % that errors of 1 % made of one clean campaign and the 2.5 % that a wrong label made of another.
_MOST_ERRORS = 1.5
#: The same, beyond which a level is a fault though few levels tell such errors; chosen: of one that is normal and as
#: large as that standard deviation, one in 16,000 goes so far.
_NO_RIG = 4.0


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
    data, begun, left = _without_wild(data, model, settings)
    whole, (data, fewer) = data, condensed(data)
    if fewer:
        begun = _begin(data, model, settings)
    searched = _search(data, begun, model, settings)
    errors = _errors_beside(searched, data)
    if errors is not None:
        data = data.with_level_errors(errors.error, errors.freedom)
        begun = _begin(data, model, settings)
        searched = _search(data, begun, model, settings, searched.search)
    fewer += _left_out_of_fewer(whole, data, begun.outliers)
    found = searched.finding
    shared = [_level_words(data, found)] if errors is not None else data.assumed
    of_loops = outliers_at(found.result.model, data.loops)
    outliers = (*told(of_loops, robust=data.robust), *told(left, robust=True))
    notes = (*said, *fewer, *found.notes, *shared, *outliers)
    warnings = (*said, *found.result.warnings, *outliers)
    result = replace(found.result, outliers=(*of_loops, *left), warnings=warnings, specimens=data.campaign.specimens)
    return replace(found, notes=notes, result=result)


class _Searched(NamedTuple):
    """What the search made of tests whose noise is known.

    Args:
        best: the best that the library can do with these tests; None where nothing is missing.
        added: the effects that it added.
        told: the finding, where nothing is missing or a mistake in the record explains the gap.
    """

    search: Search
    best: Evidence | None
    added: Sequence[str] = ()
    told: Diagnosis | None = None

    @property
    def finding(self) -> Diagnosis:
        """The verdict, once the noise is settled."""
        return self.told or judge(self.search, self.best or self.search.base, self.added)


def _search(
    data: Data, begun: _Begun, model: Model | None, settings: Settings, earlier: Search | None = None
) -> _Searched:
    """Look for effects and mistakes in tests whose noise is known."""
    most = _NO_RIG * max(largest_error(data.campaign.rig))
    fitted, start, held = begun.evidence, begun.start, begun.held
    search = Search.begin(fitted, settings, start, held, data.bounds, earlier, most_of_level=most)
    if is_consistent(search):
        return _Searched(search, None, told=consistent(search))
    told_wrong = mistaken(search, data, lambda mended, goal: _begin(mended, model, settings, goal).evidence)
    if told_wrong:
        return _Searched(search, told_wrong.after, told=told_wrong)
    if not search.matters:
        best = search.first.best
        return _Searched(search, best.evidence if best else search.base)
    grown, added = search.grow()
    if largest_smooth_misfit(grown) > max(_BEYOND_EXCHANGE, settings.tolerance):
        remainder = find_remainder(search, grown)
        if remainder and not remainder.fault:
            return _Searched(search, grown, added)
    return _Searched(search, *search.exchange(grown, added))


def _errors_beside(searched: _Searched, data: Data) -> LevelErrors | None:
    """Errors of each level beside the best that the library can do, where they matter; in its place, where they do as
    well alone.

    Notes:
        Effects were chosen among many, in many shapes, and each such choice gains 2 ln(shapes) by chance.
    """
    search, first, best = searched.search, searched.search.first, searched.best
    if best is None:
        return None
    beside, alone = _level_errors(best, search, data), _level_errors(first.evidence, search, data)
    shapes = sum(len(claim.columns) for claim in first.proposed)
    ahead = first.evidence.bic - best.bic + beside.gain - alone.gain
    found = alone if alone.matters and ahead < 2.0 * np.log(max(shapes, 1)) * len(searched.added) else beside
    return found if found.matters else None


def _level_errors(evidence: Evidence, search: Search, data: Data) -> LevelErrors:
    """Errors of each level that would explain what a model leaves, but for what the worst single level makes of it
    where that is more than such errors do."""
    absorbed, most = evidence.solution.jacobian, largest_error(data.campaign.rig)
    levels = [fault for fault in search.faults(evidence).places if fault.suspect.kind != "repeat"]
    worst = max(levels, key=lambda fault: fault.worth, default=None)
    if worst and worst.size > _MOST_ERRORS * max(most):
        absorbed = np.concatenate((absorbed, worst.suspect.columns))
    return level_errors(evidence.data_sets, evidence.residual, absorbed, most)


def _level_words(data: Data, found: Diagnosis) -> str:
    """What is said of errors of the levels that the tests ask for."""
    noise = data.sweeps[0].noise
    whose = (
        "each level, which repeats do not show," if noise.origin == "repeats" else "each run, which was not repeated,"
    )
    does = {
        "consistent": "explains what is left",
        "unexplained": "counts as noise, and still a gap is left",
    }.get(found.verdict, "counts as noise beside what was found")
    limit = f"3 times the class of the rig at most: {class_words(data.campaign.rig)}"
    return f"an error of {words_of(noise.level)} of {whose} {does} ({limit})"


def _left_out_of_fewer(whole: Data, fewer: Data, outliers: Sequence[Outlier]) -> tuple[str, ...]:
    """A sentence on each sweep that was condensed and of whose points a robust fit then left some out."""
    pairs = zip(whole.sweeps, fewer.sweeps, strict=True)
    changed = {after.name for before, after in pairs if after.size < before.size}
    counts = Counter(outlier.test for outlier in outliers if outlier.test in changed)
    return tuple(f"{name}: {count} of these points left out, farther off than noise" for name, count in counts.items())


def _without_wild(data: Data, model: Model | None, settings: Settings) -> tuple[Data, _Begun, tuple[Outlier, ...]]:
    """The campaign with no weight on single points of sweeps that repeats and neighbours speak against, its fit, and
    these points: a row that went wrong is neither physics nor a fault of the rig."""
    left: tuple[Outlier, ...] = ()
    for _ in range(_MOST_ROUNDS):
        begun = _begin(data, model, settings)
        known = {(outlier.test, outlier.row) for outlier in left}  # a robust fit finds them anew
        found = (*begun.outliers, *outliers_at(begun.evidence.model, parted(begun.evidence.data_sets)[1]))
        wild = tuple(outlier for outlier in found if (outlier.test, outlier.row) not in known)
        if not wild:
            break
        data, left = data.without(wild), (*left, *wild)
    return data, begun, left


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
        if mistake_named(name) is None and name not in (model := model.with_twin(name)).effects:
            # at a tenth of its typical size: at its neutral value a fit may not see it
            amount = (effect := effect_named(name)).amount
            little = {} if effect.replaces else {qualified(effect, amount): amount.sized(0.1)}
            model = model.with_effect(name, little)
    outliers: tuple[Outlier, ...] = ()
    if data.robust:
        names = [name for name in model.parameters if name not in held]
        robust = estimate(model, data_sets, names, data.bounds, robust=True)
        outliers, data_sets = robust.outliers, robust.data_sets
    data_sets = [data_set.standing() for data_set in data_sets]
    descent = fit_from(model, data_sets, held, data.bounds)
    while can_reach(descent, goal):
        descent = descent.stepped()
    return _Begun(Evidence(descent.solution, tuple(data_sets)), start, held, outliers)
