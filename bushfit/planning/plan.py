"""Plan: tests chosen for an aim, in their order, with explanations and warnings."""

from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bushfit.caveat import Caveat, join_names
from bushfit.errors import ModelError
from bushfit.geometry import TRANSLATION
from bushfit.planning.contract import Knowledge, PlanRequest, Test, operating_points
from bushfit.planning.document import PlanFile, plan_document
from bushfit.planning.exchange import add_runs
from bushfit.planning.search import RIVALS_APART, PlanSearch
from bushfit.planning.targets import UNLIMITED_RUNS, PlannedQuantity, format_half_width
from bushfit.units import number

#: Fractions of the hours that are tried before all of them: for rivals, and in steps of a tenth for targets.
_SHARES = {"rivals": (0.125, 0.1875, 0.25, 0.375, 0.5), "targets": tuple((2.0 ** (np.arange(-40, 0) / 8)).tolist())}
#: Smallest ratio of errors without and with a test that is worth a sentence; chosen.
_NOTABLE_RATIO = 1.005
#: Longest duration that is computed for a target [min]: months.
_LONGEST_MINUTES = 60.0 * 2000.0


@dataclass(frozen=True, eq=False)
class Plan:
    """Tests chosen for an aim, with their expected results.

    Args:
        knowledge: model, covariance and noise before the planned tests.
        tests: runs of the rig, in the order in which they are made.
        purposes: sentence on the accuracy that is lost without a test and all its repeats, for each test.
        document: content of plan.json: durations of the runs and expected results, compared with the standard programme
            (the tests of Garcia Tarrago et al. 2007, repeated as often as the same hours allow).
    """

    knowledge: Knowledge
    tests: tuple[Test, ...]
    purposes: Mapping[Test, str]
    document: PlanFile


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
    budgets = [
        replace(search.budget, maximum_minutes=60.0 * share * request.hours) for share in _SHARES.get(request.aim, ())
    ]
    shorter = [replace(search, budget=budget) for budget in budgets]
    for with_checks in (True, False) if search.goals else (False,):  # without checks only if no other plan reaches
        first = bisect_left(shorter, True, key=lambda search: search.reaches_aim(with_checks=with_checks))
        if first < len(shorter):
            search = shorter[first]
            break
    counts = search.counts
    if not counts.any() and not search.reaches_aim():
        shortest = float(search.budget.minutes.min() + search.budget.setup_minutes) / 60.0
        raise ModelError(
            "no test fits into the hours",
            place="--hours",
            found=f"{number(request.hours, 3)} h",
            expected=f"at least {number(shortest, 2)} h",
        )
    missed = [explain_miss(search, goal) for goal in search.goals]
    enough, warnings = explain_free_hours(search, missed), list(plan_warnings(search))
    return Plan(
        knowledge,
        tuple(search.tests[run] for run in search.runs),
        {search.tests[test]: describe_purpose(search, test) for test in np.flatnonzero(counts).tolist()},
        plan_document(search, missed, enough, warnings),
    )


def explain_miss(search: PlanSearch, goal: PlannedQuantity) -> str | None:
    """Sentence on the reason why the chosen tests miss a target, and on the hours that would meet the target.

    Args:
        search: search with the chosen tests.
        goal: parameter or prediction with a target.

    Returns:
        Sentence; None if the tests meet the target.
    """
    counts, limit, covariance = search.counts, search.limit_covariance, search.error_covariance
    if warning := search.untested_warning(goal, counts):
        origin = "in the plan" if goal.place in search.request.places else "on offer"
        return f"no test so far or {origin} covers this target: {warning}"
    if not goal.meets_target(limit):
        reached, reason = format_half_width(goal.half_width(limit)), goal.explain_limit(search.knowledge, limit)
        return f"no available test is enough; {UNLIMITED_RUNS} runs of each would reach {reached}: {reason}"
    if goal.meets_target(covariance(counts)):
        return None
    more = add_runs(
        replace(search, goals=[goal]),
        replace(search.budget, maximum_minutes=np.inf),
        counts,
        enough=lambda runs: goal.meets_target(covariance(runs)) or search.budget.total_minutes(runs) > _LONGEST_MINUTES,
    )
    hours = number(search.budget.total_minutes(more) / 60.0, 2)
    if goal.meets_target(covariance(more)):
        return f"{number(search.budget.maximum_minutes / 60.0, 3)} h are too few; about {hours} h are needed"
    reached = format_half_width(goal.half_width(covariance(more)))
    return f"{hours} h would reach {reached}, and no further run would reduce the error by 0.25 %"


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


