"""Content of a model file (model.json, truth.json and similar files), in the schema bushfit/model/1.

The dataclasses define the keys for reader, writer and JSON Schema. Pydantic validates them and ignores other keys.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, ConfigDict, Field

from bushfit.effects import Origin
from bushfit.effects.unnamed import SmoothCorrection
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
    """Entry of a model file for the bushing: name, radii, length and shape formulas.

    Args:
        name: name of the bushing.
        inner_radius_m: inner radius of the rubber [m].
        outer_radius_m: outer radius of the rubber [m].
        length_m: mean length of the rubber [m].
        shape: "paper" for the radial formulas of Garcia Tarrago et al. 2007, "calibrated" for finite elements.
    """

    name: Name
    inner_radius_m: Number
    outer_radius_m: Number
    length_m: Number
    shape: Shape = "paper"


@dataclass(frozen=True)
class SpecimenTable:
    """Entry of a model file for a specimen of the compound (coupon or blocks in shear): kind and dimensions.

    Args:
        name: name of the specimen.
        kind: "modulus" for tests of the modulus, "shear" for blocks in shear.
        strain: kind of strain in the test files; for the kind modulus.
        area_m2: sheared area of a block [m^2]; for the kind shear.
        thickness_m: thickness of a block [m]; for the kind shear.
        elements: number of blocks in parallel.
    """

    name: Name
    kind: CouponKind
    strain: StatedStrain = "engineering"
    area_m2: Number | None = None
    thickness_m: Number | None = None
    elements: WholeNumber = 1


@dataclass(frozen=True)
class ParameterTable:
    """Entry of a model file for one parameter: value, unit, standard error, 95 % interval and bound.

    Args:
        value: value of the parameter, in `unit`.
        unit: SI unit; "1" for a ratio.
        stderr: standard error; null for an exact value.
        ci95: ends of the 95 % interval; null for an exact value.
        vary: True if the parameter was fitted.
        profile95: 95 % interval by profile likelihood, if requested; null for an open end.
        at_bound: bound that the value reached: min or max.
        tied: expression of other parameters that gives the value.
        prior: prior of the parameter; null without one.
    """

    value: Number
    unit: str | None = None
    stderr: Number | None = None
    ci95: Interval | None = None
    vary: Flag = False
    profile95: tuple[Number | None, Number | None] | None = None
    at_bound: End | None = None
    tied: str | None = None
    prior: PriorUse | None = None


@dataclass(frozen=True)
class CovarianceTable:
    """Covariance matrix of the parameters [SI] in a model file, with the names of its rows and columns.

    Args:
        names: names of the parameters that have errors.
        matrix: covariance matrix, in the order of the names.
        spread: changes of the matrix if an estimated noise variance rises by its standard error, one per variance.
    """

    names: tuple[str, ...]
    matrix: Matrix
    spread: tuple[Matrix, ...] = ()


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
        raise ValueError(ModelError("an impossible covariance", place="matrix", expected=expected))
    return table


@dataclass(frozen=True)
class FitTable(Quality):
    """Entry of a model file on the fit: quality, ranges of the fitted tests, misfit of each test, and expected error.

    Args:
        frequency_Hz: lowest and highest frequency [Hz].
        strain: smallest and largest equivalent strain amplitude.
        directions: names of the fitted directions and specimens.
        temperature_K: lowest and highest temperature [K]; null if no test states one.
        preloads: preloads by direction or specimen, if there are two or more.
        tests: misfit of every test, fitted or not, and of its runs.
        usable: expected error by direction or specimen.
    """

    frequency_Hz: Interval | None = None  # noqa: N815
    strain: Interval | None = None
    directions: tuple[Name, ...] = ()
    temperature_K: Interval | None = None  # noqa: N815  # a key of the file
    preloads: tuple[PreloadRange, ...] = ()
    tests: tuple[Misfit, ...] = ()
    usable: tuple[ExpectedError, ...] = ()

    def __post_init__(self) -> None:
        """Raise a ValueError for a range that is incomplete or not ascending, or a measure of quality below zero."""
        if self.strain and not self.frequency_Hz:
            raise ValueError(ModelError("a key is missing", place="frequency_Hz", expected="frequency_Hz = ..."))
        for key in ("frequency_Hz", "strain", "temperature_K"):
            low, high = getattr(self, key) or (1.0, 1.0)
            if not SIZES[0] <= low <= high <= SIZES[1]:
                found, expected = f"{low:g}, {high:g}", "least and largest, above zero"
                raise ValueError(ModelError("this range is not valid", place=key, found=found, expected=expected))
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
    """Name, checksum and conditions of a test's data file, in the provenance of a model file.

    Args:
        file: name of the file as in the campaign.
        sha256: SHA-256 of the content of the file.
        conditions: conditions in the campaign, such as preload and date.
    """

    file: str
    sha256: str
    conditions: Mapping[str, str | WholeNumber | Number] = field(default_factory=dict)


@dataclass(frozen=True)
class ProvenanceTable:
    """Entry of a model file on its origin: version of bushfit, versions of numerical packages, and test files.

    Args:
        bushfit: version of bushfit that wrote the file.
        inputs: files of the tests.
        packages: versions of numerical packages.
    """

    bushfit: str | None = None
    inputs: tuple[InputTable, ...] = ()
    packages: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class AlternativeTable:
    """Entry of a model file for another model that the tests do not rule out.

    Args:
        effects: names of the effects of the other model.
        values: parameter values of the other model by name [SI].
        probability: probability of the other model by the diagnosis.
        covariance: covariance of the parameters in the fit of the other model.
        unnamed: data of the effect unnamed, a smooth correction, of the other model.
    """

    effects: tuple[str, ...]
    values: Mapping[str, Number]
    probability: Annotated[Number, Field(ge=0.0, le=1.0)]
    covariance: Annotated[CovarianceTable, AfterValidator(_check_covariance)] = CovarianceTable((), ())
    unnamed: SmoothCorrection | None = None


@dataclass(frozen=True)
class ModelFile:
    """Content of a model file such as model.json: model, parameters with uncertainty, fit and provenance.

    Args:
        schema: schema of the file.
        bushing: geometry of the bushing; null if several bushings, or only specimens, were tested.
        effects: names of the effects of the model.
        laws: package or file of each effect from outside bushfit, by its name.
        parameters: parameters by name.
        bushings: bushings, if several were tested.
        specimens: other bodies of the compound.
        covariance: covariance of the parameters.
        fit: quality and range of the fit; null without a fit.
        unresolved: effects that may belong to the rig instead of the bushing.
        unnamed: data of the effect unnamed, a smooth correction.
        model_error: error of the model in the fit, relative to the stiffness.
        alternatives: other models that the tests do not rule out.
        warnings: warnings on the use of the numbers.
        warning_kinds: kind of each warning, as in bushfit/caveat.toml.
        outliers: points far outside their noise.
        provenance: origin of the file.
        campaign: campaign that the model was fitted to.
    """

    __pydantic_config__ = ConfigDict(str_max_length=10_000)  # for texts that pages show

    schema: Literal["bushfit/model/1"]
    bushing: BushingTable | None
    effects: tuple[str, ...]
    laws: Mapping[str, Origin] = field(default_factory=dict, kw_only=True)
    parameters: Mapping[str, ParameterTable]
    bushings: tuple[BushingTable, ...] = ()
    specimens: tuple[SpecimenTable, ...] = ()
    covariance: Annotated[CovarianceTable | None, AfterValidator(lambda table: table and _check_covariance(table))] = (
        None
    )
    fit: FitTable | None = None
    unresolved: tuple[str, ...] = ()
    unnamed: SmoothCorrection | None = None
    model_error: SmoothCorrection | None = None
    alternatives: tuple[AlternativeTable, ...] = ()
    warnings: Annotated[tuple[str, ...], Field(max_length=10000)] = ()
    warning_kinds: Annotated[tuple[str, ...], Field(max_length=10000)] = ()
    outliers: tuple[Outlier, ...] = ()
    provenance: ProvenanceTable = field(default_factory=ProvenanceTable)
    campaign: CampaignTable | None = None
