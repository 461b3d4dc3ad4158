"""What plan writes as JSON, key by key. Its JSON Schema is made of these types; the type checker holds to them."""

from typing import Annotated, Literal

from typing_extensions import Doc, TypedDict

from bushfit.planning.contract import Aim


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
