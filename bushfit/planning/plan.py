"""The plan: tests chosen for an aim, in their order, with explanations and warnings."""

from bisect import bisect_left
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from bushfit.effects.contract import Array
from bushfit.errors import ModelError
from bushfit.planning.candidates import unlimited_rig_warning
from bushfit.planning.contract import Knowledge, Plan, PlanRequest, Programme
from bushfit.planning.criterion import add_runs, order_runs
from bushfit.planning.search import DETECTABLE, RIVALS_APART, PlanSearch
from bushfit.planning.targets import UNLIMITED_RUNS, PlannedQuantity, format_half_width
from bushfit.units import number

#: Fractions of the hours that are tried before all of them: for rivals, and in steps of a tenth for targets.
_SHARES = {"rivals": (0.125, 0.1875, 0.25, 0.375, 0.5), "targets": tuple((2.0 ** (np.arange(-40, 0) / 8)).tolist())}
#: Smallest ratio of errors without and with a test that is worth a sentence; chosen.
_NOTABLE_RATIO = 1.005
#: Longest duration that is computed for a target [min]: months.
_LONGEST_MINUTES = 60.0 * 2000.0


def plan(knowledge: Knowledge, request: PlanRequest) -> Plan:
    """Choose tests for an aim within the hours and the limits of the rig.

    The plan separates rival models, or meets targets, in as few hours as possible.

    Args:
        knowledge: model, covariance and noise before the planned tests.
        request: aim, hours and limits of the rig.

    Returns:
        The tests in their order with their expected results, compared with the standard programme.

    Raises:
        ModelError: no test is possible or fits into the hours, or there are no rival models to separate.
    """
    if request.aim == "rivals" and len(knowledge.rivals) < 2:
        raise ModelError(
            "there are no rivals to distinguish",
            found=knowledge.source,
            expected="tests of a campaign that two effects or more explain alike",
            hint="plan from the campaign, or for parameters or predictions",
        )
    search = PlanSearch.from_request(knowledge, request)
    shorter = [search.within(share * request.hours) for share in _SHARES.get(request.aim, ())]
    for with_checks in (True, False) if search.goals else (False,):  # without checks only if no other plan reaches
        first = bisect_left(shorter, True, key=lambda search: search.reaches_aim(with_checks=with_checks))
        if first < len(shorter):
            search = shorter[first]
            break
    counts, places = search.counts, search.budget.place
    if not counts.any() and not search.reaches_aim():
        shortest = float(search.budget.minutes.min() + search.budget.setup_minutes) / 60.0
        raise ModelError(
            "no test fits into the hours",
            place="--hours",
            found=f"{number(request.hours, 3)} h",
            expected=f"at least {number(shortest, 2)} h",
        )
    planned = programme(search, order_runs(counts, places))
    missed = tuple(explain_miss(search, goal) for goal in search.goals)
    purposes = {search.tests[test]: describe_purpose(search, test) for test in np.flatnonzero(counts).tolist()}
    return Plan(
        knowledge,
        request,
        before=programme(search, []),
        planned=planned,
        standard=programme(search, search.standard_runs),
        purposes=purposes,
        missed=missed,
        enough=explain_free_hours(search, planned, missed),
        notes=tuple(plan_warnings(search, planned)),
    )


def programme(search: PlanSearch, runs: Sequence[int]) -> Programme:
    """Compute the durations and expected results of a sequence of runs.

    Args:
        search: search with the candidate tests.
        runs: test indices in the order of the runs.

    Returns:
        The tests with their durations, standard errors and detectable amounts.
    """
    counts, places = search.count_runs(runs), search.budget.place[list(runs)]
    model, k = search.models[0], len(search.knowledge.names)
    information = model.total(counts)
    covariance = model.error_covariance(information)[0]
    return Programme(
        tests=tuple(search.tests[run] for run in runs),
        minutes=search.budget.minutes[list(runs)] + search.budget.setup_minutes * (np.diff(places, prepend=-1) != 0),
        errors=np.sqrt(np.diag(covariance))[:k],
        predictions={quantity.name: quantity.standard_errors(covariance) for quantity in search.predictions},
        rival_chi_square=search.nearest_rivals(counts) if search.knowledge.rivals else None,
        half_widths=tuple(goal.half_width(covariance) for goal in search.goals),
        detectable=detectable_amounts(search, counts),
    )


