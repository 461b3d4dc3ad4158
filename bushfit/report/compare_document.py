"""What compare writes as JSON, key by key. Its JSON Schema is made of these types; the type checker holds to them."""

from typing import Annotated, Literal, NotRequired

from typing_extensions import Doc, TypedDict

from bushfit.diagnosis.holdout import Skipped
from bushfit.model.document import BushingTable
from bushfit.model.result import Range
from bushfit.prediction.comparison import ParameterContrast
from bushfit.reading.measurement import Source
from bushfit.validation import Number

#: What "schema" of the document says.
SchemaName = Literal["bushfit/compare/1"]
SCHEMA: SchemaName = "bushfit/compare/1"


class ComparedEntry(TypedDict):
    """One of what is compared."""

    label: Annotated[str, Doc("A, the reference, or B and so on.")]
    name: Annotated[str, Doc("of the bushing, or the model family.")]
    source: Annotated[str, Doc("file or folder that it was read from.")]
    sha256: Annotated[str | None, Doc("of the model file or campaign; null where it came from none.")]
    bushing: Annotated[BushingTable | None, Doc("null where specimens of the compound alone are known.")]
    effects: Annotated[list[str], Doc("of its model.")]
    reduced_chi_square: Annotated[
        Number | None, Doc("mean square residual in units of noise; null where it was not fitted.")
    ]
    nrmse: Annotated[
        Number | None, Doc("root mean square difference of model and tests, relative; null where it was not fitted.")
    ]
    measured: Annotated[Range | None, Doc("what it was fitted at; null where it was not fitted.")]
    inputs: Annotated[
        tuple[Source, ...],
        Doc("the files of the tests that it was fitted to, with the conditions that the campaign states."),
    ]


class Joint(TypedDict):
    """All parameters of two results together, correlations counted."""

    p: Annotated[Number, Doc("probability by chance of such differences.")]
    parameters: Annotated[int, Doc("how many count.")]


class Pair(TypedDict):
    """One result against the reference."""

    reference: Annotated[str, Doc("label of the reference.")]
    other: Annotated[str, Doc("label of the other.")]
    shared_inputs: Annotated[list[str], Doc("files that both were fitted to.")]
    joint: Annotated[Joint | None, Doc("all parameters together; null where none is tested.")]
    parameters: Annotated[list[ParameterContrast], Doc("each that both have.")]
    places: Annotated[
        dict[str, dict[str, list[Number | None] | list[Literal["yes", "no"]]]],
        Doc("by place, the columns of differences.csv: values, differences, and whether they are sure."),
    ]


class HeldOutPart(TypedDict):
    """A part of the tests that was held out."""

    part: Annotated[str, Doc("which.")]
    first: Annotated[Number, Doc("root mean square of the first family there, in units of noise.")]
    heldout: Annotated[Number, Doc("that of this family.")]


class Family(TypedDict):
    """A model family on the one campaign."""

    label: Annotated[str, Doc("as in `compared`.")]
    name: Annotated[str, Doc("effects that it adds, or puts in place of a branch, joined by +.")]
    parameters: Annotated[int, Doc("fitted.")]
    reduced_chi_square: Annotated[Number, Doc("mean square residual in units of noise.")]
    bic: Annotated[Number, Doc("chi-square + parameters ln n; lower is better.")]
    heldout: Annotated[
        Number | None, Doc("root mean square of what was held out, in units of noise; null where nothing can be.")
    ]
    first_there: Annotated[Number | None, Doc("that of the first family on the same parts.")]
    gain: Annotated[
        tuple[Number, Number, Number] | None,
        Doc(
            "by how much the mean square of what was held out is less than that of the first, low and high of its 95 "
            "% interval; null where nothing can be held out, and of the first."
        ),
    ]
    p: Annotated[Number | None, Doc("probability by chance of so large a gain or loss, over all families (Holm).")]
    probability: NotRequired[
        Annotated[
            Number,
            Doc(
                "of all families compared, by the evidence of the tests, a smooth error of the model counted where "
                "they are likelier with it; none where an older file does not say."
            ),
        ]
    ]
    parts: Annotated[list[HeldOutPart], Doc("each part that was held out.")]
    skipped: Annotated[list[Skipped], Doc("each that was not, and why.")]
    words: Annotated[str, Doc("whether it is nearer to what was held out than the first; empty of the first.")]


class ComparisonFile(TypedDict):
    """compare.json: several results side by side, or model families on one campaign."""

    schema: Annotated[SchemaName, Doc("of this file.")]
    compared: Annotated[list[ComparedEntry], Doc("what is compared, the reference first.")]
    pairs: Annotated[list[Pair], Doc("each other against the reference.")]
    families: Annotated[list[Family] | None, Doc("how each meets the tests; null where none were asked for.")]
    words: Annotated[list[str], Doc("what differs, or how much may differ that is not seen.")]
    warnings: Annotated[list[str], Doc("what a user must know before using the numbers.")]
    command: Annotated[str, Doc("as it was typed; empty where it was made otherwise.")]
    versions: Annotated[dict[str, str], Doc("of bushfit, and of the packages that the numbers rest on.")]
