"""plan: which tests next, chosen for what they would tell, and the file that says so, key by key."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from typing_extensions import Doc, TypedDict

from bushfit.campaign.campaign import Campaign, model_of
from bushfit.campaign.schema import PredictSettings, RigSettings, SimulatedLoop
from bushfit.effects.contract import Array
from bushfit.errors import ModelError, did_you_mean
from bushfit.fitting.data import Data
from bushfit.geometry import Direction, Place, place_named
from bushfit.jobs.grid import asked_or, default_grid, grid_settings
from bushfit.model.result import Result
from bushfit.planning.campaign import Check, campaign_toml
from bushfit.planning.contract import Aim, Knowledge, Plan, Points, Programme, Target, Test, Wanted, motions
from bushfit.planning.knowledge import guess, of_campaign, of_result, rig_of
from bushfit.planning.offer import RIVALS_APART
from bushfit.planning.plan import plan
from bushfit.report.artifacts import plan_contents
from bushfit.report.contents import Contents, Kinds

#: Quantities of predictions that may be targets.
PREDICTED = ("stiffness", "loss_factor")
#: File of the plan that `simulate` takes.
CAMPAIGN_FILE = "campaign.toml"


class PlannedRun(TypedDict):
    """One run of the rig, in the order of the plan."""

    place: Annotated[str, Doc("direction, or specimen by its name.")]
    kind: Annotated[Literal["loop", "sweep"], Doc("of the test.")]
    stepped: Annotated[
        Literal["frequency", "amplitude"] | None,
        Doc("what changes from point to point of a sweep, the other is held; null of a loop."),
    ]
    amplitudes: Annotated[list[float], Doc("zero-to-peak, in the unit.")]
    unit: Annotated[str, Doc('SI, of the amplitudes: "m", "rad" or "1".')]
    frequencies_Hz: Annotated[list[float], Doc("of the points, or of the loop.")]
    cycles: Annotated[int | None, Doc("of a loop; null of a sweep.")]
    minutes: Annotated[float, Doc("that it takes, with the change of direction before it.")]


class Reached(TypedDict):
    """What is known before, with the planned tests, and with the standard programme of as many hours."""

    before: Annotated[float, Doc("without further tests.")]
    planned: Annotated[float, Doc("with the tests of the plan.")]
    standard: Annotated[float, Doc("with the standard programme instead.")]


class TargetEntry(Reached):
    """Half of a 95 % interval over its value, the widest of all points that are wanted."""

    asked: Annotated[float, Doc("at most.")]
    met: Annotated[bool, Doc("whether the planned tests meet it.")]
    why: Annotated[str | None, Doc("what they fail by, in words; null where it is met.")]


class Shown(TypedDict):
    """The smallest amount of an effect that a test of 5 % finds in 90 % of the cases."""

    parameter: Annotated[str, Doc("whose amount it is.")]
    unit: Annotated[str, Doc('SI; "1" of a ratio.')]
    planned: Annotated[float | None, Doc("by the tests of the plan.")]
    standard: Annotated[float | None, Doc("by the standard programme.")]


class Rivalry(TypedDict):
    """Models that explain what is known alike."""

    effects: Annotated[list[str], Doc("that each adds.")]
    planned: Annotated[
        float,
        Doc("expected chi-square between the two nearest after the best refit of either, by the tests of the plan."),
    ]
    standard: Annotated[float, Doc("the same by the standard programme.")]
    enough: Annotated[float, Doc("from which on they are told apart in nine of ten cases.")]


class Checked(TypedDict):
    """The plan simulated many times, each campaign fitted anew."""

    campaigns: Annotated[int, Doc("that were simulated.")]
    failed: Annotated[int, Doc("that could not be fitted.")]
    seed: Annotated[int, Doc("of the first; the others count on.")]
    predicted: Annotated[dict[str, float], Doc("relative standard error of each parameter by the plan, by name.")]
    found: Annotated[dict[str, float], Doc("the same from the scatter of the fits.")]
    ci95: Annotated[dict[str, list[float]], Doc("of what was found, least and largest.")]


class PlanFile(TypedDict):
    """plan.json: tests chosen for an aim, and what they would tell."""

    schema: Annotated[str, Doc("of this file.")]
    source: Annotated[str, Doc("where what is known before comes from, in words.")]
    aim: Annotated[Aim, Doc("what the plan is for.")]
    hours: Annotated[float, Doc("of the rig, at most.")]
    tests: Annotated[list[PlannedRun], Doc("runs in their order.")]
    hours_planned: Annotated[float, Doc("that they take.")]
    hours_standard: Annotated[
        float,
        Doc("that the standard programme takes, as often as it fits into the hours that the plan needs."),
    ]
    hours_left: Annotated[float, Doc("of those of the rig, that no test takes.")]
    enough: Annotated[str | None, Doc("why hours stay free, in words; null where they are used.")]
    targets: Annotated[dict[str, TargetEntry], Doc("95 % intervals that were asked for, by name; none but for them.")]
    parameters: Annotated[dict[str, Reached], Doc("relative standard error of each parameter, by name.")]
    stiffness: Annotated[
        dict[str, Reached],
        Doc("root mean square relative standard error of the stiffness where it is wanted, by place."),
    ]
    loss_factor: Annotated[dict[str, Reached], Doc("the same of the loss factor, in loss factor.")]
    visible: Annotated[dict[str, Shown], Doc("effects that the standard programme shows, by name.")]
    drift: Annotated[
        dict[str, float],
        Doc(
            "largest shift of a parameter over its standard error by a drift of the gain of 1 % over the session; by "
            "the order of the plan, and by direction and level in turn."
        ),
    ]
    rivals: Annotated[Rivalry | None, Doc("null where there are none.")]
    check: Annotated[Checked | None, Doc("null where the plan was not simulated.")]
    warnings: Annotated[list[str], Doc("what a user must know.")]


@dataclass(frozen=True, eq=False)
class Planned:
    """The outcome: the plan, and its check by simulation where it was asked for."""

    plan: Plan
    check: Check | None = None

    @property
    def campaign(self) -> dict[str, bytes]:
        """The plan as a campaign file for `bushfit simulate`, by its name; none of a plan without tests."""
        return {CAMPAIGN_FILE: campaign_toml(self.plan).encode()} if self.plan.planned.tests else {}

    @cached_property
    def document(self) -> PlanFile:
        known, wanted, found = self.plan.knowledge, self.plan.wanted, self.plan
        every = (found.before, found.planned, found.standard)
        return {
            "schema": "bushfit/plan/1",
            "source": known.source,
            "aim": wanted.aim,
            "hours": wanted.hours,
            "tests": [_run(*pair) for pair in zip(found.planned.tests, found.planned.minutes.tolist(), strict=True)],
            "hours_planned": found.planned.hours,
            "hours_standard": found.standard.hours,
            "hours_left": wanted.hours - found.planned.hours,
            "enough": found.enough,
            "targets": dict(self._targets()),
            "parameters": {
                name: _reached([programme.errors[place] for programme in every])
                for place, name in enumerate(known.names)
            },
            "stiffness": dict(self._root_mean_squares([programme.stiffness for programme in every])),
            "loss_factor": dict(self._root_mean_squares([programme.loss for programme in every])),
            "visible": dict(self._smallest_amounts()),
            "drift": {"planned": found.planned.drift, "standard": found.standard.drift},
            "rivals": self._rivalry(found.planned, found.standard),
            "check": _checked(self.check) if self.check else None,
            "warnings": list(found.notes),
        }

    def _targets(self) -> Iterator[tuple[str, TargetEntry]]:
        """How each target comes out."""
        found = self.plan
        halves = (found.before.halves, found.planned.halves, found.standard.halves)
        for target, why, *reached in zip(found.wanted.targets, found.missed, *halves, strict=True):
            yield str(target), {"asked": target.half, **_reached(reached), "met": why is None, "why": why}

    def _root_mean_squares(self, errors: Sequence[Array]) -> Iterator[tuple[str, Reached]]:
        """Root mean square of errors at the points of each place, of each programme."""
        points = self.plan.wanted.points
        ends = np.cumsum([each.frequency.size for each in points])[:-1]
        for each, *parts in zip(points, *(np.split(error, ends) for error in errors), strict=True):
            yield str(each.place), _reached([float(np.sqrt(np.mean(np.square(part)))) for part in parts])

    def _smallest_amounts(self) -> Iterator[tuple[str, Shown]]:
        """The smallest amounts that either programme finds of each effect."""
        for planned, standard in zip(self.plan.planned.visible, self.plan.standard.visible, strict=True):
            amounts = [each.amount if np.isfinite(each.amount) else None for each in (planned, standard)]
            yield (
                planned.effect,
                Shown(parameter=planned.parameter, unit=planned.unit, planned=amounts[0], standard=amounts[1]),
            )

    def _rivalry(self, planned: Programme, standard: Programme) -> Rivalry | None:
        if planned.apart is None or standard.apart is None:
            return None
        effects = [rival.model.effects[-1] for rival in self.plan.knowledge.rivals]
        return {"effects": effects, "planned": planned.apart, "standard": standard.apart, "enough": RIVALS_APART}

    @property
    def contents(self) -> Contents:
        return Contents({"plan": self.document}) | plan_contents(self.plan)


@dataclass(frozen=True)
class PlanTests:
    """Which tests next: for an aim, within hours, in these directions [axial and radial, or all specimens].

    Args:
        parameters: whose errors count; none for all.
        rivals: effects to be told apart; none for those that the diagnosis cannot tell.
        targets: half of the 95 % interval, over the value, by parameter, or by "stiffness" or "loss_factor", of all
            places where predictions are wanted or of one, as in "stiffness.axial".
        asked: where predictions are wanted.
    """

    aim: Aim = "predictions"
    hours: float = 8.0
    directions: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()
    rivals: tuple[str, ...] = ()
    targets: Mapping[str, float] = field(default_factory=dict)
    asked: PredictSettings = field(default_factory=PredictSettings)

    def kinds(self) -> Kinds:
        """The names of all that the outcome will hold."""
        return Kinds(("plan",), ("plan",), ("plan",))

    def run(self, source: Campaign | Result | Knowledge, campaign: Campaign | None = None) -> Planned:
        """After the tests of a campaign; or without tests by its [compound], or its model; or of a fitted model.

        Args:
            campaign: of a model, has the rig and what is to be predicted.

        Raises:
            CampaignError: nothing is known of the rubber.
            FitError: tests that cannot support a fit.
            ModelError: a parameter that is not fitted, a direction without a body, or no tests for this aim.
        """
        known = self._known(source)
        campaign = source if isinstance(source, Campaign) else campaign
        for name in self.parameters:
            if name not in known.names:
                raise ModelError(
                    "this parameter is not among those that tests are to tell",
                    place="--parameters",
                    found=name,
                    expected=", ".join(known.names),
                    hint=did_you_mean(name, known.names),
                )
        result = Result(known.model, specimens=known.specimens)
        usual = [Direction.AXIAL, Direction.RADIAL] if known.model.bushing else list(known.specimens)
        places = tuple(place_named(name, known.specimens) for name in self.directions) or tuple(usual)
        points = tuple(self._points(result, campaign, usual))
        rig = rig_of(campaign.rig if campaign else RigSettings(), known.noise)
        targets = tuple(target for name, half in self.targets.items() for target in _target(name, half, known, points))
        wanted = Wanted(self.aim, self.hours, rig, places, points, self.parameters or known.names, targets)
        return Planned(plan(known, wanted))

    def _known(self, source: Campaign | Result | Knowledge) -> Knowledge:
        if isinstance(source, Knowledge):
            return source
        if isinstance(source, Result):
            return of_result(source)
        if source.loops or source.sweeps:
            return of_campaign(Data.of(source), self.rivals if self.aim == "rivals" else None)
        if source.bushing and source.compound:
            return guess(source.bushing, source.compound)
        return of_result(Result(model_of(source), specimens=source.specimens))

    def _points(self, result: Result, campaign: Campaign | None, usual: Sequence[Place]) -> Iterator[Points]:
        """Where the stiffness is wanted: as asked, as the campaign's [predict] says, or on the grid of `predict`."""
        settings = grid_settings(self.asked, campaign)
        places = [place_named(name, result.specimens) for name in settings.directions or ()]
        for place in places or usual:
            usual_grid = default_grid(result, place, campaign.sweeps if campaign else ())
            frequencies, amplitudes = asked_or(usual_grid, settings, place)
            amplitude, frequency = np.meshgrid(np.unique(amplitudes), np.unique(frequencies), indexing="ij")
            yield Points(place, frequency.ravel(), amplitude.ravel())


