"""plan.json: the tests of a plan and their expected results."""

from collections import defaultdict
from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
from typing_extensions import TypedDict

from bushfit.campaign.simulated import SimulatedLoop
from bushfit.caveat import Caveat, WarningEntries, to_entries
from bushfit.effects import get_effect, qualified_name
from bushfit.effects.contract import Array
from bushfit.planning.contract import Aim, Test, operating_points
from bushfit.planning.search import DETECTABLE, RIVALS_APART, PlanSearch
from bushfit.planning.targets import PlannedQuantity


class PlannedRun(TypedDict):
    """Entry of plan.json for one run of the rig.

    Args:
        place: direction, or name of the specimen.
        kind: kind of test.
        stepped: quantity that a sweep steps through while the other is constant; null for a loop.
        amplitudes: zero-to-peak amplitudes in the unit.
        unit: SI unit of the amplitudes: "m", "rad" or "1".
        frequencies_Hz: frequencies of the points, or of the loop [Hz].
        cycles: cycles of a loop; null for a sweep.
        minutes: duration with the change of direction before it [min].
    """

    place: str
    kind: Literal["loop", "sweep"]
    stepped: Literal["frequency", "amplitude"] | None
    amplitudes: list[float]
    unit: str
    frequencies_Hz: list[float]
    cycles: int | None
    minutes: float


class ErrorComparison(TypedDict):
    """Relative standard error or half width: before further tests, with the plan, and with the standard programme.

    Args:
        before: standard error without further tests.
        planned: standard error with the tests of the plan.
        standard: standard error with the standard programme of as many hours instead.
    """

    before: float
    planned: float
    standard: float


class TargetEntry(ErrorComparison):
    """Half width of the 95 % interval of a target, relative to its value, at the worst operating point.

    Args:
        asked: largest half width of the interval that the target allows.
        met: True if the planned tests reach the target.
        why: reason why the target is not reached; null if it is.
    """

    asked: float
    met: bool
    why: str | None


class DetectableEntry(TypedDict):
    """Smallest amount of an effect that tests detect in 90 % of the cases, and that the rig's errors do not hide.

    Args:
        parameter: parameter of the effect that measures the amount.
        unit: SI unit of the amount; "1" for a ratio.
        planned: smallest amount that the tests of the plan detect; null if none.
        standard: smallest amount that the standard programme detects; null if none.
    """

    parameter: str
    unit: str
    planned: float | None
    standard: float | None


class Rivalry(TypedDict):
    """Expected separation of the models that explain the tests so far equally well.

    Args:
        effects: effect that each of the models adds.
        planned: expected chi-square between the two nearest models, after the best refit of either, with the tests of
            the plan.
        standard: expected chi-square between the two nearest models with the standard programme.
        enough: chi-square above which nine of ten campaigns separate the models.
    """

    effects: list[str]
    planned: float
    standard: float
    enough: float


class PlanFile(WarningEntries):
    """plan.json: the tests of a plan and their expected results.

    Args:
        schema: name and version of this schema.
        source: starting point of the plan.
        aim: quantity that the plan makes more accurate, or the separation of rivals.
        hours: available time on the rig [h].
        tests: runs of the rig in their order.
        hours_planned: duration of the planned tests [h].
        hours_standard: duration of the standard programme, repeated as often as fits into the duration of the plan [h].
        hours_left: available time that the plan does not use [h].
        enough: reason why hours are left; null if they are used.
        targets: targets by name; empty if none was given.
        parameters: relative standard error of each parameter if the model is right.
        stiffness: root mean square relative standard error of the stiffness, by direction or specimen.
        loss_factor: root mean square standard error of the loss factor, by direction or specimen.
        visible: smallest detectable amount of each effect.
        rivals: models to separate; null if there are none.
        warnings: warnings on the plan.
    """

    schema: str
    source: str
    aim: Aim
    hours: float
    tests: list[PlannedRun]
    hours_planned: float
    hours_standard: float
    hours_left: float
    enough: str | None
    targets: dict[str, TargetEntry]
    parameters: dict[str, ErrorComparison]
    stiffness: dict[str, ErrorComparison]
    loss_factor: dict[str, ErrorComparison]
    visible: dict[str, DetectableEntry]
    rivals: Rivalry | None


