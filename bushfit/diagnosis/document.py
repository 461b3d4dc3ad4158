"""Keys of diagnosis.json, in the schema bushfit/diagnosis/3.

The JSON Schema is generated from these types, and the type checker compares them with `diagnosis.record`.
"""

from dataclasses import dataclass
from typing import Annotated, Literal, NotRequired

from typing_extensions import Doc, TypedDict

from bushfit.diagnosis.holdout import HeldOut, Skipped
from bushfit.model.result import ExpectedError

Verdict = Literal["consistent", "named", "ambiguous", "described", "partly", "unexplained"]


class SizeEntry(TypedDict):
    """Value of one parameter of an effect, with its uncertainty if the model to use has this parameter."""

    value: Annotated[float, Doc("in the unit.")]
    stderr: Annotated[float | None, Doc("standard error, in the unit; null where the parameter was not fitted.")]
    ci95: Annotated[
        list[float] | None,
        Doc("least and largest value of the 95 % interval; null where the parameter was not fitted."),
    ]
    unit: Annotated[str, Doc('SI; "1" of a ratio.')]


class EffectEntry(TypedDict):
    """Effect or mistake in the record that was added, or the first of a set that the tests cannot distinguish."""

    name: Annotated[str, Doc("of the effect or mistake.")]
    level: Annotated[
        str,
        Doc('level: material, component, instrument or record; "unresolved" if it has twins.'),
    ]
    twins: Annotated[list[str], Doc("effects of the rig that tests of the bushing cannot distinguish from it.")]
    replaces: Annotated[str | None, Doc("the branch of the paper that it replaces, or null.")]
    test: Annotated[str | None, Doc("the test with the mistake; null for an effect.")]
    sentence: Annotated[str, Doc("description.")]
    correction: Annotated[
        str | None,
        Doc("what to write into the campaign to correct a mistake; null for an effect."),
    ]
    parameters: Annotated[dict[str, SizeEntry], Doc("by name.")]
    evidence: Annotated[str, Doc("the reason for the name.")]
    alternatives: Annotated[list[str], Doc("explanations that these tests cannot distinguish from it.")]


#: Some keys contain a unit that is not a valid Python name, so this type is created by a call.
MisfitRegionEntry = TypedDict(
    "MisfitRegionEntry",
    {
        "direction": Annotated[str, Doc("of the bushing, or a specimen by its name.")],
        "kind": Annotated[Literal["sweep", "loop"], Doc("of the tests.")],
        "frequency_Hz": Annotated[list[float], Doc("least and largest [Hz].")],
        "amplitude_mm": NotRequired[
            Annotated[list[float], Doc("least and largest, zero-to-peak [mm], of a displacement.")]
        ],
        "amplitude_deg": NotRequired[
            Annotated[list[float], Doc("least and largest, zero-to-peak [deg], of a rotation.")]
        ],
        "amplitude_%": NotRequired[Annotated[list[float], Doc("least and largest, zero-to-peak [%], of a strain.")]],
        "component": Annotated[Literal["storage", "loss", "force"], Doc("of the stiffness, or the force of a loop.")],
        "excess": Annotated[float, Doc("root mean square of the smooth misfit there, in units of its own noise.")],
        "reading": Annotated[str, Doc("the same as a sentence.")],
    },
)
MisfitRegionEntry.__doc__ = "One region in which model and measurement disagree."


class BeforeAfter(TypedDict):
    """Root mean square residual in units of noise, before and after the additions; 1 is noise alone."""

    before: Annotated[float | None, Doc("of the model at the start.")]
    after: Annotated[
        float | None,
        Doc("of the model with the added effects, or with the corrected record."),
    ]


class GapEntry(TypedDict):
    """Misfit between model and tests, in units of noise."""

    calibration: Annotated[BeforeAfter, Doc("on the data that were fitted.")]
    heldout: Annotated[
        BeforeAfter | None,
        Doc("on data that were left out and predicted from the rest; null if no data can be left out."),
    ]
    parts: Annotated[tuple[HeldOut, ...], Doc("the held-out figures part by part.")]
    skipped: Annotated[tuple[Skipped, ...], Doc("parts that were not held out.")]


class OddsEntry(TypedDict):
    """One explanation of a gap, with its probability."""

    words: Annotated[str, Doc("what it is.")]
    probability: Annotated[float, Doc("if anything is missing.")]


class ExpectedErrorEntry(TypedDict):
    """Expected error of model.json for the worst direction or specimen: 95 % of its points have smaller errors."""

    stiffness: Annotated[float, Doc("relative difference of |K|.")]
    loss_factor: Annotated[float, Doc("difference of the loss factor.")]
    held_out: Annotated[bool, Doc("whether each point was predicted from a fit without its run.")]
    places: Annotated[tuple[ExpectedError, ...], Doc("the same place by place.")]


@dataclass(frozen=True)
class Description:
    """Power law A e^(i phi) f^p X^q nearest to a gap without a name, added to the model's stiffness.

    Each quantity is a value with the ends of its 95 % interval.

    Args:
        phase_deg: phi [deg].
        frequency_power, amplitude_power: p and q [1].
        words: the power law as a sentence.
    """

    phase_deg: tuple[float, float, float]
    frequency_power: tuple[float, float, float]
    amplitude_power: tuple[float, float, float]
    words: str


class DiagnosisFile(TypedDict):
    """Content of diagnosis.json, the result of a diagnosis."""

    schema: Annotated[Literal["bushfit/diagnosis/3"], Doc("of this file.")]
    verdict: Annotated[
        Verdict,
        Doc(
            "consistent: nothing is missing; named: one explanation closes the gap; ambiguous: several "
            "explanations; described: a correction without a name; partly: a remainder is left; unexplained: "
            "nothing closes the gap."
        ),
    ]
    summary: Annotated[str, Doc("the verdict in a sentence.")]
    nothing: Annotated[float, Doc("probability that nothing is missing beyond noise and tolerance.")]
    odds: Annotated[
        list[OddsEntry],
        Doc(
            "possible explanations, the most probable first; the rest to 1 belongs to explanations that are not listed."
        ),
    ]
    effects: Annotated[
        list[EffectEntry], Doc("effects that were added, or those of the most probable explanation if none was.")
    ]
    where: Annotated[list[MisfitRegionEntry], Doc("regions of disagreement before anything was added.")]
    remainder: Annotated[list[MisfitRegionEntry], Doc("regions of disagreement that remain.")]
    description: Annotated[Description | None, Doc("of a gap without a name; else null.")]
    gap: Annotated[GapEntry, Doc("misfit of model and tests, before and after.")]
    usable: Annotated[ExpectedErrorEntry | None, Doc("expected error of model.json; null if nothing was fitted.")]
    next_test: Annotated[str, Doc("the test that would decide or confirm; empty if there is none.")]
    warnings: Annotated[list[str], Doc("warnings.")]
