"""diagnosis.json, key by key: the schema bushfit/diagnosis/3.

Its JSON Schema is made of these types, and the type checker holds to them what `diagnosis.record` writes.
"""

from dataclasses import dataclass
from typing import Literal, NotRequired

from typing_extensions import TypedDict

from bushfit.diagnosis.holdout import HeldOut, Skipped
from bushfit.model.result import Usable

Verdict = Literal["consistent", "named", "ambiguous", "described", "partly", "unexplained"]


class SizeEntry(TypedDict):
    """A parameter of an effect, with its uncertainty where it is part of the model to use.

    Args:
        value: in the unit.
        stderr: standard error, in the unit; null where the parameter was not fitted.
        ci95: least and largest value of the 95 % interval; null where the parameter was not fitted.
        unit: SI; "1" of a ratio.
    """

    value: float
    stderr: float | None
    ci95: list[float] | None
    unit: str


class EffectEntry(TypedDict):
    """An effect or a mistake in the record that was added, or that leads a set of look-alikes.

    Args:
        name: of the effect or mistake.
        level: whether it belongs to the material, the component, the rig and so on; "unresolved" where it has twins.
        twins: effects of the rig that no such test tells from it.
        replaces: the branch of the paper that it stands in place of, or null.
        test: of a mistake in the record, the test in which it was made; else null.
        sentence: what it is, in words.
        correction: of a mistake, where it was made and what to write into the campaign; else null.
        parameters: by name.
        evidence: why it was named, in words.
        alternatives: what these tests cannot tell it from.
    """

    name: str
    level: str
    twins: list[str]
    replaces: str | None
    test: str | None
    sentence: str
    correction: str | None
    parameters: dict[str, SizeEntry]
    evidence: str
    alternatives: list[str]


#: The keys have a unit that is no name in Python, so that this type is made by a call.
WhereEntry = TypedDict(
    "WhereEntry",
    {
        "direction": str,
        "kind": Literal["sweep", "loop"],
        "frequency_Hz": list[float],
        "amplitude_mm": NotRequired[list[float]],
        "amplitude_deg": NotRequired[list[float]],
        "amplitude_%": NotRequired[list[float]],
        "component": Literal["storage", "loss", "force"],
        "excess": float,
        "reading": str,
    },
)
WhereEntry.__doc__ = """One region in which model and measurement disagree.

Args:
    direction: of the bushing, or a specimen by its name.
    kind: of the tests.
    frequency_Hz: least and largest [Hz].
    amplitude_mm: least and largest, zero-to-peak [mm], of a displacement.
    amplitude_deg: least and largest, zero-to-peak [deg], of a rotation.
    amplitude_%: least and largest, zero-to-peak [%], of a strain.
    component: of the stiffness, or the force of a loop.
    excess: root mean square of the smooth misfit there, in units of its own noise.
    reading: the same as a sentence.
"""


class BeforeAfter(TypedDict):
    """Root mean square residual in units of noise: 1 is the floor.

    Args:
        before: of the model as it came.
        after: of the model with what was added; or, of a mistake, if the record is put right.
    """

    before: float | None
    after: float | None


class GapEntry(TypedDict):
    """How far model and tests lie apart, in units of noise.

    Args:
        calibration: on the data that were fitted.
        heldout: on data that were left out and predicted from the rest; null where nothing can be left out.
        parts: the held-out figures part by part.
        skipped: parts that were not held out.
    """

    calibration: BeforeAfter
    heldout: BeforeAfter | None
    parts: tuple[HeldOut, ...]
    skipped: tuple[Skipped, ...]


class OddsEntry(TypedDict):
    """One explanation of a gap.

    Args:
        words: what it is.
        probability: if anything is missing.
        chances: the same for people.
    """

    words: str
    probability: float
    chances: str


class UsableEntry(TypedDict):
    """Within what model.json meets the tests, at the worst of all places: 95 % of the points lie nearer.

    Args:
        stiffness: relative difference of |K|.
        loss_factor: difference of the loss factor.
        held_out: whether each point was predicted from a fit without its run.
        places: the same place by place.
    """

    stiffness: float
    loss_factor: float
    held_out: bool
    places: tuple[Usable, ...]


@dataclass(frozen=True)
class Description:
    """What a gap without a name is like: one term A e^(i phi) f^p X^q beside the model; value, low and high of each.

    Args:
        phase_deg: phi [deg].
        frequency_power, amplitude_power: p and q [1].
        words: the same for people.
    """

    phase_deg: tuple[float, float, float]
    frequency_power: tuple[float, float, float]
    amplitude_power: tuple[float, float, float]
    words: str


class DiagnosisFile(TypedDict):
    """Where model and tests disagree, and what is missing.

    Args:
        schema: of this file.
        verdict: in a word: nothing is missing; named, and the gap is closed; several that cannot be told apart; a gap
            without a name, described; most of it named; a gap that nothing explains.
        summary: the verdict in a sentence.
        nothing: probability that nothing is missing beyond noise and tolerance.
        odds: what may explain the gap, the most probable first; what is left of 1 is for what is not told.
        effects: what was added, or the leaders of sets that cannot be told apart.
        where: regions of disagreement before anything was added.
        remainder: regions of disagreement that stay.
        description: of a gap without a name; else null.
        gap: how far model and tests lie apart, before and after.
        usable: within what model.json meets the tests; null where nothing was fitted.
        next_test: the measurement that would decide or confirm; empty where there is none.
        warnings: what else a user must know.
    """

    schema: Literal["bushfit/diagnosis/3"]
    verdict: Verdict
    summary: str
    nothing: float
    odds: list[OddsEntry]
    effects: list[EffectEntry]
    where: list[WhereEntry]
    remainder: list[WhereEntry]
    description: Description | None
    gap: GapEntry
    usable: UsableEntry | None
    next_test: str
    warnings: list[str]