def explain_free_hours(search: PlanSearch, missed: Sequence[str | None]) -> str | None:
    """Sentence on the reason why the plan leaves hours of the rig free.

    Args:
        search: search with the chosen tests.
        missed: reason why each target is missed; None for a target that is met.

    Returns:
        Sentence; None if the hours are used.
    """
    request, budget = search.request, search.budget
    hours, planned = request.hours, budget.total_minutes(search.counts) / 60.0
    free = hours - planned
    if free <= float(budget.minutes.max() + budget.setup_minutes) / 60.0:
        return None
    reason = "no further run would reduce the error by 0.25 %"
    is_shorter = budget.maximum_minutes < 60.0 * hours
    if request.aim == "rivals" and is_shorter:
        reason = "these tests distinguish the rivals"
    elif missed and is_shorter:
        reason = "further runs would not meet the missed targets" if any(missed) else "all targets are met"
    if not search.counts.any():
        needed = "would help" if any(missed) else "is needed"
        return f"no test {needed}: {reason}, and all {number(hours, 3)} h remain free"
    return f"{number(planned, 2)} of {number(hours, 3)} h are enough: {reason}, and {number(free, 2)} h remain free"


def plan_warnings(search: PlanSearch) -> Iterator[Caveat]:
    """Generate the warnings of a plan, the most important first.

    Args:
        search: search with the chosen tests.

    Returns:
        Iterator over warnings.
    """
    knowledge, request, counts = search.knowledge, search.request, search.counts
    rig, tests = request.rig, [search.tests[test] for test in np.flatnonzero(counts)]
    points = [(test.direction, *operating_points(test)) for test in tests if test.direction.motion is TRANSLATION]
    if points and not any((rig.max_force, rig.max_displacement, rig.max_velocity, rig.max_frequency)):
        frequency, amplitude = np.concatenate([pair for _, *pair in points], axis=1)
        fastest = int(np.argmax(frequency * amplitude))
        velocity = 2.0 * np.pi * float(frequency[fastest] * amplitude[fastest])
        acceleration = float(np.max(np.square(2.0 * np.pi * frequency) * amplitude)) / 9.80665
        force = max(float(np.max(np.abs(knowledge.model.stiffness(place, f, x)) * x)) for place, f, x in points)
        point = f"{number(1e3 * amplitude[fastest], 3)} mm at {number(frequency[fastest], 3)} Hz"
        reached = f"{number(velocity, 3)} m/s ({point}), {number(acceleration, 3)} g and {number(force, 3)} N"
        advice = "State max_velocity, max_force, max_displacement and max_frequency, and plan again"
        yield Caveat("plan_without_limits", f"[rig] states no limits: the plan reaches {reached}. {advice}")
    stiffnesses = (quantity for quantity in search.predictions if quantity.name.startswith("stiffness"))
    model_error = max((float(quantity.model_error.max()) for quantity in stiffnesses), default=0.0)
    if model_error > _NOTABLE_RATIO - 1.0 and not knowledge.rivals:
        sentence = f"the errors of the stiffness include the model error, up to {number(100.0 * model_error, 2)} %"
        yield Caveat("plan_model_error", f"{sentence}, which the planned tests do not reduce")
    yield from knowledge.result.warnings
    if knowledge.bounded:
        sentence = f"{join_names(knowledge.bounded)} ended at a bound: the planned errors of the other parameters"
        yield Caveat("plan_at_bound", f"{sentence} include half of the additional error of a fit without the bound")
    if search.goals and not search.determines_noise(counts):
        sentence = "repeats are too few to determine the scatter of sweeps"
        yield Caveat("few_repeats", f"{sentence}: intervals may be 1.5 times as wide as planned")
    if effects := search.less_visible_effects(counts):
        sentence = f"the standard programme shows these effects better: {', '.join(effects)}"
        yield Caveat("standard_programme_better", sentence)
    for pair in np.argwhere(np.triu(~search.separable_rivals, 1)).tolist():
        names = (knowledge.rivals[rival].model.effects[-1] for rival in pair)
        sentence = f"no test of this rig would distinguish {' from '.join(names)}: these rivals are left out"
        yield Caveat("rivals_alike", sentence)
    if knowledge.rivals and (chi_square := search.nearest_rivals(counts)) < RIVALS_APART:
        sentence = f"the expected chi-square between the nearest rivals is {number(chi_square, 2)}"
        needed = f"less than the {number(RIVALS_APART, 3)} that distinguishes them in nine of ten cases"
        yield Caveat("rivals_close", f"{sentence}, {needed}")
