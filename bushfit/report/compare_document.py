"""Types of `compare.json`, the JSON file of a comparison, from which its JSON Schema is made."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from bushfit.diagnosis.holdout import Skipped
from bushfit.model.document import BushingTable
from bushfit.model.result import Range
from bushfit.prediction.parameter_comparison import JointContrast, ParameterContrast
from bushfit.reading.measurement import Source
from bushfit.validation import Number

#: Value of the key `schema`.
SchemaName = Literal["bushfit/compare/1"]
SCHEMA: SchemaName = "bushfit/compare/1"


@dataclass(frozen=True)
class ComparedEntry:
    """Entry of compare.json for one of the compared results: name, source, model and agreement with its tests.

    Args:
        label: letter of the result: A for the reference, then B and so on.
        name: name of the bushing, or of the model family.
        source: file or folder that the result was read from.
        sha256: SHA-256 of the model file or campaign; null without a file.
        bushing: geometry of the bushing; null if the result has only specimens of the compound.
        effects: names of the effects of the model.
        reduced_chi_square: mean square residual in units of noise; null if the model was not fitted.
        nrmse: relative root mean square difference of model and tests; null if the model was not fitted.
        measured: ranges of the fitted tests; null if the model was not fitted.
        inputs: files of the fitted tests, with the conditions that the campaign states.
    """

    label: str
    name: str
    source: str
    sha256: str | None
    bushing: BushingTable | None
    effects: Sequence[str]
    reduced_chi_square: Number | None
    nrmse: Number | None
    measured: Range | None
    inputs: tuple[Source, ...]


@dataclass(frozen=True)
class ComparedPair:
    """Entry of compare.json for one result and the reference: differences of parameters, |K| and loss factor.

    Args:
        reference: letter of the reference.
        other: letter of the result that is compared with the reference.
        shared_inputs: test files to which both results were fitted.
        joint: test of all parameters together; null if no parameter is tested.
        parameters: comparison of each parameter that both results have.
        places: columns of differences.csv by direction: values, differences, and their significance.
    """

    reference: str
    other: str
    shared_inputs: Sequence[str]
    joint: JointContrast | None
    parameters: Sequence[ParameterContrast]
    places: Mapping[str, Mapping[str, Sequence[Number | None] | Sequence[Literal["yes", "no"]]]]


@dataclass(frozen=True)
class HeldOutPart:
    """Root mean square residuals of two model families, in units of noise, on a held-out part of the tests.

    Args:
        part: name of the part of the tests.
        first: root mean square residual of the first family, in units of noise.
        heldout: root mean square residual of this family, in units of noise.
    """

    part: str
    first: Number
    heldout: Number


@dataclass(frozen=True)
class FamilyEntry:
    """Entry of compare.json for one model family (a set of effects): agreement, held-out error and probability.

    Args:
        label: letter of the family in `compared`.
        name: effects that the family adds or that replace a branch, joined by +.
        parameters: number of fitted parameters.
        reduced_chi_square: mean square residual in units of noise.
        bic: Bayesian information criterion: chi-square + parameters ln n; lower is better.
        heldout: root mean square residual of the held-out parts, in units of noise; null without any.
        first_there: root mean square residual of the first family on the same parts, in units of noise.
        gain: mean square of the held-out parts of the first family minus that of this family, with its 95 %
            interval; null where nothing can be held out, and of the first.
        p: probability that chance alone causes this gain or loss, over all families (Holm).
        probability: probability among the compared families, with a smooth error of the model if this raises the
            likelihood.
        parts: errors on each part of the tests that was held out.
        skipped: parts of the tests that were not held out, with the reason.
        words: sentence that compares the held-out error with that of the first family; empty for the first.
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
    probability: Number
    parts: Sequence[HeldOutPart]
    skipped: Sequence[Skipped]
    words: str


@dataclass(frozen=True)
class ComparisonFile:
    """Content of compare.json: several results side by side, or model families on one campaign.

    Args:
        schema: name and version of the layout of this file.
        compared: compared results, the reference first.
        pairs: comparison of each other result with the reference.
        families: agreement of each model family with the tests; null if results are compared.
        words: sentences on the differences, one for each result and direction.
        warnings: warnings on the use of the numbers.
        command: command line; empty if the comparison was made from Python.
        versions: versions of bushfit and of the numerical packages, by name.
        warning_kinds: kind of each warning, as in bushfit/caveat.toml.
    """

    schema: SchemaName
    compared: Sequence[ComparedEntry]
    pairs: Sequence[ComparedPair]
    families: Sequence[FamilyEntry] | None
    words: Sequence[str]
    warnings: Sequence[str]
    command: str
    versions: Mapping[str, str]
    warning_kinds: Sequence[str] = ()

    @property
    def names(self) -> dict[str, str]:
        """Name of each result by its label (A, B, ...); the source file or folder if two results have the same name."""
        repeated = len({entry.name for entry in self.compared}) < len(self.compared)
        return {entry.label: entry.source if repeated else entry.name for entry in self.compared}
