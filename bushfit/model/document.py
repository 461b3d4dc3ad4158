"""Keys of a model file (model.json, truth.json and the like), in the schema bushfit/model/1.

The dataclasses are the keys for the reader, the writer and the JSON Schema. Pydantic validates them and ignores other
keys.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, ConfigDict, Field

from bushfit.effects import Origin
from bushfit.effects.unnamed import Unnamed
from bushfit.errors import ModelError
from bushfit.geometry import CouponKind, Shape, StatedStrain
from bushfit.model.result import CampaignTable as CampaignTable
from bushfit.model.result import End, ExpectedError, Misfit, Outlier, PreloadRange, PriorUse, Quality, Range
from bushfit.model.result import TestTable as TestTable
from bushfit.units import SIZES
from bushfit.validation import Flag, Name, Number, WholeNumber

#: Value of the key "schema" of a model file.
SCHEMA: Literal["bushfit/model/1"] = "bushfit/model/1"

Matrix = tuple[tuple[Number, ...], ...]
Interval = tuple[Number, Number]
#: Relative tolerance for a least eigenvalue below zero that results from rounding in a file.
_ROUNDING = 1e-6


@dataclass(frozen=True)
class BushingTable:
    """Entry of a model file for the bushing: name, radii, length and shape formulas."""

    name: Annotated[Name, Field(description="Name of the bushing.")]
    inner_radius_m: Annotated[Number, Field(description="Inner radius of the rubber [m].")]
    outer_radius_m: Annotated[Number, Field(description="Outer radius of the rubber [m].")]
    length_m: Annotated[Number, Field(description="Mean length of the rubber [m].")]
    shape: Annotated[
        Shape, Field(description='"paper" for the radial formulas of the paper, "calibrated" for finite elements.')
    ] = "paper"


@dataclass(frozen=True)
class SpecimenTable:
    """Entry of a model file for a specimen of the compound (coupon or blocks in shear): kind and dimensions."""

    name: Annotated[Name, Field(description="Name of the specimen.")]
    kind: Annotated[CouponKind, Field(description='"modulus" for tests of the modulus, "shear" for blocks in shear.')]
    strain: Annotated[StatedStrain, Field(description="Kind of strain in the test files; for the kind modulus.")] = (
        "engineering"
    )
    area_m2: Annotated[Number | None, Field(description="Sheared area of a block [m^2]; for the kind shear.")] = None
    thickness_m: Annotated[Number | None, Field(description="Thickness of a block [m]; for the kind shear.")] = None
    elements: Annotated[WholeNumber, Field(description="Number of blocks in parallel.")] = 1


@dataclass(frozen=True)
class ParameterTable:
    """Entry of a model file for one parameter: value, unit, standard error, 95 % interval and bound."""

    value: Annotated[Number, Field(description="Value of the parameter, in `unit`.")]
    unit: Annotated[str | None, Field(description='SI unit; "1" for a ratio.')] = None
    stderr: Annotated[Number | None, Field(description="Standard error; null for an exact value.")] = None
    ci95: Annotated[Interval | None, Field(description="Ends of the 95 % interval; null for an exact value.")] = None
    vary: Annotated[Flag, Field(description="True if the parameter was fitted.")] = False
    profile95: Annotated[
        tuple[Number | None, Number | None] | None,
        Field(description="95 % interval by profile likelihood, if requested; null for an open end."),
    ] = None
    at_bound: Annotated[End | None, Field(description="Bound that the value reached: min or max.")] = None
    tied: Annotated[str | None, Field(description="Expression of other parameters that gives the value.")] = None
    prior: Annotated[PriorUse | None, Field(description="Prior of the parameter; null without one.")] = None


@dataclass(frozen=True)
class CovarianceTable:
    """Covariance matrix of the parameters [SI] in a model file, with the names of its rows and columns."""

    names: Annotated[tuple[str, ...], Field(description="Names of the parameters that have errors.")]
    matrix: Annotated[Matrix, Field(description="Covariance matrix, in the order of the names.")]
    spread: Annotated[
        tuple[Matrix, ...],
        Field(description="Change of the matrix when one estimated figure of the noise rises by its standard error."),
    ] = ()


def _check_covariance(table: CovarianceTable) -> CovarianceTable:
    """Return the table unchanged; raise a ValueError if its matrix is not a covariance of its names."""
    size = len(table.names)
    for matrix in (table.matrix, *table.spread):
        widths = {len(row) for row in matrix}
        if len(matrix) != size or widths - {size}:
            found = f"{len(matrix)} rows of {' or '.join(sorted(map(str, widths))) or 'no'} numbers"
            raise ValueError(
                ModelError("a covariance that does not match its names", found=found, expected=f"{size} x {size}")
            )
    if any(table.matrix[i][i] < 0.0 for i in range(size)):
        raise ValueError(ModelError("a variance below zero", place="matrix", expected="squares on the diagonal"))
    if len(set(table.names)) < size:
        raise ValueError(ModelError("a parameter twice", place="names", expected="each name once"))
    if not size:
        return table
    sigma = np.sqrt(np.diag(table.matrix))
    with np.errstate(over="ignore"):
        correlation = (table.matrix / np.outer(sigma, sigma).clip(np.finfo(float).tiny)).clip(-2.0, 2.0)
    if not np.allclose(correlation, correlation.T):
        raise ValueError(ModelError("a covariance that is not symmetric", place="matrix", expected="C = C^T"))
    if not np.linalg.eigvalsh(correlation).min() > -_ROUNDING * size:
        expected = "a positive semidefinite matrix"
        raise ValueError(ModelError("a covariance that no quantities have", place="matrix", expected=expected))
    return table


@dataclass(frozen=True)
class FitTable(Quality):
    """Entry of a model file on its fit: quality, ranges of the fitted tests, misfit by test, and expected error."""

    frequency_Hz: Annotated[Interval | None, Field(description="Lowest and highest frequency [Hz].")] = None  # noqa: N815
    strain: Annotated[Interval | None, Field(description="Smallest and largest equivalent strain amplitude.")] = None
    directions: Annotated[tuple[Name, ...], Field(description="Names of the fitted directions and specimens.")] = ()
    temperature_K: Annotated[  # noqa: N815
        Interval | None, Field(description="Lowest and highest temperature [K]; null if no test states one.")
    ] = None
    preloads: Annotated[
        tuple[PreloadRange, ...], Field(description="Preloads by direction or specimen, if there are two or more.")
    ] = ()
    tests: Annotated[
        tuple[Misfit, ...], Field(description="Misfit of every test, fitted or not, and of its runs.")
    ] = ()
    usable: Annotated[tuple[ExpectedError, ...], Field(description="Expected error by direction or specimen.")] = ()

    def __post_init__(self) -> None:
        """Raise a ValueError for a range that is incomplete or not ascending, or a measure of quality below zero."""
        if self.strain and not self.frequency_Hz:
            raise ValueError(ModelError("a key is missing", place="frequency_Hz", expected="frequency_Hz = ..."))
        for key in ("frequency_Hz", "strain", "temperature_K"):
            low, high = getattr(self, key) or (1.0, 1.0)
            if not SIZES[0] <= low <= high <= SIZES[1]:
                found, expected = f"{low:g}, {high:g}", "least and largest, above zero"
                raise ValueError(ModelError("this is not a range", place=key, found=found, expected=expected))
        for key in ("nrmse", "reduced_chi_square", "points", "noise"):
            if getattr(self, key) < 0.0:
                found = f"{getattr(self, key):g}"
                raise ValueError(ModelError("no fit has this", place=key, found=found, expected="zero or more"))

    @property
    def quality(self) -> Quality:
        """Agreement of the model with its tests (NRMSE, reduced chi-square, residual count, noise), without ranges."""
        return Quality(self.nrmse, self.reduced_chi_square, self.points, self.noise, self.loop_gain_error)

    @property
    def measured(self) -> Range | None:
        """Ranges of frequency, strain, temperature and preload of the fitted tests; None if not in the file."""
        if self.frequency_Hz is None or self.strain is None:
            return None
        return Range(self.frequency_Hz, self.strain, self.directions, self.temperature_K, self.preloads)


@dataclass(frozen=True)
class InputTable:
    """Name, checksum and conditions of a test's data file, in the provenance of a model file."""

    file: Annotated[str, Field(description="Name of the file as in the campaign.")]
    sha256: Annotated[str, Field(description="SHA-256 of the content of the file.")]
    conditions: Annotated[
        Mapping[str, str | Number], Field(description="Conditions in the campaign, such as preload and date.")
    ] = field(default_factory=dict)