def plan_document(
    search: PlanSearch, missed: Sequence[str | None], enough: str | None, warnings: Sequence[Caveat]
) -> PlanFile:
    """Collect the content of plan.json.

    Args:
        search: search with the candidate tests.
        missed: reason why the plan misses each target; None for a target that it meets.
        enough: reason why hours remain free; None if the hours are used.
        warnings: warnings and limits of the plan.

    Returns:
        Keys and values of the file, in SI units.
    """
    knowledge, request, budget = search.knowledge, search.request, search.budget
    planned, standard = search.counts, search.standard_counts
    changes = np.diff(budget.place[search.runs], prepend=-1) != 0
    minutes = (budget.minutes[search.runs] + budget.setup_minutes * changes).tolist()
    covariances = [search.error_covariance(counts) for counts in (0 * planned, planned, standard)]

    def compare_error(error: Callable[[Array], float]) -> ErrorComparison:
        """Compare an error before further tests, with the plan and with the standard programme.

        `error` computes it from a covariance of the parameters.
        """
        before, with_plan, with_standard = map(error, covariances)
        return {"before": before, "planned": with_plan, "standard": with_standard}

    errors = defaultdict[str, dict[str, ErrorComparison]](dict)
    for quantity in search.predictions:
        errors[quantity.name.partition(".")[0]][str(quantity.place)] = compare_error(quantity.rms_error)
    rivals: Rivalry | None = None
    if knowledge.rivals:
        rivals = {
            "effects": [rival.model.effects[-1] for rival in knowledge.rivals],
            "planned": search.nearest_rivals(planned),
            "standard": search.nearest_rivals(standard),
            "enough": RIVALS_APART,
        }
    return {
        "schema": "bushfit/plan/1",
        "source": knowledge.source,
        "aim": request.aim,
        "hours": request.hours,
        "tests": [planned_run(search.tests[run], duration) for run, duration in zip(search.runs, minutes, strict=True)],
        "hours_planned": sum(minutes) / 60.0,
        "hours_standard": budget.total_minutes(standard) / 60.0,
        "hours_left": request.hours - sum(minutes) / 60.0,
        "enough": enough,
        "targets": {
            goal.name: {"asked": goal.target, **compare_error(goal.half_width), "met": reason is None, "why": reason}
            for goal, reason in zip(search.goals, missed, strict=True)
        },
        "parameters": {
            quantity.name: compare_error(quantity.rms_error) for quantity in PlannedQuantity.parameters(knowledge)
        },
        "stiffness": errors["stiffness"],
        "loss_factor": errors["loss_factor"],
        "visible": detectable_amounts(search, planned, standard),
        "rivals": rivals,
        **to_entries(warnings),
    }


def planned_run(test: Test, minutes: float) -> PlannedRun:
    """Make the entry of plan.json for one run of a test.

    Args:
        test: test of the plan.
        minutes: duration, with the change of direction before the run.

    Returns:
        Entry with amplitudes in the unit of the direction.
    """
    frequencies, amplitudes = (np.unique(axis).tolist() for axis in operating_points(test))
    return {
        "place": str(test.direction),
        "kind": "loop" if isinstance(test, SimulatedLoop) else "sweep",
        "stepped": None if isinstance(test, SimulatedLoop) else test.stepped,
        "amplitudes": amplitudes,
        "unit": test.direction.motion.displacement_unit,
        "frequencies_Hz": frequencies,
        "cycles": test.cycles if isinstance(test, SimulatedLoop) else None,
        "minutes": minutes,
    }


def detectable_amounts(search: PlanSearch, planned: Array, standard: Array) -> dict[str, DetectableEntry]:
    """Compute the smallest amount of each effect that tests detect in 90 % of the cases, at a significance of 5 %.

    Args:
        search: search with the candidate tests.
        planned: number of runs of each test in the plan, (tests,).
        standard: number of runs of each test in the standard programme, (tests,).

    Returns:
        Amounts [SI] by name of the effect, for effects that the standard programme can detect.

    Notes:
        Noise alone would permit amounts that many repeats average out, such as 0.1 g of moving mass. The accuracy
        class of a rig limits its errors at each frequency and amplitude, not only their average: an amount is
        detected only if it changes the response somewhere by more than the class. Of the shapes of an effect, such
        as the frequencies of a resonance, the median is reported: the most visible one, a resonance at a tested
        frequency, is a rare case.
    """
    model, smallest, shapes = search.models[0], [], defaultdict[str, list[int]](list)
    for counts in (planned, standard):
        ratios = model.class_ratios[counts > 0].max(axis=0, initial=0.0)
        with np.errstate(divide="ignore"):
            smallest.append(np.maximum(DETECTABLE / np.sqrt(model.total(counts).noncentralities()[0]), 1.0 / ratios))
    for index in np.flatnonzero(search.minimum_noncentrality).tolist():
        shapes[search.effects[index].name].append(index)
    entries = dict[str, DetectableEntry]()
    for name, indices in shapes.items():
        effect, amount = get_effect(name), get_effect(name).amount
        sizes = amount.typical * np.median(np.array(smallest)[:, indices], axis=1)
        plan_size, standard_size = (size if np.isfinite(size) else None for size in sizes.tolist())
        parameter = qualified_name(effect, amount)
        entries[name] = {"parameter": parameter, "unit": amount.unit, "planned": plan_size, "standard": standard_size}
    return entries
