"""What plan writes as JSON, key by key. Its JSON Schema is made of these types; the type checker holds to them."""

from typing import Literal

from typing_extensions import TypedDict

from bushfit.planning.contract import Aim


class PlannedRun(TypedDict):
    """One run of the rig, in the order of the plan.

    Args:
        place: direction, or specimen by its name.
        kind: of the test.
        stepped: what changes from point to point of a sweep, the other is held; null of a loop.
        amplitudes: zero-to-peak, in the unit.
        unit: SI, of the amplitudes: "m", "rad" or "1".
        frequencies_Hz: of the points, or of the loop.
        cycles: of a loop; null of a sweep.
        minutes: that it takes, with the change of direction before it.
    """

    place: str
    kind: Literal["loop", "sweep"]
    stepped: Literal["frequency", "amplitude"] | None
    amplitudes: list[float]
    unit: str
    frequencies_Hz: list[float]
    cycles: int | None
    minutes: float


class Reached(TypedDict):
    """What is known before, with the planned tests, and with the standard programme of as many hours.

    Args:
        before: without further tests.
        planned: with the tests of the plan.
        standard: with the standard programme instead.
    """

    before: float
    planned: float
    standard: float


class TargetEntry(Reached):
    """Half of a 95 % interval over its value, the widest of all points that are wanted.

    Args:
        asked: at most.
        met: whether the planned tests meet it.
        why: what they fail by, in words; null where it is met.
    """

    asked: float
    met: bool
    why: str | None


class Shown(TypedDict):
    """The smallest amount of an effect that a test of 5 % finds in 90 % of the cases.

    Args:
        parameter: whose amount it is.
        unit: SI; "1" of a ratio.
        planned: by the tests of the plan.
        standard: by the standard programme.
    """

    parameter: str
    unit: str
    planned: float | None
    standard: float | None


class Rivalry(TypedDict):
    """Models that explain what is known alike.

    Args:
        effects: that each adds.
        planned: expected chi-square between the two nearest after the best refit of either, by the tests of the plan.
        standard: the same by the standard programme.
        enough: from which on they are told apart in nine of ten cases.
    """

    effects: list[str]
    planned: float
    standard: float
    enough: float


class Checked(TypedDict):
    """The plan simulated many times, each campaign fitted anew.

    Args:
        campaigns: that were simulated.
        failed: that could not be fitted.
        seed: of the first; the others count on.
        predicted: relative standard error of each parameter by the plan, by name.
        found: the same from the scatter of the fits.
        ci95: of what was found, least and largest.
    """

    campaigns: int
    failed: int
    seed: int
    predicted: dict[str, float]
    found: dict[str, float]
    ci95: dict[str, list[float]]


class PlanFile(TypedDict):
    """plan.json: tests chosen for an aim, and what they would tell.

    Args:
        schema: of this file.
        source: where what is known before comes from, in words.
        aim: what the plan is for.
        hours: of the rig, at most.
        tests: runs in their order.
        hours_planned: that they take.
        hours_standard: that the standard programme takes, as often as it fits into the hours that the plan needs.
        hours_left: of those of the rig, that no test takes.
        enough: why hours stay free, in words; null where they are used.
        targets: 95 % intervals that were asked for, by name; none but for them.
        parameters: relative standard error of each parameter, by name.
        stiffness: root mean square relative standard error of the stiffness where it is wanted, by place.
        loss_factor: the same of the loss factor, in loss factor.
        visible: effects that the standard programme shows, by name.
        drift: largest shift of a parameter over its standard error by a drift of the gain of 1 % over the session; by
            the order of the plan, and by direction and level in turn.
        rivals: null where there are none.
        check: null where the plan was not simulated.
        warnings: what a user must know.
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
    parameters: dict[str, Reached]
    stiffness: dict[str, Reached]
    loss_factor: dict[str, Reached]
    visible: dict[str, Shown]
    drift: dict[str, float]
    rivals: Rivalry | None
    check: Checked | None
    warnings: list[str]