def detectable_amounts(search: PlanSearch, counts: Array) -> Mapping[str, float]:
    """Compute the smallest amount of each effect that runs detect in 90 % of the cases by a test at the 5 % level.

    Args:
        search: search with the candidate tests.
        counts: number of runs of each test, (tests,).

    Returns:
        Amount [SI] by name, for effects that the standard programme can detect; infinite if the runs detect none.

    Notes:
        Noise alone would permit amounts that many repeats average out, such as 0.1 g of moving mass. The accuracy
        class of a rig limits its errors at each frequency and amplitude, not only their average: an amount is
        detected only if it changes the response somewhere by more than the class. Of the shapes of an effect, such
        as the frequencies of a resonance, the median is reported: the most visible one, a resonance at a tested
        frequency, is a rare case.
    """
    model = search.models[0]
    ratios = model.class_ratios[counts > 0].max(axis=0, initial=0.0)
    with np.errstate(divide="ignore"):
        smallest = np.maximum(DETECTABLE / np.sqrt(model.total(counts).noncentralities()[0]), 1.0 / ratios)
    amounts = defaultdict[str, list[float]](list)
    for index in np.flatnonzero(search.minimum_noncentrality).tolist():
        effect = search.effects[index]
        amounts[effect.name].append(effect.amount.typical * float(smallest[index]))
    return {name: float(np.median(sizes)) for name, sizes in amounts.items()}


def explain_miss(search: PlanSearch, goal: PlannedQuantity) -> str | None:
    """Sentence on the reason why the chosen tests miss a target, and on the hours that would meet the target.

    Args:
        search: search with the chosen tests.
        goal: parameter or prediction with a target.

    Returns:
        Sentence; None if the tests meet the target.
    """
    counts, limit, covariance = search.counts, search.limit_covariance, search.error_covariance
    if sentence := search.untested_warning(goal, counts):
        origin = "in the plan" if goal.place in search.request.places else "on offer"
        return f"no test so far or {origin} covers this: {sentence}"
    if not goal.met(limit):
        reached, reason = format_half_width(goal.half_width(limit)), goal.explain_limit(search.knowledge, limit)
        return f"no available test meets it; {UNLIMITED_RUNS} runs of each would reach {reached}: {reason}"
    if goal.met(covariance(counts)):
        return None
    more = add_runs(
        replace(search.strict_criterion, weight=goal.weight(limit)),
        replace(search.budget, maximum_minutes=np.inf),
        counts,
        enough=lambda runs: goal.met(covariance(runs)) or search.budget.spent(runs) > _LONGEST_MINUTES,
    )
    hours = number(search.budget.spent(more) / 60.0, 2)
    if goal.met(covariance(more)):
        return f"{number(search.budget.maximum_minutes / 60.0, 3)} h are too few, about {hours} h would do"
    reached = format_half_width(goal.half_width(covariance(more)))
    return f"{hours} h would reach {reached}, and no further run would reduce that by a quarter per cent"