def _target(name: str, half: float, known: Knowledge, points: Sequence[Points]) -> list[Target]:
    """What a target stands for: a parameter, or a quantity at one place or at all where predictions are wanted."""
    possible = {each: [Target(each, half)] for each in known.names}
    for quantity in PREDICTED:
        at = [Target(quantity, half, each.place) for each in points]
        possible |= {quantity: at, **{str(each): [each] for each in at}}
    if name not in possible:
        expected, hint = ", ".join(possible), did_you_mean(name, tuple(possible))
        raise ModelError("there is no such target", place="--target", found=name, expected=expected, hint=hint)
    return possible[name]


def _run(test: Test, minutes: float) -> PlannedRun:
    """One run as the document has it."""
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


def _reached(errors: Sequence[float]) -> Reached:
    before, planned, standard = map(float, errors)
    return {"before": before, "planned": planned, "standard": standard}


def _checked(check: Check) -> Checked:
    """A check as the document has it."""
    low, high = check.interval
    return {
        "campaigns": len(check.off) + check.failed,
        "failed": check.failed,
        "seed": check.seed,
        "predicted": dict(zip(check.names, check.predicted.tolist(), strict=True)),
        "found": dict(zip(check.names, check.found.tolist(), strict=True)),
        "ci95": {name: list(ends) for name, *ends in zip(check.names, low.tolist(), high.tolist(), strict=True)},
    }
