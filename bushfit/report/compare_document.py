"""Types of `compare.json`, the JSON file of a comparison, from which its JSON Schema is made."""

from typing import Annotated, Literal

from typing_extensions import Doc, TypedDict

from bushfit.diagnosis.holdout import Skipped
from bushfit.model.document import BushingTable
from bushfit.model.result import Range
from bushfit.prediction.parameter_comparison import ParameterContrast
from bushfit.reading.measurement import Source
from bushfit.validation import Number

#: Value of the key `schema`.
SchemaName = Literal["bushfit/compare/1"]
SCHEMA: SchemaName = "bushfit/compare/1"


class ComparedEntry(TypedDict):
    """Entry of compare.json for one of the compared results: name, source, model and agreement with its tests."""

    label: Annotated[str, Doc("letter of the result: A for the reference, then B and so on.")]
    name: Annotated[str, Doc("name of the bushing, or of the model family.")]
    source: Annotated[str, Doc("file or folder that the result was read from.")]
    sha256: Annotated[str | None, Doc("SHA-256 of the model file or campaign; null without a file.")]
    bushing: Annotated[
        BushingTable | None, Doc("geometry of the bushing; null if the result has only specimens of the compound.")
    ]
    effects: Annotated[list[str], Doc("names of the effects of the model.")]
    reduced_chi_square: Annotated[
        Number | None, Doc("mean square residual in units of noise; null if the model was not fitted.")
    ]
    nrmse: Annotated[
        Number | None, Doc("relative root mean square difference of model and tests; null if the model was not fitted.")
    ]
    measured: Annotated[Range | None, Doc("ranges of the fitted tests; null if the model was not fitted.")]
    inputs: Annotated[
        tuple[Source, ...], Doc("files of the fitted tests, with the conditions that the campaign states.")
    ]


class JointContrast(TypedDict):
    """Test of all parameters of two results together for a difference, with their correlations."""

    p: Annotated[Number, Doc("probability that chance alone causes such differences.")]
    parameters: Annotated[int, Doc("number of independent differences of parameters.")]


class ComparedPair(TypedDict):
    """Entry of compare.json for one result and the reference: differences of parameters, |K| and loss factor."""

    reference: Annotated[str, Doc("letter of the reference.")]
    other: Annotated[str, Doc("letter of the result that is compared with the reference.")]
    shared_inputs: Annotated[list[str], Doc("test files to which both results were fitted.")]
    joint: Annotated[JointContrast | None, Doc("test of all parameters together; null if no parameter is tested.")]
    parameters: Annotated[list[ParameterContrast], Doc("comparison of each parameter that both results have.")]
    places: Annotated[
        dict[str, dict[str, list[Number | None] | list[Literal["yes", "no"]]]],
        Doc("columns of differences.csv by direction: values, differences, and their significance."),
    ]


class HeldOutPart(TypedDict):
    """Root mean square residuals of two model families, in units of noise, on a held-out part of the tests."""

    part: Annotated[str, Doc("name of the part of the tests.")]
    first: Annotated[Number, Doc("root mean square residual of the first family, in units of noise.")]
    heldout: Annotated[Number, Doc("root mean square residual of this family, in units of noise.")]


class FamilyEntry(TypedDict):
    """Entry of compare.json for one model family (a set of effects): agreement, held-out error and probability."""

    label: Annotated[str, Doc("letter of the family in `compared`.")]
    name: Annotated[str, Doc("effects that the family adds or that replace a branch, joined by +.")]
    parameters: Annotated[int, Doc("number of fitted parameters.")]
    reduced_chi_square: Annotated[Number, Doc("mean square residual in units of noise.")]
    bic: Annotated[Number, Doc("Bayesian information criterion: chi-square + parameters ln n; lower is better.")]
    heldout: Annotated[
        Number | None, Doc("root mean square residual of the held-out parts, in units of noise; null without any.")
    ]
    first_there: Annotated[
        Number | None, Doc("root mean square residual of the first family on the same parts, in units of noise.")
    ]
    gain: Annotated[
        tuple[Number, Number, Number] | None,
        Doc(
            "mean square of the held-out parts of the first family minus that of this family, with its 95 % interval; "
            "null where nothing can be held out, and of the first."
        ),
    ]
    p: Annotated[
        Number | None, Doc("probability that chance alone causes this gain or loss, over all families (Holm).")
    ]
    probability: Annotated[
        Number,
        Doc("probability among the compared families; a smooth model error is included if that raises the likelihood."),
    ]
    parts: Annotated[list[HeldOutPart], Doc("errors on each part of the tests that was held out.")]
    skipped: Annotated[list[Skipped], Doc("parts of the tests that were not held out, with the reason.")]
    words: Annotated[
        str, Doc("sentence that compares the held-out error with that of the first family; empty for the first.")
    ]


class ComparisonFile(TypedDict):
    """Content of compare.json: several results side by side, or model families on one campaign."""

    schema: Annotated[SchemaName, Doc("name and version of the layout of this file.")]
    compared: Annotated[list[ComparedEntry], Doc("compared results, the reference first.")]
    pairs: Annotated[list[ComparedPair], Doc("comparison of each other result with the reference.")]
    families: Annotated[
        list[FamilyEntry] | None, Doc("agreement of each model family with the tests; null if results are compared.")
    ]
    words: Annotated[list[str], Doc("sentences on the differences, one for each result and direction.")]
    warnings: Annotated[list[str], Doc("warnings on the use of the numbers.")]
    command: Annotated[str, Doc("command line; empty if the comparison was made from Python.")]
    versions: Annotated[dict[str, str], Doc("versions of bushfit and of the numerical packages, by name.")]