@dataclass(frozen=True)
class ProvenanceTable:
    """Entry of a model file on its origin: version of bushfit, versions of numerical packages, and test files."""

    bushfit: Annotated[str | None, Field(description="Version of bushfit that wrote the file.")] = None
    inputs: Annotated[tuple[InputTable, ...], Field(description="Files of the tests.")] = ()
    packages: Annotated[Mapping[str, str], Field(description="Versions of numerical packages.")] = field(
        default_factory=dict
    )


@dataclass(frozen=True)
class AlternativeTable:
    """Entry of a model file for another model that the tests do not rule out: effects, values and probability."""

    effects: Annotated[tuple[str, ...], Field(description="Names of the effects of the other model.")]
    values: Annotated[Mapping[str, Number], Field(description="Parameter values of the other model by name [SI].")]
    probability: Annotated[
        Number, Field(ge=0.0, le=1.0, description="Probability of the other model by the diagnosis.")
    ]


@dataclass(frozen=True)
class ModelFile:
    """Content of a model file such as model.json: model, parameters with uncertainty, fit and provenance."""

    __pydantic_config__ = ConfigDict(str_max_length=10_000)  # for texts that pages show

    schema: Annotated[Literal["bushfit/model/1"], Field(description="Schema of the file.")]
    bushing: Annotated[
        BushingTable | None,
        Field(description="Geometry of the bushing; null if several bushings, or only specimens, were tested."),
    ]
    effects: Annotated[tuple[str, ...], Field(description="Names of the effects of the model.")]
    laws: Annotated[
        Mapping[str, Origin], Field(description="Package or file of each effect from outside bushfit, by its name.")
    ] = field(default_factory=dict, kw_only=True)
    parameters: Annotated[Mapping[str, ParameterTable], Field(description="Parameters by name.")]
    bushings: Annotated[tuple[BushingTable, ...], Field(description="Bushings, if several were tested.")] = ()
    specimens: Annotated[tuple[SpecimenTable, ...], Field(description="Other bodies of the compound.")] = ()
    covariance: Annotated[
        CovarianceTable | None,
        AfterValidator(lambda table: table and _check_covariance(table)),
        Field(description="Covariance of the parameters."),
    ] = None
    fit: Annotated[FitTable | None, Field(description="Quality and range of the fit; null without a fit.")] = None
    unresolved: Annotated[
        tuple[str, ...], Field(description="Effects that may belong to the rig instead of the bushing.")
    ] = ()
    unnamed: Annotated[Unnamed | None, Field(description="Data of the effect unnamed, a smooth correction.")] = None
    model_error: Annotated[
        Unnamed | None, Field(description="Error of the model in the fit, relative to the stiffness.")
    ] = None
    alternatives: Annotated[
        tuple[AlternativeTable, ...], Field(description="Other models that the tests do not rule out.")
    ] = ()
    warnings: Annotated[
        tuple[str, ...], Field(max_length=10_000, description="Warnings on the use of the numbers.")
    ] = ()
    outliers: Annotated[tuple[Outlier, ...], Field(description="Points far outside their noise.")] = ()
    provenance: Annotated[ProvenanceTable, Field(description="Origin of the file.")] = field(
        default_factory=ProvenanceTable
    )
    campaign: Annotated[CampaignTable | None, Field(description="Campaign that the model was fitted to.")] = None
