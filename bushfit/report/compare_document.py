"""What compare writes as JSON, key by key. Its JSON Schema is made of these types; the type checker holds to them."""

from typing import Literal, NotRequired

from typing_extensions import TypedDict

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
    """One of what is compared.

    Args:
        label: A, the reference, or B and so on.
        name: of the bushing, or the model family.
        source: file or folder that it was read from.
        sha256: of the model file or campaign; null where it came from none.
        bushing: null where specimens of the compound alone are known.
        effects: of its model.
        reduced_chi_square: mean square residual in units of noise; null where it was not fitted.
        nrmse: root mean square difference of model and tests, relative; null where it was not fitted.
        measured: what it was fitted at; null where it was not fitted.
        inputs: the files of the tests that it was fitted to, with the conditions that the campaign states.
    """

    label: str
    name: str
    source: str
    sha256: str | None
    bushing: BushingTable | None
    effects: list[str]
    reduced_chi_square: Number | None
    nrmse: Number | None
    measured: Range | None
    inputs: tuple[Source, ...]


class Joint(TypedDict):
    """All parameters of two results together, correlations counted.

    Args:
        p: probability by chance of such differences.
        parameters: how many count.
    """

    p: Number
    parameters: int


class Pair(TypedDict):
    """One result against the reference.

    Args:
        reference: label of the reference.
        other: label of the other.
        shared_inputs: files that both were fitted to.
        joint: all parameters together; null where none is tested.
        parameters: each that both have.
        places: by place, the columns of differences.csv: values, differences, and whether they are sure.
    """

    reference: str
    other: str
    shared_inputs: list[str]
    joint: Joint | None
    parameters: list[ParameterContrast]
    places: dict[str, dict[str, list[Number | None] | list[Literal["yes", "no"]]]]


class HeldOutPart(TypedDict):
    """A part of the tests that was held out.

    Args:
        part: which.
        first: root mean square of the first family there, in units of noise.
        heldout: that of this family.
    """

    part: str
    first: Number
    heldout: Number


class Family(TypedDict):
    """A model family on the one campaign.

    Args:
        label: as in `compared`.
        name: effects that it adds, or puts in place of a branch, joined by +.
        parameters: fitted.
        reduced_chi_square: mean square residual in units of noise.
        bic: chi-square + parameters ln n; lower is better.
        heldout: root mean square of what was held out, in units of noise; null where nothing can be.
        first_there: that of the first family on the same parts.
        gain: by how much the mean square of what was held out is less than that of the first, low and high of its 95 %
            interval; null where nothing can be held out, and of the first.
        p: probability by chance of so large a gain or loss, over all families (Holm).
        probability: of all families compared, by the evidence of the tests, a smooth error of the model counted where
            they are likelier with it; none where an older file does not say.
        parts: each part that was held out.
        skipped: each that was not, and why.
        words: whether it is nearer to what was held out than the first; empty of the first.
    """

    label: str
    name: str
    parameters: int
    reduced_chi_square: Number
    bic: Number
    heldout: Number | None
    first_there: Number | None
    gain: tuple[Number, Number, Number] | None
    p: Number | None
    probability: NotRequired[Number]
    parts: list[HeldOutPart]
    skipped: list[Skipped]
    words: str


class ComparisonFile(TypedDict):
    """compare.json: several results side by side, or model families on one campaign.

    Args:
        schema: of this file.
        compared: what is compared, the reference first.
        pairs: each other against the reference.
        families: how each meets the tests; null where none were asked for.
        words: what differs, or how much may differ that is not seen.
        warnings: what a user must know before using the numbers.
        command: as it was typed; empty where it was made otherwise.
        versions: of bushfit, and of the packages that the numbers rest on.
    """

    schema: SchemaName
    compared: list[ComparedEntry]
    pairs: list[Pair]
    families: list[Family] | None
    words: list[str]
    warnings: list[str]
    command: str
    versions: dict[str, str]
