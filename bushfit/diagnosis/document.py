"""Keys of diagnosis.json, in the schema bushfit/diagnosis/3.

The JSON Schema is generated from these types, and the type checker compares them with `diagnosis.record`.
"""

from dataclasses import dataclass
from typing import Annotated, Literal, NotRequired

from pydantic import Field
from typing_extensions import TypedDict

from bushfit.diagnosis.holdout import HeldOut, Skipped
from bushfit.model.result import ExpectedError
from bushfit.prediction.validation import ValidationEntry

Verdict = Literal["consistent", "named", "ambiguous", "described", "partly", "unexplained"]


class SizeEntry(TypedDict):
    """Entry of diagnosis.json for one parameter of an effect: value, standard error, 95 % interval and unit.

    Args:
        value: value of the parameter, in `unit`.
        stderr: standard error, in `unit`; null if the parameter was not fitted.
        ci95: ends of the 95 % interval, in `unit`; null if the parameter was not fitted.
        unit: SI unit of the parameter; "1" for a ratio.
    """

    value: float
    stderr: float | None
    ci95: list[float] | None
    unit: str


class EffectEntry(TypedDict):
    """Effect, or mistake in a test file, that the diagnosis adds to the model, or the first of an undecided set.

    Args:
        name: name of the effect or mistake.
        level: material, component, instrument or record; "unresolved" for an effect that has twins.
        twins: effects of the rig that tests of the bushing cannot distinguish from this effect.
        replaces: branch (elastic, springpot or friction) that the effect replaces; null if it is added.
        test: name of the test with the mistake; null for an effect.
        sentence: description of the effect or mistake.
        correction: line for the campaign file that corrects the mistake; null for an effect.
        parameters: fitted parameters of the effect by name.
        evidence: reason why the diagnosis names this effect or mistake.
        alternatives: explanations without this effect or mistake that these tests cannot exclude.
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


#: Keys of a region whose units are no Python names.
_RegionKeys = TypedDict(
    "_RegionKeys",
    {
        "frequency_Hz": Annotated[list[float], Field(description="lowest and highest frequency [Hz].")],
        "amplitude_%": NotRequired[
            Annotated[list[float], Field(description="smallest and largest zero-to-peak strain [%].")]
        ],
    },
)


class MisfitRegionEntry(_RegionKeys):
    """One region in which model and measurement disagree.

    Args:
        direction: direction of the bushing, or name of a specimen.
        kind: kind of the tests in this region.
        amplitude_mm: smallest and largest zero-to-peak displacement [mm].
        amplitude_deg: smallest and largest zero-to-peak rotation [deg].
        component: storage or loss stiffness of sweeps, or force of a loop.
        excess: root mean square of the smooth misfit in the region, in units of its noise.
        reading: description of the region as a sentence.
    """

    direction: str
    kind: Literal["sweep", "loop"]
    amplitude_mm: NotRequired[list[float]]
    amplitude_deg: NotRequired[list[float]]
    component: Literal["storage", "loss", "force"]
    excess: float
    reading: str


class BeforeAfter(TypedDict):
    """Root mean square residual in units of noise, before and after effects are added; 1 is noise alone.

    Args:
        before: root mean square residual of the starting model.
        after: root mean square residual with the added effects, or with the corrected record.
    """

    before: float | None
    after: float | None


class GapEntry(TypedDict):
    """Entry of diagnosis.json on the root mean square residual, in units of noise, of fitted and of held-out data.

    Args:
        calibration: misfit of the data that were fitted.
        heldout: misfit of data that were left out of the fit and predicted; null if none can be left out.
        parts: misfit of each part of the tests that was left out of a fit and predicted.
        skipped: parts of the tests that could not be left out of a fit, with the reason.
    """

    calibration: BeforeAfter
    heldout: BeforeAfter | None
    parts: tuple[HeldOut, ...]
    skipped: tuple[Skipped, ...]


class OddsEntry(TypedDict):
    """Entry of diagnosis.json for one explanation of the gap between model and tests, with its probability.

    Args:
        words: description of the explanation.
        probability: probability of the explanation if anything is missing.
    """

    words: str
    probability: float


class ExpectedErrorEntry(TypedDict):
    """Expected errors of |K| (relative) and loss factor (absolute) of model.json for the worst direction or specimen.

    95 % of its points have smaller errors.

    Args:
        stiffness: error of |K|, relative to |K|.
        loss_factor: absolute error of the loss factor.
        held_out: true if each point was predicted from a fit without its run.
        places: expected error of each direction or specimen.
    """

    stiffness: float
    loss_factor: float
    held_out: bool
    places: tuple[ExpectedError, ...]


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


class DiagnosisFile(TypedDict):
    """Content of diagnosis.json, the result of a diagnosis.

    Args:
        schema: name and version of the layout of this file.
        verdict: consistent: nothing is missing; named: one explanation closes the gap; ambiguous: several explanations;
            described: a correction without a name; partly: a remainder is left; unexplained: nothing closes the gap.
        summary: verdict as a sentence.
        nothing: probability that nothing is missing beyond noise and tolerance.
        odds: possible explanations, the most probable first; the rest to 1 belongs to explanations that are not listed.
        effects: effects that were added to the model; if none was added, the effects of the most probable explanation.
        where: regions in which the starting model and the tests disagree.
        remainder: regions in which the final model and the tests disagree.
        description: power law nearest to a gap that no known effect explains; null without such a gap.
        gap: misfit between model and tests, before and after the additions.
        validation: validation records of the campaign; missing without any.
        usable: expected error of model.json; null for fewer than five fitted points.
        next_test: test that would decide between the explanations or confirm the verdict; empty without one.
        warnings: warnings on the tests, the fit and the model to use.
        warning_kinds: kind of each warning, as in bushfit/caveat.toml; missing in older files.
    """

    schema: Literal["bushfit/diagnosis/3"]
    verdict: Verdict
    summary: str
    nothing: float
    odds: list[OddsEntry]
    effects: list[EffectEntry]
    where: list[MisfitRegionEntry]
    remainder: list[MisfitRegionEntry]
    description: Description | None
    gap: GapEntry
    validation: NotRequired[list[ValidationEntry]]
    usable: ExpectedErrorEntry | None
    next_test: str
    warnings: list[str]
    warning_kinds: NotRequired[list[str]]
