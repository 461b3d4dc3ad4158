"""plan: tests that would reduce the uncertainty most, within what the rig can do."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import chain
from typing import Annotated, Any, Literal

import numpy as np
import pandas as pd
from pydantic import Field
from typing_extensions import TypedDict

from bushfit.campaign.campaign import Campaign, model_of
from bushfit.campaign.schema import PredictSettings, RigSettings, SimulatedLoop
from bushfit.commands.fit import prepare_tests
from bushfit.commands.predict import Numbers, grid_of
from bushfit.effects.contract import Array
from bushfit.errors import ModelError, did_you_mean
from bushfit.geometry import Direction, Place, get_place
from bushfit.model.result import Result
from bushfit.planning.campaign import Check, campaign_toml
from bushfit.planning.compound import guess_parameters
from bushfit.planning.contract import (
    Aim,
    Knowledge,
    Plan,
    PlanRequest,
    Points,
    Target,
    Test,
    motions,
    operating_points,
)
from bushfit.planning.knowledge import from_campaign, from_result, rig_of
from bushfit.planning.plan import plan as choose_tests
from bushfit.planning.problem import RIVALS_APART
from bushfit.prediction.grid import default_grid, grid_settings, requested_grid
from bushfit.report import plots
from bushfit.report.results import ResultFile, figure_file, json_file, raw_file, table_file
from bushfit.units import number

#: Predicted quantities that may be targets.
PREDICTED = ("stiffness", "loss_factor")
#: Name of the campaign file of a plan, which `simulate` takes.
CAMPAIGN_FILE = "campaign.toml"
#: Columns of the sheet of tests; a plan without tests has them too.
_COLUMNS = (
    *("order", "direction", "test", "amplitude", "frequency [Hz]", "cycles", "repeat", "force up to", "minutes"),
    *("minutes so far", "what for"),
)


class PlannedRun(TypedDict):
    """One run of the rig, in the order of the plan."""

    place: Annotated[str, Field(description="Direction, or name of the specimen.")]
    kind: Annotated[Literal["loop", "sweep"], Field(description="Kind of test.")]
    stepped: Annotated[
        Literal["frequency", "amplitude"] | None,
        Field(description="Quantity that a sweep steps through while the other is constant; null for a loop."),
    ]
    amplitudes: Annotated[list[float], Field(description="Zero-to-peak amplitudes in the unit.")]
    unit: Annotated[str, Field(description='SI unit of the amplitudes: "m", "rad" or "1".')]
    frequencies_Hz: Annotated[list[float], Field(description="Frequencies of the points, or of the loop [Hz].")]
    cycles: Annotated[int | None, Field(description="Cycles of a loop; null for a sweep.")]
    minutes: Annotated[float, Field(description="Duration with the change of direction before it [min].")]


class Reached(TypedDict):
    """A standard error before further tests, with the planned tests, and with the standard programme."""

    before: Annotated[float, Field(description="Without further tests.")]
    planned: Annotated[float, Field(description="With the tests of the plan.")]
    standard: Annotated[float, Field(description="With the standard programme of as many hours instead.")]


class TargetEntry(Reached):
    """Half of a 95 % interval over its value, the widest of all points at which predictions are wanted."""

    asked: Annotated[float, Field(description="Largest half width that was asked for.")]
    met: Annotated[bool, Field(description="Whether the planned tests reach the target.")]
    why: Annotated[str | None, Field(description="Reason why the target is not reached; null if it is.")]


class Shown(TypedDict):
    """Smallest amount of an effect that a test at the 5 % level detects in 90 % of the cases."""

    parameter: Annotated[str, Field(description="Parameter of the effect that the amount is of.")]
    unit: Annotated[str, Field(description='SI unit of the amount; "1" for a ratio.')]
    planned: Annotated[float | None, Field(description="With the tests of the plan; null if no amount is detected.")]
    standard: Annotated[float | None, Field(description="With the standard programme.")]


class Rivalry(TypedDict):
    """Models that explain the tests equally well."""

    effects: Annotated[list[str], Field(description="Effect that each of the models adds.")]
    planned: Annotated[
        float,
        Field(
            description="Expected chi-square between the two nearest models, after the best refit of either, with the "
            "tests of the plan."
        ),
    ]
    standard: Annotated[float, Field(description="The same with the standard programme.")]
    enough: Annotated[float, Field(description="Chi-square above which nine of ten campaigns separate the models.")]


class Checked(TypedDict):
    """Simulations of the plan, each fitted."""

    campaigns: Annotated[int, Field(description="Number of simulated campaigns.")]
    failed: Annotated[int, Field(description="Number of campaigns that could not be fitted.")]
    seed: Annotated[int, Field(description="Seed of the first campaign; the others count on from it.")]
    predicted: Annotated[dict[str, float], Field(description="Relative standard error that the plan predicts.")]
    found: Annotated[dict[str, float], Field(description="Relative standard error from the scatter of the fits.")]
    ci95: Annotated[dict[str, list[float]], Field(description="Ends of the 95 % interval of the latter.")]


class PlanFile(TypedDict):
    """plan.json: the tests of a plan and their expected results."""

    schema: Annotated[str, Field(description="Name and version of this schema.")]
    source: Annotated[str, Field(description="Origin of what is knowledge before further tests.")]
    aim: Annotated[Aim, Field(description="Aim of the plan.")]
    hours: Annotated[float, Field(description="Largest duration on the rig [h].")]
    tests: Annotated[list[PlannedRun], Field(description="Runs of the rig in their order.")]
    hours_planned: Annotated[float, Field(description="Duration of the planned tests [h].")]
    hours_standard: Annotated[
        float,
        Field(description="Duration of the standard programme, repeated as often as fits into that of the plan [h]."),
    ]
    hours_left: Annotated[float, Field(description="Hours of the rig that no test takes [h].")]
    enough: Annotated[str | None, Field(description="Reason why hours are left; null if they are used.")]
    targets: Annotated[dict[str, TargetEntry], Field(description="Targets by name; empty if none was given.")]
    parameters: Annotated[dict[str, Reached], Field(description="Relative standard error of each parameter.")]
    stiffness: Annotated[
        dict[str, Reached],
        Field(description="Root mean square relative standard error of the stiffness, by direction or specimen."),
    ]
    loss_factor: Annotated[
        dict[str, Reached], Field(description="Root mean square standard error of the loss factor, likewise.")
    ]
    visible: Annotated[dict[str, Shown], Field(description="Smallest detectable amount of each effect.")]
    drift: Annotated[
        dict[str, float],
        Field(
            description="Largest shift of a parameter over its standard error if the gain drifts by 1 % over the "
            "session, in the order of the plan and in that by direction and level."
        ),
    ]
    rivals: Annotated[Rivalry | None, Field(description="Models to separate; null if there are none.")]
    check: Annotated[Checked | None, Field(description="Simulations of the plan; null if none were asked for.")]
    warnings: Annotated[list[str], Field(description="Limits of the plan.")]


@dataclass(frozen=True, eq=False)
class PlanOutput:
    """Results of a plan.

    Args:
        plan: the plan.
        check: simulations of the plan, if they were asked for.
    """

    plan: Plan
    check: Check | None = None

    @property
    def files(self) -> list[ResultFile]:
        """Document, sheet of tests, figure, and the plan as a campaign file unless it has no tests."""
        files = [
            json_file("plan", self.document),
            table_file("plan", partial(plan_sheet, self.plan)),
            figure_file("plan", lambda: plots.plan.plan_figure(self.plan)),
        ]
        if self.plan.planned.tests:
            files.append(raw_file(CAMPAIGN_FILE, campaign_toml(self.plan).encode()))
        return files

    @cached_property
    def document(self) -> PlanFile:
        """Content of plan.json."""
        plan, request, names = self.plan, self.plan.request, self.plan.knowledge.names
        programmes = (plan.before, plan.planned, plan.standard)
        halves = zip(*(programme.halves for programme in programmes), strict=True)
        rivals: Rivalry | None = None
        if plan.planned.rival_chi_square is not None and plan.standard.rival_chi_square is not None:
            rivals = {
                "effects": [rival.model.effects[-1] for rival in plan.knowledge.rivals],
                "planned": plan.planned.rival_chi_square,
                "standard": plan.standard.rival_chi_square,
                "enough": RIVALS_APART,
            }
        return {
            "schema": "bushfit/plan/1",
            "source": plan.knowledge.source,
            "aim": request.aim,
            "hours": request.hours,
            "tests": [_run(*pair) for pair in zip(plan.planned.tests, plan.planned.minutes.tolist(), strict=True)],
            "hours_planned": plan.planned.hours,
            "hours_standard": plan.standard.hours,
            "hours_left": request.hours - plan.planned.hours,
            "enough": plan.enough,
            "targets": {
                str(target): {"asked": target.half, **_reached(half), "met": reason is None, "why": reason}
                for target, reason, half in zip(request.targets, plan.missed, halves, strict=True)
            },
            "parameters": {
                name: _reached([programme.errors[index] for programme in programmes])
                for index, name in enumerate(names)
            },
            "stiffness": dict(self._root_mean_squares([programme.stiffness for programme in programmes])),
            "loss_factor": dict(self._root_mean_squares([programme.loss for programme in programmes])),
            "visible": dict(self._smallest_amounts()),
            "drift": {"planned": plan.planned.drift, "standard": plan.standard.drift},
            "rivals": rivals,
            "check": _checked(self.check) if self.check else None,
            "warnings": list(plan.notes),
        }

    def _root_mean_squares(self, errors: Sequence[Array]) -> Iterator[tuple[str, Reached]]:
        """Root mean square of errors at the points of each direction, for each programme."""
        points = self.plan.request.points
        ends = np.cumsum([part.frequency.size for part in points])[:-1]
        for part, *errors_there in zip(points, *(np.split(error, ends) for error in errors), strict=True):
            yield str(part.place), _reached([float(np.sqrt(np.mean(np.square(error)))) for error in errors_there])

    def _smallest_amounts(self) -> Iterator[tuple[str, Shown]]:
        """Smallest detectable amount of each effect."""
        for planned, standard in zip(self.plan.planned.detectable, self.plan.standard.detectable, strict=True):
            amounts = [item.amount if np.isfinite(item.amount) else None for item in (planned, standard)]
            yield (
                planned.effect,
                Shown(parameter=planned.parameter, unit=planned.unit, planned=amounts[0], standard=amounts[1]),
            )


def plan(
    source: Campaign | Result | Knowledge,
    campaign: Campaign | None = None,
    *,
    aim: Aim = "predictions",
    hours: float = 8.0,
    test_directions: Sequence[str] = (),
    parameters: Sequence[str] = (),
    rivals: Sequence[str] = (),
    targets: Mapping[str, float] | None = None,
    directions: Sequence[str] | None = None,
    frequencies: Numbers | None = None,
    amplitudes: Numbers | None = None,
    torsion_amplitudes: Numbers | None = None,
    strain_amplitudes: Numbers | None = None,
) -> PlanOutput:
    """Choose the next tests of a campaign, of a fitted model, or of a compound that was not tested yet.

    Args:
        source: campaign with tests, with a compound, or with a model to simulate; or a fitted model.
        campaign: of a fitted model, campaign with the rig and the wanted predictions.
        aim: "parameters", "predictions" or "rivals".
        hours: largest duration on the rig [h].
        test_directions: directions or specimens that the rig can test; default axial and radial, or all specimens.
        parameters: parameters whose errors count; default all.
        rivals: effects to separate; default those that the diagnosis leaves open.
        targets: half of the 95 % interval over the value, by parameter, or by "stiffness" or "loss_factor" everywhere
            or at one direction, such as "stiffness.axial".
        directions: directions of the wanted predictions.
        frequencies: [Hz] of the wanted predictions.
        amplitudes: zero-to-peak displacements [m] of the wanted predictions.
        torsion_amplitudes: zero-to-peak rotations [rad] of them.
        strain_amplitudes: zero-to-peak strains of them.

    Returns:
        Tests in their order with their expected results, and the result files.

    Raises:
        CampaignError: nothing is known of the rubber.
        FitError: tests that cannot support a fit.
        ModelError: a parameter that is not fitted, a direction without a body, or no tests for this aim.
    """
    knowledge = _knowledge(source, rivals if aim == "rivals" else None)
    campaign = source if isinstance(source, Campaign) else campaign
    for name in parameters:
        if name not in knowledge.names:
            raise ModelError(
                "this parameter is not among those that tests are to tell",
                place="--parameters",
                found=name,
                expected=", ".join(knowledge.names),
                hint=did_you_mean(name, knowledge.names),
            )
    default = [Direction.AXIAL, Direction.RADIAL] if knowledge.model.bushing else list(knowledge.specimens)
    places = tuple(get_place(name, knowledge.specimens) for name in test_directions) or tuple(default)
    grid = grid_of(directions, frequencies, amplitudes, torsion_amplitudes, strain_amplitudes)
    points = tuple(_wanted_points(Result(knowledge.model, specimens=knowledge.specimens), grid, campaign, default))
    rig = rig_of(campaign.rig if campaign else RigSettings(), knowledge.noise)
    named = (_targets(name, half, knowledge, points) for name, half in (targets or {}).items())
    wanted = tuple(chain.from_iterable(named))
    request = PlanRequest(aim, hours, rig, places, points, tuple(parameters) or knowledge.names, wanted)
    return PlanOutput(choose_tests(knowledge, request))


def with_check(output: PlanOutput, check: Check) -> PlanOutput:
    """Output of a plan together with its simulations."""
    return replace(output, check=check)


def _knowledge(source: Campaign | Result | Knowledge, rivals: Sequence[str] | None) -> Knowledge:
    """Model and uncertainty before further tests."""
    if isinstance(source, Knowledge):
        return source
    if isinstance(source, Result):
        return from_result(source)
    if source.loops or source.sweeps:
        return from_campaign(prepare_tests(source), rivals)
    if source.bushing and source.compound:
        return guess_parameters(source.bushing, source.compound)
    return from_result(Result(model_of(source), specimens=source.specimens))


def _wanted_points(
    result: Result, grid: PredictSettings, campaign: Campaign | None, default: Sequence[Place]
) -> Iterator[Points]:
    """Operating points of the wanted predictions: as asked for, as [predict] states, or the grid of `predict`."""
    settings = grid_settings(grid, campaign)
    places = [get_place(name, result.specimens) for name in settings.directions or ()]
    for place in places or default:
        usual = default_grid(result, place, campaign.sweeps if campaign else ())
        frequencies, amplitudes = requested_grid(usual, settings, place)
        amplitude, frequency = np.meshgrid(np.unique(amplitudes), np.unique(frequencies), indexing="ij")
        yield Points(place, frequency.ravel(), amplitude.ravel())


def _targets(name: str, half: float, knowledge: Knowledge, points: Sequence[Points]) -> list[Target]:
    """Targets of a name: a parameter, or a quantity at one direction or at all where predictions are wanted."""
    possible = {parameter: [Target(parameter, half)] for parameter in knowledge.names}
    for quantity in PREDICTED:
        targets = [Target(quantity, half, part.place) for part in points]
        possible |= {quantity: targets, **{str(target): [target] for target in targets}}
    if name not in possible:
        expected, hint = ", ".join(possible), did_you_mean(name, tuple(possible))
        raise ModelError("there is no such target", place="--target", found=name, expected=expected, hint=hint)
    return possible[name]


def plan_sheet(plan: Plan) -> pd.DataFrame:
    """Sheet for the operator of the rig: a row for each run in its order, with zero-to-peak amplitudes.

    The force, moment or stress is the largest that the model expects, to choose a load cell.

    Args:
        plan: with its tests in order.

    Returns:
        Table of texts, with durations [min].
    """
    tests = plan.planned.tests
    counts, repeats, rows = Counter(tests), Counter[Test](), []
    for order, (test, minutes) in enumerate(zip(tests, plan.planned.minutes, strict=True), start=1):
        repeats[test] += 1
        (frequency, amplitude), (length, force, _) = operating_points(test), test.direction.display
        stiffness = np.abs(plan.knowledge.model.stiffness(test.direction, frequency, amplitude))
        largest = number(force.factor * float(np.max(stiffness * amplitude)), 2)
        rows.append(
            {
                "order": order,
                "direction": str(test.direction),
                "test": "loop" if isinstance(test, SimulatedLoop) else f"sweep over {test.stepped}",
                "amplitude": f"{_distinct(length.factor * amplitude)} {length.name}",
                "frequency [Hz]": _distinct(frequency),
                "cycles": str(test.cycles) if isinstance(test, SimulatedLoop) else "until steady",
                "repeat": f"{repeats[test]} of {counts[test]}",
                "force up to": f"{largest} {force.name}",
                "minutes": round(float(minutes), 1),
                "minutes so far": round(float(np.sum(plan.planned.minutes[:order])), 1),
                "what for": plan.purposes[test],
            }
        )
    return pd.DataFrame(rows, columns=_COLUMNS)


def _distinct(values: Array) -> str:
    """Distinct numbers of an array, in their order."""
    return " ".join(dict.fromkeys(number(value, 4) for value in values.tolist()))


def _run(test: Test, minutes: float) -> PlannedRun:
    """One run as plan.json has it."""
    amplitudes, frequencies = map(list, motions(test))
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


def _reached(errors: Sequence[Any]) -> Reached:
    before, planned, standard = map(float, errors)
    return {"before": before, "planned": planned, "standard": standard}


def _checked(check: Check) -> Checked:
    """Simulations as plan.json has them."""
    low, high = check.interval
    return {
        "campaigns": len(check.deviations) + check.failed,
        "failed": check.failed,
        "seed": check.seed,
        "predicted": dict(zip(check.names, check.predicted.tolist(), strict=True)),
        "found": dict(zip(check.names, check.observed.tolist(), strict=True)),
        "ci95": {name: list(ends) for name, *ends in zip(check.names, low.tolist(), high.tolist(), strict=True)},
    }
