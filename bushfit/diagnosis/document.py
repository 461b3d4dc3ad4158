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
    """Entry of diagnosis.json for one parameter of an effect: value, standard error, 95 % interval and unit."""

    value: Annotated[float, Doc("value of the parameter, in `unit`.")]
    stderr: Annotated[float | None, Doc("standard error, in `unit`; null if the parameter was not fitted.")]
    ci95: Annotated[
        list[float] | None,
        Doc("ends of the 95 % interval, in `unit`; null if the parameter was not fitted."),
    ]
    unit: Annotated[str, Doc('SI unit of the parameter; "1" for a ratio.')]


class EffectEntry(TypedDict):
    """Effect, or mistake in a test file, that the diagnosis adds to the model, or the first of an undecided set."""

    name: Annotated[str, Doc("name of the effect or mistake.")]
    level: Annotated[
        str,
        Doc('material, component, instrument or record; "unresolved" for an effect that has twins.'),
    ]
    twins: Annotated[
        list[str], Doc("effects of the rig that tests of the bushing cannot distinguish from this effect.")
    ]
    replaces: Annotated[str | None, Doc("branch of the paper's model that the effect replaces; null if it is added.")]
    test: Annotated[str | None, Doc("name of the test with the mistake; null for an effect.")]
    sentence: Annotated[str, Doc("description of the effect or mistake.")]
    correction: Annotated[
        str | None,
        Doc("line for the campaign file that corrects the mistake; null for an effect."),
    ]
    parameters: Annotated[dict[str, SizeEntry], Doc("fitted parameters of the effect by name.")]
    evidence: Annotated[str, Doc("reason why the diagnosis names this effect or mistake.")]
    alternatives: Annotated[
        list[str], Doc("explanations that these tests cannot distinguish from this effect or mistake.")
    ]


#: Some keys contain a unit that is not a valid Python name, so this type is created by a call.
MisfitRegionEntry = TypedDict(
    "MisfitRegionEntry",
    {
        "direction": Annotated[str, Doc("direction of the bushing, or name of a specimen.")],
        "kind": Annotated[Literal["sweep", "loop"], Doc("kind of the tests in this region.")],
        "frequency_Hz": Annotated[list[float], Doc("lowest and highest frequency [Hz].")],
        "amplitude_mm": NotRequired[
            Annotated[list[float], Doc("smallest and largest zero-to-peak displacement [mm].")]
        ],
        "amplitude_deg": NotRequired[Annotated[list[float], Doc("smallest and largest zero-to-peak rotation [deg].")]],
        "amplitude_%": NotRequired[Annotated[list[float], Doc("smallest and largest zero-to-peak strain [%].")]],
        "component": Annotated[
            Literal["storage", "loss", "force"], Doc("storage or loss stiffness of sweeps, or force of a loop.")
        ],
        "excess": Annotated[float, Doc("root mean square of the smooth misfit in the region, in units of its noise.")],
        "reading": Annotated[str, Doc("description of the region as a sentence.")],
    },
)
MisfitRegionEntry.__doc__ = "One region in which model and measurement disagree."


class BeforeAfter(TypedDict):
    """Root mean square residual in units of noise, before and after the additions; 1 is noise alone."""

    before: Annotated[float | None, Doc("root mean square residual of the starting model.")]
    after: Annotated[
        float | None,
        Doc("root mean square residual with the added effects, or with the corrected record."),
    ]


class GapEntry(TypedDict):
    """Entry of diagnosis.json on the root mean square residual, in units of noise, of fitted and of held-out data."""

    calibration: Annotated[BeforeAfter, Doc("misfit of the data that were fitted.")]
    heldout: Annotated[
        BeforeAfter | None,
        Doc("misfit of data that were left out of the fit and predicted; null if none can be left out."),
    ]
    parts: Annotated[
        tuple[HeldOut, ...], Doc("misfit of each part of the tests that was left out of a fit and predicted.")
    ]
    skipped: Annotated[
        tuple[Skipped, ...], Doc("parts of the tests that could not be left out of a fit, with the reason.")
    ]


class OddsEntry(TypedDict):
    """Entry of diagnosis.json for one explanation of the gap between model and tests, with its probability."""

    words: Annotated[str, Doc("description of the explanation.")]
    probability: Annotated[float, Doc("probability of the explanation if anything is missing.")]


class ExpectedErrorEntry(TypedDict):
    """Expected errors of |K| (relative) and loss factor (absolute) of model.json for the worst direction or specimen.

    95 % of its points have smaller errors.
    """

    stiffness: Annotated[float, Doc("error of |K|, relative to |K|.")]
    loss_factor: Annotated[float, Doc("absolute error of the loss factor.")]
    held_out: Annotated[bool, Doc("true if each point was predicted from a fit without its run.")]
    places: Annotated[tuple[ExpectedError, ...], Doc("expected error of each direction or specimen.")]


@dataclass(frozen=True)
class Description:
    """Power law A e^(i phi) f^p X^q of the complex stiffness that a model lacks, nearest to a gap without a name.

    Each quantity is a value with the ends of its 95 % interval.

    Args:
        phase_deg: phase phi [deg].
        frequency_power, amplitude_power: powers p and q of the frequency f and the amplitude X [1].
        words: the power law as a sentence.
    """

    phase_deg: tuple[float, float, float]
    frequency_power: tuple[float, float, float]
    amplitude_power: tuple[float, float, float]
    words: str


class ValidationEntry(TypedDict):
    """Entry of diagnosis.json on one validation record, which no fit used: predicted compared with measured force."""

    test: Annotated[str, Doc("name of the record.")]
    direction: Annotated[str, Doc("direction of the bushing, or name of a specimen.")]
    nrmse: Annotated[float, Doc("rms error of the force with model.json, relative to half the range of the force.")]
    nrmse_before: Annotated[float | None, Doc("the same without the added effects; null if none were added.")]
    peak_gap: Annotated[float, Doc("relative gap of the largest force, measured minus predicted.")]
    energy_gap: Annotated[float, Doc("relative gap of the work, measured minus predicted.")]
    share_inside: Annotated[float, Doc("share of the measured points inside the 95 % band, 0 to 1.")]


class DiagnosisFile(TypedDict):
    """Content of diagnosis.json, the result of a diagnosis."""

    schema: Annotated[Literal["bushfit/diagnosis/3"], Doc("name and version of the layout of this file.")]
    verdict: Annotated[
        Verdict,
        Doc(
            "consistent: nothing is missing; named: one explanation closes the gap; ambiguous: several "
            "explanations; described: a correction without a name; partly: a remainder is left; unexplained: "
            "nothing closes the gap."
        ),
    ]
    summary: Annotated[str, Doc("verdict as a sentence.")]
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
    where: Annotated[list[MisfitRegionEntry], Doc("regions in which the starting model and the tests disagree.")]
    remainder: Annotated[list[MisfitRegionEntry], Doc("regions in which the final model and the tests disagree.")]
    description: Annotated[
        Description | None, Doc("power law nearest to a gap that no known effect explains; null without such a gap.")
    ]
    gap: Annotated[GapEntry, Doc("misfit between model and tests, before and after the additions.")]
    validation: NotRequired[
        Annotated[list[ValidationEntry], Doc("validation records of the campaign; missing without any.")]
    ]
    usable: Annotated[ExpectedErrorEntry | None, Doc("expected error of model.json; null if nothing was fitted.")]
    next_test: Annotated[
        str, Doc("test that would decide between the explanations or confirm the verdict; empty without one.")
    ]
    warnings: Annotated[list[str], Doc("warnings on the tests, the fit and the model to use.")]
