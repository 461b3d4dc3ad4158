"""plan.json: the tests of a plan and their expected results."""

from collections.abc import Iterable
from typing import Literal

import numpy as np
from typing_extensions import TypedDict

from bushfit.campaign.simulated import SimulatedLoop
from bushfit.effects import get_effect, qualified_name
from bushfit.planning.contract import Aim, Plan, amplitudes_and_frequencies
from bushfit.planning.search import RIVALS_APART


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


class PlanFile(TypedDict):
    """plan.json: the tests of a plan and their expected results.

    Args:
        schema: name and version of this schema.
        source: starting point of the plan.
        aim: quantity that the plan makes more accurate, or the separation of rivals.
        hours: available time on the rig [h].
        tests: runs of the rig in their order.
        hours_planned: duration of the planned tests [h].
        hours_standard: duration of the standard programme, repeated as often as fits into that of the plan [h].
        hours_left: available time that the plan does not use [h].
        enough: reason why hours are left; null if they are used.
        targets: targets by name; empty if none was given.
        parameters: relative standard error of each parameter if the model is right.
        stiffness: root mean square relative standard error of the stiffness, by direction or specimen.
        loss_factor: root mean square standard error of the loss factor, likewise.
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
    warnings: list[str]


def plan_document(plan: Plan) -> PlanFile:
    """Convert a plan to the content of plan.json.

    Returns:
        Keys and values of the file, in SI units.
    """
    request, planned, standard = plan.request, plan.planned, plan.standard
    programmes = (plan.before, planned, standard)
    rivals: Rivalry | None = None
    if planned.rival_chi_square is not None and standard.rival_chi_square is not None:
        rivals = {
            "effects": [rival.model.effects[-1] for rival in plan.knowledge.rivals],
            "planned": planned.rival_chi_square,
            "standard": standard.rival_chi_square,
            "enough": RIVALS_APART,
        }
    targets: dict[str, TargetEntry] = {}
    halves = zip(*(programme.half_widths for programme in programmes), strict=True)
    for target, reason, half in zip(request.targets, plan.missed, halves, strict=True):
        targets[str(target)] = {
            "asked": target.half_width,
            **_error_comparison(half),
            "met": reason is None,
            "why": reason,
        }
    predicted: dict[str, dict[str, ErrorComparison]] = {"stiffness": {}, "loss_factor": {}}
    for quantity, by_place in predicted.items():
        for place in (str(grid.place) for grid in request.grids):
            errors = (programme.predictions[f"{quantity}.{place}"] for programme in programmes)
            by_place[place] = _error_comparison(np.sqrt(np.mean(np.square(error))) for error in errors)
    visible: dict[str, DetectableEntry] = {}
    for name, amount in planned.detectable.items():
        effect, standard_amount = get_effect(name), standard.detectable[name]
        visible[name] = {
            "parameter": qualified_name(effect, effect.amount),
            "unit": effect.amount.unit,
            "planned": amount if np.isfinite(amount) else None,
            "standard": standard_amount if np.isfinite(standard_amount) else None,
        }
    tests: list[PlannedRun] = []
    for test, minutes in zip(planned.tests, planned.minutes.tolist(), strict=True):
        amplitudes, frequencies = amplitudes_and_frequencies(test)
        tests.append(
            {
                "place": str(test.direction),
                "kind": "loop" if isinstance(test, SimulatedLoop) else "sweep",
                "stepped": None if isinstance(test, SimulatedLoop) else test.stepped,
                "amplitudes": list(amplitudes),
                "unit": test.direction.motion.displacement_unit,
                "frequencies_Hz": list(frequencies),
                "cycles": test.cycles if isinstance(test, SimulatedLoop) else None,
                "minutes": minutes,
            }
        )
    parameter_errors = zip(plan.knowledge.names, *(programme.errors for programme in programmes), strict=True)
    return {
        "schema": "bushfit/plan/1",
        "source": plan.knowledge.source,
        "aim": request.aim,
        "hours": request.hours,
        "tests": tests,
        "hours_planned": planned.hours,
        "hours_standard": standard.hours,
        "hours_left": request.hours - planned.hours,
        "enough": plan.enough,
        "targets": targets,
        "parameters": {name: _error_comparison(errors) for name, *errors in parameter_errors},
        "stiffness": predicted["stiffness"],
        "loss_factor": predicted["loss_factor"],
        "visible": visible,
        "rivals": rivals,
        "warnings": list(plan.notes),
    }


def _error_comparison(errors: Iterable[float]) -> ErrorComparison:
    """Entry with three relative errors: before further tests, with the plan, with the standard programme."""
    before, planned, standard = map(float, errors)
    return {"before": before, "planned": planned, "standard": standard}
