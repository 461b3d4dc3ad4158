"""Model files, key by key: the schemas bushfit/model/1, and /2 with specimens.

The dataclasses are the keys, for the reader and for the JSON Schema alike: pydantic checks them all at once, and leaves
other keys alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal, get_args

import numpy as np
from pydantic import ConfigDict, Field

from bushfit.effects.unnamed import Unnamed
from bushfit.errors import ModelError
from bushfit.geometry import Shape, SpecimenKind, StatedStrain
from bushfit.model.result import CampaignTable as CampaignTable
from bushfit.model.result import End, Misfit, Outlier, Quality, Range, Usable
from bushfit.model.result import TestTable as TestTable
from bushfit.reading.measurement import Source
from bushfit.units import SIZES
from bushfit.validation import Flag, Name, Number, WholeNumber

#: What the key "schema" of a model file has to say: of one with a bushing alone, and of one with specimens too.
SchemaName = Literal["bushfit/model/1", "bushfit/model/2"]
SCHEMAS: tuple[SchemaName, ...] = get_args(SchemaName)

Matrix = tuple[tuple[Number, ...], ...]
#: Share of a variance by which rounding in a file may take the least eigenvalue below zero.
_ROUNDING = 1e-6


@dataclass(frozen=True)
class BushingTable:
    """The bushing: its name, its geometry and the radial formulas it goes by.

    Args:
        name: of the bushing.
        inner_radius_m, outer_radius_m: of the rubber [m].
        length_m: mean length of the rubber [m].
        shape: "paper" for the paper's radial formulas, "calibrated" for these corrected by finite elements.
    """

    name: Name
    inner_radius_m: Number
    outer_radius_m: Number
    length_m: Number
    shape: Shape = "paper"


@dataclass(frozen=True)
class SpecimenTable:
    """Another body of the compound.

    Args:
        name: of the specimen.
        kind: "modulus" where its tests gave a modulus, else blocks in shear.
        strain: which strain its tests state; of a modulus.
        area_m2: of a block, sheared [m^2].
        thickness_m: of a block [m].
        elements: blocks side by side.
    """

    name: Name
    kind: SpecimenKind
    strain: StatedStrain = "engineering"
    area_m2: Number | None = None
    thickness_m: Number | None = None
    elements: WholeNumber = 1


@dataclass(frozen=True)
class ParameterTable:
    """A parameter: its value, and what the fit says of it. Read back are value, vary, profile95 and at_bound; how
    uncertain it is, the covariance says.

    Args:
        value: in the unit.
        unit: SI; "1" of a ratio.
        stderr: standard error, in the unit; null where it was held at an exact value.
        ci95: least and largest value of the 95 % interval, in the unit; null where it was held at an exact value.
        vary: whether it was fitted.
        profile95: the 95 % interval by profile likelihood, where it was asked for; null is an open end.
        at_bound: where the value came to rest on the least or largest that it may have: which of the two.
    """

    value: Number
    unit: str | None = None
    stderr: Number | None = None
    ci95: tuple[Number, Number] | None = None
    vary: Flag = False
    profile95: tuple[Number | None, Number | None] | None = None
    at_bound: End | None = None


@dataclass(frozen=True)
class CovarianceTable:
    """The covariance of the parameters.

    Args:
        names: of the parameters that have errors.
        matrix: with a row and a column for each of them, in the order of the names, in their SI units.
        spread: how far the matrix moves, up or down, when an estimated figure of the noise (a variance, a correlation
            of rows) moves up by its own standard error: a change, not a covariance; a matrix for each figure.
    """

    names: tuple[str, ...]
    matrix: Matrix
    spread: tuple[Matrix, ...] = ()

    def __post_init__(self) -> None:
        size = len(self.names)
        for matrix in (self.matrix, *self.spread):
            widths = {len(row) for row in matrix}
            if len(matrix) != size or widths - {size}:
                found = f"{len(matrix)} rows of {' or '.join(sorted(map(str, widths))) or 'no'} numbers"
                raise ValueError(ModelError("no covariance of its names", found=found, expected=f"{size} x {size}"))
        if any(self.matrix[i][i] < 0.0 for i in range(size)):
            raise ValueError(ModelError("a variance below zero", place="matrix", expected="squares on the diagonal"))
        if len(set(self.names)) < size:
            raise ValueError(ModelError("a parameter twice", place="names", expected="each name once"))
        if size:
            self._check_values()

    def _check_values(self) -> None:
        """Refuse a matrix that no variances and covariances of real quantities make."""
        sigma = np.sqrt(np.diag(self.matrix))
        with np.errstate(over="ignore"):
            correlation = (self.matrix / np.outer(sigma, sigma).clip(np.finfo(float).tiny)).clip(-2.0, 2.0)
        if not np.allclose(correlation, correlation.T):
            raise ValueError(ModelError("a covariance that is not symmetric", place="matrix", expected="C = C^T"))
        if not np.linalg.eigvalsh(correlation).min() > -_ROUNDING * len(self.names):
            expected = "a positive semidefinite matrix"
            raise ValueError(ModelError("a covariance that no quantities have", place="matrix", expected=expected))


@dataclass(frozen=True)
class FitTable(Quality):
    """How well the model meets its tests, and the operating conditions of these.

    Args:
        frequency_Hz: least and largest that was tested [Hz].
        strain: least and largest equivalent strain amplitude that was tested.
        directions: of the tests that were fitted, and specimens by their names.
        temperature_K: lowest and highest that was tested [K]; left out where no test states one.
        tests: every test, fitted or not, then each run of it.
        usable: within what the model meets the measurement, place by place.
    """

    frequency_Hz: tuple[Number, Number] | None = None  # noqa: N815
    strain: tuple[Number, Number] | None = None
    directions: tuple[Name, ...] = ()
    temperature_K: tuple[Number, Number] | None = None  # noqa: N815
    tests: tuple[Misfit, ...] = ()
    usable: tuple[Usable, ...] = ()

    def __post_init__(self) -> None:
        if self.strain and not self.frequency_Hz:
            raise ValueError(ModelError("a key is missing", place="frequency_Hz", expected="frequency_Hz = ..."))
        for key in ("frequency_Hz", "strain", "temperature_K"):
            low, high = getattr(self, key) or (1.0, 1.0)
            if not SIZES[0] <= low <= high <= SIZES[1]:
                expected = "least and largest, above zero"
                raise ValueError(
                    ModelError("this is no range", place=key, found=f"{low:g}, {high:g}", expected=expected)
                )
        for key in ("nrmse", "reduced_chi_square", "points", "noise"):
            if getattr(self, key) < 0.0:
                found = f"{getattr(self, key):g}"
                raise ValueError(ModelError("no fit has this", place=key, found=found, expected="zero or more"))

    @property
    def quality(self) -> Quality:
        return Quality(self.nrmse, self.reduced_chi_square, self.points, self.noise, self.loop_gain_error)

    @property
    def measured(self) -> Range | None:
        """The operating conditions; None where an older file does not say them."""
        if self.frequency_Hz is None or self.strain is None:
            return None
        return Range(self.frequency_Hz, self.strain, self.directions, self.temperature_K)


@dataclass(frozen=True)
class ProvenanceTable:
    """What the model was made from, and with what.

    Args:
        bushfit: version that wrote the file.
        inputs: the files of the tests.
        packages: versions of the packages that the numbers rest on.
    """

    bushfit: str | None = None
    inputs: tuple[Source, ...] = ()
    packages: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class AlternativeTable:
    """Another model of the same bushing that may be the right one, as the tests cannot tell.

    Args:
        effects: by name, in order.
        values: of its parameters by name, in SI units.
        probability: of it, by the diagnosis that found it.
    """

    effects: tuple[str, ...]
    values: Mapping[str, Number]
    probability: Annotated[Number, Field(ge=0.0, le=1.0)]


@dataclass(frozen=True)
class ModelFile:
    """A bushing or compound: the effects that its response is made of, their parameters, and how uncertain these are.

    Args:
        schema: of this file: /1 of a bushing alone, /2 with specimens.
        bushing: null where specimens of the compound alone are known.
        effects: by name, in order: the paper's, then what was added.
        parameters: by name; those of an added effect are called <effect>.<name>.
        covariance: of the fitted parameters, and of held ones whose error is known.
        fit: how well the model meets its tests; null where it was not fitted.
        warnings: what a user must know before using the numbers.
        outliers: points that lie farther off than noise explains.
        provenance: what the model was made from.
        specimens: other bodies of the compound.
        unresolved: effects of the model that may as well be the rig's, as the tests cannot tell.
        unnamed: data of the effect of that name: a smooth correction of the stiffness.
        model_error: what the fit counted beside noise, as a share of the stiffness; null where noise was all.
        alternatives: models that explain the tests, where these cannot tell which does.
        campaign: that the model was fitted to; null where it is known of none.
    """

    __pydantic_config__ = ConfigDict(str_max_length=10_000)  # what people read, and a table shows in no time

    schema: SchemaName
    bushing: BushingTable | None
    effects: tuple[str, ...]
    parameters: Mapping[str, ParameterTable]
    covariance: CovarianceTable | None = None
    fit: FitTable | None = None
    warnings: Annotated[tuple[str, ...], Field(max_length=10_000)] = ()
    outliers: tuple[Outlier, ...] = ()
    provenance: ProvenanceTable = field(default_factory=ProvenanceTable)
    specimens: tuple[SpecimenTable, ...] = ()
    unresolved: tuple[str, ...] = ()
    unnamed: Unnamed | None = None
    model_error: Unnamed | None = None
    alternatives: tuple[AlternativeTable, ...] = ()
    campaign: CampaignTable | None = None