def describe_purpose(search: PlanSearch, test: int) -> str:
    """Sentence on the purpose of a test: the largest loss of accuracy without the test and all its repeats.

    Args:
        search: search with the chosen tests.
        test: index of the test among those of the search.

    Returns:
        Sentence for the sheet of the rig operator.
    """
    counts = search.counts
    request, reduced = search.request, np.where(np.arange(counts.size) == test, 0, counts)
    covariance, wider = search.error_covariance(counts), search.error_covariance(reduced)
    if request.aim == "rivals":
        chi_square, closer = search.nearest_rivals(counts), search.nearest_rivals(reduced)
        if closer * _NOTABLE_RATIO <= chi_square:
            return f"chi-square of rivals: {number(closer, 2)} without this run, {number(chi_square, 2)} with this run"
    elif search.goals:
        widened = [
            goal for goal in search.goals if goal.half_width(wider) >= _NOTABLE_RATIO * goal.half_width(covariance)
        ]
        if widened:
            goal = max(widened, key=lambda goal: goal.half_width(wider) / goal.target)
            without, planned = (format_half_width(goal.half_width(errors), 3) for errors in (wider, covariance))
            return f"{goal.name}: {without} without this run, {planned} with this run"
    else:
        if request.aim == "predictions":
            name, ratio = "stiffness", np.sqrt(np.sum(wider * search.weight) / np.sum(covariance * search.weight))
        else:
            ratios = zip(np.sqrt(np.diag(wider) / np.diag(covariance)), search.knowledge.names, strict=False)
            ratio, name = max(pair for pair in ratios if pair[1] in request.parameters)
        if ratio >= _NOTABLE_RATIO:
            return f"{name}: error {number(100.0 * (ratio - 1.0), 2)} % larger without this run"
    return "shows effects that the model lacks"


def explain_free_hours(search: PlanSearch, planned: Programme, missed: Sequence[str | None]) -> str | None:
    """Sentence on the reason why the plan leaves hours of the rig free.

    Args:
        search: search with the chosen tests.
        planned: programme of the chosen tests.
        missed: reason why each target is missed; None for a target that is met.

    Returns:
        Sentence; None if the hours are used.
    """
    request, budget = search.request, search.budget
    hours, free = request.hours, request.hours - planned.hours
    if free <= float(budget.minutes.max() + budget.setup_minutes) / 60.0:
        return None
    reason = "no further run would reduce the error by a quarter per cent"
    is_shorter = budget.maximum_minutes < 60.0 * hours
    if request.aim == "rivals" and is_shorter:
        reason = "these tests distinguish the rivals"
    elif missed and is_shorter:
        reason = "further runs would meet no missed target" if any(missed) else "all targets are met"
    if not planned.tests:
        needed = "would help" if any(missed) else "is needed"
        return f"no test {needed}: {reason}, and all {number(hours, 3)} h remain free"
    return (
        f"{number(planned.hours, 2)} of {number(hours, 3)} h are enough: {reason}, and {number(free, 2)} h remain free"
    )


def plan_warnings(search: PlanSearch, planned: Programme) -> Iterator[str]:
    """Generate the warnings of a plan, the most important first.

    Args:
        search: search with the chosen tests.
        planned: programme of the chosen tests.

    Returns:
        Iterator over sentences.
    """
    knowledge, request = search.knowledge, search.request
    if sentence := unlimited_rig_warning(knowledge, request.rig, planned.tests):
        yield sentence
    stiffnesses = (quantity for quantity in search.predictions if quantity.name.startswith("stiffness"))
    model_error = max((float(quantity.model_error.max()) for quantity in stiffnesses), default=0.0)
    if model_error > _NOTABLE_RATIO - 1.0:
        yield (
            f"the errors of the stiffness include the model error, up to {number(100.0 * model_error, 2)} %, "
            "which no test reduces; bushfit diagnose looks for the missing effect"
        )
    yield from knowledge.warnings
    if knowledge.bounded:
        yield (
            f"{' and '.join(knowledge.bounded)} ended at a bound: the planned errors of the other parameters "
            "include half of the additional error of a fit without the bound"
        )
    if search.goals and not search.determines_scatter(search.counts):
        yield "too few repeats determine the scatter of sweeps: intervals may become 1.5 times as wide as planned"
    if effects := search.less_visible_effects(search.counts):
        yield f"the standard programme shows these effects better: {', '.join(effects)}"
    for pair in np.argwhere(np.triu(~search.separable_rivals, 1)).tolist():
        names = (knowledge.rivals[rival].model.effects[-1] for rival in pair)
        yield f"no test of this rig would distinguish {' from '.join(names)}: they are left out"
    if planned.rival_chi_square is not None and planned.rival_chi_square < RIVALS_APART:
        yield (
            f"the expected chi-square between the nearest rivals is {number(planned.rival_chi_square, 2)}, less "
            f"than the {number(RIVALS_APART, 3)} that distinguishes them in nine of ten cases"
        )
