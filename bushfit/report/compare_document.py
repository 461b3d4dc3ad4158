"""Types of `compare.json`, the JSON file of a comparison, from which its JSON Schema is made."""

from typing import Annotated, Literal

from typing_extensions import Doc, TypedDict

from bushfit.diagnosis.holdout import Skipped
from bushfit.model.document import BushingTable
from bushfit.model.result import Range
from bushfit.prediction.comparison import ParameterContrast
from bushfit.reading.measurement import Source
from bushfit.validation import Number

#: Value of the key `schema`.
SchemaName = Literal["bushfit/compare/1"]
SCHEMA: SchemaName = "bushfit/compare/1"


class ComparedEntry(TypedDict):
    """One result of a comparison."""

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


class JointContrast(TypedDict):
    """Test of all parameters of two results together for a difference, with their correlations."""

    p: Annotated[Number, Doc("probability by chance of such differences.")]
    parameters: Annotated[int, Doc("number of parameters that count.")]


class ComparedPair(TypedDict):
    """One result compared with the reference."""

    reference: Annotated[str, Doc("label of the reference.")]
    other: Annotated[str, Doc("label of the other.")]
    shared_inputs: Annotated[list[str], Doc("files that both were fitted to.")]
    joint: Annotated[JointContrast | None, Doc("all parameters together; null where none is tested.")]
    parameters: Annotated[list[ParameterContrast], Doc("parameters that both have.")]
    places: Annotated[
        dict[str, dict[str, list[Number | None] | list[Literal["yes", "no"]]]],
        Doc("columns of differences.csv by direction: values, differences, and whether they are significant."),
    ]


class HeldOutPart(TypedDict):
    """Errors of two model families on a part of the tests that was held out of the fit."""

    part: Annotated[str, Doc("name of the part.")]
    first: Annotated[Number, Doc("root mean square of the first family on the part, in units of noise.")]
    heldout: Annotated[Number, Doc("the same of this family.")]


class FamilyEntry(TypedDict):
    """Agreement of one model family with the tests of the campaign."""

    label: Annotated[str, Doc("as in `compared`.")]
    name: Annotated[str, Doc("effects that it adds or that replace a branch, joined by +.")]
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
            "mean square of the held-out parts of the first family minus that of this family, with its 95 % interval; "
            "null where nothing can be held out, and of the first."
        ),
    ]
    p: Annotated[Number | None, Doc("probability by chance of so large a gain or loss, over all families (Holm).")]
    probability: Annotated[
        Number,
        Doc("of the family among those compared, by the evidence of the tests, with a smooth model error if it helps."),
    ]
    parts: Annotated[list[HeldOutPart], Doc("parts that were held out.")]
    skipped: Annotated[list[Skipped], Doc("parts that were not held out, and why.")]
    words: Annotated[str, Doc("comparison of its held-out error with that of the first family; empty of the first.")]


class ComparisonFile(TypedDict):
    """Content of compare.json: several results side by side, or model families on one campaign."""

    schema: Annotated[SchemaName, Doc("of this file.")]
    compared: Annotated[list[ComparedEntry], Doc("results, the reference first.")]
    pairs: Annotated[list[ComparedPair], Doc("each other result with the reference.")]
    families: Annotated[list[FamilyEntry] | None, Doc("agreement with the tests; null without families.")]
    words: Annotated[list[str], Doc("sentences on what differs.")]
    warnings: Annotated[list[str], Doc("warnings on the use of the numbers.")]
    command: Annotated[str, Doc("command line; empty if the comparison was made from Python.")]
    versions: Annotated[dict[str, str], Doc("of bushfit, and of the packages that the numbers rest on.")]
