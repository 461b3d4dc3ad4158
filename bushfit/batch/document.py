"""The JSON file of one part of a batch, `row.json`; that of the whole batch is in `report.batch_document`."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Literal

from pydantic import Field

from bushfit.diagnosis import document
from bushfit.model.covariance import Z95
from bushfit.model.result import End

#: Value of the key `schema`, which names the layout of the file; a row with another layout is evaluated again.
ROW_SCHEMA: Literal["bushfit/row/3"] = "bushfit/row/3"


@dataclass(frozen=True, slots=True)
class Estimate:
    """Value of a quantity with its 95 % interval and standard error; None if the tests do not determine them."""

    value: Annotated[float, Field(description="Value of the quantity.")]
    low: Annotated[float | None, Field(description="Lower end of the 95 % interval.")] = None
    high: Annotated[float | None, Field(description="Upper end of the 95 % interval.")] = None
    stderr: Annotated[float | None, Field(description="Standard error.")] = None
    unit: Annotated[str, Field(description="SI unit of all four numbers.")] = "1"

    @classmethod
    def finite(cls, value: float, low: float | None, high: float | None, stderr: float | None, unit: str) -> "Estimate":
        """Make an estimate whose interval and standard error are None where they are not finite.

        Args:
            value: the value, in `unit`.
            low, high: ends of the 95 % interval, in `unit`.
            stderr: standard error, in `unit`.
            unit: SI unit.
        """
        low, high, stderr = (x if x is not None and math.isfinite(x) else None for x in (low, high, stderr))
        return cls(value, low, high, stderr, unit)

    @classmethod
    def normal(cls, value: float, stderr: float, unit: str) -> "Estimate":
        """Make an estimate with the 95 % interval of a normally distributed error.

        Args:
            value: the value, in `unit`.
            stderr: standard error, in `unit`.
            unit: SI unit.
        """
        return cls(value, value - Z95 * stderr, value + Z95 * stderr, stderr, unit)


@dataclass(frozen=True, kw_only=True, slots=True)
class RowFile:
    """Results of one part, and the hashes by which a later run recognises that the results are still valid."""

    schema: Annotated[Literal["bushfit/row/3"], Field(description="Name and version of the layout of this file.")] = (
        ROW_SCHEMA
    )
    status: Annotated[Literal["done", "failed"], Field(description="A failed row has an error and no results.")]
    error: Annotated[str, Field(description="Reason why the row failed; empty if it is done.")] = ""
    seconds: Annotated[float, Field(description="Computing time of the row [s].")] = 0.0
    key: Annotated[str, Field(description="Hash of the settings of the row and of the version of bushfit.")] = ""
    inputs: Annotated[Mapping[str, str], Field(description="SHA-256 of each input file.")] = field(default_factory=dict)
    files: Annotated[Mapping[str, str], Field(description="SHA-256 of each result file.")] = field(default_factory=dict)
    campaign_name: Annotated[str, Field(description="Name of the campaign.")] = ""
    verdict: Annotated[document.Verdict | None, Field(description="Verdict of diagnose; null without it.")] = None
    effects: Annotated[Sequence[str], Field(description="Effects that diagnose named.")] = ()
    alternatives: Annotated[
        Sequence[str], Field(description="Effects that these tests cannot distinguish from the named effects.")
    ] = ()
    warnings: Annotated[Sequence[str], Field(description="Warnings of the fit and of the predictions.")] = ()
    quantities: Annotated[
        Mapping[str, Estimate],
        Field(description="Parameters, NRMSE, reduced chi-square, stiffness and loss factor at the points, by name."),
    ] = field(default_factory=dict)
    measured: Annotated[
        Mapping[str, Estimate], Field(description="Stiffness and loss factor as measured at the points, where known.")
    ] = field(default_factory=dict)
    at_bound: Annotated[
        Mapping[str, End], Field(description="Parameters whose fitted value is at a bound, with the bound: min or max.")
    ] = field(default_factory=dict)
    curve: Annotated[
        Mapping[str, float], Field(description="|K| [SI] of the first sweep at its middle level, by operating point.")
    ] = field(default_factory=dict)
